"""Numerical damping: the energy that a method loses by itself, per unit time and per oscillation, measured in the run."""

import math
from collections.abc import Sequence

LEAST_SAMPLES = 6  # between two maxima; with fewer their times and heights are not accurate
STEADY = 0.1  # largest relative difference of successive periods of one oscillation, and of ratios of successive heights
FADED = 1e-6  # maxima below this part of the highest maximum are rounding errors


class OscillationCounter:
    """Maxima of the kinetic energy along a run, for a motion that one oscillation dominates.

    An oscillation has two maxima, one each way. Time and height of a maximum come from the parabola through three samples.
    """

    def __init__(self) -> None:
        """Start without a sample."""
        self._start: float | None = None
        self._recent: list[tuple[float, float]] = []
        self._samples = 0  # since the last maximum
        self._fewest = math.inf  # samples between two maxima
        self._maxima: list[tuple[float, float]] = []
        self._highest = 0.0

    def add(self, time: float, kinetic_energy: float) -> None:
        """Take a sample."""
        recent = self._recent
        if recent and time <= recent[-1][0]:
            return
        if self._start is None:
            self._start = time
        recent.append((time, kinetic_energy))
        self._samples += 1
        if len(recent) == 3:
            (t0, k0), (t1, k1), (t2, k2) = recent
            del recent[0]
            if k0 < k1 >= k2:
                self._keep(*_vertex(t0 - t1, k0 - k1, t2 - t1, k2 - k1), t1, k1)

    def _keep(self, shift: float, rise: float, time: float, height: float) -> None:
        self._highest = max(self._highest, height + rise)
        if height + rise < FADED * self._highest:
            return
        if self._maxima:
            self._fewest = min(self._fewest, self._samples)
        self._samples = 0
        self._maxima.append((time + shift, height + rise))

    @property
    def problem(self) -> str:
        """Why no oscillation can be told; empty when one can."""
        times = [time for time, _ in self._maxima]
        periods = [later - sooner for sooner, later in zip(times, times[2:], strict=False)]
        if not periods:
            return "less than one oscillation was seen"
        if self._fewest < LEAST_SAMPLES:
            return f"an oscillation has fewer than {2 * LEAST_SAMPLES} samples"
        heights = [height for _, height in self._maxima]
        ratios = [later / sooner for sooner, later in zip(heights, heights[1:], strict=False)]
        if not (_is_steady(periods) and _is_steady(ratios)):
            return "no single oscillation dominates the motion"
        return ""

    @property
    def period(self) -> float:
        """Mean period of the oscillation [time]; only where there is no `problem`."""
        return 2.0 * (self._maxima[-1][0] - self._maxima[0][0]) / (len(self._maxima) - 1)

    def count_until(self, time: float) -> float:
        """Number of oscillations from the start to `time`, or until they faded."""
        last, period = self._maxima[-1][0], self.period
        end = time if time - last < period else last + 0.25 * period
        return (end - (self._start or 0.0)) / period

    @property
    def energy(self) -> float:
        """Mean height of the maxima, which is the energy of the oscillation."""
        return math.fsum(height for _, height in self._maxima) / len(self._maxima)


def _is_steady(values: Sequence[float]) -> bool:
    return all(abs(second - first) <= STEADY * first for first, second in zip(values, values[1:], strict=False))


def _vertex(left: float, left_rise: float, right: float, right_rise: float) -> tuple[float, float]:
    """Place of the maximum of the parabola through the origin and two neighbours, and its height above the origin."""
    curvature = (right_rise / right - left_rise / left) / (right - left)
    slope = left_rise / left - curvature * left
    return (-0.5 * slope / curvature, -0.25 * slope * slope / curvature) if curvature < 0.0 else (0.0, 0.0)


def numerical_damping(
    times: Sequence[float], losses: Sequence[float], oscillations: OscillationCounter | None
) -> dict[str, float | str | None]:
    """The energy that a method lost over a run, from its `losses` so far at each of the `times`.

    energy_lost            at the end [energy]; negative where the method gained energy
    per_time               mean rate of the loss [energy / time]
    oscillations           number of oscillations
    per_oscillation        mean loss [energy]
    share_per_oscillation  per_oscillation over the mean energy of the oscillation
    problem                reason why the last three, or all but the first, are None

    An error that swings more than it grows is no damping and has no rate.
    """
    found: dict[str, float | str | None] = dict.fromkeys(
        ("per_time", "oscillations", "per_oscillation", "share_per_oscillation")
    )
    lost, span = losses[-1] - losses[0], times[-1] - times[0]
    moves = [later - sooner for sooner, later in zip(losses, losses[1:], strict=False)]
    back = math.fsum(abs(move) for move in moves if move * lost < 0.0)
    if not (span > 0.0 and math.isfinite(lost) and back < abs(lost)):
        return {"energy_lost": lost, **found, "problem": "the error swings, a steady loss does not stand out from it"}
    found["per_time"] = lost / span
    problem = "oscillations are counted only with an energy balance" if oscillations is None else oscillations.problem
    if oscillations is not None and not problem:
        count = oscillations.count_until(times[-1])
        found |= {"oscillations": count, "per_oscillation": lost / count}
        found["share_per_oscillation"] = lost / count / oscillations.energy
    return {"energy_lost": lost, **found, "problem": problem}
