"""The modes of a scene that are followed, and the share of each mode in a motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.modes.lattice_theory import LatticeTheory, NoTheoryError, lattice_shape, lattice_theory
from mpp_taichi.modes.linear_network import LinearNetwork, linearise
from mpp_taichi.modes.spectrum import MOST_FREEDOMS, spectrum
from mpp_taichi.scene.layout import Lattice, layout_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import rest_positions

Numbers = tuple[int, int, int]
SAME_FREQUENCY = 1e-6  # relative: modes with closer frequencies span one space, in which any basis is as good
SHOWN_BY_DEFAULT = 4


class ModeError(SceneError):
    """A mode that is asked for does not exist, or cannot be found."""


@dataclass(frozen=True, eq=False)
class Mode:
    """A mode of a linear network.

    numbers              (r, s) of a lattice, or (k,) for the k-th of a network's vibrating modes
    angular_frequency    ω by theory [radians time⁻¹]; 0 where no restoring force acts to first order
    shape                displacements at amplitude 1, shape (particle_count, d)
    """

    numbers: tuple[int, ...]
    angular_frequency: float
    shape: np.ndarray

    @property
    def label(self) -> str:
        """`(2, 1)`."""
        return f"({', '.join(map(str, self.numbers))})"


@dataclass(frozen=True, eq=False)
class ModeReading:
    """A motion in terms of modes: amplitudes and their rates [length, length time⁻¹], energies of the modes, and the total.

    Energies are energies of the linear network: ½ M (ȧ² + ω² a²) with the modal mass M = Σ m shape², and ½ Σ m v² + ½ uᵀ K u.
    """

    amplitude: np.ndarray
    rate: np.ndarray
    energy: np.ndarray
    total_energy: float

    @property
    def share(self) -> np.ndarray:
        """The share of the energy in each mode; NaN where the energy is zero."""
        return self.energy / self.total_energy if self.total_energy > 0.0 else np.full(len(self.energy), np.nan)


class ModeSet:
    """Modes of a network about the placement at rest, and the projection of snapshots on them.

    source   the origin of frequencies and shapes: `lattice theory`, or `the network's matrix` with the reason
    """

    def __init__(self, network: LinearNetwork, modes: Sequence[Mode], source: str) -> None:
        """Prepare the products."""
        self.network, self.modes, self.source = network, tuple(modes), source
        shapes = np.stack([mode.shape.ravel() for mode in modes])
        weighted = shapes * np.repeat(network.mass, network.free.shape[1])
        self.modal_mass = np.einsum("ki,ki->k", shapes, weighted)
        self._project = weighted / self.modal_mass[:, None]
        self._square = np.array([mode.angular_frequency for mode in modes]) ** 2

    def read(self, snapshot: Snapshot) -> ModeReading:
        """Project the displacement from rest, and the velocity."""
        dimensions = self.network.free.shape[1]
        displacement = snapshot.position[:, :dimensions] - self.network.position
        velocity = snapshot.velocity[:, :dimensions]
        amplitude, rate = self._project @ displacement.ravel(), self._project @ velocity.ravel()
        energy = 0.5 * self.modal_mass * (rate**2 + self._square * amplitude**2)
        total = self.network.kinetic_energy(velocity) + self.network.potential_energy(displacement)
        return ModeReading(amplitude, rate, energy, total)


def placed_at_rest(spec: SceneSpec, start: Snapshot) -> Snapshot:
    """The start of a scene without the displacements and velocities that it gives its particles."""
    return replace(start, position=rest_positions(spec), velocity=np.zeros_like(start.velocity))


def find_modes(
    spec: SceneSpec, start: Snapshot, *, of: str | None = None, show: Sequence[Numbers] = (), along: str | None = None
) -> ModeSet:
    """The modes that a scene's `modes:` key, or a measured quantity, names; the lowest few when it names none.

    With `of` they are modes of a lattice along a direction, by lattice theory where its springs are such a lattice; otherwise
    the modes of the network's matrix nearest to the shapes of lattice theory. Without `of` they are counted: (k,) is the k-th
    mode from below that vibrates.

    Raises:
        ModeError: no such modes exist.
    """
    if not len(start.springs):
        raise ModeError("modes: the scene has no springs")
    if len(start.rods):
        raise ModeError("modes: the modes of springs beside rods, which hold freedoms, are not known")
    placed = placed_at_rest(spec, start)
    lattices = layout_of(spec).lattices
    pairs = [list(numbers) for numbers in show if max(numbers[1:]) > 1]  # these count along the axes of a lattice
    if of is None and (pairs or not show) and len(lattices) == 1:
        (only,) = lattices  # by default the modes of this lattice
        of = only if along or _across(lattices[only], spec.dimensions) is not None else None
    if of is None and pairs:
        raise ModeError(f"modes: {pairs[0]} counts along the axes of a lattice, so of: must name one")
    if of is None:
        return _by_number(linearise(placed, dimensions=spec.dimensions), show)
    direction = "xyz".index(along) if along else _across(lattices[of], spec.dimensions)
    if direction is None or direction >= spec.dimensions:
        problem = "is no direction of this scene" if along else f"is not said, and {of} has no direction across itself"
        raise ModeError(f"modes: along {problem}, allowed: {', '.join('xyz'[: spec.dimensions])}")
    network = linearise(_only(placed, lattices[of]), dimensions=spec.dimensions)
    try:
        return _by_theory(network, lattice_theory(network, *lattices[of], direction), show)
    except NoTheoryError as reason:
        return _nearest(network, lattices[of], direction, show, str(reason))


def _across(lattice: Lattice, dimensions: int) -> int | None:
    """The default direction: the last one across the lattice, if such a direction exists."""
    return max((axis for axis in range(dimensions) if lattice[1][axis] == 1), default=None)


def _only(placed: Snapshot, lattice: Lattice) -> Snapshot:
    """The network with only the springs that have an end in a lattice."""
    first, counts = lattice
    ends = placed.springs.between
    keep = ((ends >= first) & (ends < first + np.prod(counts))).any(axis=1)
    return replace(placed, springs=placed.springs.chosen(keep))


def _by_theory(network: LinearNetwork, theory: LatticeTheory, show: Sequence[Numbers]) -> ModeSet:
    modes = []
    for numbers in show or theory.lowest(SHOWN_BY_DEFAULT):
        frequency = theory.angular_frequency(numbers)
        label = _significant(numbers, theory.counts)
        if not np.isfinite(frequency):
            raise ModeError(f"modes: mode {label} does not vibrate, its springs are compressed and buckle")
        modes.append(Mode(label, frequency, theory.shape(numbers, *network.free.shape)))
    return ModeSet(network, modes, "lattice theory")


def _significant(numbers: Numbers, counts: Numbers) -> tuple[int, ...]:
    """The mode numbers along the axes that have more than one particle."""
    return tuple(number for number, count in zip(numbers, counts) if count > 1)


def _by_number(network: LinearNetwork, show: Sequence[Numbers]) -> ModeSet:
    frequencies, shapes = _spectrum(network)
    total = len(frequencies)
    modes = []
    for number in [numbers[0] for numbers in show] or range(1, min(SHOWN_BY_DEFAULT, total) + 1):
        if number > total:
            raise ModeError(f"modes: there is no mode {number}, the network has {total} that vibrate")
        shape = network.expand(shapes[:, number - 1])
        modes.append(Mode((number,), float(frequencies[number - 1]), shape / _largest(shape)))
    if not modes:
        raise ModeError("modes: the network has no mode that vibrates")
    return ModeSet(network, modes, "the network's matrix")


def _nearest(network: LinearNetwork, lattice: Lattice, direction: int, show: Sequence[Numbers], reason: str) -> ModeSet:
    """The modes of the matrix nearest to the shapes of the theory, for a lattice to which the theory does not apply."""
    if not show:
        return _by_number(network, ())
    frequencies, shapes = _spectrum(network)
    modes = []
    for numbers in show:
        label = _significant(numbers, lattice[1])
        wanted = lattice_shape(*lattice, direction, numbers, network.free.shape).ravel()[network.freedoms]
        share = (shapes.T @ (network.freedom_masses * wanted)) ** 2
        if not share.any():
            raise ModeError(f"modes: {reason}, and none of its modes that vibrate is like {label}")
        frequency = frequencies[np.argmax(share)]
        near = np.abs(frequencies - frequency) <= SAME_FREQUENCY * frequency
        basis = shapes[:, near]
        shape = network.expand(basis @ (basis.T @ (network.freedom_masses * wanted)))
        modes.append(Mode(label, float(frequency), shape / _largest(shape)))
    return ModeSet(network, modes, f"the network's matrix, for {reason}")


def _spectrum(network: LinearNetwork) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and shapes."""
    if network.freedom_count > MOST_FREEDOMS:
        most = f"allowed up to {MOST_FREEDOMS:,}"
        raise ModeError(f"modes: the network has {network.freedom_count:,} freedoms and no closed form, {most}")
    found = spectrum(network, shapes=True)
    assert found.shape is not None
    return found.angular_frequency, found.shape


def _largest(shape: np.ndarray) -> float:
    """The largest displacement, with its sign: shapes are scaled to have it at +1."""
    return float(shape.ravel()[np.argmax(np.abs(shape))])
