"""Path samples: moments of a run between its frames, for the trails of bodies that turn far from one frame to the next.

Only positions and velocities are read: the steps keep their bits. The next sample is taken where, at the present rate, no body
will have changed its velocity by more than `TARGET` of it since the last sample; slow motion has no samples but the frames.
The change counts, and not the angle alone, as a body that falls straight to a pericentre turns there within a short time.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views.appearance import DrawnPlaces
from mpp_taichi.views.wall_outline import Outline

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

TARGET = (
    0.2  # |Δv|/|v| between two samples: 11° of a circle; cubics are then off an ellipse of eccentricity 0.9 by 4e-4 of its size
)
CORNER = math.radians(100.0)  # of a turn between two samples: more than this is a collision, or the way back on a straight line
ALLOWED = 1.0 / 3.0  # of a revolution from frame to frame: beyond it an eye may see the motion backwards
MOST = 64  # samples for each frame
MOST_PLACES = 200_000  # particles times samples for each frame
SLOWEST, LONGEST = 0.25, 2.0  # factors between two intervals
FAST = 0.3  # of a body's largest speed so far: its turns count from this speed on, not where it stops and goes back
FADING = 0.98  # of the largest speed so far that is left in the next frame
STILL = 2e-3  # of the size of the scene, that a body must go in a frame for its turns to count

Told = Callable[[str, float], None]
"""Is told the name of a body, and by how many revolutions it turns between two frames."""


class PathSamples:
    """Takes samples of a run whose frames are `interval` apart, and tells once of a body that turns by a third of a circle.

    Without trails only the motion until the second frame is sampled, for the warning.
    """

    MADE_ANEW = ("_walls", "_drawn", "_told")  # for `archive.object_state`

    def __init__(self, spec: SceneSpec, interval: float, walls: Outline | None, told: Told) -> None:
        """No sample was taken yet."""
        self._interval, self._walls, self._told = interval, walls, told
        self._drawn, self._collides = DrawnPlaces(spec.view.bodies), bool(spec.contacts or spec.walls)
        self._goes_on = spec.view.trails > 0
        self._has_told = False
        self._ahead = 0.0  # time from the last sample to the next
        self._fastest = np.zeros(1)  # speed of each body
        self._resolves = True  # whether samples between the frames are possible
        self._rate = 0.0  # of the turn that was fastest between the last two samples
        self._times: list[float] = []
        self._places: list[
            np.ndarray
        ] = []  # since the last frame, which is the first entry; positions and velocities (count, 6)

    def steps_until_due(self, simulation: "Simulation", due: float) -> int:
        """Steps until the next sample, where there is one before the next frame, which is `due` then."""
        if not self._times:
            return 2**31
        following = self._times[-1] + self._ahead
        if following > due - 0.5 * simulation.dt:
            return 2**31
        return max(0, round((following - simulation.time) / simulation.dt))

    def look(self, simulation: "Simulation", snapshot: Snapshot, due: float) -> None:
        """Take a sample, if one is due now."""
        if self.steps_until_due(simulation, due) == 0:
            self._add(simulation.time, snapshot)
            self._look_ahead(simulation.dt)

    def take(self, simulation: "Simulation", snapshot: Snapshot, time: float) -> dict[str, Any]:
        """End with the samples of a frame: the fields of `Frame` about the paths of bodies that turn far, or {}."""
        if math.isinf(self._ahead):
            return {}
        if len(self._times) > 1 and self._times[-1] > simulation.time - 0.5 * simulation.dt:
            del self._times[-1], self._places[-1]  # the frame is made from the state of the same step
        self._add(time, snapshot)
        found: dict[str, Any] = {}
        if len(self._times) == 1:
            self._ahead = min(simulation.dt, self._interval)
            self._resolves = self._collides or self._interval > 1.5 * simulation.dt
        else:
            found = self._found(snapshot)
            self._ahead = self._ahead if self._goes_on else math.inf
        self._times, self._places = self._times[-1:], self._places[-1:]
        return found

    def _add(self, time: float, snapshot: Snapshot) -> None:
        position = snapshot.position if self._walls is None else self._walls.inside(snapshot.position)
        moment = np.concatenate([self._drawn.of(position), self._drawn.of(snapshot.velocity)], axis=1)
        moment[~snapshot.present] = np.nan
        if self._places and len(self._places[-1]) != len(moment):
            self._times, self._places, self._fastest = [], [], np.zeros(1)
        self._times.append(time)
        self._places.append(moment)

    def _look_ahead(self, dt: float) -> None:
        """Choose the time of the next sample."""
        since = self._times[-1] - self._times[-2]
        velocity = np.stack([each[:, 3:] for each in self._places[-2:]])
        change = np.where(self._is_still(), 0.0, _changes(velocity)[0])
        if self._collides:
            change = np.where(_angles(velocity)[0] > CORNER, 0.0, change)
        largest = float(change.max(initial=0.0))
        rate, before = largest / since, self._rate
        self._rate = rate
        if before > 0.0:
            rate *= min(max(rate / before, 1.0), LONGEST)  # a body that turns faster and faster, on its way to a pericentre
        wanted = TARGET / rate if rate > 0.0 else math.inf
        least = max(self._interval / max(1.0, min(MOST, MOST_PLACES / max(1, len(change)))), dt)
        self._ahead = min(max(min(max(wanted, SLOWEST * self._ahead), LONGEST * self._ahead), least), self._interval)

    def _is_still(self) -> np.ndarray:
        """Whether a body hardly moves within a frame, (count,)."""
        place, velocity = self._places[-1][:, :3], self._places[-1][:, 3:]
        with np.errstate(invalid="ignore", over="ignore"):
            there = np.isfinite(place).all(axis=1)
            reach = float(np.ptp(place[there], axis=0).max(initial=0.0)) if there.any() else 0.0
            return ~(np.linalg.norm(velocity, axis=1) * self._interval > STILL * reach)

    def _found(self, snapshot: Snapshot) -> dict[str, Any]:
        moments = np.stack(self._places)
        velocity, still = moments[:, :, 3:], self._is_still()
        with np.errstate(invalid="ignore", over="ignore"):
            angle, speed = _angles(velocity), np.linalg.norm(velocity, axis=2)
            corner = angle > CORNER
            jump = corner & self._collides
            turned = np.where(corner & self._resolves, 0.0, angle)
            change = np.where(jump, 0.0, _changes(velocity)).sum(axis=0)
            pace = np.minimum(speed[1:], speed[:-1])
            self._fastest = np.fmax(FADING * self._fastest, np.fmax.reduce(speed, axis=0))
            counted = np.where(pace > FAST * self._fastest, turned, 0.0).sum(axis=0) / (2.0 * math.pi)
        counted = np.where(still, 0.0, counted)
        if not self._has_told and counted.max(initial=0.0) > ALLOWED:
            self._has_told, most = True, int(np.argmax(counted))
            name = snapshot.name[most] if most < len(snapshot.name) and snapshot.name[most] else f"particle {most}"
            self._told(name, float(counted[most]))
        index = np.flatnonzero(~still & ((change > TARGET) | jump.any(axis=0)))
        if not len(index) or len(moments) < 3 or not self._goes_on:
            return {}
        return {"path_index": index, "path_time": np.array(self._times[1:-1]), "path": moments[1:-1, index]}


def _changes(velocity: np.ndarray) -> np.ndarray:
    """|Δv| over the larger speed, between successive moments of each particle, (moments − 1, count); 0 where both are 0."""
    first, second = velocity[:-1], velocity[1:]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        fastest = np.maximum(np.linalg.norm(first, axis=2), np.linalg.norm(second, axis=2))
        return np.nan_to_num(np.linalg.norm(second - first, axis=2) / fastest)


def _angles(velocity: np.ndarray) -> np.ndarray:
    """Angles between successive velocities of each particle, (moments − 1, count); 0 where one is 0 or not a number."""
    first, second = velocity[:-1], velocity[1:]
    with np.errstate(invalid="ignore", over="ignore"):
        across = np.linalg.norm(np.cross(first, second), axis=2)
        return np.nan_to_num(np.arctan2(across, (first * second).sum(axis=2)))
