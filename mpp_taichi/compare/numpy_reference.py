"""Numpy reference: forces and energies in float64 by direct sums, written apart from the kernels that it judges.

Arrays have a leading axis of copies, which may differ in every number: position and velocity (copies, N, 3), mass and charge
(copies, N), springs (copies, spring_count). Numbers that a backend stores in single precision are rounded here
as well, by `kept`, so that its arithmetic is judged and not the rounding of its input.
"""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from mpp_taichi import component
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

BLOCK = 40_000  # separations at a time: a few arrays of them fit into a core's cache
DIRECT = "direct"  # the solver of a force that sums over all pairs
KNOWN_FORCES = {  # each with the parameters that the reference supports
    "newtonian_gravity": ("strength", "softening", "solver", "accuracy"),
    "coulomb": ("coulomb_constant", "softening"),
    "uniform_gravity": ("acceleration",),
    "linear_drag": ("coefficient",),
}
KINDS = {"f32": np.float32, "f64": np.float64}
# Roundings, in units of 2⁻²⁴ or 2⁻⁵³, of one term of a force as a kernel may compute it, worst case throughout. Of OpenCL and
# Vulkan: a root to 3 units in the last place, of two roundings each, a quotient to 2.5 (OpenCL C Specification 3.0, §7.4).
ROOT, QUOTIENT, STEP = 6, 5, 1
SQUARE = 2 * STEP + STEP + 2 * STEP  # of a sum of three squared differences: differences, squares, additions
INVERSE = (SQUARE + 3 * STEP) / 2 + ROOT + QUOTIENT  # 1/ρ; ε² is rounded, squared and added
PAIR = 3 * INVERSE + 2 * STEP + 6 * STEP  # its cube, times parameter, source, response, quotient q/m, difference
LENGTH = SQUARE / 2 + ROOT
SPRING = 2 * LENGTH + SQUARE + QUOTIENT + 8 * STEP  # D (|d| − L) |d| + c w·d over d², times d
WEIGHT = QUOTIENT + STEP  # a force over the mass
ROUNDINGS = PAIR + WEIGHT
CONSPIRING = 32  # roundings of the sum: the last five bits of larger terms are lost at random


@dataclass(frozen=True, eq=False)
class Bodies:
    """The input of a scene's forces, for some copies of the scene; see the module."""

    mass: np.ndarray
    charge: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    rest_length: np.ndarray
    gain: np.ndarray  # factor of the acceleration of each particle, (copies, N); 1 except in a perturbed copy
    between: np.ndarray  # (spring_count, 2)
    free: np.ndarray  # (N, 3), 1.0 or 0.0

    @property
    def copies(self) -> int:
        """Number of copies."""
        return len(self.mass)


def bodies(snapshot: Snapshot, dimensions: int, precisions: Sequence[str]) -> Bodies:
    """A copy for each precision, with its numbers as the precision stores them."""
    springs = snapshot.springs
    free = snapshot.free.astype(float)
    free[:, dimensions:] = 0.0

    def each(values: np.ndarray) -> np.ndarray:
        return np.stack([kept(values, precision) for precision in precisions])

    return Bodies(
        mass=each(snapshot.mass),
        charge=each(snapshot.charge),
        stiffness=each(springs.stiffness),
        damping=each(springs.damping),
        rest_length=each(springs.rest_length),
        gain=np.ones((len(precisions), snapshot.particle_count)),
        between=springs.between,
        free=free,
    )


def kept(values: np.ndarray, precision: str) -> np.ndarray:
    """Numbers as a precision stores them, in float64."""
    return np.asarray(values).astype(KINDS[precision]).astype(np.float64)


def refusal(spec: SceneSpec) -> str | None:
    """The reason why a scene has no reference here, the forces that are missing; None where all forces have one."""
    foreign = [force.name for force in spec.forces if force.name not in KNOWN_FORCES]
    for force in spec.forces:
        for parameter in component.declaration("forces", force.name).parameters:
            asked = force.parameters.get(parameter.name) != parameter.default
            if asked and parameter.name not in KNOWN_FORCES.get(force.name, (parameter.name,)):
                foreign.append(f"{force.name}.{parameter.name}")
    return f"the NumPy reference has no {', '.join(foreign)}" if foreign else None


