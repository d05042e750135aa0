"""Implicit methods: springs of any stiffness, steps of any length, agreement of the solvers, and reported failures."""

import json

import hard_networks
import numpy as np
import pytest
from reference import rigid_pendulum

from mpp_taichi import Simulation, StabilityError, component
from mpp_taichi.arithmetic.ordering import bandwidth, narrow_order
from mpp_taichi.cli.main import main
from mpp_taichi.integrators import _implicit
from mpp_taichi.solvers import newton
from mpp_taichi.solvers.conjugate_gradients import ConjugateGradients
from scenes import everything

IMPLICIT = [name for name in component.names("integrators") if component.declaration("integrators", name).base == "Implicit"]
TOLERANCE = 1e-12  # of the way of a step, to which Newton's method solves in f64
GRAVITY = np.array([0.0, -1.8])
FIRST, SECOND = [0.564642, 0.174664, 0.0], [1.129285, -0.650671, 0.0]


def declared(name, attribute):
    return getattr(component.build("integrators", name, {"dt": 1.0}), attribute)


def double_pendulum(integrator, stiffness, dt, **more):
    """A mass of 1 on a stiff spring of length 1, another on a soft one: the paper's, whose explicit limit is 2/√(D + 10)."""
    return {
        "particles": [
            {"body": {"mass": 1.0, "position": [0, 1, 0], "free": False}},
            {"body": {"mass": 1.0, "position": FIRST}},
            {"body": {"mass": 1.0, "position": SECOND}},
        ],
        "springs": [
            {"link": {"between": [0, 1], "stiffness": stiffness, "rest_length": 1.0}},
            {"link": {"between": [1, 2], "stiffness": 5.0, "rest_length": 1.0}},
        ],
        "forces": [{"uniform_gravity": {"acceleration": [*GRAVITY, 0]}}],
        "integrator": {integrator: {"dt": dt, **more}},
    }


def sheet(integrator, dt, count=8, solver="auto", damping=0.1):
    """A sheet of count² masses on springs along and across, thrown into a wave; held at its corners."""
    links = [
        {"lattice_links": {"of": "sheet", "neighbors": n, "stiffness": 50.0, "damping": damping}}
        for n in ("nearest", "diagonal")
    ]
    lattice = {
        "name": "sheet",
        "shape": [count, count],
        "lower": [-1, -1, 0],
        "upper": [1, 1, 0],
        "mass": 0.01,
        "fixed": "corners",
    }
    lattice["displacement"] = [0, 0, "0.3 * sin(pi * u) * sin(2 * pi * v)"]
    return {
        "particles": [{"lattice": lattice}],
        "springs": links,
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}, {"linear_drag": {"coefficient": 0.01}}],
        "integrator": {integrator: {"dt": dt, "solver": solver}},
    }


# --- the double pendulum --------------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", IMPLICIT)
def test_a_stiff_pendulum_converges_at_the_order_to_the_rigid_one(name):
    """D from 5e3 to 1e9 at dt = 1e-2 and below, where explicit methods end at 0.028, …, 6e-5."""
    reference = rigid_pendulum.end_positions(FIRST[:2], SECOND[:2], 5.0, GRAVITY, 2.0)
    order = declared(name, "order")
    errors = {}
    for stiffness in (5e3, 1e6, 1e9):
        with Simulation(double_pendulum(name, stiffness, 1e-2), backend="cpu", precision="f64") as simulation:
            for count in (200, 400, 800):
                simulation.dt = 2.0 / count
                simulation.restart()
                simulation.run(steps=count)
                end = simulation.snapshot().position
                errors[stiffness, count] = np.abs(end[1:, :2] - reference).max()
                # The rod is stretched by the pull along it, below 2 m g plus the soft spring's 5, over D; and once more when it
                # was at rest without that pull at the start, and swings. Beside that the methods leave the circle by (v dt)²/8.
                assert abs(np.linalg.norm(end[1, :2] - [0, 1]) - 1.0) <= 2.0 * 10.0 / stiffness + 4.0 * simulation.dt**2 / 8.0
    for count in (200, 400):  # at 1e9 the stretch of the rod is far below the errors of the steps
        assert errors[1e9, count] / errors[1e9, 2 * count] == pytest.approx(2.0**order, rel=0.1)
    if order == 2:  # then the steps' own errors are small enough to see that the slow motion differs from the rigid one as 1/D
        assert errors[5e3, 800] > 50 * errors[1e6, 800] - 50 * errors[1e9, 800]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", IMPLICIT)
