"""Frequency meter: the frequency of an oscillation, from the times of its zero crossings."""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.arithmetic.hermite import crossing

LOOKS_PER_OSCILLATION = 40  # the cubic between two samples is then good to (2π/40)⁴/384 = 2e-6 of the amplitude


@dataclass(frozen=True)
class MeasuredFrequency:
    """ω [radians time⁻¹] and its standard error, None where two crossings per direction show no scatter."""

    angular_frequency: float
    uncertainty: float | None


class FrequencyMeter:
    """Follows one oscillation, and keeps only the times at which it crosses zero.

    Crossing k is at t_k = α_up|down + k T/2: two straight lines of the same slope, one through the upward and one through the
    downward crossings, are fitted by least squares. The two offsets allow for an oscillation about another value than zero.
    Linear damping does not change the times between crossings; the frequency found is the damped one.
    """

    def __init__(self) -> None:
        """Begin without a crossing."""
        self.crossings: list[float] = []
        self.largest = 0.0
        self._side = 0.0
        self._last: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def observe(self, time: float, value: float, rate: float) -> None:
        """Take a sample of the value and its rate of change."""
        side = math.copysign(1.0, value) if value else 0.0
        if side and self._side and side != self._side:
            last_time, last_value, last_rate = self._last
            self.crossings.append(crossing(last_time, time, (last_value, last_rate), (value, rate), level=0.0))
        self._side = side or self._side
        self._last = (time, value, rate)
        self.largest = max(self.largest, abs(value))

    def interval(self, angular_frequency: float) -> float:
        """The longest time to the next sample: a small part of an oscillation at this frequency, or at the one found."""
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
