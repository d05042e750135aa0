"""Springs that break and yield: closed forms, the energy that they lose, their bits, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from measured import MadeUpSample
from repeated_runs import run_with_a_way_back

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.errors import BackendError, MppError, PrecisionError, UnsupportedError
from mpp_taichi.quantities._base import NoResultError, Setting
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.start.assemble import assemble
from mpp_taichi.views._base import Frame

STIFFNESS, STRAIN, SPEED = 10.0, 0.2, 1.0
METHODS = ("leapfrog", "velocity_verlet", "symplectic_euler")


def pair(dt=1e-3, method="leapfrog", *, speed=SPEED, forces=(), **spring):
    """Two bodies of mass 1 at a distance of 1, which fly apart and are linked by a spring."""
    bodies = [
        {"body": {"name": name, "mass": 1.0, "position": [place, 0, 0], "velocity": [way, 0, 0]}}
        for name, place, way in (("left", 0.0, -speed), ("right", 1.0, speed))
    ]
    link = {"between": ["left", "right"], "stiffness": STIFFNESS, "breaks_at": STRAIN} | spring
    return {"particles": bodies, "springs": [{"link": link}], "forces": list(forces), "integrator": {method: {"dt": dt}}}


def sheet(method="leapfrog", *, dt=0.02, count=12, breaks_at=0.03, damping=0.0, forces=(), **more):
    """A sheet whose right half is pulled away, so that it tears."""
    lattice = {"shape": [count, count], "lower": [-1, -1, 0], "upper": [1, 1, 0], "mass": 0.1, "name": "sheet"}
    springs = [
        {"lattice_links": {"of": "sheet", "neighbors": kind, "stiffness": 20.0, "damping": damping, "breaks_at": breaks_at}}
        for kind in ("nearest", "diagonal")
    ]
    pull = {"external": {"acceleration": ["2*x", "0.3*sin(5*y)"]}}
    return {
        "dimensions": 2,
        "particles": [{"lattice": lattice}],
        "springs": springs,
        "forces": [pull, *forces],
        "integrator": {method: {"dt": dt}},
    } | more


def run(scene, steps, *, backend="cpu", precision="f64", **more):
    with Simulation(scene, backend=backend, precision=precision, **more) as simulation:
        simulation.run(steps=steps)
        return simulation.snapshot()


@pytest.mark.parametrize("method", METHODS)
def test_a_spring_that_breaks_takes_its_energy_at_the_strain(method):
    # Each body has ½ v². The spring takes ½ D (0.2)² of both. It breaks within a step, in which its length grows by 2 v dt.
    left = SPEED**2 - 0.5 * STIFFNESS * STRAIN**2
    for dt in (4e-3, 1e-3):
        end = run(pair(dt, method), round(0.5 / dt))
        found = end.velocity[1, 0] ** 2
        # D δ · 2 v dt is the energy of one step at the limit; a kick at half a step adds half as much.
        bound = 1.5 * STIFFNESS * STRAIN * 2.0 * SPEED * dt
        assert abs(found - left) < bound
        assert end.velocity[0, 0] == -end.velocity[1, 0]  # both halves broke in the same step
        assert not end.springs.whole[0]
        # The length grows as sin: the spring reaches the strain at time t with 2 v/ω sin(ω t) = δ, ω² = 2 D/m.
        omega = math.sqrt(2.0 * STIFFNESS)
        time = math.asin(STRAIN * omega / (2.0 * SPEED)) / omega
        assert 0.0 <= end.springs.broke_at[0] - time <= 1.5 * dt


def test_a_spring_below_its_strain_is_the_spring_without_a_limit():
    scene = pair(breaks_at=STRAIN, speed=0.4)  # stretched to 2 v/ω = 0.18 at the most
    without = pair(speed=0.4)
    del without["springs"][0]["link"]["breaks_at"]
    given, wanted = run(scene, 1000), run(without, 1000)
    # The same forces, summed one after the other and not in lanes: rounding errors of 1000 steps.
    assert np.abs(given.position - wanted.position).max() < 1000 * 4 * np.finfo(float).eps
    assert given.springs.whole.all()


@pytest.mark.parametrize("method", METHODS)
def test_a_spring_that_yields_is_longer_by_the_energy_over_the_force(method):
    # ½ m v² of both bodies = ½ D y² + D y Δ, with the largest elastic stretch y = 0.05: plastic work D y Δ.
    largest, dt = 0.05, 5e-4
    scene = pair(dt, method, breaks_at=5.0, yields_at=largest)
    end = run(scene, round(3.0 / dt))
    wanted = (SPEED**2 - 0.5 * STIFFNESS * largest**2) / (STIFFNESS * largest)
    # The force is right but for a step; what the length gains in this step is 2 v dt, and the work differs by as much.
    assert end.springs.rest_length[0] == pytest.approx(1.0 + wanted, abs=2.0 * SPEED * dt * 1.5)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        lengths = []
        for _ in range(300):
            simulation.run(steps=40)
            place = simulation.snapshot().position
            lengths.append(abs(place[1, 0] - place[0, 0]))
        # The plastic work D y Δ is lost, and nothing else; each step of 2 v dt is rounded to a rectangle.
        lost = STIFFNESS * largest * (simulation.snapshot().springs.rest_length[0] - 1.0)
        assert simulation.phase.lost_by_springs == pytest.approx(lost, rel=2.0 * SPEED * dt / largest)
    # Afterwards it swings about its new rest length, by the largest elastic stretch, and yields no more.
    late = np.array(lengths[200:])
    assert late.max() - late.min() == pytest.approx(2.0 * largest, rel=2e-2)


def test_a_compressed_spring_yields_and_does_not_break():
    scene = pair(speed=-1.0, breaks_at=0.2, yields_at=0.05)
    end = run(scene, 250)
    assert end.springs.whole.all() and end.springs.rest_length[0] < 0.9


@pytest.mark.parametrize("method", ["leapfrog", "velocity_verlet", "langevin"])  # of first order, Euler loses more itself
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_the_energy_lost_by_a_torn_sheet_is_booked(method, damping):
    scene = sheet(method, damping=damping)
    if method == "langevin":
        scene["integrator"] = {"langevin": {"dt": 0.02, "temperature": 1e-4, "friction": 0.2}}
    scene["forces"] = [{"external": {"potential": "-m*(x^2 - 0.1*cos(5*y))"}}]
    residuals = []
    for dt in (4e-3, 1e-3):
        scene["integrator"][method]["dt"] = dt
        with Simulation(scene, backend="cpu", precision="f64", threads=1) as simulation:
            balance = simulation.keep_energy_balance()
            simulation.run(steps=round(2.4 / dt))
            account = balance.account(simulation, simulation.diagnostics()["total_energy"])
            lost = simulation.phase.lost_by_springs
            broken = int((~simulation.snapshot().springs.whole).sum())
        assert broken > 40
        assert account["dissipated_energy"] >= lost > 0.0
        residuals.append(abs(account["energy_balance_residual"]) / lost)
    # Each break is late by up to a step, so that the residual falls with the step.
    assert residuals[1] < 0.02
    assert residuals[1] < residuals[0]


@pytest.mark.parametrize(
    ("limit", "kept"),
    [({"breaks_at": STRAIN}, False), ({"yields_at": STRAIN}, False), ({}, True)],
)
def test_only_a_scene_whose_springs_have_no_limits_promises_to_keep_its_energy(limit, kept):
    scene = pair()
    del scene["springs"][0]["link"]["breaks_at"]
    scene["springs"][0]["link"] |= limit
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert simulation.phase.conserves_energy is kept


def test_a_balance_that_begins_after_a_break_counts_what_is_lost_from_then_on():
    with Simulation(sheet(), backend="cpu", precision="f64") as simulation:
        simulation.run(steps=100)
        before = simulation.phase.lost_by_springs
        balance = simulation.keep_energy_balance()
        simulation.run(steps=40)
        account = balance.account(simulation, simulation.diagnostics()["total_energy"])
        assert simulation.phase.lost_by_springs > before > 0.0
        assert account["dissipated_energy"] == pytest.approx(simulation.phase.lost_by_springs - before, rel=1e-12)


def test_both_halves_of_each_spring_break_together():
    with Simulation(sheet(count=20), backend="cpu", precision="f64") as simulation:
        limits = simulation.phase.total_force.limits
        for _ in range(60):
            simulation.run(steps=3)
            breaking = simulation.state.spring_breaking_length.to_numpy()
            since = simulation.state.spring_broke_at.to_numpy()
            for values in (breaking, since):
                order = np.argsort(limits.number, kind="stable")
                first, second = values[order].reshape(-1, 2).T
                assert np.array_equal(first, second)
        assert (breaking == 0.0).any() and (breaking > 0.0).any()


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_the_bits_depend_neither_on_threads_nor_on_cuts_nor_on_measurements(precision, plan):
    scene = sheet()
    for entry in scene["springs"]:
        entry["lattice_links"]["yields_at"] = 0.01
    whole = run(scene, 120, precision=precision, plan=plan)
    assert 0 < (~whole.springs.whole).sum() < len(whole.springs)
    with Simulation(scene, backend="cpu", precision=precision, plan=plan, threads=1) as simulation:
        back = run_with_a_way_back(simulation, 50, 60, 70)
    with Simulation(scene, backend="cpu", precision=precision, plan=plan) as simulation:
        for _ in range(24):
            simulation.run(steps=5)
            simulation.accelerations()
        measured = simulation.snapshot()
    for other in (back, measured):
        assert np.array_equal(other.position, whole.position) and np.array_equal(other.velocity, whole.velocity)
        assert np.array_equal(other.springs.broke_at, whole.springs.broke_at)
        assert np.array_equal(other.springs.rest_length, whole.springs.rest_length)


def test_a_saved_state_goes_on_with_what_is_left(tmp_path):
    scene = sheet()
    for entry in scene["springs"]:
        entry["lattice_links"]["yields_at"] = 0.01
    middle = run(scene, 100)
    middle.save(tmp_path / "middle.npz")
    loaded = Snapshot.load(tmp_path / "middle.npz")
    assert np.array_equal(loaded.springs.broke_at, middle.springs.broke_at)
    with Simulation(scene, backend="cpu", precision="f64", start=loaded) as simulation:
        first = simulation.snapshot()
        simulation.run(steps=20)
        end = simulation.snapshot()
    assert np.array_equal(first.springs.broke_at, middle.springs.broke_at)
    assert np.array_equal(first.springs.rest_length, middle.springs.rest_length)
    wanted = run(scene, 120)
    assert np.array_equal(end.position, wanted.position)
    assert np.array_equal(end.springs.whole, wanted.springs.whole)


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
def test_pairs_beside_springs_see_the_same_breaks(backend):
    # With forces between pairs the springs are summed with them, in another place of the step.
    push = {"coulomb": {"coulomb_constant": 1e-9, "softening": 0.1}}
    alone = run(sheet(count=6), 120, backend=backend, precision="f32")
    beside = run(sheet(count=6, forces=[push]), 120, backend=backend, precision="f32")
    assert 0 < (~alone.springs.whole).sum() < len(alone.springs)
    assert np.array_equal(alone.springs.broke_at, beside.springs.broke_at)


@pytest.mark.parametrize("precision", ["f32", "f32c", "ds"])
def test_single_precision_breaks_at_the_same_step(precision):
    wanted, found = run(pair(), 500), run(pair(), 500, precision=precision)
    assert found.springs.broke_at[0] == pytest.approx(wanted.springs.broke_at[0], abs=1.5e-3)
    assert found.velocity[1, 0] == pytest.approx(wanted.velocity[1, 0], abs=2e-2)


def test_a_formula_along_a_spring_is_lost_with_the_spring():
    morse = {"bond": {"potential": "D*(1 - exp(-a*(l - l0)))^2", "parameters": {"D": 2, "a": 2, "l0": 1}}}
    scene = pair(stiffness=0.0, breaks_at=0.5, forces=[morse])
    end = run(scene, 1000)
    left = SPEED**2 - 2.0 * (1.0 - math.exp(-1.0)) ** 2
    force = 8.0 * math.exp(-1.0) * (1.0 - math.exp(-1.0))  # V′ at the limit
    assert end.velocity[1, 0] ** 2 == pytest.approx(left, abs=1.5 * force * 2.0 * SPEED * 1e-3)


def test_sliders_and_timelines_change_stiffness_and_heal_nothing():
    scene = pair() | {"run": {"duration": 1.0}}
    scene["timeline"] = [{"at": 0.4, "set": {"springs[0].link.stiffness": 50}}]
    after = run(scene, 800)
    assert not after.springs.whole[0] and after.velocity[1, 0] == run(pair(), 800).velocity[1, 0]
    live = scene | {"sliders": [{"set": "springs[0].link.stiffness", "from": 1, "to": 100}]}
    assert run(live, 800).velocity[1, 0] == after.velocity[1, 0]


def test_frames_show_no_broken_springs():
    end = run(pair(), 500)
    assert len(Frame.of(end).between) == 0
    assert len(Frame.of(run(pair(), 50)).between) == 1


def test_springs_of_several_kinds_are_joined():
    plain = Springs(np.array([[0, 1]], np.int32), np.ones(1), np.zeros(1), np.ones(1), np.ones((1, 3)))
    never = np.full(1, np.inf)
    limited = replace(plain, breaking_length=np.full(1, 2.0), yield_stretch=never, broke_at=never)
    both = Springs.joined([Springs(), plain, limited])
    assert both.breaking_length.tolist() == [math.inf, 2.0] and both.have_limits
    assert not Springs.joined([plain, plain]).have_limits
    assert both.chosen([False, True]).breaking_length.tolist() == [2.0]


def test_quantities_leave_broken_springs_out():
    end = run(pair(), 500)
    values = {}
    for name, given in (("spring_strain", {"between": None}), ("spring_length", {"between": (0, 1)}), ("broken_springs", {})):
        quantity = component.build("quantities", name, given)
        quantity.begin(Setting(load_scene(pair()), end))
        try:
            values[name] = quantity.measure(MadeUpSample(end))
        except NoResultError as reason:
            values[name] = str(reason)
    assert end.springs.stiffness[0] == end.springs.damping[0] == 0.0  # so that quantities of forces have none
    assert values == {
        "spring_strain": f"the last of 1 springs broke at time {end.springs.broke_at[0]:.6g}",
        "spring_length": f"the last of 1 springs broke at time {end.springs.broke_at[0]:.6g}",
        "broken_springs": 1.0,
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"integrator": {"rk4": {"dt": 0.01}}}, "so that it cannot tell when springs break or yield, allowed: "),
        ({"integrator": {"yoshida4": {"dt": 0.01}}}, "so that it cannot tell when springs break or yield, allowed: "),
        ({"sliders": [{"set": "springs[0].link.prestretch"}]}, "cannot be moved while the scene runs"),
        ({"springs": [{"link": {"between": ["left", "right"], "stiffness": 1, "breaks_at": 0}}]}, "must be above 0"),
        (
            {"springs": [{"link": {"between": ["left", "right"], "stiffness": 1, "rest_length": 0, "breaks_at": 1}}]},
            "breaks_at is a strain, which a spring without a rest length does not have",
        ),
        (
            {"run": {"duration": 1}, "timeline": [{"at": 0.5, "set": {"springs[0].link.breaks_at": 3}}]},
            "of springs that break or yield only stiffness and damping may be changed",
        ),
    ],
)
def test_what_cannot_be_is_refused(change, message):
    with pytest.raises(SceneError, match=message.replace("[", r"\[")):
        run(pair() | change, 1)


def test_what_other_parts_cannot_do_is_refused():
    with pytest.raises(PrecisionError, match="springs that break or yield does not carry low parts"):
        run(pair(), 1, precision="df64")
    with pytest.raises(BackendError, match="springs that break or yield have no plan replicas"):
        run(pair(), 1, replica_starts=[assemble(load_scene(pair()))] * 2)
    tangent = pair() | {"record": {"table": {"columns": ["lyapunov"]}}}
    with pytest.raises(UnsupportedError, match="springs that break or yield do not have"):
        run(tangent, 1)
    from mpp_taichi.accuracy.problem import pose

    with pytest.raises(MppError, match="accuracy compares motions that are smooth"):
        pose(load_scene(pair() | {"run": {"duration": 1}}))
