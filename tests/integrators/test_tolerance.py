"""What `tolerance` means: the error of an orbit within a factor of 10, at any eccentricity and in a cluster."""

import math

import numpy as np
import pytest
from test_ias15 import bodies

from mpp_taichi import Simulation

GRAVITY = {"newtonian_gravity": {"strength": 1.0}}
ECCENTRICITIES = (0.0, 0.5, 0.9, 0.99)
PLANET = 1e-3
ORBITS = 10
METHODS = [
    ("taylor", (1e-4, 1e-7, 1e-10)),
    ("adaptive_dop853", (1e-4, 1e-7, 1e-10)),
    ("adaptive_bogacki_shampine", (1e-4, 1e-5)),
]
# Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993) p. 245: x and y at t = 3.
PLEIADES_AT_3 = np.array([
    [0.3706139143970502, 3.237284092057233, -3.222559032418324, 0.6597091455775310, 0.3425581707156584, 1.562172101400631,
     -0.7003092922212495],
    [-3.943437585517392, -3.271380973972550, 5.225081843456543, -2.590612434977470, 1.198213693392275, -0.2429682344935824,
     1.091449240428980],
]).T  # fmt: skip


def orbit(eccentricity):
    """Positions and velocities at the end of the minor axis, where distance and speed have their means, and the period."""
    rate = math.sqrt(1 + PLANET)
    weight = np.array([1.0, PLANET]) / (1 + PLANET)
    x = np.array([[0, 0, 0], [-eccentricity, -math.sqrt(1 - eccentricity**2), 0]])
    v = np.array([[0, 0, 0], [rate, 0, 0]])
    return x - weight @ x, v - weight @ v, 2 * math.pi / rate


def scene_of(method, masses, places, velocities, dt):
    """Bodies under gravity."""
    entries = [(float(m), x.tolist(), v.tolist()) for m, x, v in zip(masses, places, velocities)]
    return {"particles": bodies(*entries), "forces": [GRAVITY], "integrator": {method: {"dt": dt}}}


def begin(run, tolerance, mark):
    """Another tolerance, from the start."""
    run.integrator.tolerance = tolerance
    run.return_to(mark)
    run.launcher.prepare(0.0, run.dt)


@pytest.mark.parametrize(("method", "tolerances"), METHODS)
@pytest.mark.sampled(3)
def test_the_tolerance_is_the_error_of_an_orbit_at_any_eccentricity(method, tolerances):
    """A wrong period counts in each orbit, so that n orbits make n (n + 1)/2 errors of an orbit.

    The largest of ten orbits counts, since errors of both signs pass through zero.
    """
    x, v, period = orbit(0.0)
    scene = scene_of(method, (1.0, PLANET), x, v, period)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.snapshot()
    starts = [start.moved(position=x, velocity=v, time=0.0, step=0) for x, v, _ in map(orbit, ECCENTRICITIES)]
    size = math.sqrt((starts[0].position ** 2).sum(1).mean())
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=starts) as run:
        mark = run.mark()
        for tolerance in tolerances:
            begin(run, tolerance, mark)
            largest = np.zeros(len(starts))
            for n in range(1, ORBITS + 1):
                run.run(steps=1)
                off = [run.snapshot(k).position - each.position for k, each in enumerate(starts)]
                errors = np.linalg.norm(off, axis=2).max(1) / size
                largest = np.maximum(largest, errors / (n * (n + 1) / 2))
            assert np.all((tolerance / 10 < largest) & (largest < 10 * tolerance)), (tolerance, largest / tolerance)


@pytest.mark.parametrize(("method", "tolerances"), METHODS)
@pytest.mark.sampled(3)
def test_the_tolerance_is_the_error_of_seven_stars_in_close_encounters(method, tolerances):
    places = np.array([[3, 3, 0], [3, -3, 0], [-1, 2, 0], [-3, 0, 0], [2, 0, 0], [-2, -4, 0], [2, 4, 0]], float)
    velocities = np.zeros((7, 3))
    velocities[5:, 0], velocities[3:5, 1] = [1.75, -1.5], [-1.25, 1]
    size = math.sqrt(((places - np.arange(1, 8) @ places / 28) ** 2).sum(1).mean())
    with Simulation(scene_of(method, np.arange(1.0, 8.0), places, velocities, 3.0), backend="cpu", precision="f64") as run:
        mark = run.mark()
        for tolerance in tolerances:
            begin(run, tolerance, mark)
            run.run(steps=1)
            error = np.linalg.norm(run.snapshot().position[:, :2] - PLEIADES_AT_3, axis=1).max() / size
            assert tolerance / 10 < error < 10 * tolerance


@pytest.mark.parametrize("method", ["taylor", "adaptive_dop853"])
@pytest.mark.sampled(3)
def test_the_tolerance_is_the_error_of_an_orbit_about_a_held_body(method):
    """The pull of a held body moves nothing, so that it has no part in the energy of the pair: e = 0.9, from apocentre."""
    e, tolerance = 0.9, 1e-8
    start, speed = np.array([[0, 0, 0], [1 + e, 0, 0]]), math.sqrt((1 - e) / (1 + e))
    scene = scene_of(method, (1.0, 1.0), start, np.array([[0, 0, 0], [0, speed, 0]]), 2 * math.pi)
    scene["particles"][0]["body"]["free"] = False
    with Simulation(scene, backend="cpu", precision="f64") as run:
        begin(run, tolerance, run.mark())
        largest = 0.0
        for n in range(1, ORBITS + 1):
            run.run(steps=1)
            largest = max(largest, np.linalg.norm(run.snapshot().position[1] - start[1]) / (n * (n + 1) / 2))
    # At the apocentre the body is slower by √((1 + e)/(1 − e)) = 4.4 than at the mean distance.
    assert tolerance / 10 < largest * math.sqrt((1 + e) / (1 - e)) < 10 * tolerance
