"""Frequency meter: the frequency of an oscillation, from the times at which it goes through zero."""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.arithmetic.hermite import crossing

LOOKS_PER_OSCILLATION = 40  # the cubic between two looks is then good to (2π/40)⁴/384 = 2e-6 of the amplitude


@dataclass(frozen=True)
class MeasuredFrequency:
    """ω [radians time⁻¹] and its standard error, None where two crossings a side leave no scatter to judge it by."""

    angular_frequency: float
    uncertainty: float | None


class FrequencyMeter:
    """Follows one oscillation, and keeps only when it crossed zero.

    Crossing k comes at t_k = α_up|down + k T/2: a straight line through those on the way up and one through those on the way
    down, of one slope, fitted by least squares. The two offsets let the oscillation be off centre; that it dies away does
    not move the crossings of a linear one, of which this is the damped frequency.
    """

    def __init__(self) -> None:
        """Nothing seen yet."""
        self.crossings: list[float] = []
        self.largest = 0.0
        self._side = 0.0
        self._last: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def observe(self, time: float, value: float, rate: float) -> None:
        """Look at the value and its rate of change."""
        side = math.copysign(1.0, value) if value else 0.0
        if side and self._side and side != self._side:
            last_time, last_value, last_rate = self._last
            self.crossings.append(crossing(last_time, time, (last_value, last_rate), (value, rate), level=0.0))
        self._side = side or self._side
        self._last = (time, value, rate)
        self.largest = max(self.largest, abs(value))

    def interval(self, angular_frequency: float) -> float:
        """Longest time to the next look: a small part of an oscillation of this frequency, or of one as fast as now seen."""
        seen = abs(self._last[2]) / self.largest if self.largest > 0.0 else 0.0
        fastest = max(angular_frequency, seen)
        return 2.0 * math.pi / (LOOKS_PER_OSCILLATION * fastest) if fastest > 0.0 else math.inf

    def measured(self) -> MeasuredFrequency | None:
        """The frequency, or None before it has crossed zero three times."""
        times = np.array(self.crossings)
        if len(times) < 3:
            return None
        halves = np.arange(len(times), dtype=float)
        for parity in (0, 1):
            times[parity::2] -= times[parity::2].mean()
            halves[parity::2] -= halves[parity::2].mean()
        spread = float(halves @ halves)
        half_period = float(halves @ times) / spread
        frequency = math.pi / half_period
        freedoms = len(times) - 3
        if freedoms == 0:
            return MeasuredFrequency(frequency, None)
        scatter = float(np.sum((times - half_period * halves) ** 2)) / freedoms
        return MeasuredFrequency(frequency, frequency * math.sqrt(scatter / spread) / half_period)
