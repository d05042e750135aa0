"""Impulses of one group of spheres to the last digits, whatever the condition of its contacts. NumPy only.

The complementarity problem of contacts is a quadratic problem, whose solution is found by the proximal point method: each step
solves the problem of contacts that yield a little, in addition to ε, about the impulses of the step before, and what they
yield is 0 where the steps end. A step is Newton's method for a function with a continuous, piecewise linear gradient, in the
velocities: a banded system of equations, and an exact search along its direction. Some ten systems are solved in all, where a
gradient iteration takes as many sweeps as the square root of the condition number. Contacts that determine each other, as in a
regular packing, do no harm.
Sources: Rockafellar, SIAM J. Control Optim. 14 (1976) 877; Qi & Sun, Math. Program. 58 (1993) 353.
"""

from dataclasses import dataclass

import numpy as np

from mpp_taichi.contacts.rest.banded import BandedCholesky, narrow_order

SOFTNESS, LEAST_SOFTNESS = 1e-8, 1e-12  # share by which a contact yields in a step, of its own yielding to an impulse
MOST_SOFTNESS = 1e-4
STEPS, NEWTON_STEPS = 30, 60
DIVERGED = 1e3  # times the violation of the best impulses
ROUNDINGS = 2  # of the terms that the speed of a contact is the sum of


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """The contacts of one group of spheres; those of held spheres and surfaces are part of it.

    first, second   (m,) the two spheres, numbered in the group; −1: held, or a surface
    normal          (m, dimensions) unit vector towards the first sphere
    inverse_mass    (n, dimensions) [1 / mass]
    approach        (m,) n·(v_i − v_j) + offset at the velocities without impulses [length / time]
    impulse         (m,) with which the search begins [momentum]
    allowed         (m,) speed by which a contact may be violated, or open under load, at the end [length / time]
    rounded         (m,) the same where impulses cancel that are so large that a rounding of them is more than `allowed`
    yielding        ε [1 / mass]
    """

    first: np.ndarray
    second: np.ndarray
    normal: np.ndarray
    inverse_mass: np.ndarray
    approach: np.ndarray
    impulse: np.ndarray
    allowed: np.ndarray
    rounded: np.ndarray
    yielding: float = 0.0


@dataclass(frozen=True, eq=False)
class Solution:
    """Impulses of the contacts of a group, and what they make of its spheres.

    impulse     (m,) [momentum]
    velocity    (n, dimensions) that they add
    speeds      (m,) n·(v_i − v_j) + offset with them [length / time]
    violation   of the complementarity, the largest over all contacts, relative to `allowed`
    solved      whether every contact is as close to the complementarity as it has to be
    """

    impulse: np.ndarray
    velocity: np.ndarray
    speeds: np.ndarray
    violation: float
    solved: bool


