"""JANUS: exact reversal of chaotic motion, the orders and errors of its tables, and the end of its lattice."""

import numpy as np
import pytest
from test_integrators import errors_at, kepler_reference, slope

from mpp_taichi import BackendError, SceneError, Simulation, StabilityError
from mpp_taichi.scene.load import load_scene
from scenes import cluster, everything, kepler

TABLES = {2: "leapfrog", 4: "pefrl", 6: "kahan_li6"}


def chaos(integrator="janus", **parameters):
    """Twelve bodies that fall together and pass each other many times, softened by a twentieth of their distance."""
    return cluster(12, integrator=integrator, softening=0.05, dt=0.004) | {
        "integrator": {integrator: {"dt": 0.004, **parameters}}
    }


def there_and_back(scene, steps, **options):
    """Start, turning point and end of a run so many steps forward and as many backward."""
    with Simulation(scene, backend="cpu", **options) as simulation:
        start = simulation.snapshot()
        turn = simulation.run(steps=steps).snapshot()
        simulation.dt = -simulation.dt
        return start, turn, simulation.run(steps=steps).snapshot()


def same_bits(one, other):
    return one.position.tobytes() == other.position.tobytes() and one.velocity.tobytes() == other.velocity.tobytes()


def test_an_ordinary_leapfrog_does_not_come_back():
    """Its roundings have grown to the size of the system: 1e15 and more, some 35 Lyapunov times and back."""
    start, _turn, end = there_and_back(chaos("leapfrog"), 8_000, precision="f64")
    assert np.abs(end.position - start.position).max() > 0.1


# Orders are tables of one code; a lattice in single precision is another.
@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("order", "plan", "precision"),
    [
        *((order, plan, "f64") for order in TABLES for plan in ("serial", "parallel")),
        *((2, plan, "f32") for plan in ("serial", "parallel")),
    ],
)
def test_a_run_forward_and_backward_returns_to_the_very_bits(order, plan, precision):
    steps = 8_000 if plan == "serial" else 200
    start, turn, end = there_and_back(chaos(order=order), steps, plan=plan, precision=precision)
    assert same_bits(start, end)
    assert np.abs(turn.position - start.position).max() > (0.1 if plan == "serial" else 0.01)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("order", TABLES)
def test_orders_and_energy_errors_are_those_of_the_tables(order):
    """Positions against Kepler's equation, and the errors of energy against those of the splitting itself."""
    finest = {2: 512, 4: 160, 6: 40}[order]
    scene = kepler(0.3, integrator="janus", order=order)
    dts, errors = errors_at(scene, finest, 5.0, kepler_reference)
    assert errors[-1] > 1e-11, "the ladder reaches round-off and shows nothing"
    assert slope(dts, errors) == pytest.approx(order, abs=0.1)
    found = []
    for each in (scene, kepler(0.3, integrator=TABLES[order])):
        with Simulation(each, backend="cpu", precision="f64") as simulation:
            simulation.dt = 0.05
            energy = simulation.diagnostics()["total_energy"]
            found.append([simulation.run(steps=40).diagnostics()["total_energy"] / energy - 1.0 for _ in range(40)])
    # 1600 steps of up to 18 roundings of 2⁻⁵³ of the largest numbers; an error of the orbit's phase grows with the time.
    np.testing.assert_allclose(*found, rtol=0, atol=1600 * 18 * 2.0**-53)
    assert np.abs(found[0]).max() > 10 * 1600 * 18 * 2.0**-53


