"""Adaptive leapfrog: order, bounded energy, cost and smooth frames, against leapfrog with a fixed step."""

import numpy as np
import pytest
from test_ias15 import TWO_BODY, bodies, planet

from mpp_taichi import SceneError, Simulation

FRAMES = 200  # an orbit


def orbit(integrator, eccentricity, orbits, *, looks=FRAMES):
    """The way from sun to planet at every frame, (frames, 2); evaluations an orbit; largest energy error at the frames."""
    scene, period = planet(eccentricity, looks, orbits)
    (name,) = integrator
    fixed = "dt" in integrator[name]
    scene["integrator"] = integrator if fixed else {name: {**integrator[name], "dt": period / looks}}
    with Simulation(scene, backend="cpu", precision="f64") as run:
        energy, frames, errors = run.mechanics()["total_energy"], [], []
        stride = round(period / looks / run.dt)
        for _ in range(looks * orbits):
            run.run(steps=stride)
            now = run.snapshot()
            frames.append((now.position[1] - now.position[0])[:2])
            errors.append(abs(run.mechanics()["total_energy"] / energy - 1))
        taken = run.step_count if fixed else run.integrator.counts(run.state)[0, run.integrator.EVALUATIONS]
    return np.array(frames), taken / orbits, np.array(errors)


@pytest.mark.parametrize("eccentricity", [0.3, 0.9])
@pytest.mark.sampled(3)
def test_second_order_and_the_same_steps_whatever_the_eccentricity(eccentricity):
    start = np.array([1 + eccentricity, 0.0])
    errors = []
    for step in (0.02, 0.01, 0.005):
        frames, _, _ = orbit({"adaptive_leapfrog": {"step": step}}, eccentricity, 5, looks=3)
        errors.append(np.linalg.norm(frames[-1] - start))
    slopes = np.diff(np.log(errors)) / np.log(0.5)
    assert slopes == pytest.approx([2.0, 2.0], abs=0.1)


@pytest.mark.sampled(3)
def test_the_energy_error_stays_where_it_is():
    """Reversible steps: no drift over 25,000 steps. Looks fall elsewhere as the phase drifts, hence one part in a hundred."""
    _, cost, errors = orbit({"adaptive_leapfrog": {"step": 0.03}}, 0.9, 90, looks=61)
    thirds = errors[: len(errors) // 3], errors[-(len(errors) // 3) :]
    assert thirds[1].max() == pytest.approx(thirds[0].max(), rel=0.01) and 90 * cost > 25_000


def test_a_fifth_of_the_evaluations_and_frames_as_smooth_as_with_a_fixed_step():
    """At e = 0.9 a fixed step with five times the evaluations is no closer to the orbit, and its frames are no smoother."""
    adaptive, cost, _ = orbit({"adaptive_leapfrog": {"step": 0.03}}, 0.9, 3)
    _, period = planet(0.9, 1, 1)
    substeps = int(np.ceil(5 * cost / FRAMES))
    fixed, fixed_cost, _ = orbit({"leapfrog": {"dt": period / FRAMES / substeps}}, 0.9, 3)
    assert fixed_cost >= 5 * cost
    start = np.array([1.9, 0.0])
    assert np.linalg.norm(adaptive[-1] - start) <= np.linalg.norm(fixed[-1] - start)
    rough = [np.linalg.norm(np.diff(frames, 3, axis=0), axis=1).max() for frames in (adaptive, fixed)]
    assert rough[0] == pytest.approx(rough[1], rel=0.05)


def test_other_forces_are_refused_by_name():
    scene = TWO_BODY | {"particles": bodies((1.0, (0, 0)), (1e-3, (1, 0))), "integrator": {"adaptive_leapfrog": {"dt": 1.0}}}
    with pytest.raises(SceneError, match="knows no forces but newtonian_gravity .*, not linear_drag"):
        Simulation(scene | {"forces": [*scene["forces"], {"linear_drag": {"coefficient": 1.0}}]}, backend="cpu")
    with pytest.raises(SceneError, match="needs newtonian_gravity"):
        Simulation(scene | {"forces": []}, backend="cpu")
