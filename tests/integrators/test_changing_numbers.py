"""Masses and charges that are given functions of the time: against SciPy, the energy balance, bits, files and refusals."""

import argparse

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from test_integrators import declared

from mpp_taichi import SceneError, Simulation, component, resume
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.cli import compare
from mpp_taichi.errors import BackendError, PrecisionError, StateError, UnsupportedError
from mpp_taichi.recorders.trajectory import TrajectoryRecorder
from mpp_taichi.recorders.trajectory_file import TrajectoryFile
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble
from mpp_taichi.sweep.structure import key_of, why_alone

TAKES = component.marked("integrators", "takes_paths")
G, SOFTENING, DRAG, STIFFNESS, DAMPING, FALL = 1.3, 0.1, 0.05, 1.0, 0.1, 0.3


def bodies():
    """A star that loses mass, a planet whose mass and charge swing, and a third body with numbers that last."""
    return [
        {"name": "a", "mass": 2.0, "mass_factor": "exp(-k*t)", "position": [0, 0, 0], "velocity": [0.1, 0, 0]},
        {
            **{"name": "b", "mass": 1.0, "mass_factor": "1 + 0.5*sin(t)", "charge": 0.4, "charge_factor": "cos(2*t)"},
            **{"position": [1, 0, 0], "velocity": [0, 1.2, 0.1]},
        },
        {"name": "c", "mass": 0.5, "charge": -0.8, "position": [-1.5, 0.5, 0.2], "velocity": [0, -0.9, 0]},
    ]


def scene(integrator="leapfrog", dt=0.01, **more):
    return {
        "constants": {"k": 0.3},
        "particles": [{"body": body} for body in bodies()],
        "springs": [{"link": {"between": ["a", "c"], "stiffness": STIFFNESS, "damping": DAMPING}}],
        "forces": [
            {"newtonian_gravity": {"strength": G, "softening": SOFTENING}},
            {"coulomb": {}},
            {"uniform_gravity": {"acceleration": [0, 0, -FALL]}},
            {"linear_drag": {"coefficient": DRAG}},
        ],
        "integrator": {integrator: {"dt": dt}},
        "run": {"duration": 2.0},
        **more,
    }


def numbers(t):
    """Masses and charges at a time."""
    return np.array([2.0 * np.exp(-0.3 * t), 1.0 + 0.5 * np.sin(t), 0.5]), np.array([0.0, 0.4 * np.cos(2.0 * t), -0.8])


def reference(end, *, drag=DRAG, damping=DAMPING):
    """Places by SciPy."""
    x0, v0 = (np.array([body[key] for body in bodies()], float) for key in ("position", "velocity"))
    rest = np.linalg.norm(x0[2] - x0[0])

    def rate(t, y):
        x, v = y.reshape(2, 3, 3)
        m, q = numbers(t)
        force = -drag * v
        for i in range(3):
            for j in range(3):
                if i != j:
                    d = x[j] - x[i]
                    force[i] += G * m[i] * m[j] * d / (d @ d + SOFTENING**2) ** 1.5 - q[i] * q[j] * d / np.linalg.norm(d) ** 3
        d = x[2] - x[0]
        n = d / np.linalg.norm(d)
        pull = (STIFFNESS * (np.linalg.norm(d) - rest) + damping * ((v[2] - v[0]) @ n)) * n
        force[0] += pull
        force[2] -= pull
        return np.concatenate([v.ravel(), (force / m[:, None] - [0, 0, FALL]).ravel()])

    start = np.concatenate([x0.ravel(), v0.ravel()])
    return solve_ivp(rate, [0.0, end], start, method="DOP853", rtol=1e-12, atol=1e-13).y[:9, -1].reshape(3, 3)


@pytest.mark.parametrize("name", TAKES)
@pytest.mark.sampled(5)
def test_each_method_keeps_its_order(name):
    """Methods that take no forces of the velocity go without friction, which SciPy's solution has too then."""
    takes = declared(name, "takes_velocity")
    order = declared(name, "order")
    dt = {1: 0.01, 2: 0.02, 3: 0.02, 4: 0.02, 6: 0.02, 8: 0.02}[order]
    given, end, errors = scene(name), reference(2.0, drag=DRAG * takes, damping=DAMPING * takes), []
    if not takes:
        given["forces"].pop()
        given["springs"][0]["link"]["damping"] = 0.0
    for step in (dt, dt / 2):
        with Simulation({**given, "integrator": {name: {"dt": step}}}, backend="cpu") as simulation:
            simulation.run(judge="off")
            errors.append(np.abs(simulation.snapshot().position - end).max())
            mass, charge = numbers(simulation.time)
            assert np.allclose(simulation.snapshot().mass, mass, rtol=1e-14)
            assert np.allclose(simulation.snapshot().charge, charge, rtol=1e-13, atol=1e-15)
    assert errors[1] < (3e-2 if order == 1 else 3e-3), errors
    assert np.log2(errors[0] / errors[1]) > order - 0.45 or errors[1] < 1e-9, errors


