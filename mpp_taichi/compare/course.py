"""Course: a reference run, and the largest distance from it that rounding can cause; every allowance is derived.

Copies of the reference run with every number of their forces off by as many roundings as a force is allowed, and with a
rounding of one sign after every update of a position or velocity. They show the effect of rounding on the motion: σ, the
largest distance of a copy. The roundings of the copies are so small that σ is linear in their size, and σ is scaled to the
roundings of the precision. By chance all K copies may have a small component in the one direction that grows: the error of a
correct run exceeds m σ with a probability of at most (2/√π)^K Γ((K+1)/2)/(√π m^K), for normally distributed errors; m is
chosen so that this is as rare as CHANCE.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.compare.evidence import Evidence
from mpp_taichi.compare.numpy_reference import norm

ROUNDING = {"f32": 2.0**-24, "f64": 2.0**-53}
CHANCE = 1e-6  # of a false alarm in one certificate
COPIES = 6
AMPLITUDE = 2.0**-40  # of the copies' roundings: far above the rounding errors of f64, far below the end of linearity
MEANINGLESS = 0.1  # of the system's size: where rounding may move particles this far, positions are not compared


@dataclass(frozen=True)
class Finding:
    """One comparison: the largest difference in units of its allowance, and its place.

    `difference` and `allowance` are relative to `of`: the largest acceleration, or the system's size.
    """

    check: str
    ratio: float
    difference: float
    allowance: float
    of: str
    particle: int
    looked_at: str

    @property
    def holds(self) -> bool:
        """Whether the difference is within its allowance; NaN is not."""
        return self.ratio <= 1.0


@dataclass(frozen=True, eq=False)
class ReferenceCourse:
    """The reference run, (precisions, samples, N, 3); σ of positions and velocities, (samples, N), for roundings of size 1."""

    precisions: tuple[str, ...]
    steps: np.ndarray
    places: np.ndarray
    speeds: np.ndarray
    place_growth: np.ndarray
    speed_growth: np.ndarray
    size: float
    speed: float
    given_by: str = "the reference"
    limits: np.ndarray | None = None
    """(samples,): the largest displacement by rounding at which a sample is judged; None: only MEANINGLESS is the limit."""

    def _unit(self, precision: str) -> float:
        """The factor of σ."""
        return (ROUNDING[precision] + ROUNDING["f64"]) * margin(2 * self.place_growth.size)

    def looks(self, evidence: Evidence, precision: str) -> dict[str, Any]:
        """The largest distance from the reference in each sample, and the largest by rounding, relative to the system's size.

        `meaning_until_step` is given where the second becomes MEANINGLESS before the last sample.
        """
        seen = len(evidence.steps)
        off = norm(evidence.places - self.places[self.precisions.index(precision), :seen]).max(axis=1) / self.size
        growth = self.place_growth[:seen].max(axis=1)
        allowed = np.nan_to_num(self._unit(precision) * growth, nan=math.inf) / self.size
        told = [
            {"steps": int(step), "distance": float(far), "allowed": float(most)}
            for step, far, most in zip(evidence.steps, off, allowed)
        ]
        last = int(evidence.steps[self._means_something(precision)[:seen]].max(initial=0))
        return {"looks": told} | ({} if last == evidence.steps[-1] else {"meaning_until_step": last})

    def _means_something(self, precision: str) -> np.ndarray:
        """Whether rounding leaves the positions of each sample a meaning, (samples,)."""
        growth = np.nan_to_num(self._unit(precision) * self.place_growth.max(axis=1), nan=math.inf)
        means = growth < MEANINGLESS * self.size
        return means if self.limits is None else means & (growth <= self.limits)

    def findings(self, evidence: Evidence, precision: str) -> list[Finding]:
        """Findings for positions and velocities in every sample in which rounding leaves them a meaning."""
        number, count, unit = self.precisions.index(precision), len(evidence.steps), self._unit(precision)
        findings = []
        for kind, growth, exact, seen, scale, of in (
            ("position", self.place_growth, self.places, evidence.places, self.size, "the system’s size"),
            ("velocity", self.speed_growth, self.speeds, evidence.speeds, self.speed, "the typical velocity"),
        ):
            allowed = unit * growth[:count]
            off = norm(seen - exact[number, :count])
            ratio = ratios(off, allowed)
            means = np.nan_to_num(allowed.max(axis=1), nan=math.inf) < MEANINGLESS * scale
            means &= self._means_something(precision)[:count]
            ratio[~means] = np.where(np.isnan(off[~means]), math.inf, 0.0)
            if not (means.any() or ratio.any()):
                continue
            look, particle = np.unravel_index(np.argmax(ratio), ratio.shape)
            findings.append(
                Finding(
                    f"{kind} after {evidence.steps[look]:,} step{'s' if evidence.steps[look] > 1 else ''}",
                    float(ratio[look, particle]),
                    float(off[look, particle]) / scale,
                    float(allowed[look, particle]) / scale,
                    of,
                    int(particle),
                    f"{count} looks to {int(evidence.steps[means].max(initial=0)):,} steps, {self.given_by}",
                )
            )
        return findings


def margin(comparisons: int, copies: int = COPIES) -> float:
    """The factor m by which a correct run may exceed the largest of some copies, except by CHANCE; see the module."""
    each = CHANCE / comparisons
    bound = (2.0 / math.sqrt(math.pi)) ** copies * math.gamma((copies + 1) / 2) / math.sqrt(math.pi)
    return max(1.0, (bound / each) ** (1.0 / copies))


def ratios(off: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Differences in units of their allowances; infinite for NaN, and for a difference where the allowance is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(off == 0.0, 0.0, off / allowed)
    return np.nan_to_num(ratio, nan=math.inf, posinf=math.inf)
