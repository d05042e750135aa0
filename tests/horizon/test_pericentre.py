"""An error that is large only near a pericentre, which few samples of a long run meet."""

from pathlib import Path

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.horizon.search import find

KEPLER = Path(__file__).parents[2] / "scenes" / "kepler.yaml"
CASES = [("rk4", 0.05, 2000.0), ("leapfrog", 0.005, 62.8)]


def simulation_of(integrator, dt, span):
    changes = [f"integrator={{{integrator}: {{dt: {dt}}}}}", f"run.duration={span}"]
    return mpp.Simulation(KEPLER, overrides=changes, backend="cpu", precision="f64")


@pytest.mark.parametrize(("integrator", "dt", "span"), CASES)
@pytest.mark.sampled(3)
def test_the_horizon_of_an_ellipse_is_the_pericentre_at_which_the_error_first_reaches_the_limit(integrator, dt, span):
    with simulation_of(integrator, dt, span) as simulation:
        found = find(simulation, span)
        assert found.found == "before_end"
        steps = int(1.5 * found.time / dt)
        path = np.array([simulation.run(steps=1).snapshot().position for _ in range(steps)])
    with simulation_of("ias15", dt, span) as simulation:
        right = np.array([simulation.run(until=dt * k).snapshot().position for k in range(1, steps + 1)])
    size = np.sqrt(np.mean(np.sum((path - path.mean(axis=(0, 1))) ** 2, axis=-1)))
    errors = np.linalg.norm(path - right, axis=-1).max(axis=1) / size
    # The error rises at each pericentre by what a revolution adds, so that an estimate a few per cent too small names the next
    # pericentre: the ninth in place of the eighth.
    assert found.time == pytest.approx(dt * (1 + np.argmax(errors > 1e-3)), rel=0.2)