@pytest.mark.parametrize("name", ["leapfrog", "velocity_verlet", "yoshida4", "yoshida8"])
@pytest.mark.sampled(3)
def test_plans_agree(name):
    found = []
    for plan in ("serial", "parallel"):
        with Simulation(scene(name), backend="cpu", plan=plan) as simulation:
            found.append(simulation.run(steps=60, judge="off").snapshot().position)
    assert np.allclose(*found, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["leapfrog", "velocity_verlet"])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_bits_depend_neither_on_launches_nor_on_what_is_measured(name, plan):
    ends = []
    for pieces, looks in (([40], False), ([1, 2, 30, 7], True)):
        with Simulation(scene(name, 0.02), backend="cpu", plan=plan) as simulation:
            for steps in pieces:
                simulation.run(steps=steps, judge="off")
                if looks:
                    simulation.diagnostics()
                    simulation.accelerations(simulation.snapshot_ahead(0.01))
            ends.append(simulation.snapshot())
    assert np.array_equal(ends[0].position, ends[1].position) and np.array_equal(ends[0].velocity, ends[1].velocity)


@pytest.mark.parametrize("name", ["leapfrog", "velocity_verlet"])
def test_a_run_goes_on_with_the_same_bits_from_an_archive_and_back(name, tmp_path):
    with Simulation(scene(name, 0.02), backend="cpu") as simulation:
        simulation.run(steps=25, judge="off")
        simulation.checkpoint(tmp_path / "middle.npz")
        bookmark = simulation.bookmark()
        end = simulation.run(steps=25, judge="off").snapshot()
        simulation.go_back(bookmark)
        assert np.array_equal(simulation.run(steps=25, judge="off").snapshot().velocity, end.velocity)
    with Simulation(scene(name, 0.02), backend="cpu", start=Snapshot.load(tmp_path / "middle.npz")) as simulation:
        near = simulation.run(steps=25, judge="off").snapshot()
    with Simulation(scene(name, 0.02), backend="cpu") as simulation:
        simulation.checkpoint(tmp_path / "run.archive", every=1000.0)
        simulation.run(steps=25, judge="off")
    with resume(tmp_path / "run.archive") as simulation:
        again = simulation.run(steps=25, judge="off").snapshot()
    assert np.array_equal(end.position, again.position) and np.array_equal(end.velocity, again.velocity)
    assert np.allclose(end.position, near.position, rtol=0.0, atol=1e-13)


def test_a_state_with_another_mass_that_lasts_is_refused(tmp_path):
    with Simulation(scene(), backend="cpu") as simulation:
        simulation.run(steps=5, judge="off")
        simulation.checkpoint(tmp_path / "state.npz")
    other = scene()
    other["particles"][2]["body"]["mass"] = 0.6
    with pytest.raises(StateError, match="masses of the state differ"):
        Simulation(other, backend="cpu", start=Snapshot.load(tmp_path / "state.npz"))


@pytest.mark.parametrize(("name", "order"), [("leapfrog", 2), ("velocity_verlet", 2), ("yoshida4", 4), ("kahan_li6", 4)])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.sampled(3)
def test_the_energy_balance_books_the_change_of_the_numbers(name, order, plan):
    """The residual has the order of the method, up to the fourth order, to which powers are integrated."""
    residuals = []
    for dt in (0.01, 0.005):
        given = scene(name, dt)
        given["particles"][1]["body"].pop("charge_factor")
        with Simulation(given, backend="cpu", plan=plan) as simulation:
            simulation.keep_energy_balance()
            simulation.run(judge="off")
            found = simulation.diagnostics()
            residuals.append(abs(found["energy_balance_residual"]))
            assert abs(found["work"]) > 0.1
    assert np.log2(residuals[0] / residuals[1]) > order - 0.45, residuals
    assert residuals[1] < (0.05 if order == 2 else 1e-3) * found["energy_turnover"]


