"""The motion ahead: a camera that chooses its place frames all of a run, which keeps its bits and its counts."""

import math

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.recorders import motion
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.recorders.motion import motion_ahead
from mpp_taichi.report.summary import Stopwatch
from scenes import kepler

SPAN = 2 * math.pi


@pytest.mark.sampled(3)
def test_the_motion_is_that_of_the_run_and_leaves_no_trace() -> None:
    with Simulation(kepler(eccentricity=0.6), backend="cpu", precision="f64") as plain:
        plain.run(until=SPAN)
        end = plain.snapshot()
    with Simulation(kepler(eccentricity=0.6), backend="cpu", precision="f64") as simulation:
        ahead = motion_ahead(simulation, SPAN)
        assert (simulation.time, simulation.step_count, simulation.timings.launch_count) == (0.0, 0, 0)
        assert ahead.shape == (2 * 201, 4)
        # Pericentre and apocentre of the relative orbit, whose semi-major axis is that of both bodies' masses: 1 to 1e-3.
        planet = ahead[1::2]
        assert planet[:, 0].max() == pytest.approx(0.4, abs=0.01) and planet[:, 0].min() == pytest.approx(-1.6, abs=0.01)
        simulation.run(until=SPAN)
        after = simulation.snapshot()
    np.testing.assert_array_equal(after.position, end.position)
    np.testing.assert_array_equal(after.velocity, end.velocity)
    assert after.step == end.step


@pytest.mark.parametrize(("most", "moments"), [(60, 30), (61, 30), (15, None)])
def test_many_particles_have_fewer_moments_or_none(monkeypatch, most, moments) -> None:
    monkeypatch.setattr(motion, "MOST_PLACES", most)
    with Simulation(kepler(), backend="cpu", precision="f64") as simulation:
        ahead = motion_ahead(simulation, SPAN)
    assert ahead is None if moments is None else ahead.shape == (2 * (moments + 1), 4)  # the first place, too


class Pictures:
    """A view that keeps the motion of its frames."""

    def __init__(self):
        self.motions = []

    def draw(self, frame):
        self.motions.append(frame.motion)
        return np.zeros((2, 2, 3), np.uint8)


@pytest.mark.parametrize("integrator", ["leapfrog", "ias15"])
@pytest.mark.sampled(3)
def test_a_film_of_a_run_has_the_motion_once_and_the_run_its_bits(integrator) -> None:
    scene, ends, view = kepler(integrator=integrator), [], Pictures()
    for films in (False, True):
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            film = FilmRecorder(view, (), 5, SPAN, stopwatch=Stopwatch())
            simulation.run(until=SPAN, recorders=[film] if films else [])
            if films:
                film.finish(simulation)
            ends.append(simulation.snapshot())
    np.testing.assert_array_equal(ends[0].position, ends[1].position)
    np.testing.assert_array_equal(ends[0].velocity, ends[1].velocity)
    assert len(view.motions) == 5 and view.motions[0] is not None and view.motions[1:] == [None] * 4


@pytest.mark.parametrize(
    "more",
    [
        {"view": {"camera": {"position": [0, 0, 5]}}},
        {"walls": [{"plane": {"point": [0, -9, 0], "normal": [0, 1, 0]}}], "contacts": {"hard_spheres": {"solver": "swept"}}},
    ],
)
def test_a_camera_with_a_place_and_a_scene_with_walls_need_no_motion(more) -> None:
    with Simulation(kepler() | more, backend="cpu", precision="f64") as simulation:
        assert motion_ahead(simulation, SPAN) is None


def test_the_part_that_is_looked_at_follows_from_the_work(monkeypatch) -> None:
    with Simulation(kepler(), backend="cpu", precision="f64") as simulation:
        monkeypatch.setattr(motion, "MOST_WORK", 5_000)
        ahead = motion_ahead(simulation, SPAN)
        assert 16 <= len(ahead) < 2 * 401 and np.hypot(*ahead[1::2, :2].T).max() < 1.0, "not as far as the apocentre"
        monkeypatch.setattr(motion, "MOST_WORK", 100)
        assert motion_ahead(simulation, SPAN) is None


def test_a_run_that_blows_up_is_filmed_until_then() -> None:
    scene = {
        "particles": [{"body": {"name": f"b{k}", "mass": 1.0, "position": [1.1 * k, 0, 0]}} for k in range(2)],
        "springs": [{"link": {"between": [0, 1], "stiffness": 500.0, "rest_length": 1.0}}],
        "integrator": {"leapfrog": {"dt": 0.1}},
    }
    with Simulation(scene, backend="cpu", precision="f64", force=True) as simulation:
        motion_ahead(simulation, 1000.0)
        assert simulation.step_count == 0 and np.isfinite(simulation.snapshot().position).all()
