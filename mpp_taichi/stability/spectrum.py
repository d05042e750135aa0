"""Spectrum: the largest eigenvalue of a network by the Lanczos iteration, with a bound of its error."""

from functools import cached_property

import numpy as np

from mpp_taichi.stability.operator import Bonds

SEED = 20140306
NEGLIGIBLE = 1e-9  # relative residual at which the iteration for a small network ends: rounding
CLOSE = 3e-4  # the same for a larger network
ENOUGH = 5e-3  # the same after LONG_WORK; on a sheet of a million springs the value was then wrong by 1.4e-3
USABLE = 4e-2  # relative residual above which the value is not used
MOST_PRODUCTS = 400
LONG_WORK = 20_000_000  # springs × products after which ENOUGH is enough: about a second
LONGEST_WORK = 200_000_000
SMALL_SIZE = 3000  # degrees of freedom up to which the basis is kept, and kept orthogonal


class LargestEigenvalue:
    """The largest eigenvalue λ of an operator, by Lanczos iteration from a random start with a fixed seed.

    value       Rayleigh quotient of `vector`: never above λ, beyond rounding
    residual    ‖A v − value·v‖, the largest distance from `value` to the nearest eigenvalue; the random start makes it
                all but certain that this is the largest eigenvalue
    converged   whether the residual is small enough to use the value

    For a small network the iteration ends when the residual is rounding; for a large network, whose spectrum is dense at its
    end, when the residual is at most `ENOUGH`. Source: Golub and Van Loan, Matrix Computations, 4th ed. (2013), §10.1, §10.3.
    """

    def __init__(self, bonds: Bonds) -> None:
        """Iterate."""
        self.bonds = bonds
        start = np.random.default_rng(SEED).standard_normal(bonds.size) * (bonds.weight.ravel() > 0.0)
        self._start = start / max(float(np.linalg.norm(start)), np.finfo(float).tiny)
        self._diagonal: list[float] = []
        self._beside: list[float] = []  # beside the diagonal, and one entry more, which leads out of the space
        self._basis = [self._start]
        self._weights = np.ones(1)
        self.value, self.residual = 0.0, 0.0
        self._iterate()
        self.converged = self.residual <= USABLE * abs(self.value)

    @property
    def upper(self) -> float:
        """Upper end of the interval that holds the eigenvalue: value + residual."""
        return self.value + self.residual

    def _iterate(self) -> None:
        most = min(MOST_PRODUCTS, int(np.count_nonzero(self._start)))
        last, before, check = self._start, np.zeros_like(self._start), 2
        for step in range(1, most + 1):
            last, before = self._extend(last, before), last
            work = step * len(self.bonds.first)
            exhausted = self._beside[-1] == 0.0
            if exhausted or step in (most, check) or work > LONGEST_WORK:
                check = step + max(4, step // 2)
                self._solve()
                if exhausted or self.residual <= self._wanted(work) * abs(self.value) or work > LONGEST_WORK:
                    return

    def _wanted(self, work: int) -> float:
        """The relative residual at which the iteration ends, after so many springs × products."""
        if work > LONG_WORK:
            return ENOUGH
        return NEGLIGIBLE if len(self._start) <= SMALL_SIZE else CLOSE

    def _extend(self, last: np.ndarray, before: np.ndarray) -> np.ndarray:
        """The next vector of the basis."""
        following = self._three_terms(len(self._diagonal), last, before)
        if len(last) <= SMALL_SIZE:
            basis = np.stack(self._basis)
            for _ in range(2):  # twice is enough (Parlett)
                following -= basis.T @ (basis @ following)
        norm = float(np.linalg.norm(following))
        scale = max(map(abs, (*self._diagonal, *self._beside)))
        self._beside.append(norm if norm > 1e-14 * scale else 0.0)
        if norm > 0.0:
            following /= norm
        if len(last) <= SMALL_SIZE:
            self._basis.append(following)
        return following

    def _three_terms(self, step: int, last: np.ndarray, before: np.ndarray) -> np.ndarray:
        """A qₖ − αₖ qₖ − βₖ₋₁ qₖ₋₁; αₖ is computed in the first pass."""
        following = self.bonds.product(last)
        if step == len(self._diagonal):
            self._diagonal.append(float(following @ last))
        following -= self._diagonal[step] * last
        if step:
            following -= self._beside[step - 1] * before
        return following

    def _solve(self) -> None:
        """Largest Ritz value, its vector in the basis, and its residual."""
        beside = self._beside[:-1]
        values, vectors = np.linalg.eigh(np.diag(self._diagonal) + np.diag(beside, 1) + np.diag(beside, -1))
        self.value, self._weights = float(values[-1]), vectors[:, -1]
        self.residual = abs(self._beside[-1] * float(vectors[-1, -1]))

    @cached_property
    def vector(self) -> np.ndarray:
        """The Ritz vector; where the basis was not kept, the iteration is repeated."""
        total = self._weights[0] * self._start
        last, before = self._start, np.zeros_like(self._start)
        for step, weight in enumerate(self._weights[1:]):
            if len(self._start) <= SMALL_SIZE:
                following = self._basis[step + 1]
            else:
                following = self._three_terms(step, last, before) / self._beside[step]
            last, before = following, last
            total = total + weight * following
        return total / max(float(np.linalg.norm(total)), np.finfo(float).tiny)