@pytest.mark.parametrize(
    "force",
    [
        {"pair": {"potential": "-m1*m2/(r + 0.2)"}},
        {"pair": {"potential": "sqrt(m1*m2)*exp(-r)"}},
        {"pair": {"potential": "q1*q2/(r + 0.3)"}},
        {"external": {"potential": "m*(x^2 + 2*y^2)/2 + q*z + m^3*x/9"}},
        {"pair": {"potential": "-m1*m2/(r + 0.2)", "between": ["a", "b"]}},
        {"pair": {"potential": "-m1*m2/(r + 0.2)", "cutoff": "1.4"}},
    ],
)
@pytest.mark.sampled(3)
def test_the_power_is_the_derivative_of_the_energy_with_all_places_held(force):
    """P = dE/dt at fixed places and velocities, by a difference of fourth order of energies that NumPy and kernels sum."""
    given = scene("leapfrog", 0.01, forces=[force], springs=[])
    h = 1e-3
    with Simulation(given, backend="cpu") as simulation:
        snapshot = simulation.snapshot()
        meter = simulation.phase.power_meter()
        for time in (0.0, 0.7):
            energies = []
            for shift in (-2, -1, 1, 2):
                mass, _charge = numbers(time + shift * h)
                kinetic = 0.5 * (mass * (snapshot.velocity**2).sum(axis=1)).sum()
                energies.append(kinetic + simulation.phase.energy_meter.potential_energy(time + shift * h))
            expected = (energies[0] - 8.0 * energies[1] + 8.0 * energies[2] - energies[3]) / (12.0 * h)
            meter.keep(0, time)
            found = meter.kept(1)[0][1]
            # The fifth derivatives of the numbers are below 30 in size: h⁴/30 × 30; rounding: 1e-15/h; SHIFT⁴ of the root.
            assert abs(found - expected) < 30.0 * h**4 + 1e-11 + 0.02**4 * 0.5


def test_a_binary_that_loses_mass_slowly_widens_as_the_mass_falls():
    """a m stays the same where the mass changes little in a period (Jeans 1924); the change here is 0.2 % in a period."""
    given = {
        "particles": [
            {"body": {"name": "star", "mass": 1.0, "mass_factor": "1 - t/4000", "position": [0, 0, 0]}},
            {"body": {"mass": 1e-6, "around": "star", "semi_major_axis": 1.0, "eccentricity": 0.1}},
        ],
        "forces": [{"newtonian_gravity": {}}],
        "integrator": {"yoshida4": {"dt": 0.02}},
        "run": {"duration": 1000.0},
    }
    with Simulation(given, backend="cpu") as simulation:
        simulation.run(judge="off")
        now = simulation.snapshot()
    x, v, m = now.position[1] - now.position[0], now.velocity[1] - now.velocity[0], now.mass.sum()
    axis = 1.0 / (2.0 / np.linalg.norm(x) - v @ v / m)
    assert now.mass[0] == pytest.approx(0.75, rel=1e-14)
    assert axis == pytest.approx(4.0 / 3.0, rel=2 * np.pi * 1.33 / 4000 * 0.1 * 10)


def test_a_mass_on_a_pendulum_of_a_rod_does_not_matter():
    """Gravity and the force along the rod are both proportional to the mass, so the motion stays the same to rounding."""
    ends = []
    for factor in ({}, {"mass_factor": "exp(-t)"}):
        given = {
            "particles": [
                {"body": {"name": "pivot", "mass": 1.0, "position": [0, 0, 0], "free": [False, False, False]}},
                {"body": {"name": "bob", "mass": 2.0, "position": [1, 0, 0], **factor}},
            ],
            "springs": [{"rod": {"between": ["pivot", "bob"]}}],
            "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}],
            "integrator": {"leapfrog": {"dt": 0.01}},
            "run": {"duration": 3.0},
        }
        with Simulation(given, backend="cpu") as simulation:
            ends.append(simulation.run(judge="off").snapshot().position)
    assert np.abs(ends[0] - ends[1]).max() < 300 * 10 * np.finfo(float).eps


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
def test_single_precision_moves_as_double_precision(backend):
    """300 steps, each with some ten roundings of places and forces of order one, which grow little in this time."""
    ends = []
    for precision, where in (("f64", "cpu"), ("f32", backend)):
        with Simulation(scene("velocity_verlet"), backend=where, precision=precision) as simulation:
            ends.append(simulation.run(judge="off").snapshot())
    assert np.abs(ends[0].position - ends[1].position).max() < 200 * 10 * np.finfo(np.float32).eps
    assert np.allclose(ends[0].mass, ends[1].mass, rtol=1e-6)


