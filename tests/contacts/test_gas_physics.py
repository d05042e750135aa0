"""Gases of hard spheres in equilibrium against kinetic theory: rates of collision, pressures, speeds."""

import math

import numpy as np
import pytest
from scipy import stats

from mpp_taichi import Simulation
from mpp_taichi.kinetic_theory.collision_rate import enskog_rate
from mpp_taichi.kinetic_theory.equation_of_state import compressibility

BATCHES = 20
# A t-distributed mean of so many batches is farther from the true one than this in one of 10⁴ cases.
ERRORS = float(stats.t.ppf(1 - 0.5e-4, BATCHES - 1))
EQUATION_ERROR = 0.003  # of the equations of state, by their authors, at these densities


def gas(count, packing, dimensions, solver="event_driven"):
    """A gas of disks or spheres of radius 1 and k T = 1 in a periodic box."""
    volume = count * (math.pi if dimensions == 2 else 4 * math.pi / 3) / packing
    edge = volume ** (1 / dimensions)
    box = {"lower": [0, 0, 0][:dimensions], "upper": [edge] * dimensions}
    radius = {"count": count, "radius": 1.0, "temperature": 1.0, "zero_momentum": True}
    scene = {
        "dimensions": dimensions,
        "particles": [{"gas": {**box, **radius}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "walls": [{"periodic_box": box}],
        "run": {"duration": 1.0},
    }
    return scene, volume


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("dimensions", "packing"), [(2, 0.2), (2, 0.4), (2, 0.6), (3, 0.1), (3, 0.3), (3, 0.45)])
def test_pressure_and_collision_rate_are_those_of_theory(dimensions, packing):
    count = 500
    scene, volume = gas(count, packing, dimensions)
    expected_rate = enskog_rate(count / volume, 1.0, 1.0, 1.0, dimensions)
    compressed = compressibility(packing, dimensions)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        run.run(duration=30 / expected_rate)  # collisions per particle in which the lattice is forgotten
        rates, pressures = [], []
        temperature = (run.snapshot().velocity ** 2).sum() / (dimensions * (count - 1))  # the momentum is held at zero
        for _ in range(BATCHES):
            before, span = run.contact_report, 60 / expected_rate
            run.run(duration=span)
            pairs = run.contact_report.pair_count - before.pair_count
            rates.append(2 * pairs / count / span)
            pressures.append(1 + (run.contact_report.virial - before.virial) / (dimensions * count * temperature * span))
        assert run.contact_report.largest_overlap < 1e-9
    # One degree of freedom of the momentum is missing in each direction: of relative order 1/count.
    scale = math.sqrt(temperature)  # of all rates
    for found, expected in ((np.array(rates) / scale, expected_rate), (np.array(pressures), compressed)):
        error = ERRORS * found.std(ddof=1) / math.sqrt(BATCHES)
        assert error < 0.02 * expected  # the statistics are worth something
        assert abs(found.mean() - expected) < error + (EQUATION_ERROR + 1 / count) * expected


def figure_13(solver):
    """T. Müller, arXiv:1403.1695, Fig. 13: 250 disks of radius 0.1 and speed 1 in a box of 7.5 × 5."""
    box = {"lower": [0, 0], "upper": [7.5, 5]}
    scene = {
        "dimensions": 2,
        "particles": [{"gas": {**box, "count": 250, "radius": 0.1, "speed": 1.0}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "walls": [{"box": box}],
        "run": {"duration": 1.0},
    }
    return scene if solver == "event_driven" else scene | {"integrator": {"leapfrog": {"dt": 0.02}}}


@pytest.mark.parametrize("solver", ["event_driven", "swept", "simultaneous"])
@pytest.mark.sampled(3)
def test_speeds_become_those_of_maxwell_and_boltzmann(solver):
    """f(v) = (2v/b²) exp(−v²/b²), b² the mean square speed: T. Müller, arXiv:1403.1695, Eq. 21, Fig. 13."""
    passed, rates = 0, []
    with Simulation(figure_13(solver), backend="cpu", precision="f64") as run:
        speeds = np.linalg.norm(run.snapshot().velocity, axis=1)
        assert stats.kstest(speeds, lambda v: 1 - np.exp(-(v**2))).statistic > 0.6  # all are 1 at the start
        run.run(duration=1.0)  # some five collisions of each
        looks = 30
        for _ in range(looks):
            before = run.contact_report.pair_count
            run.run(duration=0.8)
            rates.append(2 * (run.contact_report.pair_count - before) / 250 / 0.8)
            speeds = np.linalg.norm(run.snapshot().velocity, axis=1)
            passed += stats.kstest(speeds, lambda v: 1 - np.exp(-(v**2))).pvalue > 0.05
        # Each sample fails with a chance of 5 % (less, as the energy is fixed); 7 of 30 do with one of 6e-4.
        assert stats.binom.sf(6, looks, 0.05) < 1e-3 and passed >= looks - 6
        # Enskog's rate with the density that the walls leave to the centres; 4.86 by the box's own area.
        found, error = np.mean(rates), ERRORS * np.std(rates, ddof=1) / math.sqrt(looks)
        bulk = enskog_rate(250 / (7.5 * 5.0), 0.1, 1.0, 0.5, 2)
        assert bulk == pytest.approx(4.86, abs=0.02)
        assert bulk - error < found < enskog_rate(250 / (7.3 * 4.8), 0.1, 1.0, 0.5, 2) + error
