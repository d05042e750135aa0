"""Kicks in which a magnetic field turns the velocity: exact for any step, in every order, and only where forces do no more."""

import math

import numpy as np
import pytest
from repeated_runs import assert_copies_have_the_bits_of
from scipy.linalg import expm

from mpp_taichi import Simulation
from mpp_taichi.device.backends import start
from mpp_taichi.forces._composition import compose
from mpp_taichi.integrators._turning import only_turns
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

FIELD, PUSH = np.array([0.3, -0.5, 2.0]), np.array([0.4, 0.1, -0.2])
START = np.array([1.0, 0.5, 0.3])
MAGNET = {"magnetic_field": {"field": FIELD.tolist()}}
ELECTRIC = {"uniform_gravity": {"acceleration": PUSH.tolist()}}


def charge(forces, method="leapfrog", dt=0.5, dimensions=3, **body):
    """One charge; in two dimensions it has no velocity along z."""
    velocity = [*START[:dimensions].tolist(), *[0.0] * (3 - dimensions)]
    particle = {"mass": 1, "charge": 1, "position": [0.3, 0.1, 0.2 * (dimensions == 3)], "velocity": velocity}
    return {
        "dimensions": dimensions,
        "particles": [{"body": particle | body}],
        "forces": forces,
        "integrator": {method: {"dt": dt}},
    }


def turned(time, field=FIELD, push=PUSH, velocity=START):
    """v(t) of v' = A + v × Ω, by the exponential of a matrix."""
    x, y, z = field
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    matrix[:3, 3] = push
    return (expm(matrix * time) @ [*velocity, 1.0])[:3]


@pytest.mark.parametrize("method", ["leapfrog", "velocity_verlet", "yoshida4"])
@pytest.mark.parametrize("dt", [0.01, 0.5, 3.0])
@pytest.mark.parametrize("precision", ["f64", "f32", "ds"])
def test_in_uniform_fields_the_velocity_is_exact_whatever_the_step_is(method, dt, precision):
    steps = 40
    with Simulation(charge([MAGNET, ELECTRIC], method, dt), backend="cpu", precision=precision) as simulation:
        found = simulation.run(steps=steps).snapshot().velocity[0]
    wanted = turned(steps * dt)
    # Some twenty roundings a kick of numbers up to |A| t and |v|, the angle of a kick among them.
    angle = np.linalg.norm(FIELD) * dt
    eps = np.finfo(np.float64 if precision == "f64" else np.float32).eps
    kicks = {"yoshida4": 3}.get(method, 1) * steps
    assert np.abs(found - wanted).max() < 20 * kicks * (1.0 + angle) * eps * (1.0 + np.abs(wanted).max())


def test_in_a_plane_the_field_along_z_turns():
    scene = charge([{"magnetic_field": {"field": [0, 0, 2]}}], dt=1.0, dimensions=2)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        found = simulation.run(steps=7).snapshot().velocity[0]
    wanted = turned(7.0, np.array([0, 0, 2.0]), np.zeros(3), np.array([1.0, 0.5, 0.0]))
    assert found == pytest.approx(wanted, abs=1e-13)


def test_a_held_axis_leaves_the_turn_about_it():
    scene = charge([MAGNET], dt=0.7, free=[False, True, True])
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        found = simulation.run(steps=11).snapshot().velocity[0]
    wanted = turned(7.7, np.array([FIELD[0], 0, 0]), np.zeros(3), np.array([0, START[1], START[2]]))
    assert found == pytest.approx(wanted, abs=1e-13)


def test_in_a_dipole_the_speed_stays_at_a_large_step():
    scene = charge([{"magnetic_dipole": {"strength": 5.0}}], dt=0.05, position=[1.0, 0.1, 0.2])
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        found = simulation.run(steps=2000).snapshot().velocity[0]
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(START), rel=20 * 2000 * 2.3e-16)
    assert not np.allclose(found, START, atol=0.1)


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("method", "order"), [("yoshida4", 4), ("yoshida6", 6), ("kahan_li8", 8)])
def test_every_order_of_the_table_holds(method, order):
    """Fields of the place, where the turn and the drift do not commute; kicks by Runge and Kutta kept orders up to 4."""
    forces = [{"external": {"acceleration": ["(1 + x*x)*vy - x", "-(1 + x*x)*vx - y", "0"]}}]

    def ends_at(name, dt):
        with Simulation(charge(forces, name, dt), backend="cpu", precision="f64") as simulation:
            return simulation.run(steps=round(4.0 / dt)).snapshot().position[0]

    exact = ends_at("dop853", 1.0 / 256)  # which has no kicks
    coarse = {4: 16, 6: 8, 8: 4}[order]
    errors = [np.linalg.norm(ends_at(method, 1.0 / (coarse * k)) - exact) for k in (1, 2)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4)


@pytest.mark.parametrize(
    ("forces", "turns"),
    [
        ([MAGNET], True),
        ([MAGNET, ELECTRIC, {"harmonic_trap": {"frequencies": [1, 1, 1]}}], True),
        ([{"rotating_frame": {"rate": [0, 0, 0.3]}}], True),
        ([{"external": {"acceleration": ["vy*x^2", "-vx*x^2", "0"]}}], True),
        ([{"external": {"acceleration": ["vy", "vx", "0"]}}], False),
        ([{"external": {"acceleration": ["vy*v", "-vx*v", "0"]}}], False),
        ([MAGNET, {"linear_drag": {"coefficient": 0.1}}], False),
        ([{"migration": {"rate": 0.1}}], False),
        ([ELECTRIC], False),
    ],
)
def test_only_forces_across_the_velocity_and_linear_in_it_turn(forces, turns):
    from mpp_taichi.forces._total_force import TotalForce

    spec = load_scene(charge(forces))
    start("cpu", "f64")
    assert only_turns(TotalForce(compose(spec, assemble(spec)), 1, 3)) == turns


def test_copies_have_the_bits_of_a_single_run():
    scene = charge([MAGNET, ELECTRIC], dt=0.3)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        single = simulation.run(steps=30).snapshot()
    assert_copies_have_the_bits_of(single, scene, copies=9, steps=30)


def test_the_tangent_is_the_derivative_of_the_exact_kick():
    """A deviation of a charge in a uniform field stays on its circle: it grows as the time, and its exponent goes to 0."""
    scene = charge([MAGNET], dt=0.5) | {"inspect": [{"y": "lyapunov"}]}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=2000)
        assert float(simulation.phase.read_tangent().growth[0]) < math.log(2000.0)