def test_a_timeline_changes_the_mass_that_is_multiplied_and_the_jump_is_booked():
    given = scene("yoshida4", 0.01, timeline=[{"at": 1.0, "set": {"particles[0].body.mass": 3.0}}])
    with Simulation(given, backend="cpu") as simulation:
        simulation.keep_energy_balance()
        simulation.run(judge="off")
        assert simulation.snapshot().mass[0] == pytest.approx(3.0 * np.exp(-0.6), rel=1e-14)
        assert abs(simulation.diagnostics()["energy_balance_residual"]) < 1e-4


def test_trajectories_have_the_numbers_of_every_frame(tmp_path):
    with Simulation(scene(), backend="cpu") as simulation, TrajectoryRecorder(tmp_path / "run.npz") as recorder:
        simulation.run(steps=40, recorders=[recorder], judge="off")
    frames = [snapshot for snapshot, _box in TrajectoryFile(tmp_path / "run.npz").frames()]
    assert len(frames) > 10
    for frame in frames:
        mass, charge = numbers(frame.time)
        assert np.allclose(frame.mass, mass, rtol=1e-14) and np.allclose(frame.charge, charge, rtol=1e-12, atol=1e-15)


# Refusals


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_factor": "1 - t"}, "the factor is 0 at t = 1, must be above 0 at all times"),
        ({"mass_factor": "exp(-b*t)"}, "unknown name 'b'"),
        ({"mass_factor": "log(t)"}, "is no finite number at t = 0"),
        ({"mass_factor": "floor(t) + 1"}, "floor has no derivative"),
        ({"charge_factor": "cos(t)", "charge": 0.0}, "multiplies a charge of 0, so nothing would change"),
        ({"mass_factor": "exp(-t)", "mass": 0.0}, "multiplies a mass of 0, so nothing would change"),
    ],
)
def test_bad_factors_are_told(change, message):
    given = scene()
    given["particles"][0]["body"].pop("mass_factor")
    given["particles"][0]["body"].update(change)
    with pytest.raises(SceneError) as caught:
        assemble(load_scene(given))
    assert message in str(caught.value) and len(caught.value.faults) == 1


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"integrator": {"rk4": {"dt": 0.01}}}, "does not know masses and charges that change, allowed: "),
        ({"integrator": {"hermite4": {"dt": 0.01}}}, "does not know masses and charges that change"),
        ({"contacts": {"hard_spheres": {"solver": "swept"}}}, "a mass that changes cannot be beside contacts:"),
        ({"expect": {"lyapunov": {"above": 0}}}, "which a mass that changes does not have"),
    ],
)
def test_parts_of_a_scene_that_do_not_go_with_it_are_refused(more, message):
    with pytest.raises(SceneError, match="|".join([message.replace("(", r"\(")])):
        assemble(load_scene({**scene(), **more}))


def test_it_is_refused_where_it_cannot_run():
    with pytest.raises(PrecisionError, match="have no low parts"):
        Simulation(scene(), backend="cpu", precision="df64")
    with pytest.raises(BackendError, match="plan replicas has no masses and charges that change"):
        Simulation(scene(), backend="cpu", plan="replicas")
    with pytest.raises(SceneError, match="do not know masses and charges that change"):
        pose(load_scene(scene()), None)


def test_members_of_a_sweep_with_other_factors_have_a_step_of_their_own():
    one, other = (load_scene(scene(constants={"k": k})) for k in (0.3, 0.4))
    assert "masses and charges that change" in why_alone(one)
    assert key_of(one, assemble(one)) != key_of(other, assemble(other)) and key_of(one, assemble(one)) == key_of(
        one, assemble(one)
    )


def test_nothing_to_compare(tmp_path):
    parser = argparse.ArgumentParser()
    compare.add_arguments(parser)
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene()))
    with pytest.raises(UnsupportedError, match="no other backend has masses and charges that change"):
        compare.execute(parser.parse_args([str(tmp_path / "scene.yaml")]))


def test_the_numbers_at_the_start_are_those_of_the_time_zero():
    """Also for an orbit, whose speed has the mass of both bodies at the start in it."""
    given = {
        "particles": [
            {"body": {"name": "star", "mass": 1.0, "mass_factor": "4 + t", "position": [0, 0, 0]}},
            {"body": {"mass": 2.5, "mass_factor": "2 - t/9", "charge": 0.5, "charge_factor": "3*cos(t)", **ORBIT}},
        ],
        "forces": [{"newtonian_gravity": {}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }
    start = assemble(load_scene(given))
    assert start.mass.tolist() == [4.0, 5.0] and start.charge.tolist() == [0.0, 1.5]
    assert np.linalg.norm(start.velocity[1] - start.velocity[0]) == pytest.approx(np.sqrt(9.0 / 2.0), rel=1e-14)


ORBIT = {"around": "star", "semi_major_axis": 2.0}