def test_a_stiff_pendulum_stays_bounded_for_a_long_time(name):
    # f32 is the same text with another type: a method of one equation, one of two states, one whose force is a mean of a step.
    for precision in ("f64", "f32") if name in ("newmark", "bdf2", "energy_momentum") else ("f64",):
        with Simulation(double_pendulum(name, 1e8, 1.0 / 60.0), backend="cpu", precision=precision) as simulation:
            energy = simulation.diagnostics()["total_energy"]
            for _ in range(20):
                simulation.run(steps=500)
                end = simulation.snapshot().position
                assert abs(np.linalg.norm(end[1] - [0, 1, 0]) - 1.0) < 1e-3
                # No more than the energy it began with, but for the stretch of the rod in mid-flight, ½ D ((v dt)²/8)².
                assert simulation.diagnostics()["total_energy"] <= energy + 0.5e8 * (4.0 / 3600.0 / 8.0) ** 2


# --- networks that break careless programs ---------------------------------------------------------------------------------

LONG_STEPS = (0.02, 0.2)  # up to a hundred and more times what is stable for explicit methods


def energies(simulation, dt, steps=60):
    simulation.dt = dt
    simulation.restart()
    found = [simulation.diagnostics()["total_energy"]]
    for _ in range(steps):
        simulation.run(steps=1)
        found.append(simulation.diagnostics()["total_energy"])
    assert np.isfinite(found).all() and np.isfinite(simulation.snapshot().position).all()
    return np.array(found)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("make", hard_networks.SMOOTH + hard_networks.WITH_JUMPS, ids=lambda make: make.__name__)
def test_the_energy_momentum_method_keeps_every_energy_and_gains_none_where_there_is_damping(make):
    with Simulation(make("energy_momentum", 0.02, 0.05), backend="cpu", precision="f64") as simulation:
        for damping in (0.05, 0.0):  # what is compiled serves both; other tests compile networks without damping
            simulation.state.spring_damping.fill(damping)
            for dt in LONG_STEPS if make is not hard_networks.flattened_cloth else LONG_STEPS[:1]:
                found = energies(simulation, dt)
                # The work of the springs is theirs up to the solver's tolerance of a step's way, times forces that reach some
                # 1e3 of what does useful work where stiffnesses differ by 1e8.
                room = 1e3 * TOLERANCE * len(found) * np.abs(found).max()
                if damping:
                    assert np.diff(found).max() <= room
                else:
                    assert np.abs(found - found[0]).max() <= room


@pytest.mark.sampled(6)
@pytest.mark.parametrize("name", ["implicit_euler", "bdf2"])
@pytest.mark.parametrize("make", hard_networks.SMOOTH + hard_networks.WITH_JUMPS, ids=lambda make: make.__name__)
def test_damped_methods_survive_every_network_and_gain_no_energy(make, name):
    """Implicit Euler gains none in any step, unless the smallest piece of one does and says so; BDF2 never more than it had."""
    with Simulation(make(name, 0.02, 0.05), backend="cpu", precision="f64") as simulation:
        for dt in LONG_STEPS:
            found = energies(simulation, dt)
            assert found.max() <= found[0] * (1.0 + 60 * TOLERANCE)
            if name == "implicit_euler" and simulation.solver_report.gaining_pieces == 0:
                assert np.diff(found).max() <= 2.0 * TOLERANCE * found[0]
            if make not in (hard_networks.huge_stretch,):
                assert simulation.solver_report.gaining_pieces == 0


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", ["implicit_midpoint", "newmark", "imex_midpoint"])
def test_conservative_methods_keep_the_energy_of_hard_networks_to_their_order(name):
    for make in (hard_networks.random_cloth, hard_networks.inverted_chain):
        errors = []
        with Simulation(make(name, 1e-3), backend="cpu", precision="f64") as simulation:
            for dt in (2e-3, 1e-3):
                found = energies(simulation, dt, steps=round(0.1 / dt))
                errors.append(np.abs(found / found[0] - 1.0).max())
        assert errors[0] / errors[1] > 2.0 ** (declared(name, "order") - 0.3), (make.__name__, errors)


# --- solvers ----------------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["implicit_midpoint", "bdf2"])
def test_both_linear_solvers_and_all_plans_give_the_same_step(name):
    """At ω dt = 1; with much longer steps the equations have several solutions, and which is found is nobody's promise."""
    ends = {}
    ways = [("direct", "serial"), ("conjugate_gradients", "parallel")]
    if name == "bdf2":  # the equation of a method is one text for all ways to solve it
        ways += [("direct", "parallel"), ("conjugate_gradients", "serial")]
    for solver, plan in ways:
        with Simulation(sheet(name, 0.005, count=5, solver=solver), backend="cpu", precision="f64", plan=plan) as simulation:
            ends[solver, plan] = simulation.run(steps=10).snapshot().position
            assert simulation.solver_report.steps == 10 and simulation.solver_report.unsolved == 0
            assert simulation.solver_report.linear_iterations >= simulation.solver_report.newton_iterations >= 10
    for end in ends.values():
        np.testing.assert_allclose(end, ends["direct", "serial"], rtol=0, atol=100 * 10 * TOLERANCE)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("count", [3, 5])
