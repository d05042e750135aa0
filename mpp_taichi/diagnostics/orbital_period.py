"""Time of the first full turn of one particle around another."""

import math

import numpy as np

from mpp_taichi.arithmetic.hermite import crossing
from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.quantities._base import NoResultError, RunSample
from mpp_taichi.quantities._particles import center_of

SAMPLE_ANGLE = 0.05  # radians between two samples; the cubic below is then good to about 1e-9 of a turn, and less on a circle


@component
class OrbitalPeriod(Diagnostic):
    """Time of the first full turn of `of` around `around`, as seen from `around` in the plane of their first motion.

    The angle is the angle of the relative position, its rate ω = (r × v)·n / |r in the plane|². Between two samples the angle
    is the cubic with both angles and both rates (Hermite), and the turn is complete at its root. The turn is the sidereal one:
    against fixed directions, not from pericentre to pericentre.
    """

    of: Particle = param(help="the orbiting particle")
    around: Particle = param(help="the central particle, from which the angle is measured")
    _axes: np.ndarray | None = None
    _last: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _start: float = 0.0
    _period: float | None = None

    def observe(self, sample: RunSample) -> None:
        """Follow the angle until it has grown by 2π."""
        if self._period is not None:
            return
        time, snapshot = sample.time, sample.snapshot
        of, around = (self.of, 1), (self.around, 1)
        separation = center_of(snapshot.position, snapshot, of) - center_of(snapshot.position, snapshot, around)
        motion = center_of(snapshot.velocity, snapshot, of) - center_of(snapshot.velocity, snapshot, around)
        if self._axes is None:
            self._axes = _plane(separation, motion)
            self._start = time
        x, y = self._axes @ separation
        u, w = self._axes @ motion
        squared = x * x + y * y
        rate = (x * w - y * u) / squared if squared > 0.0 else 0.0
        last_time, last_angle, last_rate = self._last
        turned = (math.atan2(y, x) - last_angle + math.pi) % (2.0 * math.pi) - math.pi
        angle = last_angle + turned
        if angle >= 2.0 * math.pi:
            self._period = crossing(last_time, time, (last_angle, last_rate), (angle, rate), level=2.0 * math.pi) - self._start
        self._last = (time, angle, rate)

    @property
    def interval(self) -> float:
        """A small angle at the present rate."""
        if self._period is not None or self._last[2] == 0.0:
            return math.inf
        return SAMPLE_ANGLE / abs(self._last[2])

    def result(self) -> float:
        """The period [time]."""
        if self._period is None:
            degrees = math.degrees(self._last[1])
            pair = f"particle {self.of} did not complete a turn around particle {self.around}"
            raise NoResultError(f"{pair}: it reached {degrees:.1f} degrees")
        return self._period


def _plane(separation: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Two unit vectors, shape (2, 3): along the separation, and across it in the sense of the motion."""
    normal = np.cross(separation, motion)
    if not np.linalg.norm(normal) > 0.0:
        raise NoResultError("there is no orbit to time: the two particles move along one line")
    first = separation / np.linalg.norm(separation)
    second = np.cross(normal, separation)
    return np.array([first, second / np.linalg.norm(second)])
