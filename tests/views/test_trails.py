"""Trails follow the motion between frames: near the true path, with few pieces, and within the walls where spheres bounce."""

import math

import numpy as np
import pytest
from pictures import frame_of

from mpp_taichi.views.path_curves import MOST_PIECES, path_pieces
from mpp_taichi.views.trails import Trails

WHITE, BLACK = np.ones((1, 3)), np.zeros(3)


def moving(time, position, velocity, **others):
    """A frame of moving particles."""
    return frame_of(position, 0.1, time=time, velocity=np.array(velocity, dtype=float).reshape(-1, 3), **others)


def segments_of(frames, tolerance, length=1000):
    """The segments of all frames."""
    trails = Trails(length)
    for frame in frames:
        trails.add(frame)
    color = np.ones((len(frames[0].position), 3))
    return trails.segments(color, BLACK, tolerance)


def circle(turn, frames):
    """Frames of a body on the unit circle, so many revolutions apart."""
    angles = 2.0 * math.pi * turn * np.arange(frames)
    return [moving(angle, [math.cos(angle), math.sin(angle), 0], [-math.sin(angle), math.cos(angle), 0]) for angle in angles]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("turn", [1 / 120, 1 / 40, 1 / 12, 1 / 6])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_a_trail_of_a_circle_is_as_near_as_asked_and_has_few_pieces(turn, tolerance) -> None:
    ends, _, _ = segments_of(circle(turn, 20), tolerance)
    middles = ends.mean(axis=1)
    error = np.abs(np.linalg.norm(np.concatenate([ends[:, 0], middles]), axis=1) - 1.0).max()
    # The cubic is off by θ⁴/384 between frames θ apart, and θ⁶ beyond; its chords by the tolerance.
    assert error <= 1.1 * (2.0 * math.pi * turn) ** 4 / 384 + tolerance
    # A chord over φ is off by φ²/8, so these are enough; rounded up in each frame.
    pieces = math.ceil(1.1 * 2.0 * math.pi * turn / math.sqrt(8.0 * tolerance))
    assert len(ends) <= 19 * pieces


def test_a_straight_path_has_one_piece_for_each_frame_and_colors_as_before() -> None:
    frames = [moving(0.5 * k, [0.5 * k, 0, 0], [1, 0, 0]) for k in range(6)]
    ends, colors, age = segments_of(frames, 1e-6, length=10)
    np.testing.assert_allclose(ends, [[[0.5 * k, 0, 0], [0.5 * k + 0.5, 0, 0]] for k in range(5)])
    np.testing.assert_allclose(colors[:, :, 0], [[1 - (5 - k) / 10, 1 - (4 - k) / 10] for k in range(5)])
    np.testing.assert_allclose(age, [0.4, 0.3, 0.2, 0.1, 0.0], atol=1e-15)


def test_a_trail_is_one_line_that_goes_through_every_frame() -> None:
    ends, colors, _ = segments_of(circle(1 / 9, 15), 1e-4)
    np.testing.assert_array_equal(ends[1:, 0], ends[:-1, 1])
    np.testing.assert_allclose(colors[1:, 0], colors[:-1, 1], atol=1e-14)
    for frame in circle(1 / 9, 15):
        assert (np.abs(ends - frame.position[0]).sum(axis=2) == 0.0).any()


def test_a_camera_that_comes_nearer_gets_finer_pieces() -> None:
    trails = Trails(100)
    for frame in circle(1 / 12, 12):
        trails.add(frame)
    counts = [len(trails.segments(WHITE, BLACK, tolerance)[0]) for tolerance in (1e-2, 1e-4, 0.9e-4, 1e-2)]
    assert counts[0] < counts[1] == counts[2] and counts[3] == counts[0]


def test_samples_between_frames_lead_around_whole_circles() -> None:
    """A body that comes back to its place at each frame: without samples its trail would be a point."""
    angles = np.linspace(0.0, 2.0 * math.pi, 17)
    places = np.stack([np.cos(angles), np.sin(angles), 0 * angles, -np.sin(angles), np.cos(angles), 0 * angles], axis=1)
    frames = [moving(2.0 * math.pi * k, [[1, 0, 0], [5, 0, 0]], [[0, 1, 0], [0, 0, 0]]) for k in range(2)]
    frames[1] = moving(
        2.0 * math.pi,
        [[1, 0, 0], [5, 0, 0]],
        [[0, 1, 0], [0, 0, 0]],
        path_index=np.array([0]),
        path_time=angles[1:-1],
        path=places[1:-1, None],
    )
    ends, colors, _ = segments_of(frames, 1e-3, length=2)
    around = np.linalg.norm(ends, axis=2) < 2.0
    np.testing.assert_allclose(np.linalg.norm(ends[around], axis=1), 1.0, atol=2e-4 + 1e-3)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    assert length == pytest.approx(2.0 * math.pi, rel=2e-3)
    turning = around.all(axis=1)
    assert (np.diff(colors[turning][:, 0, 0]) > 0).all() and colors[turning][0, 0, 0] == 0.5


