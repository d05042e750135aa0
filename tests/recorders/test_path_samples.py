"""Samples between the frames of a film: trails follow fast motion, the steps keep their bits, and aliasing is told once."""

import math

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.recorders.path_samples import MOST
from mpp_taichi.report.summary import Stopwatch
from mpp_taichi.views.trails import Trails

MOON = {"body": {"name": "moon", "mass": 1e-9, "position": [1, 0, 0], "velocity": [0, 1, 0]}}
EARTH = {"body": {"name": "earth", "mass": 1.0, "position": [0, 0, 0], "free": False}}


def circling(trails=100, dt=0.01, duration=8 * math.pi, **others):
    """A body on the unit circle, a revolution in 2π."""
    return {
        "particles": [EARTH, MOON],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "integrator": {"leapfrog": {"dt": dt}},
        "run": {"duration": duration},
        "view": {"trails": trails},
        **others,
    }


class Frames:
    """Keeps the frames of a film."""

    def __init__(self):
        self.frames = []

    def add(self, frame):
        self.frames.append(frame)


def filmed(scene, count, span=None):
    """The frames of a film, what was told, and the state at the end."""
    kept, told = Frames(), []
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        span = simulation.spec.run.duration if span is None else span
        film = FilmRecorder(None, (), count, span, pages=[kept], stopwatch=Stopwatch(), told=lambda *each: told.append(each))
        simulation.run(until=span, recorders=[film])
        film.finish(simulation)
        return kept.frames, told, simulation.snapshot()


def trail_of(frames, tolerance=1e-4):
    """The ends of the segments of all trails together."""
    trails = Trails(10_000)
    for frame in frames:
        trails.add(frame)
    return trails.segments(np.ones((len(frames[0].position), 3)), np.zeros(3), tolerance)[0]


@pytest.mark.parametrize("eccentricity", [0.0, 0.6, 0.9])
@pytest.mark.sampled(3)
def test_the_trail_of_an_ellipse_is_an_ellipse_at_four_frames_in_a_revolution(eccentricity) -> None:
    far, slow = 1.0 + eccentricity, math.sqrt((1.0 - eccentricity) / (1.0 + eccentricity))
    planet = {"body": {"name": "planet", "mass": 1.0, "position": [-far, 0, 0], "velocity": [0, -slow, 0]}}
    scene = circling(dt=2e-4 if eccentricity == 0.9 else 2e-3) | {"particles": [EARTH, planet]}
    frames, told, _ = filmed(scene, 40, 20 * math.pi)
    ends = trail_of(frames)
    center = -eccentricity
    planet = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 1e-9
    points = np.concatenate([ends[planet].reshape(-1, 3), ends[planet].mean(axis=1)])
    axis = math.sqrt(1.0 - eccentricity**2)
    # Distance from the ellipse to first order: the level of x² + y²/b² − 1 over the length of its gradient.
    x, y = points[:, 0] - center, points[:, 1]
    away = np.abs(x**2 + (y / axis) ** 2 - 1.0) / (2.0 * np.hypot(x, y / axis**2))
    assert away.max() < 1e-3
    if eccentricity == 0.0:
        assert not told, "92° from frame to frame"
        return
    (name, turns) = told[0]
    assert len(told) == 1 and name == "planet" and 1 / 3 < turns < 1.0


def test_the_steps_of_a_run_do_not_notice_the_samples() -> None:
    with Simulation(circling(), backend="cpu", precision="f64") as simulation:
        simulation.run()
        plain = simulation.snapshot()
    frames, _, end = filmed(circling(), 5)
    assert sum(len(frame.path_time) for frame in frames[1:]) > 4 * 12
    np.testing.assert_array_equal(end.position, plain.position)
    np.testing.assert_array_equal(end.velocity, plain.velocity)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("turns", [0.93, 1.0, 2.5])
@pytest.mark.parametrize("trails", [100, 0])
def test_a_body_that_turns_farther_than_a_third_of_a_circle_between_frames_is_told_once(turns, trails) -> None:
    frames, told, _ = filmed(circling(trails=trails, duration=turns * 2 * math.pi * 6), 7)
    assert [name for name, _ in told] == ["moon"]
    assert told[0][1] == pytest.approx(turns, rel=0.01)
    assert (frames[3].path is not None) == (trails > 0)
    if trails:
        ends = trail_of(frames)
        moving = np.abs(ends).max(axis=(1, 2)) > 0.1
        np.testing.assert_allclose(np.linalg.norm(ends[moving], axis=2), 1.0, atol=2e-4)


def test_slow_motion_is_sampled_only_at_the_start() -> None:
    frames, told, _ = filmed(circling(duration=2 * math.pi), 100)
    assert not told
    assert all(frame.path is None for frame in frames), "at 3.6° from frame to frame the frames are enough"


def test_there_are_no_more_samples_than_agreed() -> None:
    frames, _, _ = filmed(circling(duration=400 * math.pi), 3)
    assert all(len(frame.path_time) <= MOST + 1 for frame in frames[1:])


@pytest.mark.sampled(3)
def test_a_bounce_and_a_swing_are_no_turns() -> None:
    """A ball on a floor and a pendulum's weight on a straight line come back on themselves, and turn nowhere."""
    ball = {
        "particles": [{"body": {"name": "ball", "mass": 1.0, "position": [0, 0, 1], "radius": 0.1}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}],
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "walls": [{"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "integrator": {"symplectic_euler": {"dt": 0.01}},
        "run": {"duration": 20},
        "view": {"trails": 100},
    }
    frames, told, _ = filmed(ball, 40)
    ends = trail_of(frames)
    assert not told and frames[1].collides
    # The centre stays a radius above the floor; a corner is off by the fall in a frame, ½ g δ², at most.
    assert ends[..., 2].min() >= 0.1 - 1e-9 and ends[..., 2].max() < 1.0 + 0.5 * 0.5**2
    line = {
        "particles": [{"body": {"name": "weight", "mass": 1.0, "position": [1, 0, 0]}}, EARTH],
        "springs": [{"link": {"between": ["weight", "earth"], "stiffness": 1.0, "rest_length": 0.5}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 40},
        "view": {"trails": 100},
    }
    assert not filmed(line, 60)[1]


def test_record_says_which_frames_would_show_the_path(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    import yaml

    (tmp_path / "moon.yaml").write_text(yaml.safe_dump(circling(duration=12 * math.pi)))
    words = ["record", "moon.yaml", "--frames", "f", "--size", "64x48", "--fps", "6", "--duration", "1", "--backend", "cpu"]
    assert main([*words, "--no-archive"]) == 0
    warnings = [line for line in capsys.readouterr().err.splitlines() if line.startswith("warning:")]
    # Six revolutions in five intervals; six frames of each revolution are 6 · 1.2 times as many as now.
    assert warnings == ["warning: moon turns 1.20 times between two frames; --fps 44 shows its path"]
