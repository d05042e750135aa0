"""Running integral: ∫ p dt of a quantity that is sampled during a run, to fourth order for any spacing of the samples."""

import numpy as np

POINTS = 4  # of the interpolating cubic
CLOSE = 0.25  # least distance of two samples, in parts of the newest interval: weights grow with the inverse of a distance
_GAUSS = 0.5 / np.sqrt(3.0)  # two-point Gauss–Legendre, exact for cubics, at the middle ∓ this part of the interval


class RunningIntegral:
    """∫ p dt from the first sample to the last, p a scalar or an array.

    The integral over the newest interval is the integral of the cubic through the last four samples (at equal spacing with the
    weights of the Adams–Moulton method of fourth order, (1, −5, 19, 9)/24), or with fewer samples of the polynomial through
    all. The error is O(h⁴) of the spacing h, also where a single interval is shorter. Sums are compensated.
    """

    def __init__(self) -> None:
        """Start without a sample; the integral is 0."""
        self._past: np.ndarray | float = 0.0  # integral of the finished pieces
        self._lost: np.ndarray | float = 0.0  # rounding error of `_past`
        self._opening: np.ndarray | float = 0.0  # integral of the first intervals of the piece, until there are four samples
        self.cut()

    @property
    def value(self) -> np.ndarray:
        """The integral up to the last sample."""
        return np.asarray(self._past + self._lost + self._opening)

    def cut(self) -> None:
        """End the piece where p jumps; the next sample, at the same time, begins a new piece."""
        self._add(self._opening)
        self._times: list[float] = []
        self._samples: list[np.ndarray] = []
        self._begin = 0.0
        self._opening = 0.0
        self._is_opening = True

    def add(self, time: float, sample: np.ndarray) -> None:
        """Continue the integral to `time`, where p = `sample`."""
        times, samples = self._times, self._samples
        if not times:
            self._begin = time
        elif time <= times[-1]:
            return
        times.append(time)
        samples.append(np.asarray(sample, dtype=np.float64))
        if len(times) > 2 and times[-2] - times[-3] < CLOSE * (times[-1] - times[-2]):
            del times[-3], samples[-3]
        if self._is_opening:
            self._opening = self._integral(self._begin)
            if len(times) == POINTS:
                self._add(self._opening)
                self._opening, self._is_opening = 0.0 * self._opening, False
        else:
            self._add(self._integral(times[-2]))
        del times[: -POINTS - 1], samples[: -POINTS - 1]

    def _integral(self, begin: float) -> np.ndarray:
        times, samples = self._times[-POINTS:], self._samples[-POINTS:]
        weights = interpolation_weights(times, begin, times[-1])
        return np.tensordot(weights, samples, axes=1)

    def _add(self, piece: np.ndarray | float) -> None:
        """Neumaier's sum: `_lost` keeps the rounding error of `_past + piece`."""
        total = self._past + piece
        larger = np.abs(self._past) >= np.abs(piece)
        self._lost = self._lost + np.where(larger, (self._past - total) + piece, (piece - total) + self._past)
        self._past = total


def interpolation_weights(times: list[float], begin: float, end: float) -> list[float]:
    """Weights with which samples at up to four `times` give the integral of their interpolating polynomial."""
    half = 0.5 * (end - begin)
    middle = begin + half
    places = (middle - 2.0 * half * _GAUSS, middle + 2.0 * half * _GAUSS)
    weights = []
    for k, own in enumerate(times):
        weight = 0.0
        for place in places:
            term = half
            for other in times[:k] + times[k + 1 :]:
                term *= (place - other) / (own - other)
            weight += term
        weights.append(weight)
    return weights
