"""Diagnostics of gases against known inputs, and against kinetic theory in short event-driven runs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from measured import MadeUpSample, measuring

from mpp_taichi import Simulation
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._gas import Total, box_of
from mpp_taichi.diagnostics.mean_square_displacement import shortest
from mpp_taichi.kinetic_theory import gas_in_box, kolmogorov_smirnov
from mpp_taichi.quantities._base import NoResultError, Setting
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

BOX = {"box": {"lower": [0, 0], "upper": [7.5, 5]}}
GAS = {"gas": {"count": 250, "lower": [0, 0], "upper": [7.5, 5], "radius": 0.1, "speed": 1}}


def scene(particles=(GAS,), *, walls=(BOX,), **changes):
    """The gas of 250 disks, all of one speed, or what is given."""
    return {
        "particles": list(particles),
        "dimensions": 2,
        "contacts": {"hard_spheres": {"solver": "event_driven"}},
        "walls": list(walls),
        "integrator": {"event_driven": {"dt": 0.1}},
        **changes,
    }


# --- in a run, against theory ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def gas_run():
    """What 40 units of time say, from the fifth on: verdicts and diagnostics in the order of the list, and the final count."""
    asked = [("collision_rate", {"after": 5}), ("mean_free_path", {"after": 5}), ("pressure", {"after": 5})]
    asked += [("pressure", {"after": 5, "by": "walls"}), ("speed_distribution_distance", {}), ("kinetic_temperature", {})]
    asked += [("largest_overlap", {}), ("collision_count", {})]
    expect = {name: [{"above": -1e300, **given} for each, given in asked if each == name] for name, _ in asked}
    described = scene(run={"duration": 40}, expect=expect)
    with Simulation(described, backend="cpu", precision="f64") as simulation:
        watcher = Watcher(simulation.spec.expect, every=1)
        simulation.run(recorders=[watcher])
        watcher.finish(simulation)
        found = {(row.quantity, row.parameters.get("by", "")): row.value for row in watcher.verdicts({}, "f64")}
        errors = {
            (each.quantity, each.parameters.get("by", "")): watcher._diagnostics[number].standard_error()
            for number, each in enumerate(watcher.expectations)
            if each.quantity in ("collision_rate", "pressure")
        }
        return found, errors, simulation.contact_report


@pytest.mark.sampled(6)
def test_a_gas_has_the_collision_rate_of_theory(gas_run):
    """N Γ t / 2 = 21,000 collisions; four of the standard errors that the blocks show, and 0.5 % that the theory leaves out."""
    found, errors, _ = gas_run
    rate, error = found["collision_rate", ""], errors["collision_rate", ""]
    theory = gas_in_box.rate_in_box(250, (7.5, 5.0), 0.1, 1.0, 0.5)
    assert 0.2 / math.sqrt(21_000) < error / theory < 3.0 / math.sqrt(21_000)
    assert rate == pytest.approx(theory, abs=4 * error + 0.005 * theory)
    mean_speed = math.sqrt(math.pi / 4)  # √(π k T / 2 m), k T = 1/2; over 350 samples it scatters by 0.2 % and less
    assert found["mean_free_path", ""] == pytest.approx(mean_speed / rate, rel=0.01)


@pytest.mark.parametrize("by", ["virial", "walls"])
def test_a_gas_has_the_pressure_of_theory_by_both_ways(gas_run, by):
    found, errors, _ = gas_run
    theory = gas_in_box.pressure_in_box(250, (7.5, 5.0), 0.1, 0.5)
    error = errors["pressure", by]
    assert error < 0.02 * theory
    assert found["pressure", by] == pytest.approx(theory, abs=4 * error + 0.005 * theory)


def test_a_gas_of_one_speed_becomes_maxwells(gas_run):
    """Below the critical distance of one in a thousand; before the first collision it is 1 − 1/e."""
    found, _, report = gas_run
    assert found["speed_distribution_distance", ""] < kolmogorov_smirnov.critical_distance(250, 1e-3)
    assert found["kinetic_temperature", ""] == pytest.approx(0.5, rel=1e-12)
    assert found["largest_overlap", ""] == report.largest_overlap < 1e-9
    assert found["collision_count", ""] == report.pair_count + report.wall_count
    assert shown("speed_distribution_distance", {}, scene(), []) == pytest.approx(1 - math.exp(-1), rel=1e-6)


# Invented samples


def shown(name, parameters, described, looks):
    """What a diagnostic says after the start of a scene and these samples: time, changes of the particles, report."""
    spec = load_scene(described)
    start = assemble(spec)
    diagnostic = measuring(name, **parameters)
    diagnostic.begin(Setting(spec, start))
    for time, changes, report in [(0.0, {}, ContactReport()), *looks]:
        snapshot = replace(start, **{key: np.array(value, float) for key, value in changes.items()})
        diagnostic.observe(MadeUpSample(snapshot, time, report))
    return diagnostic.result()


def body(position, velocity=(0, 0), mass=1, **more):
    return {"body": {"position": list(position), "velocity": list(velocity), "mass": mass, "radius": 0.1, **more}}


def test_one_ball_between_walls_presses_as_often_as_it_comes():
    """Way 0.8 and back at speed 3: sixty bounces in 16, 2 m v = 12 each, over the four sides of 0.8: m v² / (2 A_c)."""
    described = scene([body([0.5, 0.5], [3, 0], mass=2)], walls=[{"box": {"lower": [0, 0], "upper": [1, 1]}}])
    report = ContactReport(wall_count=60, wall_impulse=(360.0, 360.0, 0.0, 0.0))
    looks = [(16.0, {}, report)]
    assert shown("pressure", {"by": "walls"}, described, looks) == pytest.approx(2 * 9 / (2 * 0.64), rel=1e-12)
    assert shown("pressure", {"by": "virial"}, described, looks) == pytest.approx(2 * 9 / (2 * 0.64), rel=1e-12)
    assert shown("collision_count", {"between": "walls"}, described, looks) == 60


def test_a_virial_adds_to_the_pressure_of_a_box_that_repeats():
    """d P V = Σ m v² + virial / t, the whole box being open to the centres: (4 + 9/3) / (2 · 2)."""
    described = scene([body([0.5, 0.5], [2, 0])], walls=[{"periodic_box": {"lower": [0, 0], "upper": [2, 1]}}])
    looks = [(3.0, {}, ContactReport(pair_count=5, virial=9.0))]
    assert shown("pressure", {"by": "virial"}, described, looks) == pytest.approx((4 + 9 / 3) / (2 * 2))


def test_counts_begin_with_after():
    """2 · 30 pairs in 2 units of time among two particles; a mean speed of 3/2 over that rate."""
    described = scene([body([1, 1], [3, 0]), body([2, 2])])
    looks = [(1.0, {}, ContactReport(pair_count=100)), (3.0, {}, ContactReport(pair_count=130))]
    assert shown("collision_rate", {"after": 1.0}, described, looks) == pytest.approx(2 * 30 / (2 * 2))
    assert shown("mean_free_path", {"after": 1.0}, described, looks) == pytest.approx(1.5 / 15)


def test_velocities_momenta_and_rest_are_those_of_the_end():
    described = scene([body([1, 1], [1, 0]), body([2, 1], [0, 0], mass=3)])
    end = [(2.0, {"velocity": [[-0.5, 0, 0], [0.3, 0.4, 0]], "position": [[1, 1, 0], [1, 0.9, 0]]}, ContactReport())]
    assert shown("end_velocity", {"of": 1, "axis": "y"}, described, end) == 0.4
    assert shown("group_momentum", {"of": (0, 2)}, described, end) == pytest.approx(-0.5 + 0.9)
    assert shown("resting_speed", {}, described, end) == pytest.approx(0.5)
    assert shown("resting_speed", {"of": (1, 1)}, described, end) == pytest.approx(0.5)
    assert shown("kinetic_temperature", {}, described, end) == pytest.approx((0.25 + 3 * 0.25) / 4)
    assert shown("mirror_error", {"axis": "y", "at": 0.95}, described, end) == pytest.approx(0.0, abs=1e-15)
    assert shown("mirror_error", {"axis": "y", "at": 0.9}, described, end) == pytest.approx(0.1)


@pytest.mark.parametrize("wrapped", [True, False])
def test_ways_are_followed_through_the_sides_of_a_periodic_box(wrapped):
    """Seven along a box of 2 in steps of 0.7, whether the positions shown are brought back into the box or not."""
    described = scene([body([1, 1], [0.7, -0.1])], walls=[{"periodic_box": {"lower": [0, 0], "upper": [2, 1.5]}}])
    places = [np.array([1 + 0.7 * k, 1 - 0.1 * k, 0]) for k in range(1, 11)]
    looks = [
        (float(k), {"position": [place % [2, 1.5, 9] if wrapped else place]}, ContactReport())
        for k, place in enumerate(places, start=1)
    ]
    assert shown("mean_square_displacement", {}, described, looks) == pytest.approx(50.0, rel=1e-12)
    assert shown("mean_square_displacement", {"after": 6}, described, looks) == pytest.approx(50 * 0.16, rel=1e-12)


def test_a_fast_particle_is_looked_at_often_enough():
    """A tenth of the shortest period, 1.5, at speed 5."""
    spec = load_scene(scene([body([1, 1], [3, 4])], walls=[{"periodic_box": {"lower": [0, 0], "upper": [2, 1.5]}}]))
    diagnostic = measuring("mean_square_displacement")
    diagnostic.begin(Setting(spec, assemble(spec)))
    diagnostic.observe(MadeUpSample(assemble(spec)))
    assert diagnostic.interval == pytest.approx(0.03)


def test_speeds_of_different_masses_are_each_compared_with_their_own():
    """Half of the particles nine times as heavy, at a third of the speed: as one gas they fit, as equal masses they do not."""
    random = np.random.default_rng(3)
    mass = np.where(np.arange(600) < 300, 1.0, 9.0)
    velocity = random.normal(size=(600, 3)) / np.sqrt(mass)[:, None] * [1, 1, 0]
    described = scene([{"gas": {**GAS["gas"], "count": 600, "radius": 0.01}}])
    fits = shown("speed_distribution_distance", {}, described, [(1.0, {"velocity": velocity, "mass": mass}, ContactReport())])
    wrong = shown("speed_distribution_distance", {}, described, [(1.0, {"velocity": velocity}, ContactReport())])
    assert fits < kolmogorov_smirnov.critical_distance(600, 1e-3) < wrong


def test_the_shortest_step_is_the_one_within_half_a_period():
    step = np.array([[1.9, -1.9, 5.0], [0.4, 0.9, -5.0]])
    assert shortest(step, np.array([2.0, 2.0, 0.0])) == pytest.approx(np.array([[-0.1, 0.1, 5.0], [0.4, 0.9, -5.0]]))


def test_totals_know_their_rate_and_their_scatter():
    """Poisson counts at rate 50 in 400 samples of 0.1; their error is told to 1/√(2 · 9), allowed are four times that."""
    total, counts = Total(), np.random.default_rng(1).poisson(5.0, 400)
    for look, count in enumerate(np.concatenate([[0], np.cumsum(counts)])):
        total.add(0.1 * look, float(count))
    assert total.rate() == pytest.approx(counts.sum() / 40.0, rel=1e-12)
    assert total.standard_error() == pytest.approx(math.sqrt(50 / 40), rel=4 / math.sqrt(18))
    short = Total()
    short.add(0.0, 1.0)
    short.add(0.0, 2.0)
    with pytest.raises(NoResultError, match="no two samples"):
        short.rate()


def test_what_cannot_be_measured_says_why():
    """No contacts; an open room; a wall that moves; a box that repeats, whose walls nobody hits; held particles only."""
    bare = {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "integrator": {"rk4": {"dt": 1}}}
    with pytest.raises(NoResultError, match="no contacts"):
        shown("collision_rate", {}, bare, [])
    with pytest.raises(NoResultError, match="open"):
        box_of(load_scene(bare))
    piston = {"plane": {"point": [8, 0], "normal": [-1, 0], "velocity": [-1, 0]}}
    with pytest.raises(NoResultError, match="plane is no wall of a box that stays"):
        shown("pressure", {}, scene(walls=[BOX, piston]), [])
    repeating = scene([body([0.5, 0.5])], walls=[{"periodic_box": {"lower": [0, 0], "upper": [1, 1]}}])
    with pytest.raises(NoResultError, match="by: virial"):
        shown("pressure", {"by": "walls"}, repeating, [])
    with pytest.raises(NoResultError, match="no two particles met"):
        shown("mean_free_path", {}, repeating, [(1.0, {}, ContactReport())])
    with pytest.raises(NoResultError, match="before `after`, 3"):
        shown("mean_square_displacement", {"after": 3}, repeating, [])
    for name in ("kinetic_temperature", "speed_distribution_distance", "mean_square_displacement"):
        with pytest.raises(NoResultError, match="free particle"):
            shown(name, {}, scene([body([0.5, 0.5], free=False)]), [])


def test_a_box_of_planes_is_a_box():
    walls = [{"plane": {"point": [0, 1], "normal": [0, 2]}}, {"plane": {"point": [0, 3], "normal": [0, -1]}}]
    lower, upper = box_of(
        load_scene(scene(walls=[*walls, {"periodic_box": {"lower": [0, 0], "upper": [7, 9], "axes": [True, False]}}]))
    )
    assert (lower.tolist(), upper.tolist()) == ([0, 1], [7, 3])


def test_reports_of_contacts_add():
    one = ContactReport(pair_count=1, wall_impulse=(1.0, 2.0), largest_overlap=0.1)
    both = ContactReport() + one + ContactReport(wall_count=2, wall_impulse=(0.5, 0.0), largest_overlap=0.3)
    assert (both.pair_count, both.wall_count, both.wall_impulse, both.largest_overlap) == (1, 2, (1.5, 2.0), 0.3)