def test_software_vulkan_solves_the_same_equations(count, software_vulkan):
    """An odd number of 4-byte numbers before 8-byte ones is where a device may read the latter in the wrong place."""
    for scene in (sheet("bdf2", 0.02, count=count), double_pendulum("energy_momentum", 1e9, 1e-2)):
        with Simulation(scene, backend="cpu", precision="f32", plan="serial") as simulation:
            expected = simulation.run(steps=20).snapshot().position
        with Simulation(scene, backend="vulkan", precision="f32") as simulation:
            assert simulation.plan == "parallel" and isinstance(simulation.integrator.newton.linear, ConjugateGradients)
            found = simulation.run(steps=20).snapshot().position
        # f32 solves to 1e-6 of the way of a step, some 0.02 here, and rounds positions of 1 in each.
        np.testing.assert_allclose(found, expected, rtol=0, atol=20 * (10 * 2e-8 + 10 * 2.0**-24))


@pytest.mark.sampled(3)
def test_a_large_sheet_takes_conjugate_gradients_and_a_chain_of_any_length_does_not():
    with Simulation(sheet("bdf2", 0.01, count=40), backend="cpu") as simulation:
        assert isinstance(simulation.integrator.newton.linear, ConjugateGradients)
        simulation.run(steps=3)
        assert simulation.solver_report.linear_iterations > 3
    chain = [[k, k + 1] for k in range(1999)]
    shuffled = np.random.default_rng(0).permutation(2000)[np.array(chain)]
    assert bandwidth(narrow_order(2000, shuffled), shuffled) == 1
    grid = np.arange(900).reshape(30, 30)
    between = np.concatenate(
        [np.stack([grid[:-1].ravel(), grid[1:].ravel()], 1), np.stack([grid[:, :-1].ravel(), grid[:, 1:].ravel()], 1)]
    )
    order = narrow_order(900, np.random.default_rng(1).permutation(900)[between])
    assert sorted(order) == list(range(900)) and bandwidth(order, np.random.default_rng(1).permutation(900)[between]) <= 31


@pytest.mark.sampled(3)
def test_momenta_of_a_free_network_are_kept():
    scene = sheet("energy_momentum", 0.05, damping=0.0)
    scene["particles"][0]["lattice"] |= {"fixed": "none", "velocity": ["v", "-u", "0.5 * u * v"]}
    scene["forces"] = []
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.diagnostics()
        simulation.run(steps=100)
        after = simulation.diagnostics()
    for name in ("momentum", "angular_momentum"):
        assert np.abs(after[name] - before[name]).max() <= 100 * 10 * TOLERANCE * before[f"{name}_scale"]


REVERSIBLE = [name for name in IMPLICIT if component.build("integrators", name, {"dt": 1.0}).time_reversible]
RESIDUAL = 1e-14  # of the way of a step, to which Newton's method solves for reversible methods in f64


