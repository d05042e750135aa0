"""How far two particles are from each other."""

import math

import numpy as np

from mpp_taichi.component import Pair, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError, require_present
from mpp_taichi.diagnostics._between_looks import LOOK_ANGLE, Track
from mpp_taichi.snapshot import Snapshot


@component
class Distance(Diagnostic):
    """Distance of the centres of two particles [length]: at the end of the run or at a time, or its extreme until then.

    The extremes are also looked for between two looks, on the cubic through both distances and both rates. Looks follow each
    other so fast that the pair moves by at most a tenth of its distance.
    """

    between: Pair = param(help="the two particles")
    when: str = param("end", choices=("end", "largest", "smallest"), help="which distance of the run")
    until: float = param(
        None, optional=True, minimum=0.0, unit="time", help="the first look from here on is the last; absent: the end"
    )
    _track: Track | None = None
    _found: float | None = None
    _interval: float = 0.0
    _over: bool = False

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the distance, if it is the one wanted so far."""
        if self._over:
            return
        self._over = self.until is not None and time >= self.until
        first, second = self.between
        for particle in self.between:
            require_present(snapshot, particle)
        separation = snapshot.position[second] - snapshot.position[first]
        motion = snapshot.velocity[second] - snapshot.velocity[first]
        distance, speed = float(np.linalg.norm(separation)), float(np.linalg.norm(motion))
        rate = float(separation @ motion) / distance if distance > 0.0 else 0.0
        self._interval = LOOK_ANGLE * distance / speed if speed > 0.0 and self.when != "end" else math.inf
        if self.until is not None:
            self._interval = min(self._interval, self.until - time) if not self._over else math.inf
        if self.when == "end":
            self._found = distance
            return
        sign = -1.0 if self.when == "largest" else 1.0
        self._track = self._track or Track(0.0)
        self._track.add(time, sign * distance, sign * rate)
        lowest = self._track.lowest() if len(self._track.looks) == 2 else sign * distance
        self._found = lowest * sign if self._found is None else sign * min(sign * self._found, lowest)

    @property
    def interval(self) -> float:
        """Until the pair has moved by a tenth of its distance; the end alone needs no looks before."""
        return self._interval

    def result(self) -> float:
        """The distance."""
        if self._found is None:
            raise NoResultError("the run was never looked at")
        if self.until is not None and not self._over:
            raise NoResultError(f"the run ended before time {self.until:g}")
        return self._found
