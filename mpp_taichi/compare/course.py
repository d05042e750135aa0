"""Course: a reference run, and how far from it rounding may lead; every allowance is derived.

Copies of the reference run with every number of their forces off by as many roundings as a force is allowed, and with a
rounding of one sign after every update of a position or velocity. They show what the motion makes of rounding: σ, the largest
distance of a copy. It is linear in the size of the roundings, which is chosen so small that it is, and scaled to that of the
precision. All K copies may have come out small by chance in the one direction that grows: a sound run is off by more than m σ
with a chance of at most (2/√π)^K Γ((K+1)/2)/(√π m^K), for errors of a normal distribution; m is what makes that as rare.
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
AMPLITUDE = 2.0**-40  # of the copies' roundings: far above those of f64, far below what is no longer linear
MEANINGLESS = 0.1  # of the system's size: where rounding may move particles so far, a position shows nothing


@dataclass(frozen=True)
class Finding:
    """One comparison: the largest difference in units of its allowance, and where that was.

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
        """Whether it is within its allowance; what is no number is not."""
        return self.ratio <= 1.0


@dataclass(frozen=True, eq=False)
class ReferenceCourse:
    """The reference run: (precisions, looks, N, 3), and σ of positions and velocities, (looks, N), for roundings of size 1."""

    precisions: tuple[str, ...]
    steps: np.ndarray
    places: np.ndarray
    speeds: np.ndarray
    place_growth: np.ndarray
    speed_growth: np.ndarray
    size: float
    speed: float
    given_by: str = "the reference"
    limits: np.ndarray | None = None  # (looks,): displacement by rounding up to which a look is judged; None: MEANINGLESS alone

    def _unit(self, precision: str) -> float:
        """What σ is multiplied by."""
        return (ROUNDING[precision] + ROUNDING["f64"]) * margin(2 * self.place_growth.size)

    def looks(self, evidence: Evidence, precision: str) -> dict[str, Any]:
        """At each look the largest distance from the reference and what rounding may make of it, of the system's size.

        `meaning_until_step` where the second becomes MEANINGLESS before the last look.
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
        """At which looks rounding leaves positions a meaning, (looks,)."""
        growth = np.nan_to_num(self._unit(precision) * self.place_growth.max(axis=1), nan=math.inf)
        means = growth < MEANINGLESS * self.size
        return means if self.limits is None else means & (growth <= self.limits)

    def findings(self, evidence: Evidence, precision: str) -> list[Finding]:
        """Positions and velocities at every look at which rounding leaves them a meaning."""
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
                    f"{kind} after {evidence.steps[look]:,} steps",
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
    """How many times the largest of some copies an honest run is off, but for CHANCE in so many comparisons; see the module."""
    each = CHANCE / comparisons
    bound = (2.0 / math.sqrt(math.pi)) ** copies * math.gamma((copies + 1) / 2) / math.sqrt(math.pi)
    return max(1.0, (bound / each) ** (1.0 / copies))


def ratios(off: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Differences in units of what is allowed; infinite where one is no number, or where nothing is allowed but nothing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(off == 0.0, 0.0, off / allowed)
    return np.nan_to_num(ratio, nan=math.inf, posinf=math.inf)