def bouncing(span, restitution, speed=1.0, across=0.3, frames=200):
    """A point in 0…1 along y, that flies straight and bounces off both ends, and its frames `span` apart."""
    time, y, vy, found = 0.0, 0.37, speed, []
    for k in range(frames):
        while True:
            wall = 1.0 if vy > 0 else 0.0
            left = (wall - y) / vy if vy else math.inf
            if time + left > k * span:
                break
            time, y, vy = time + left, wall, -restitution * vy
        y, time = y + vy * (k * span - time), k * span
        found.append(moving(time, [across * time, y, 0], [across, vy, 0], collides=True))
    return found


@pytest.mark.sampled(2)
@pytest.mark.parametrize("span", [0.05, 0.21, 0.5, 0.93])
@pytest.mark.parametrize(("restitution", "across"), [(1.0, 0.0), (1.0, 0.3), (1.0, 20.0), (0.9, 0.3)])
def test_the_trail_of_a_bouncing_ball_stays_in_its_box(span, restitution, across) -> None:
    frames = bouncing(span, restitution, across=across)
    ends, _, _ = segments_of(frames, 1e-4)
    # Where the jump is too slight to be told from a curve, next to a speed across of 20, the cubic leaves the box by up to
    # (1 − s) s² ≈ 0.15 of the part `SLIGHT` of the way that it may differ by.
    slight = 0.15 * 0.01 * span * math.hypot(across, 1.0) if across > 5 else 0.0
    assert ends[..., 1].min() >= -1e-12 - slight and ends[..., 1].max() <= 1.0 + 1e-12 + slight
    if span < 0.5 and across < 1:
        touched = np.abs(ends[..., 1][:, :, None] - [0.0, 1.0]).min(axis=(0, 1))
        # A bounce in the middle between two frames cannot be told from a flight, whose cubic turns half as far away.
        assert (touched < (1e-9 if span == 0.21 else 0.25 * span)).all(), "the trail reaches the walls"


def test_without_the_test_for_jumps_a_bounce_would_leave_the_box() -> None:
    begin, end = np.array([[0.0, 0.006, 0, 1, -0.3, 0]]), np.array([[1.0, 0.294, 0, 1, 0.3, 0]])
    assert path_pieces(begin, end, 1.0, 1e-4).ends[..., 1].min() < -0.01
    assert path_pieces(begin, end, 1.0, 1e-4, collides=True).ends[..., 1].min() > -1e-15


def test_no_trail_leads_across_a_box_that_repeats() -> None:
    frames = [moving(0.1 * k, [(0.3 + 0.1 * k) % 1.0, 0.5, 0], [1, 0, 0], period=(1.0, 0.0, 0.0)) for k in range(20)]
    ends, _, _ = segments_of(frames, 1e-3)
    assert len(ends) == 17 and np.abs(ends[:, 1] - ends[:, 0]).max() < 0.11


def test_lost_and_merged_particles_leave_the_other_trails_alone() -> None:
    frames = [
        moving(0.1 * k, [[k, 0, 0], [np.nan] * 3, [0, k, 0]], [[10, 0, 0], [np.nan] * 3, [0, 1e200, 0]]) for k in range(4)
    ]
    ends, _, _ = segments_of(frames, 1e-3)
    seen = np.isfinite(ends).all(axis=(1, 2))
    assert (seen.sum(), len(ends)) == (6, 9)
    assert len(path_pieces(np.array([[0, 0, 0, 1e5, 0, 0.0]]), np.array([[0, 0, 0, 0, 1e5, 0.0]]), 1.0, 1e-9).ends) == 1
    assert (
        len(path_pieces(np.array([[0, 0, 0, 1, 0, 0.0]]), np.array([[0.5, 0.5, 0, 0, 1, 0.0]]), 1.0, 1e-9).ends) == MOST_PIECES
    )
