"""The run that is said to be enough for a film is right in every frame, beside the exact motion."""

import math

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.accuracy import film_checks
from mpp_taichi.accuracy import verdict as verdict_of
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.film_checks import FilmChecks
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.scene.load import load_scene
from scenes import kepler

ECCENTRICITY = 0.8
FILM = 4e-4  # the bar of these tests, between the error at the end of a run of 8,192 steps, 2.6e-4, and that on its way


def exact(time, orbit):
    """The way from the heavy to the light body, from pericentre on, by Kepler's equation."""
    e, mean = orbit.eccentricity, 2.0 * math.pi * time / orbit.period
    anomaly = mean + e * math.sin(mean)
    for _ in range(50):
        anomaly -= (anomaly - e * math.sin(anomaly) - mean) / (1.0 - e * math.cos(anomaly))
    return orbit.semi_major_axis * np.array([math.cos(anomaly) - e, math.sqrt(1.0 - e * e) * math.sin(anomaly), 0.0])


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study of an orbit that ends at its apocentre, after 1½ periods."""
    spec = load_scene({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": 3.0 * math.pi}})
    problem = pose(spec)
    store = Store(tmp_path_factory.mktemp("study"), identity(problem, problem.span, "test"))
    wishes = StudyWishes(("leapfrog",), (("cpu", "f64"),), reference="leapfrog")
    found = Study(problem, store, Budget(15.0), wishes, after_sweep=FilmChecks().run)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(film_checks, "FILM", FILM)
        found.run()
    return found


@pytest.mark.sampled(3)
def test_the_error_of_every_frame_is_measured(study):
    checked = [row for row in study.rows() if row.sample.along is not None]
    assert checked and any(row.sample.along > FILM for row in checked)  # a run whose end is right, and not its frames
    assert all(row.position.bound <= FILM for row in checked)
    for row in checked:
        configuration = row.sample.configuration
        scene = kepler(ECCENTRICITY, dt=row.sample.dt, integrator=configuration.integrator)
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            orbit = simulation.orbits()["planet"]
            largest = 0.0
            for _ in range(configuration.steps):
                sun, planet = simulation.run(steps=1).snapshot().position
                apart = planet - sun - exact(simulation.time, orbit)
                largest = max(largest, float(np.linalg.norm(apart)))
        # 1,000 looks at about as many steps may miss the largest error by a little: it changes slowly from step to step.
        assert row.sample.along == pytest.approx(largest / study.reference.size, rel=0.1)


@pytest.mark.sampled(3)
def test_the_run_for_a_film_is_within_its_bar_in_every_frame(study, monkeypatch):
    monkeypatch.setattr(verdict_of, "FILM", FILM)
    found = verdict_of.verdict(study.rows(), "position", 1e-6)["film"]
    assert found["along"] <= FILM
