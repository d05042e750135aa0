"""Low parts of positions and velocities: free flight in f32c, ds and df64 keeps 48 bits in every method and plan."""

import numpy as np
import pytest

from mpp_taichi import Simulation, component
from mpp_taichi.precision import PRECISIONS, carries_low_parts

CARRYING = [precision for precision in PRECISIONS if carries_low_parts(precision)]
METHODS = [name for name in component.names("integrators") if component.flag("integrators", name, "takes_low_parts")]
DT = 2.0**-9
THIRD = 1.0 / 3.0
UPDATE = 2 * 2.0**-48
"""Error of an update relative to its largest number: four sums of low parts, each rounded to 2⁻²⁵ of at most 2⁻²⁴."""


def flight(start, speed=THIRD, method="leapfrog", forces=(), mass=1.0):
    """Particles without interaction, on the x axis; no two at one place."""
    bodies = [{"body": {"mass": mass, "position": [x, 0, 0], "velocity": [speed, 0, 0]}} for x in np.atleast_1d(start)]
    return {"title": "Flight", "particles": bodies, "forces": list(forces), "integrator": {method: {"dt": DT}}}


def error_after(steps, scene, **options):
    """Largest distance from x + v t, and the largest coordinate on the way."""
    with Simulation(scene, **options) as simulation:
        start, speed = simulation.start.position[:, 0], simulation.start.velocity[:, 0]
        end = simulation.run(steps=steps).snapshot().position[:, 0]
    exact = start + speed * (steps * DT)
    return np.abs(end - exact).max(), np.maximum(np.abs(start), np.abs(exact)).max()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", CARRYING)
@pytest.mark.parametrize("start", [0.0, THIRD, -20.0 * THIRD, 1000.0 + THIRD])
def test_free_flight_of_a_hundred_thousand_steps_is_right_to_48_bits(start, precision):
    """v as rounded to f32 would be off by 10⁻⁸ v, 1.9e-6 of the way; a leapfrog has two drifts a step."""
    steps = 100_000
    error, size = error_after(steps, flight(start), backend="cpu", precision=precision)
    assert error <= 2 * steps * UPDATE * size


# The twelve stages of dop853 take four minutes to compile in pairs of floats, and drift as those of the other tables do.
@pytest.mark.sampled(6)
@pytest.mark.parametrize(("method", "precision"), [(m, p) for m in METHODS for p in CARRYING if (m, p) != ("dop853", "df64")])
def test_free_flight_is_right_to_48_bits_in_every_method(method, precision):
    """A step of any of them has at most 35 drifts; v as rounded to f32 would be off by 10⁻⁸ v t, sixteen times the bound."""
    steps = 2000
    error, size = error_after(steps, flight(THIRD, method=method), backend="cpu", precision=precision)
    assert error <= 35 * steps * UPDATE * size < 1e-8 * THIRD * steps * DT


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", CARRYING)
@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
def test_free_flight_has_the_same_bits_under_every_plan_and_on_vulkan(backend, precision, request):
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    scene, steps = flight([THIRD, 1000.0 + THIRD, -THIRD, 0.1]), 2000
    ends = []
    for where, plan in (("cpu", "serial"), (backend, "serial"), (backend, "parallel")):
        with Simulation(scene, backend=where, plan=plan, precision=precision) as simulation:
            ends.append(simulation.run(steps=steps).state.read())
    assert all(np.array_equal(end, ends[0]) for end in ends)
    far = np.abs(ends[0][0][:, 0] - (np.array([THIRD, 1000.0 + THIRD, -THIRD, 0.1]) + THIRD * steps * DT))
    assert (far <= 2 * steps * UPDATE * np.array([2.0, 1002.0, 1.0, 1.5])).all()
