"""Bodies on given paths: exact places at every stage, the order of every method, restarts with the same bits, energy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_integrators import declared

from mpp_taichi import Simulation, component, resume
from mpp_taichi.recorders._simulation_sample import SimulationSample
from mpp_taichi.snapshot import Snapshot

TAKES_PATHS = component.marked("integrators", "takes_paths")
TEXTBOOK = ("leapfrog", "velocity_verlet", "symplectic_euler", "yoshida4")
SWING, RATE, ORBIT = 0.3, 2.0, 1.5  # of the support, and the radius of the orbit of the planet
STIFFNESS, DAMPING, LENGTH, STRENGTH, SOFTENING = 5.0, 0.4, 1.0, 0.5, 0.3
MASSES = (1.0, 0.7, 1.3, 2.0)  # support, bob, weight, planet
STARTS = ([0, 0, 0], [1.1, 0.2, 0.0], [2.0, -0.1, 0.3])


def shaken(integrator="leapfrog", dt=0.01, *, damping=DAMPING, forces=(), **more):
    """A support that swings, with a bob and a weight on springs below it, and a planet on a circle, all of which gravitate."""
    paths = (["a*sin(w*t)", "a*cos(w*t)^2", "0.1*t"], [f"{ORBIT}*cos(t)", f"{ORBIT}*sin(t)", "exp(-t)"])
    free = [{"mass": m, "position": list(map(float, x))} for m, x in zip(MASSES[1:3], STARTS[1:], strict=True)]
    support, planet = ({"mass": m, "path": path} for m, path in zip((MASSES[0], MASSES[3]), paths, strict=True))
    names = ("support", "bob", "weight", "planet")
    link = {"stiffness": STIFFNESS, "damping": damping, "rest_length": LENGTH}
    return {
        "constants": {"a": SWING, "w": RATE},
        "particles": [{"body": {"name": n, **b}} for n, b in zip(names, (support, *free, planet), strict=True)],
        "springs": [{"link": {"between": list(pair), **link}} for pair in (("support", "bob"), ("bob", "weight"))],
        "forces": [{"newtonian_gravity": {"strength": STRENGTH, "softening": SOFTENING}}, *forces],
        "integrator": {integrator: {"dt": dt}},
        **more,
    }


def on_paths(time):
    """Places and velocities of support and planet."""
    a, w = SWING, RATE
    places = [
        (a * np.sin(w * time), a * np.cos(w * time) ** 2, 0.1 * time),
        (ORBIT * np.cos(time), ORBIT * np.sin(time), np.exp(-time)),
    ]
    velocities = [
        (a * w * np.cos(w * time), -2 * a * w * np.cos(w * time) * np.sin(w * time), 0.1),
        (-ORBIT * np.sin(time), ORBIT * np.cos(time), -np.exp(-time)),
    ]
    return np.array(places), np.array(velocities)


def reference(time, damping):
    """Places of bob and weight by SciPy."""

    def rate(t, y):
        x, v = y.reshape(2, 2, 3)
        places, velocities = on_paths(t)
        every = np.array([places[0], *x, places[1]])
        moving = np.array([velocities[0], *v, velocities[1]])
        force = np.zeros((4, 3))
        for i, j in ((0, 1), (1, 2)):
            d = every[j] - every[i]
            length = np.linalg.norm(d)
            pull = (STIFFNESS * (length - LENGTH) + damping * (moving[j] - moving[i]) @ d / length) * d / length
            force[i] += pull
            force[j] -= pull
        for i in range(4):
            for j in range(4):
                d = every[j] - every[i]
                force[i] += STRENGTH * MASSES[i] * MASSES[j] * d / (d @ d + SOFTENING**2) ** 1.5
        return np.concatenate([v, force[1:3] / np.array(MASSES[1:3])[:, None]]).ravel()

    start = np.concatenate([np.array(STARTS[1:], float), np.zeros((2, 3))]).ravel()
    return solve_ivp(rate, (0, time), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:6, -1].reshape(2, 3)


@pytest.mark.parametrize("name", TAKES_PATHS)
@pytest.mark.sampled(5)
def test_each_method_keeps_its_order(name):
    damping = DAMPING if declared(name, "takes_velocity") else 0.0
    order, time = declared(name, "order"), 2.0
    dt = {1: 0.01, 2: 0.02, 3: 0.04, 4: 0.04, 6: 0.1, 8: 0.2}[order]
    exact, errors = reference(time, damping), []
    for steps in (round(time / dt), 2 * round(time / dt)):
        with Simulation(shaken(name, time / steps, damping=damping), backend="cpu") as simulation:
            simulation.run(steps=steps)
            errors.append(np.abs(simulation.snapshot().position[1:3] - exact).max())
            places, velocities = on_paths(simulation.time)
            assert np.allclose(simulation.snapshot().position[[0, 3]], places, rtol=1e-14, atol=1e-15)
            assert np.allclose(simulation.snapshot().velocity[[0, 3]], velocities, rtol=1e-14, atol=1e-14)
    assert errors[1] < (1e-2 if order == 1 else 1e-4), errors
    assert np.log2(errors[0] / errors[1]) > order - 0.45, errors


@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.parametrize("name", ["leapfrog", "yoshida4"])
def test_bodies_are_on_their_paths_at_every_stage(name, plan):
    """A force that only the driven body feels through its place is exact: here the places are read after each stage."""
    import taichi as ti

    with Simulation(shaken(name, 0.05), backend="cpu", plan=plan) as simulation:
        simulation.run(steps=3)
        integrator, state, total_force = simulation.integrator, simulation.state, simulation.total_force
        launcher, began, dt = simulation.launcher, simulation.time, simulation.dt

        @ti.kernel
        def stage(time: float, k: ti.template()):
            ti.loop_config(serialize=True)
            for _ in range(1):
                integrator.stage(state, total_force, 0, time, dt, k)

        node = 0.0
        for k, (_node, _kick, drift) in enumerate(integrator.entries):
            if k:
                launcher.force_sum.add_up(total_force, began + node * dt)
            stage(began, k)
            node += drift
            places, velocities = on_paths(began + node * dt)
            assert np.allclose(state.read()[0][[0, 3]], places, rtol=1e-14, atol=1e-15), k
            assert np.allclose(state.read()[1][[0, 3]], velocities, rtol=1e-14, atol=1e-14), k
        assert abs(node - 1.0) < 1e-14


@pytest.mark.parametrize("damping", [0.0, DAMPING])
@pytest.mark.parametrize("name", ["leapfrog", "velocity_verlet", "yoshida4"])
def test_plans_agree(name, damping):
    """Without friction the parallel plan joins the steps of other scenes."""
    found = []
    for plan in ("serial", "parallel"):
        with Simulation(shaken(name, 0.02, damping=damping), backend="cpu", plan=plan) as simulation:
            found.append(simulation.run(steps=60).snapshot().position)
    assert np.allclose(*found, rtol=0.0, atol=1e-12)


def test_stages_that_are_looked_up_agree():
    """Many stages with many bodies on paths are one kernel of the parallel plan."""
    found = []
    for plan in ("serial", "parallel"):
        with Simulation(shaken("yoshida8", 0.05), backend="cpu", plan=plan) as simulation:
            assert simulation.integrator.looks_stages_up(simulation.total_force)
            found.append(simulation.run(steps=20).snapshot().position)
    assert np.allclose(*found, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["leapfrog", "velocity_verlet"])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_bits_do_not_depend_on_launches(name, plan):
    ends = []
    for pieces in ([40], [1, 2, 30, 7]):
        with Simulation(shaken(name, 0.02), backend="cpu", plan=plan) as simulation:
            for steps in pieces:
                simulation.run(steps=steps)
            ends.append(simulation.snapshot())
    assert np.array_equal(ends[0].position, ends[1].position)
    assert np.array_equal(ends[0].velocity, ends[1].velocity)


@pytest.mark.parametrize("name", ["leapfrog", "velocity_verlet"])
def test_a_run_goes_on_from_an_archive_with_the_same_bits(name, tmp_path):
    """From the file of a state it goes on but for the rounding of times, which are counted from this state on."""
    with Simulation(shaken(name, 0.02), backend="cpu") as simulation:
        simulation.run(steps=25)
        simulation.checkpoint(tmp_path / "middle.npz")
        end = simulation.run(steps=25).snapshot()
    with Simulation(shaken(name, 0.02), backend="cpu", start=Snapshot.load(tmp_path / "middle.npz")) as simulation:
        near = simulation.run(steps=25).snapshot()
    with Simulation(shaken(name, 0.02), backend="cpu") as simulation:
        simulation.checkpoint(tmp_path / "run.archive", every=1000.0)
        simulation.run(steps=25)
    with resume(tmp_path / "run.archive") as simulation:
        assert simulation.step_count == 25
        again = simulation.run(steps=25).snapshot()
    assert np.array_equal(end.position, again.position) and np.array_equal(end.velocity, again.velocity)
    assert np.allclose(end.position, near.position, rtol=0.0, atol=1e-14)
    assert np.allclose(end.velocity, near.velocity, rtol=0.0, atol=1e-14)


def test_a_run_goes_back_with_the_same_bits():
    with Simulation(shaken(dt=0.02), backend="cpu") as simulation:
        simulation.run(steps=10)
        mark, bookmark = simulation.mark(), simulation.bookmark()
        end = simulation.run(steps=10).snapshot()
        simulation.return_to(mark)
        assert np.array_equal(simulation.run(steps=10).snapshot().position, end.position)
        simulation.go_back(bookmark)
        assert np.array_equal(simulation.run(steps=10).snapshot().velocity, end.velocity)
        simulation.restart()
        assert np.array_equal(simulation.run(steps=20).snapshot().position, end.position)


@pytest.mark.parametrize("name", ["leapfrog", "velocity_verlet", "yoshida4"])
def test_steps_backwards_undo_the_steps(name):
    with Simulation(shaken(name, 0.02, damping=0.0), backend="cpu") as simulation:
        start = simulation.snapshot()
        simulation.run(steps=50)
        assert simulation.try_steps(50, -0.02)
        assert np.allclose(simulation.snapshot().position, start.position, rtol=0.0, atol=1e-12)
        assert np.allclose(simulation.snapshot().velocity, start.velocity, rtol=0.0, atol=1e-12)


def test_a_path_goes_on_through_the_phases_of_a_timeline():
    scene = shaken(
        dt=0.02, damping=0.0, timeline=[{"at": 0.5, "set": {"springs[0].link.stiffness": 9.0}}], run={"duration": 1.0}
    )
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(steps=25)
        assert simulation.phase_number == 1
        assert np.allclose(simulation.snapshot().velocity[[0, 3]], on_paths(simulation.time)[1], rtol=1e-13)
        simulation.run(steps=25)
        assert np.allclose(simulation.snapshot().position[[0, 3]], on_paths(simulation.time)[0], rtol=1e-13)


def test_frames_between_steps_show_bodies_on_their_paths():
    with Simulation(shaken(dt=0.2), backend="cpu") as simulation:
        simulation.run(steps=3)
        shown = simulation.snapshot_ahead(0.1)
        places, velocities = on_paths(simulation.time + 0.1)
        assert np.allclose(shown.position[[0, 3]], places, rtol=1e-14)
        assert np.allclose(shown.velocity[[0, 3]], velocities, rtol=1e-13)


def test_a_magnetic_field_does_not_turn_a_driven_body():
    scene = shaken("velocity_verlet", 0.02, damping=0.0, forces=[{"magnetic_field": {"field": [0, 0, 3.0]}}])
    for entry in scene["particles"]:
        entry["body"]["charge"] = 1.0
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(steps=10)
        places, velocities = on_paths(simulation.time)
        assert np.allclose(simulation.snapshot().position[[0, 3]], places, rtol=1e-14)
        assert np.allclose(simulation.snapshot().velocity[[0, 3]], velocities, rtol=1e-13)


def test_single_precision_keeps_the_path_but_for_rounding():
    with Simulation(shaken(dt=0.02), backend="cpu", precision="f32") as simulation:
        simulation.run(steps=100)
        places, velocities = on_paths(simulation.time)
        assert np.allclose(simulation.snapshot().position[[0, 3]], places, rtol=0.0, atol=2e-6)
        assert np.allclose(simulation.snapshot().velocity[[0, 3]], velocities, rtol=0.0, atol=4e-6)


def test_vulkan_moves_bodies_on_paths(software_vulkan):
    with Simulation(shaken(dt=0.02), backend="vulkan", precision="f32") as simulation:
        simulation.run(steps=5)
        places, velocities = on_paths(simulation.time)
        assert np.allclose(simulation.snapshot().position[[0, 3]], places, rtol=0.0, atol=2e-6)
        assert np.allclose(simulation.snapshot().velocity[[0, 3]], velocities, rtol=0.0, atol=4e-6)


def test_a_driven_body_belongs_to_the_laboratory():
    with Simulation(shaken(dt=0.02), backend="cpu") as simulation:
        simulation.run(steps=10)
        now, found = simulation.snapshot(), simulation.mechanics()
        assert np.allclose(found["momentum"], (now.mass[1:3, None] * now.velocity[1:3]).sum(axis=0))
        assert np.isclose(found["kinetic_energy"], 0.5 * (now.mass[:, None] * now.velocity**2).sum())
        assert not simulation.phase.conserves_energy and not simulation.phase.gains_no_energy
        assert not simulation.phase.conserves_momentum


def test_quantities_see_the_velocity_of_a_driven_body():
    with Simulation(shaken(dt=0.02), backend="cpu") as simulation:
        simulation.run(steps=10)
        speed = component.build("quantities", "speed", {"of": (0, 1)})
        found = speed.measure(SimulationSample(simulation))
        assert np.isclose(found, np.linalg.norm(on_paths(simulation.time)[1][0]))


def test_a_scene_without_paths_has_the_kernels_that_it_had(compilations):
    """No formula of a path is compiled, and no loop is added."""
    plain = shaken(dt=0.02)
    for entry in plain["particles"]:
        if entry["body"].pop("path", None):
            entry["body"] |= {"position": [0.0, float(len(entry["body"]["name"])), 0.0], "free": False}
    with Simulation(plain, backend="cpu") as simulation:
        simulation.run(steps=3)
        assert simulation.total_force.paths is None
        assert not simulation.start.driven and simulation.start.moving is simulation.start.free
