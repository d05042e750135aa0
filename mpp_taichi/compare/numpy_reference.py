"""Numpy reference: forces and energies in float64 by direct sums, written apart from the kernels that it judges.

Arrays have a leading axis of copies, which may differ in every number: position and velocity (copies, N, 3), mass and charge
(copies, N), springs (copies, spring_count). Numbers that a backend stores in single precision are rounded here
as well, by `kept`, so that its arithmetic is judged and not the rounding of its input.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.compare.numpy_bonds import BondTerm
from mpp_taichi.compare.numpy_pairs import ROUNDINGS, Limits, PairTerm, pair_energy, pair_magnitude, pair_sum
from mpp_taichi.scene.formulas.laws import is_formula, live_names
from mpp_taichi.scene.groups import between_groups, is_in
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

DIRECT = "direct"  # the solver of a force that sums over all pairs
KNOWN_FORCES = {  # each with the parameters that the reference supports
    "newtonian_gravity": ("strength", "softening", "solver", "accuracy", "between"),
    "coulomb": ("coulomb_constant", "softening", "between"),
    "uniform_gravity": ("acceleration",),
    "linear_drag": ("coefficient",),
}
FieldLaw = tuple[Any, dict[str, float], np.ndarray]
"""The law of a field, its live numbers, and which particles feel it."""
KINDS = {"f32": np.float32, "f64": np.float64}


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
    if spec.limited_springs:
        return "the NumPy reference has no springs that break or yield"
    foreign = [force.label for force in spec.forces if not (force.name in KNOWN_FORCES or has_reference(force))]
    for force in spec.forces:
        if is_formula(force.name):
            continue
        for parameter in component.declaration("forces", force.name).parameters:
            asked = force.parameters.get(parameter.name) != parameter.default
            if asked and parameter.name not in KNOWN_FORCES.get(force.name, (parameter.name,)):
                foreign.append(f"{force.name}.{parameter.name}")
    return f"the NumPy reference has no {', '.join(foreign)}" if foreign else None


def only_turns(spec: SceneSpec, damping: np.ndarray) -> bool:
    """Whether the forces that depend on velocity are linear in it and across it, as a magnetic force is.

    Kicks then turn the velocity by the exact angle, on each device that has sines. `damping` holds the damping of each spring.
    """
    moved = [force for force in spec.forces if force.flag("forces", "depends_on_velocity")]
    return bool(moved) and all(force.flag("forces", "turns") for force in moved) and not np.any(damping)


def has_reference(force: Any) -> bool:
    """Whether the reference evaluates a formula: it has neither radii nor a time."""
    if not is_formula(force.name):
        return False
    return "radius" not in force.law.needs and not force.flag("forces", "depends_on_time")


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
        formulas = [(force.law, _numbers(force), force) for force in spec.forces if is_formula(force.name)]
        self.pair_laws = [each for each in formulas if each[0].kind == "pair"]
        fields = [each for each in formulas if each[0].kind == "field"]
        self.bonds = [
            BondTerm.of(law, live, force.parameters["of"], given.between) for law, live, force in formulas if law.kind == "bond"
        ]
        everyone = np.arange(given.mass.shape[1])
        all_feel = (0, len(everyone))
        self.field_laws = [
            (law, values, is_in(force.parameters.get("on") or all_feel, everyone)) for law, values, force in fields
        ]
        self.has_springs = len(given.between) > 0
        self.depends_on_velocity = bool(self.drag) or bool(np.any(given.damping)) or any(map(_is_moved, self.field_laws))

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
        for field in self.field_laws:
            if not _is_moved(field):
                result += self._of_field(field, position, np.zeros_like(position))
        if self.has_springs:
            away, length = self._lengths(position)
            with np.errstate(divide="ignore", invalid="ignore"):
                along = np.where(length > 0.0, given.stiffness * (length - given.rest_length) / length, 0.0)
            for bond in self.bonds:
                along = along + bond.pull(length, given.rest_length)
            result += self._over_mass(self._both_ends(along[..., None] * away))
        return np.where(given.free > 0.0, result * given.gain[..., None], 0.0)

    def of_pairs(self, position: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Accelerations by the forces between all pairs, along all axes."""
        result = np.zeros_like(position)
        for term in self._pair_forces():
            result += pair_sum(position, term, rows, threads=self.threads)
        return result

    def friction(self, position: np.ndarray, velocity: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Accelerations by drag and by the damping of springs, (copies, N, 3)."""
        given = self.bodies
        result = np.zeros_like(position)
        if self.drag:
            result -= self._over_mass(self.drag * velocity)
        for field in self.field_laws:
            if _is_moved(field):
                result += self._of_field(field, position, velocity)
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

    def _of_field(self, field: FieldLaw, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Accelerations of a formula, (copies, N, 3)."""
        law, values, felt = field
        result = np.zeros_like(position)
        for axis, rate in enumerate(law.numbers(law.acceleration, self._values(values, position, velocity))):
            result[..., axis] = rate
        return result * felt[:, None]

    def _values(self, live: dict[str, float], position: np.ndarray, velocity: np.ndarray) -> dict[str, Any]:
        """The numbers of a formula of a place."""
        given: dict[str, Any] = {name: position[..., k] for k, name in enumerate("xyz")}
        given |= {f"v{name}": velocity[..., k] for k, name in enumerate("xyz")}
        return given | {"m": self.bodies.mass, "q": self.bodies.charge} | {k: np.float64(v) for k, v in live.items()}

    def _of_particles(self, law: Any, program: Any, live: dict[str, float]) -> np.ndarray:
        """A factor of a pair formula for each particle, (copies, N)."""
        values = {"m": self.bodies.mass, "q": self.bodies.charge, **{k: np.float64(v) for k, v in live.items()}}
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.broadcast_to(law.of_particles(program, values), self.bodies.mass.shape)
        return np.where(self.bodies.charge != 0.0, found, 0.0) if law.flags["proportional_to_charge"] else found

    def _pair_forces(self) -> list[PairTerm]:
        """The pair forces."""
        given: Any = self.bodies
        found: list[PairTerm] = []
        for law, live, force in self.pair_laws:
            source, response = (self._of_particles(law, each, live) for each in (law.source, law.response))
            term = PairTerm(source, response, force.parameters["softening"], law, live)
            found += between_groups(term, force.parameters["between"])
        if self.gravity is not None:
            strength = np.full_like(given.mass, self.gravity["strength"])
            term = PairTerm(given.mass, strength, self.gravity["softening"])
            found += between_groups(term, self.gravity.get("between"))
        if self.coulomb is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                weight = np.where(given.charge != 0.0, given.charge / given.mass, 0.0)
            term = PairTerm(given.charge, -self.coulomb["coulomb_constant"] * weight, self.coulomb["softening"])
            found += between_groups(term, self.coulomb.get("between"))
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
        for term in self._pair_forces():
            size, small = pair_magnitude(position, term, rows, limits)
            terms += size
            more += small
        for law, values, _ in self.field_laws:
            errors = law.errors(law.acceleration, self._values(values, position, velocity))
            for axis, error in enumerate(errors):
                terms[..., axis] += error / ROUNDINGS
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
            for bond in self.bonds:
                force = force + bond.magnitude(length, given.rest_length)[..., None] * np.abs(away)
            terms += self._over_mass(self._both_ends(force, sign=1.0))
        allowed = given.free > 0.0
        return np.where(allowed, terms, 0.0)[:, rows], np.where(allowed, more, 0.0)[:, rows]

    def most_terms(self) -> int:
        """The largest number of terms in an acceleration."""
        given = self.bodies
        count = given.mass.shape[1]
        springs = int(np.bincount(given.between.ravel(), minlength=1).max()) if self.has_springs else 0
        return len(self._pair_forces()) * (count - 1) + springs * (1 + len(self.bonds)) + 2

    # Energies

    def energy(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Kinetic and potential energy of each copy, (copies, 2)."""
        given = self.bodies
        kinetic = 0.5 * np.sum(given.mass[..., None] * velocity * velocity, axis=(1, 2))
        potential = -np.sum(given.mass[..., None] * position * self.field, axis=(1, 2))
        if self.gravity is not None:
            weight = -given.mass * self.gravity["strength"]
            term = PairTerm(given.mass, weight, self.gravity["softening"])
            potential = potential + _energy(position, term, self.gravity.get("between"))
        if self.coulomb is not None:
            weight = given.charge * self.coulomb["coulomb_constant"]
            term = PairTerm(given.charge, weight, self.coulomb["softening"])
            potential = potential + _energy(position, term, self.coulomb.get("between"))
        for law, live, force in self.pair_laws:
            source = self._of_particles(law, law.source, live)
            term = PairTerm(source, source, force.parameters["softening"], law, live)
            potential = potential + _energy(position, term, force.parameters["between"])
        for law, live, felt in self.field_laws:
            values = self._values(live, position, velocity)
            energy = np.broadcast_to(law.numbers(law.energy, values)[0], given.mass.shape)
            potential = potential + np.sum(energy * felt, axis=1)
        if self.has_springs:
            _, length = self._lengths(position)
            potential = potential + 0.5 * np.sum(given.stiffness * (length - given.rest_length) ** 2, axis=1)
            for bond in self.bonds:
                potential = potential + bond.energy(length, given.rest_length)
        return np.stack([kinetic, potential], axis=1)


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


def _numbers(force: Any) -> dict[str, float]:
    """The live numbers of a formula."""
    return {name: float(force.parameters[at]) for name, at in live_names(force).items() if name in force.law.live}


def _energy(position: np.ndarray, term: PairTerm, between: Any) -> np.ndarray:
    """The energy of a pair force of each copy; the response of the term is the weight of a particle in it."""
    return 0.5 * np.sum([pair_energy(position, each, each.response) for each in between_groups(term, between)], axis=0)


def _is_moved(field: FieldLaw) -> bool:
    return bool(field[0].flags["depends_on_velocity"])


def norm(vectors: np.ndarray) -> np.ndarray:
    """Lengths along the last axis."""
    return np.sqrt(np.sum(vectors * vectors, axis=-1))


def size_of(position: np.ndarray) -> float:
    """Root mean square distance of the particles from their mean place, (N, 3) → [length]; 1 where it is 0."""
    spread = math.sqrt(float(np.mean(np.sum((position - position.mean(axis=0)) ** 2, axis=1))))
    return spread or float(np.abs(position).max()) or 1.0
