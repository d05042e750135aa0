"""The horizon of scenes in which spheres touch: where collisions enlarge rounding, and where the step makes the error."""

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.horizon.contact_search import step_errors
from mpp_taichi.horizon.search import find


def gas(solver="event_driven", duration=20.0, **more):
    """24 disks in a square box of side 10."""
    return {
        "dimensions": 2,
        "seed": 1,
        "particles": [{"gas": {"count": 24, "lower": [0, 0], "upper": [10, 10], "radius": 0.6, "speed": 1}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "walls": [{"box": {"lower": [0, 0], "upper": [10, 10]}}],
        "run": {"duration": duration},
        **({} if solver == "event_driven" else {"integrator": {"leapfrog": {"dt": 0.05}}}),
        **more,
    }


def horizon_of(scene, precision="f64", **wishes):
    with mpp.Simulation(scene, backend="cpu", precision=precision) as simulation:
        return find(simulation, simulation.spec.run.duration, **wishes)


def path_of(scene, precision, times):
    """Positions at the times, (times, disks, 3)."""
    found = []
    with mpp.Simulation(scene, backend="cpu", precision=precision) as simulation:
        for time in times:
            simulation.run(until=time)
            found.append(simulation.snapshot().position)
    return np.array(found)


def parted(one, other, times):
    """The first of the times at which the paths are 10⁻³ of the size apart."""
    size = np.sqrt(np.mean(np.sum((one - one.mean(axis=(0, 1))) ** 2, axis=-1)))
    return times[np.argmax(np.linalg.norm(one - other, axis=-1).max(axis=1) > 1e-3 * size)]


@pytest.mark.sampled(3)
def test_the_horizon_of_a_gas_in_single_precision_is_where_it_leaves_the_gas_in_double_precision():
    times = np.linspace(0.0, 10.0, 101)[1:]
    true = parted(path_of(gas(), "f32", times), path_of(gas(), "f64", times), times)
    found = horizon_of(gas(), "f32")
    assert (found.found, found.by) == ("before_end", "rounding")
    # A collision enlarges an error by the free path over the radius, about 4: two errors that differ by a factor of 4 part one
    # collision earlier or later, and each disk has some 5 before the horizon.
    assert found.time == pytest.approx(true, rel=0.25)


@pytest.mark.sampled(3)
def test_a_part_of_a_gas_in_which_each_disk_has_some_collisions_tells_the_horizon_of_the_whole():
    followed = horizon_of(gas(duration=40.0))
    assert followed.found == "before_end" and 10.0 < followed.time < 25.0
    guessed = horizon_of(gas(duration=40.0), share=0.5, least=0.0)
    assert guessed.found == "extrapolated" and guessed.part * 40.0 < 0.7 * followed.time
    assert guessed.time == pytest.approx(followed.time, rel=0.25)  # the same collision earlier or later, at the mean rate
    assert "extrapolated from the first" in guessed.line()


def test_too_few_collisions_tell_nothing():
    found = horizon_of(gas(duration=40.0), share=0.05, least=0.0)
    assert found.found == "unknown" and found.reason.endswith("contacts, too few to tell how contacts enlarge the error")


@pytest.mark.sampled(3)
def test_without_a_force_the_swept_gas_ends_by_rounding_and_the_pairwise_gas_by_its_first_late_contact():
    swept, pairwise = horizon_of(gas("swept")), horizon_of(gas("pairwise"))
    assert (swept.by, pairwise.by) == ("rounding", "step")
    assert pairwise.time < 0.1 * swept.time


@pytest.mark.sampled(3)
def test_a_contact_within_a_step_does_not_know_the_fall_in_this_step():
    fall = {"forces": [{"uniform_gravity": {"acceleration": [0, -1]}}]}
    times = 0.05 * np.arange(1, 101)
    true = parted(path_of(gas("swept", **fall), "f64", times), path_of(gas(**fall), "f64", times), times)
    found = horizon_of(gas("swept", **fall))
    assert (found.found, found.by) == ("before_end", "step")
    assert 0.5 < found.time / true < 2.0  # errors of a single contact depend on its place in the step, from 0 to twice the mean


def ball(solver, **more):
    """A ball that bounces up and down on a floor, with half of its speed after each bounce."""
    return {
        "dimensions": 2,
        "particles": [{"body": {"mass": 1, "position": [0, 1], "radius": 0.1}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, -1]}}],
        "walls": [{"plane": {"point": [0, 0], "normal": [0, 1], "restitution": 0.5}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 3.0},
        **more,
    }


MERGING = {
    "particles": [
        {"body": {"mass": 2, "position": [-1, 0, 0], "velocity": [1, 0, 0], "radius": 0.2}},
        {"body": {"mass": 1, "position": [1, 0, 0], "velocity": [-1, 0.1, 0], "radius": 0.2}},
        {"body": {"mass": 1, "position": [0, 4, 0], "velocity": [0, -1, 0], "radius": 0.2}},
    ],
    "contacts": {"hard_spheres": {"solver": "merging"}},
    "integrator": {"leapfrog": {"dt": 0.01}},
    "run": {"duration": 6.0},
}
CASES = {
    "event_driven": gas(duration=5.0),
    "swept": gas("swept", 5.0),
    "pairwise": gas("pairwise", 5.0),
    "simultaneous": gas("simultaneous", 5.0),
    "resting": ball("resting"),
    "located": ball("located", integrator={"ias15": {}}),
    "merging": MERGING,
}

COUNTS = ("pair_count", "wall_count", "elastic_count", "merge_count", "unresolved")  # sums may be rounded in another order


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", CASES)
def test_the_search_changes_no_bit_and_no_count_of_a_run_with_contacts(name):
    with mpp.Simulation(CASES[name], backend="cpu", precision="f64") as simulation:
        until = simulation.spec.run.duration
        simulation.run(until=until)
        plain, counts = simulation.snapshot(), simulation.contact_report
        simulation.restart()
        assert find(simulation, until).found != "unknown"
        assert simulation.time == 0.0 and simulation.contacts.collect().pair_count == 0
        simulation.run(until=until)
        assert simulation.snapshot().position.tobytes() == plain.position.tobytes()
        assert simulation.snapshot().velocity.tobytes() == plain.velocity.tobytes()
        again = simulation.contact_report
        assert [getattr(again, name) for name in COUNTS] == [getattr(counts, name) for name in COUNTS]
    assert counts.pair_count + counts.wall_count + counts.merge_count > 0


@pytest.mark.sampled(3)
def test_a_log_of_contacts_has_none_of_the_search():
    with mpp.Simulation(gas(duration=5.0), backend="cpu", precision="f64", event_log=True) as simulation:
        find(simulation, 5.0)
        assert len(simulation.contacts.take_log()) == 0


def test_errors_of_the_step_are_told_from_two_reruns_whether_they_fall_with_the_step_or_are_random():
    error = np.geomspace(1e-9, 1e-6, 20)
    assert step_errors(3.0 * error, 0.75 * error) == pytest.approx(error)  # of second order, (2² − 1) e and (1 − 2⁻²) e
    # Independent errors in the ratio of the steps: √(1 + 2²) e and √(1 + 2⁻²) e.
    assert step_errors(np.sqrt(5.0) * error, np.sqrt(1.25) * error) == pytest.approx(error)
