"""NumPy pairs: sums over all pairs in float64, for copies side by side, with bounds of their rounding errors.

A force is a term a_i = r_i Σ_j s_j g(ρ) d: g = 1/ρ³ of gravity and of charges, or the law of a formula (scene/formulas/).
"""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mpp_taichi.scene.formulas.rounding_steps import ROUNDINGS_OF_QUOTIENT, ROUNDINGS_OF_ROOT, Rounded, RoundingArithmetic

BLOCK = 40_000  # separations at a time: a few arrays of them fit into a core's cache
# Roundings, in units of 2⁻²⁴ or 2⁻⁵³, of one term of a force as a kernel may compute it, worst case throughout.
ROOT, QUOTIENT, STEP = ROUNDINGS_OF_ROOT, ROUNDINGS_OF_QUOTIENT, 1
SQUARE = 2 * STEP + STEP + 2 * STEP  # of a sum of three squared differences: differences, squares, additions
INVERSE = (SQUARE + 3 * STEP) / 2 + ROOT + QUOTIENT  # 1/ρ; ε² is rounded, squared and added
PAIR = 3 * INVERSE + 2 * STEP + 6 * STEP  # its cube, times parameter, source, response, quotient q/m, difference
WEIGHT = QUOTIENT + STEP  # a force over the mass
ROUNDINGS = PAIR + WEIGHT
AROUND = 6 * STEP + QUOTIENT  # of a formula beside g: source, response, difference of places and their product
CONSPIRING = 32  # roundings of the sum: the last five bits of larger terms are lost at random


@dataclass(frozen=True, eq=False)
class PairTerm:
    """One pair force on some copies: source and response (copies, N), and the law of a formula, with its live numbers."""

    source: np.ndarray
    response: np.ndarray
    softening: float
    law: Any = None  # a PairLaw; None: d/ρ³
    values: Mapping[str, float] = field(default_factory=dict)


def pair_sum(position: np.ndarray, term: PairTerm, rows: np.ndarray | None = None, *, threads: int = 1) -> np.ndarray:
    """a_i = r_i Σ_j s_j g d, (copies, N, 3)."""
    result = np.zeros_like(position)

    def add(chosen: np.ndarray, away: list[np.ndarray], squared: np.ndarray) -> None:
        weight = _weights(chosen, squared, term)
        for axis, way in enumerate(away):
            result[:, chosen, axis] = np.einsum("bij,bij->bi", weight, way)

    _over_blocks(position, rows, add, threads)
    return result * term.response[..., None]


def _weights(chosen: np.ndarray, squared: np.ndarray, term: PairTerm) -> np.ndarray:
    """source_j g, 0 for a particle itself; infinite for two particles at one place, as in a kernel."""
    squared += term.softening * term.softening
    own = np.arange(len(chosen)), chosen
    if term.law is None:
        weight = squared * np.sqrt(squared)
        weight[:, own[0], own[1]] = np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.divide(term.source[:, None, :], weight, out=weight)
    squared[:, own[0], own[1]] = 1.0
    with np.errstate(all="ignore"):
        weight = term.source[:, None, :] * term.law.shape_at(np.sqrt(squared), term.values)
    weight[:, own[0], own[1]] = 0.0
    return weight


def _sizes(chosen: np.ndarray, squared: np.ndarray, term: PairTerm) -> np.ndarray:
    """|source_j g|, of a formula at least so large that ROUNDINGS of it bound the rounding errors of the formula's steps."""
    own = np.arange(len(chosen)), chosen
    if term.law is None:
        return np.abs(_weights(chosen, squared, term))
    squared += term.softening * term.softening
    squared[:, own[0], own[1]] = 1.0
    with np.errstate(all="ignore"):
        inverse = 1.0 / np.sqrt(squared)
        live = {name: Rounded(value, abs(value)) for name, value in term.values.items()}
        found = term.law.shape.run(RoundingArithmetic, {"u": Rounded(inverse, INVERSE * inverse), **live}, 1.0)[0]
        size = np.maximum(np.abs(found.value), (found.error + AROUND * np.abs(found.value)) / ROUNDINGS)
        weight: np.ndarray = np.abs(term.source[:, None, :]) * size
    weight[:, own[0], own[1]] = 0.0
    return weight


def pair_magnitude(position: np.ndarray, term: PairTerm, rows: np.ndarray, limits: "Limits") -> tuple[np.ndarray, np.ndarray]:
    """Σ|t_jk|, and the error of a sum by small terms and small numbers: see `NumpyForces.magnitude`."""
    terms, more = np.zeros_like(position), np.zeros_like(position)
    response = np.abs(term.response)
    greatest = np.abs(term.source).max(axis=1)[:, None]

    def add(chosen: np.ndarray, away: list[np.ndarray], squared: np.ndarray) -> None:
        weight = _sizes(chosen, squared, term)
        for axis, way in enumerate(away):
            size = np.abs(way)
            reach = size.sum(axis=2)
            size *= weight
            total = size.sum(axis=2)
            terms[:, chosen, axis] = total
            least = limits.unit * total[:, :, None]
            alike = np.where(size < CONSPIRING * least, np.minimum(size, least), 0.0).sum(axis=2)
            far = (response[:, chosen] * (greatest + 1.0) + 1.0) * reach + position.shape[1]
            more[:, chosen, axis] = response[:, chosen] * alike + limits.smallest * far

    _over_blocks(position, rows, add, 1)
    return response[..., None] * terms, more


@dataclass(frozen=True)
class Limits:
    """The unit of rounding of a precision, and its least normal number, below which a product may be lost."""

    unit: float
    smallest: float


def pair_energy(position: np.ndarray, term: PairTerm, weight: np.ndarray) -> np.ndarray:
    """Σ_i weight_i Σ_{j≠i} source_j U(ρ_ij) of each copy, U = 1/ρ or the U of the formula."""
    total = np.zeros(position.shape[:2])

    def add(chosen: np.ndarray, away: list[np.ndarray], squared: np.ndarray) -> None:
        squared += term.softening * term.softening
        own = np.arange(len(chosen)), chosen
        squared[:, own[0], own[1]] = 1.0
        distance = np.sqrt(squared)
        energy = 1.0 / distance if term.law is None else term.law.energy_at(distance, term.values) + 0.0 * distance
        energy[:, own[0], own[1]] = 0.0
        total[:, chosen] = weight[:, chosen] * np.einsum("bij,bj->bi", energy, term.source)

    _over_blocks(position, None, add, 1)
    return total.sum(axis=1)


def _over_blocks(
    position: np.ndarray,
    rows: np.ndarray | None,
    add: Callable[[np.ndarray, list[np.ndarray], np.ndarray], None],
    threads: int,
) -> None:
    """`add` with (particles, separations from them by component, their squares), a block of particles at a time."""
    copies, count, _ = position.shape
    columns = [np.ascontiguousarray(position[:, :, axis]) for axis in range(3)]
    wanted = np.arange(count) if rows is None else rows
    size = max(1, BLOCK // (copies * count))

    def one(begin: int) -> None:
        chosen = wanted[begin : begin + size]
        away = [column[:, None, :] - column[:, chosen, None] for column in columns]
        squared = away[0] * away[0]
        for way in away[1:]:
            squared += way * way
        add(chosen, away, squared)

    begins = range(0, len(wanted), size)
    if threads > 1 and len(begins) > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(one, begins))
    else:
        for begin in begins:
            one(begin)