def test_positions_are_those_of_rebound():
    """REBOUND's JANUS of second order on a lattice of its own."""
    rebound = pytest.importorskip("rebound")
    scene = kepler(0.3, dt=0.01, integrator="janus")
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start = simulation.snapshot()
        end = simulation.run(steps=1000).snapshot()
    other = rebound.Simulation()
    other.integrator = "janus"
    other.integrator.order = 2
    for mass, x, v in zip(start.mass, start.position, start.velocity):
        other.add(m=mass, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    other.dt = 0.01
    other.steps(1000)
    # 1000 steps of roundings of about 1e-16, cut off or to the nearest, that grow with the time: 1000² · 1e-16.
    assert np.abs(end.position - [p.xyz for p in other.particles]).max() < 1e-10


@pytest.mark.sampled(3)
def test_replicas_have_the_bits_of_one_and_going_back_to_a_mark_too():
    scene = chaos(order=4)
    with Simulation(scene, backend="cpu", precision="f64", plan="serial") as simulation:
        start = simulation.snapshot()
        mark = simulation.run(steps=150).mark()
        alone = simulation.run(steps=150).snapshot()
        simulation.return_to(mark)
        assert same_bits(simulation.run(steps=150).snapshot(), alone)
    other = start.moved(position=0.9 * start.position, velocity=start.velocity, time=0.0, step=0)
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=[other, start]) as simulation:
        first = simulation.snapshot(0)
        simulation.run(steps=300)
        assert same_bits(simulation.snapshot(1), alone)
        simulation.dt = -simulation.dt
        simulation.run(steps=300)
        assert same_bits(simulation.snapshot(0), first) and same_bits(simulation.snapshot(1), start)


def flight(**parameters):
    """A body that flies free, at 1 from x = 1 in steps of 0.25: a lattice of 2⁻⁵³ ends at 512 as it is."""
    return {
        "particles": [
            {"body": {"mass": 1.0, "position": [0, 0, 0]}},
            {"body": {"mass": 1.0, "position": [1, 0, 0], "velocity": [1, 0, 0]}},
        ],
        "integrator": {"janus": {"dt": 0.25, **parameters}},
    }


@pytest.mark.sampled(3)
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_the_end_of_the_lattice_ends_the_run_and_says_where(plan):
    with Simulation(flight(), backend="cpu", precision="f64", plan=plan) as simulation:
        with pytest.raises(StabilityError, match="particle 1 leaves the lattice of janus, .* coordinate of 512 ") as info:
            simulation.run(steps=4000)
        # It reaches x = 512 − 1/8 after half a step of its 2044th.
        assert info.value.step == 2044 and info.value.particle == 1
        assert simulation.snapshot().position[1, 0] == 1.0 + 2043 * 0.25
        simulation.restart()
        assert simulation.run(steps=4).snapshot().position[1, 0] == 2.0
    with Simulation(flight(lattice=2.0**-52), backend="cpu", precision="f64") as simulation:
        assert simulation.run(steps=4000).snapshot().position[1, 0] == 1001.0


@pytest.mark.sampled(3)
def test_a_velocity_may_leave_the_lattice_too():
    """Two bodies at rest that meet without softening: the force at 1e-9 is beyond any velocity of the lattice."""
    scene = kepler(0.3, integrator="janus")
    scene["particles"][1]["body"] |= {"position": [1e-12, 0, 0], "velocity": [0, 0, 0]}
    scene["particles"].append({"body": {"mass": 0.0, "position": [1, 0, 0]}})
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        with pytest.raises(StabilityError, match="leaves the lattice of janus"):
            simulation.run(steps=100)


def test_what_it_cannot_do_is_refused_in_one_line(software_vulkan):
    for order in (3, 8):
        with pytest.raises(SceneError, match="order.*not allowed, must be 2 or 4 or 6"):
            load_scene(kepler(integrator="janus", order=order))
    drive = {"harmonic_drive": {"force": [1, 0, 0], "angular_frequency": 1.0}}
    with pytest.raises(SceneError, match="janus: goes back bit for bit only with forces of positions, not with harmonic_drive"):
        load_scene(kepler(integrator="janus", forces=[drive]))
    dragged = everything(integrator="leapfrog")
    dragged["integrator"] = {"janus": {"dt": 0.01}}
    with pytest.raises(SceneError, match="janus: would lose its order beside linear_drag, damped springs"):
        Simulation(dragged, backend="cpu")
    with pytest.raises(
        SceneError,
        match="its lattice ends at a position of 4.6.*e-12, and the scene has a position of .* a larger `lattice` than 1e-30",
    ):
        Simulation(kepler(integrator="janus", lattice=1e-30), backend="cpu")
    with pytest.raises(BackendError, match="janus runs on the CPU only, not on vulkan"):
        Simulation(kepler(integrator="janus"), backend="vulkan")