def pair_forces(spec: SceneSpec) -> int:
    """The number of forces of a scene that are summed over all pairs."""
    direct = [force.name for force in spec.forces if force.parameters.get("solver", DIRECT) == DIRECT]
    return sum(is_pair_force(name) for name in direct)


class NumpyForces:
    """The forces of a scene on some copies of its particles."""

    def __init__(self, spec: SceneSpec, given: Bodies, *, threads: int = 1) -> None:
        """Bind the forces; pairs are distributed to some threads."""
        self.spec, self.bodies, self.threads = spec, given, threads
        forces = {force.name: force.parameters for force in spec.forces}
        self.gravity, self.coulomb = forces.get("newtonian_gravity"), forces.get("coulomb")
        self.drag = forces["linear_drag"]["coefficient"] if "linear_drag" in forces else 0.0
        field = forces["uniform_gravity"]["acceleration"] if "uniform_gravity" in forces else (0.0, 0.0, 0.0)
        self.field = np.asarray(field, float)
        self.full = spec.spring_damping == "full"
        self.has_springs = len(given.between) > 0
        self.depends_on_velocity = bool(self.drag) or bool(np.any(given.damping))

    # Accelerations

    def acceleration(self, position: np.ndarray, velocity: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """All forces, (copies, N, 3), or only on the particles `rows`."""
        return self._select(self.steady(position, rows) + self.friction(position, velocity, rows), rows)

    def _select(self, values: np.ndarray, rows: np.ndarray | None) -> np.ndarray:
        return values if rows is None else values[:, rows]

    def steady(self, position: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Accelerations by the forces that do not depend on velocity, (copies, N, 3); only the given `rows` are valid."""
        given = self.bodies
        result = self.of_pairs(position, rows) + self.field
        if self.has_springs:
            away, length = self._lengths(position)
            with np.errstate(divide="ignore", invalid="ignore"):
                along = np.where(length > 0.0, given.stiffness * (length - given.rest_length) / length, 0.0)
            result += self._over_mass(self._both_ends(along[..., None] * away))
        return np.where(given.free > 0.0, result * given.gain[..., None], 0.0)

    def of_pairs(self, position: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Accelerations by the forces between all pairs, along all axes."""
        result = np.zeros_like(position)
        for source, response, softening in self._pair_forces():
            result += pair_sum(position, source, response, softening, rows, threads=self.threads)
        return result

    def friction(self, position: np.ndarray, velocity: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Accelerations by drag and by the damping of springs, (copies, N, 3)."""
        given = self.bodies
        result = np.zeros_like(position)
        if self.drag:
            result -= self._over_mass(self.drag * velocity)
        if self.has_springs and np.any(given.damping):
            away, _ = self._lengths(position)
            closing = velocity[:, given.between[:, 1]] - velocity[:, given.between[:, 0]]
            force = given.damping[..., None] * closing
            if not self.full:
                squared = np.sum(away * away, axis=2)
                with np.errstate(divide="ignore", invalid="ignore"):
                    share = np.where(squared > 0.0, np.sum(closing * away, axis=2) / squared, 0.0)
                force = (given.damping * share)[..., None] * away
            result += self._over_mass(self._both_ends(force))
        return np.where(given.free > 0.0, result * given.gain[..., None], 0.0)

    def _pair_forces(self) -> list[tuple[np.ndarray, np.ndarray, float]]:
        """(source, response, softening) of each pair force: a_i = response_i Σ_j source_j d/ρ³."""
        given, found = self.bodies, []
        if self.gravity is not None:
            found.append((given.mass, np.full_like(given.mass, self.gravity["strength"]), self.gravity["softening"]))
        if self.coulomb is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                weight = np.where(given.charge != 0.0, given.charge / given.mass, 0.0)
            found.append((given.charge, -self.coulomb["coulomb_constant"] * weight, self.coulomb["softening"]))
        return found

    def _lengths(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The vector from the first end of each spring to the second, and its length."""
        between = self.bodies.between
        away = position[:, between[:, 1]] - position[:, between[:, 0]]
        return away, np.sqrt(np.sum(away * away, axis=2))

    def _both_ends(self, force: np.ndarray, *, sign: float = -1.0) -> np.ndarray:
        """The sum of spring forces on each particle, (copies, N, 3); a second end gets `sign` times the first end's force."""
        given = self.bodies
        count = given.mass.shape[1]
        result = np.empty((given.copies, count, 3))
        for copy, axis in np.ndindex(given.copies, 3):
            pull = force[copy, :, axis]
            first = np.bincount(given.between[:, 0], pull, count)
            result[copy, :, axis] = first + sign * np.bincount(given.between[:, 1], pull, count)
        return result

    def _over_mass(self, force: np.ndarray) -> np.ndarray:
        mass = self.bodies.mass[..., None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.bodies.free > 0.0, force / mass, 0.0)

    # Bounds of the rounding errors

    def magnitude(
        self, position: np.ndarray, velocity: np.ndarray, rows: np.ndarray, limits: "Limits"
    ) -> tuple[np.ndarray, np.ndarray]:
        """Σ of the absolute terms of each acceleration, and errors beyond their random roundings: (copies, rows, 3) each.

        A term is taken before any cancellation in it: D (|d| + L), c Σ|w_k d_k|. Terms of at most CONSPIRING roundings of the
        sum may all be rounded in the same direction, each by at most its own size or one such rounding. And a product below
        the least normal number may be lost wherever a kernel forms it.
        """
        given = self.bodies
        terms = np.zeros_like(position) + np.abs(self.field)
        more = np.zeros_like(position)
        for source, response, softening in self._pair_forces():
            size, small = pair_magnitude(position, source, response, softening, rows, limits)
            terms += size
            more += small
        if self.drag:
            terms += self._over_mass(self.drag * np.abs(velocity))
        if self.has_springs:
            away, length = self._lengths(position)
            closing = np.abs(velocity[:, given.between[:, 1]]) + np.abs(velocity[:, given.between[:, 0]])
            stretch = given.stiffness * (length + given.rest_length)
            with np.errstate(divide="ignore", invalid="ignore"):
                if self.full:
                    force = np.where(length > 0.0, stretch / length, 0.0)[..., None] * np.abs(away)
                    force += given.damping[..., None] * closing
                else:
                    damper = given.damping * np.sum(closing * np.abs(away), axis=2) / length**2
                    force = np.where(length > 0.0, stretch / length + damper, 0.0)[..., None] * np.abs(away)
            terms += self._over_mass(self._both_ends(force, sign=1.0))
        allowed = given.free > 0.0
        return np.where(allowed, terms, 0.0)[:, rows], np.where(allowed, more, 0.0)[:, rows]

    def most_terms(self) -> int:
        """The largest number of terms in an acceleration."""
        given = self.bodies
        count = given.mass.shape[1]
        springs = int(np.bincount(given.between.ravel(), minlength=1).max()) if self.has_springs else 0
        return len(self._pair_forces()) * (count - 1) + springs + 2

    # Energies

    def energy(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Kinetic and potential energy of each copy, (copies, 2)."""
        given = self.bodies
        kinetic = 0.5 * np.sum(given.mass[..., None] * velocity * velocity, axis=(1, 2))
        potential = -np.sum(given.mass[..., None] * position * self.field, axis=(1, 2))
        if self.gravity is not None:
            weight = given.mass * self.gravity["strength"]
            potential = potential - 0.5 * pair_energy(position, given.mass, weight, self.gravity["softening"])
        if self.coulomb is not None:
            weight = given.charge * self.coulomb["coulomb_constant"]
            potential = potential + 0.5 * pair_energy(position, given.charge, weight, self.coulomb["softening"])
        if self.has_springs:
            _, length = self._lengths(position)
            potential = potential + 0.5 * np.sum(given.stiffness * (length - given.rest_length) ** 2, axis=1)
        return np.stack([kinetic, potential], axis=1)


def pair_sum(
    position: np.ndarray,
    source: np.ndarray,
    response: np.ndarray,
    softening: float,
    rows: np.ndarray | None = None,
    *,
    threads: int = 1,
) -> np.ndarray:
    """a_i = response_i Σ_j source_j d/(|d|² + ε²)^(3/2), (copies, N, 3)."""
    result = np.zeros_like(position)

    def add(chosen: np.ndarray, away: list[np.ndarray], squared: np.ndarray) -> None:
        weight = _weights(chosen, squared, source, softening)
        for axis, way in enumerate(away):
            result[:, chosen, axis] = np.einsum("bij,bij->bi", weight, way)

    _over_blocks(position, rows, add, threads)
    return result * response[..., None]


def _weights(chosen: np.ndarray, squared: np.ndarray, source: np.ndarray, softening: float) -> np.ndarray:
    """source_j / ρ³, 0 for a particle itself; infinite for two particles at one place, as in a kernel."""
    squared += softening * softening
    weight = squared * np.sqrt(squared)
    weight[:, np.arange(len(chosen)), chosen] = np.inf
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.divide(source[:, None, :], weight, out=weight)


def pair_magnitude(
    position: np.ndarray, source: np.ndarray, response: np.ndarray, softening: float, rows: np.ndarray, limits: "Limits"
) -> tuple[np.ndarray, np.ndarray]:
    """Σ|t_jk|, and the error of a sum by small terms and small numbers: see `NumpyForces.magnitude`."""
    terms, more = np.zeros_like(position), np.zeros_like(position)
    scale = np.abs(response)[..., None]
    greatest = np.abs(source).max(axis=1)[:, None]

    def add(chosen: np.ndarray, away: list[np.ndarray], squared: np.ndarray) -> None:
        weight = _weights(chosen, squared, np.abs(source), softening)
        for axis, way in enumerate(away):
            size = np.abs(way)
            reach = size.sum(axis=2)
            size *= weight
            total = size.sum(axis=2)
            terms[:, chosen, axis] = total
            least = limits.unit * total[:, :, None]
            alike = np.where(size < CONSPIRING * least, np.minimum(size, least), 0.0).sum(axis=2)
            far = (np.abs(response[:, chosen]) * (greatest + 1.0) + 1.0) * reach + position.shape[1]
            more[:, chosen, axis] = np.abs(response[:, chosen]) * alike + limits.smallest * far

    _over_blocks(position, rows, add, 1)
    return scale * terms, more


@dataclass(frozen=True)
class Limits:
    """The unit of rounding of a precision, and its least normal number, below which a product may be lost."""

    unit: float
    smallest: float


def pair_energy(position: np.ndarray, source: np.ndarray, weight: np.ndarray, softening: float) -> np.ndarray:
    """Σ_i weight_i Σ_{j≠i} source_j / ρ_ij of each copy."""
    total = np.zeros(position.shape[:2])

    def add(chosen: np.ndarray, away: list[np.ndarray], squared: np.ndarray) -> None:
        squared += softening * softening
        squared[:, np.arange(len(chosen)), chosen] = np.inf
        total[:, chosen] = weight[:, chosen] * np.einsum("bij,bj->bi", 1.0 / np.sqrt(squared), source)

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


def sample(count: int, terms: float) -> np.ndarray:
    """A sample of particles where all of them, with so many terms each, would take too long: first, last and some between."""
    most = max(64, int(terms / max(count, 1)))
    if most >= count:
        return np.arange(count)
    ends = np.concatenate([np.arange(16), np.arange(count - 16, count)])
    spread = np.linspace(16, count - 17, most - 32).astype(int)
    return np.unique(np.concatenate([ends, spread]))


def perturbed(given: Bodies, amplitude: float, factor: float, copies: int, random: np.random.Generator) -> Bodies:
    """Copies of the first, with every number of a force off by `factor` roundings of the size `amplitude`, up or down."""

    def off(values: np.ndarray) -> np.ndarray:
        one = values[:1]
        signs = random.choice((-1.0, 1.0), (copies, *one.shape[1:]))
        return one * (1.0 + amplitude * factor * signs)

    changed = {name: off(getattr(given, name)) for name in ("charge", "stiffness", "damping", "rest_length", "gain")}
    return replace(given, mass=off(given.mass), **changed)


def norm(vectors: np.ndarray) -> np.ndarray:
    """Lengths along the last axis."""
    return np.sqrt(np.sum(vectors * vectors, axis=-1))


def size_of(position: np.ndarray) -> float:
    """Root mean square distance of the particles from their mean place, (N, 3) → [length]; 1 where it is 0."""
    spread = math.sqrt(float(np.mean(np.sum((position - position.mean(axis=0)) ** 2, axis=1))))
    return spread or float(np.abs(position).max()) or 1.0