class Proximal:
    """The search in one group.

    In the velocities y = M^½ (v − v₀), with rows of length 1, the problem is 0 ≤ λ ⟂ N y + f + ε λ ≥ 0, y = Nᵀ λ.
    """

    def __init__(self, group: ContactProblem):
        """Scale the problem, and order its spheres."""
        self.group = group
        self.count, self.dimensions = group.inverse_mass.shape
        root = np.sqrt(group.inverse_mass)
        has_first, has_second = group.first >= 0, group.second >= 0
        order = narrow_order(self.count, group.first[has_first & has_second], group.second[has_first & has_second])
        place = np.empty(self.count, np.intp)
        place[order] = np.arange(self.count)
        self.place = place
        self.one = np.where(has_first, place[group.first], 0)
        self.other = np.where(has_second, place[group.second], 0)
        plus = group.normal * root[group.first] * has_first[:, None]
        minus = -group.normal * root[group.second] * has_second[:, None]
        self.length = np.sqrt((plus * plus + minus * minus).sum(axis=1))
        self.plus, self.minus = plus / self.length[:, None], minus / self.length[:, None]
        self.start = group.approach / self.length
        self.soft = group.yielding / self.length**2
        self.allowed, self.rounded = group.allowed / self.length, group.rounded / self.length
        far = np.maximum(self.one, self.other)
        near = np.where(has_first & has_second, np.minimum(self.one, self.other), far)
        self.width = (int((far - near).max()) + 1) * self.dimensions - 1
        last = np.arange(self.count)
        np.maximum.at(last, near, far)
        self.ends = np.repeat((np.maximum.accumulate(last) + 1) * self.dimensions, self.dimensions)

    @property
    def work(self) -> float:
        """Operations of one factorization."""
        return float(((self.ends - np.arange(len(self.ends))) ** 2).sum())

    def _rows(self, y: np.ndarray) -> np.ndarray:
        """N y."""
        return (self.plus * y[self.one] + self.minus * y[self.other]).sum(axis=1)

    def _columns(self, x: np.ndarray) -> np.ndarray:
        """Nᵀ x."""
        result = np.empty((self.count, self.dimensions))
        for k in range(self.dimensions):
            result[:, k] = np.bincount(self.one, self.plus[:, k] * x, self.count)
            result[:, k] += np.bincount(self.other, self.minus[:, k] * x, self.count)
        return result

    def _terms(self, impulse: np.ndarray) -> np.ndarray:
        """The terms of N Nᵀ λ without their signs."""
        size = np.empty((self.count, self.dimensions))
        for k in range(self.dimensions):
            size[:, k] = np.bincount(self.one, np.abs(self.plus[:, k]) * impulse, self.count)
            size[:, k] += np.bincount(self.other, np.abs(self.minus[:, k]) * impulse, self.count)
        return (np.abs(self.plus) * size[self.one] + np.abs(self.minus) * size[self.other]).sum(axis=1)

    def solves(self, impulse: np.ndarray) -> bool:
        """Whether impulses [momentum] leave every contact as close to the complementarity as it has to be."""
        return self.judged(impulse).solved

    def judged(self, impulse: np.ndarray) -> "Solution":
        """What impulses [momentum] make of the contacts."""
        return self._judged(impulse * self.length)

    def solve(self) -> "Solution":
        """The first impulses that are close enough, else the closest that were found."""
        best = self._judged(self.group.impulse * self.length)
        softness, now = SOFTNESS, best
        for _ in range(STEPS):
            if best.solved:
                break
            impulse, speed = now.impulse * self.length, now.speeds / self.length
            before = now
            with np.errstate(over="ignore", invalid="ignore"):
                now = self._judged(np.maximum(impulse + self._step(impulse, speed + self.soft * impulse, softness), 0.0))
            if not now.violation <= DIVERGED * best.violation:  # too stiff a step for the digits of its equations
                now, softness = best, min(100.0 * softness, MOST_SOFTNESS)
                continue
            if now.solved or now.violation < best.violation:
                best = now
            if now.violation > 0.1 * before.violation:
                softness = max(0.1 * softness, LEAST_SOFTNESS)
        return best

    def pressed(self, softness: float) -> "Solution":
        """Impulses of contacts that yield by a share of their own yielding to an impulse: there always are such impulses."""
        return self._judged(self._step(np.zeros_like(self.start), self.start, softness))

    def _judged(self, impulse: np.ndarray) -> "Solution":
        y = self._columns(impulse)
        speed = self._rows(y) + self.start
        closed = speed + self.soft * impulse
        violation = np.abs(impulse - np.maximum(impulse - closed, 0.0))
        rounding = ROUNDINGS * 2.0**-52 * (np.abs(self.start) + self._terms(impulse))
        solved = bool((violation <= np.maximum(self.allowed, np.minimum(rounding, self.rounded))).all())
        velocity = np.sqrt(self.group.inverse_mass) * y[self.place]
        worst = float((violation / self.allowed).max())
        return Solution(impulse / self.length, velocity, speed * self.length, worst, solved)

    def _step(self, impulse: np.ndarray, speed: np.ndarray, softness: float) -> np.ndarray:
        """Change of the impulses by one step: the contacts yield by `softness` times the change.

        Everything is written for changes, which become small, so that roundings of the velocities themselves do not matter.
        """
        yielding = self.soft + softness
        change = np.zeros((self.count, self.dimensions))
        along = np.zeros_like(speed)
        closed_before = None
        for _ in range(NEWTON_STEPS):
            wanted = -(speed + along) / yielding
            closed = wanted > -impulse
            if closed_before is not None and (closed == closed_before).all():
                break
            gradient = change - self._columns(np.maximum(wanted, -impulse))
            try:
                direction = self._newton(closed, yielding, -gradient)
            except FloatingPointError:
                break
            slope = self._rows(direction)
            share = self._search(change, direction, wanted, slope, impulse, yielding)
            change = change + share * direction
            along = along + share * slope
            closed_before = closed if share == 1.0 else None
        return np.maximum(-(speed + along) / yielding, -impulse)

    def _newton(self, closed: np.ndarray, yielding: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The solution of (1 + Nᵀ Y⁻¹ N) d = right over the closed contacts."""
        size, columns = self.count * self.dimensions, 2 * self.width + 1
        band = np.zeros((size, columns))
        band[:, self.width] = 1.0
        flat = band.reshape(-1)
        one, other = self.one[closed] * self.dimensions, self.other[closed] * self.dimensions
        plus, minus, weight = self.plus[closed], self.minus[closed], 1.0 / yielding[closed]
        for a in range(self.dimensions):
            for b in range(self.dimensions):
                for row, left, column, right_part in (
                    (one, plus, one, plus),
                    (one, plus, other, minus),
                    (other, minus, one, plus),
                    (other, minus, other, minus),
                ):
                    p, q = row + a, column + b
                    value = weight * left[:, a] * right_part[:, b]
                    some = value != 0.0
                    np.add.at(flat, (p * columns + self.width + q - p)[some], value[some])
        return BandedCholesky(band, self.ends).solve(right.reshape(-1)).reshape(self.count, self.dimensions)

    def _search(self, change, direction, wanted, slope, impulse, yielding) -> float:
        """The share of the direction that leads to its lowest point, at most 1; the derivative along it is piecewise linear."""
        first, second = float((change * direction).sum()), float((direction * direction).sum())

        def derivative(share: float) -> float:
            return first + share * second - float((slope * np.maximum(wanted - share * slope / yielding, -impulse)).sum())

        if derivative(1.0) <= 0.0:
            return 1.0
        some = slope != 0.0
        kinks = np.sort((wanted[some] + impulse[some]) * yielding[some] / slope[some])
        points = np.concatenate([[0.0], kinks[(kinks > 0.0) & (kinks < 1.0)], [1.0]])
        low, high = 0, len(points) - 1
        while high - low > 1:
            middle = (low + high) // 2
            if derivative(points[middle]) < 0.0:
                low = middle
            else:
                high = middle
        below, above = derivative(points[low]), derivative(points[high])
        if not above > below:
            return float(points[high])
        share = float(points[low] + (points[high] - points[low]) * min(max(-below / (above - below), 0.0), 1.0))
        return 1.0 if share > 1.0 - 1e-9 else share