def stretched_sheet(integrator, dt, *, stiffness=100.0, mass=0.01, count=6):
    """A sheet of masses on springs that are stretched to 1/0.7 of their length, shaken by a hundredth; held at its edge."""
    random = np.random.default_rng(3)
    bodies, links = [], []
    for i in range(count):
        for j in range(count):
            held = {i, j} & {0, count - 1}
            place = [i / count, j / count, 0.0 if held else float(0.01 * random.normal())]
            bodies.append({"body": {"name": f"{i} {j}", "mass": mass, "position": place, "free": not held}})
            for other in ((i + 1, j), (i, j + 1)):
                if max(other) < count:
                    spring = {"stiffness": stiffness, "rest_length": 0.7 / count}
                    links.append({"link": {"between": [f"{i} {j}", f"{other[0]} {other[1]}"], **spring}})
    return {
        "particles": bodies,
        "springs": links,
        "integrator": {integrator: {"dt": dt, "solver": "conjugate_gradients"}},
    }


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", REVERSIBLE)
def test_reversible_methods_come_back_to_round_off(name):
    """Errors of steps keep their size in the norm of the energy, v² + ω² x², and add up like a random walk.

    The rounding of a coordinate below 1, at most 2⁻⁵⁴, is a velocity of at most ω 2⁻⁵⁴ with the largest frequency,
    ω² ≤ 8 D/m. What a step leaves unsolved is at most RESIDUAL of its way, h |v|, which is a velocity of 2/h times as much.
    """
    dt, steps, stiffness, mass = 0.02, 600, 100.0, 0.01
    with Simulation(stretched_sheet(name, dt, stiffness=stiffness, mass=mass), backend="cpu", precision="f64") as simulation:
        before, fastest = simulation.snapshot(), 0.0
        for _ in range(20):
            simulation.run(steps=steps // 20)
            fastest = max(fastest, np.linalg.norm(simulation.snapshot().velocity))
        assert np.abs(simulation.snapshot().position - before.position).max() > 0.01
        simulation.dt = -dt
        simulation.run(steps=steps)
        back = simulation.snapshot()
    walk, frequency = np.sqrt(2 * steps), np.sqrt(8.0 * stiffness / mass)
    # Three roundings for each step: of the position, of the velocity, and of the force. Five standard deviations.
    limit = 5.0 * walk * (np.sqrt(3.0) * frequency * 2.0**-54 + 2.0 * RESIDUAL * fastest)
    assert np.abs(back.velocity - before.velocity).max() < limit


# --- what cannot be solved is told -------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_steps_that_newton_does_not_solve_are_cut_and_counted():
    with Simulation(hard_networks.random_cloth("bdf2", 0.2, 0.05), backend="cpu", precision="f64") as simulation:
        simulation.run(steps=5)
        assert simulation.solver_report.cut_steps > 0 and simulation.solver_report.unsolved == 0
        assert np.isfinite(simulation.snapshot().position).all()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", IMPLICIT)
def test_going_back_to_a_mark_repeats_every_bit(name):
    """What a method hands on from step to step, BDF2's earlier state say, belongs to what is marked."""
    with Simulation(double_pendulum(name, 1e5, 1e-2), backend="cpu") as simulation:
        simulation.run(steps=7)
        mark = simulation.mark()
        there = simulation.run(steps=5).snapshot()
        simulation.state.unsolved.fill(1)  # after a step that was not solved nothing moves, until the run goes back
        simulation.return_to(mark)
        assert simulation.step_count == 7
        again = simulation.run(steps=5).snapshot()
    np.testing.assert_array_equal(again.position, there.position)
    np.testing.assert_array_equal(again.velocity, there.velocity)


@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.sampled(3)
def test_a_step_that_cannot_be_solved_ends_the_run_at_the_last_good_state(plan, monkeypatch):
    monkeypatch.setattr(newton, "MOST_ITERATIONS", 1)
    monkeypatch.setattr(_implicit, "MOST_PIECES", 2)
    scene = double_pendulum("implicit_midpoint", 1e5, 1e-3)
    scene["particles"][2]["body"]["name"] = "bob"
    with Simulation(scene, backend="cpu", precision="f64", plan=plan) as simulation:
        with pytest.raises(StabilityError, match=r"step \d+, time .*Newton's method does not solve .*particle [12]") as caught:
            simulation.run(steps=1000)
        assert caught.value.step == simulation.step_count + 1 and caught.value.exit_code == 4
        assert caught.value.time == pytest.approx(simulation.time + 1e-3)
        stopped = simulation.snapshot()
        assert np.isfinite(stopped.position).all() and simulation.solver_report.steps == simulation.step_count
        simulation.restart()
        simulation.run(steps=stopped.step)
        np.testing.assert_array_equal(simulation.snapshot().position, stopped.position)


@pytest.mark.sampled(3)
def test_the_summary_tells_what_the_solver_did(tmp_path, capsys):
    path = tmp_path / "sheet.yaml"
    path.write_text(json.dumps(sheet("implicit_midpoint", 0.05, count=4)), encoding="utf-8")
    assert main(["run", str(path), "--headless", "--steps", "20", "--json", "-v"]) == 0
    out = capsys.readouterr()
    found = json.loads(out.out)
    assert found["linear_solver"] == "Banded" and 1.0 <= found["newton_iterations_per_step"] <= found["newton_iterations_most"]
    assert found["unsolved_steps"] == 0 and "Newton iterations a step" in out.err


@pytest.mark.sampled(3)
def test_implicit_replicas_equal_their_single_runs():
    scene = everything(integrator="bdf2")
    with Simulation(scene, backend="cpu") as simulation:
        start = simulation.start
        starts = [
            start.moved(position=start.position * (1 + 0.01 * k), velocity=start.velocity, time=0.0, step=0) for k in range(3)
        ]
        singles = []
        for each in starts:
            simulation.restart()
            simulation.state.write(each.position, each.velocity)
            singles.append(simulation.run(steps=50).snapshot().position)
    with Simulation(scene, backend="cpu", replica_starts=starts) as simulation:
        simulation.run(steps=50)
        for k, single in enumerate(singles):
            np.testing.assert_allclose(simulation.snapshot(k).position, single, rtol=0, atol=50 * 100 * TOLERANCE)
