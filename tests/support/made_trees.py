"""Trees of gravity that tests place bodies in: compiled once for a number of bodies, and kept for all tests of a module."""

import numpy as np
import pytest

from mpp_taichi.device import backends
from mpp_taichi.forces.newtonian_gravity import NewtonianGravity
from mpp_taichi.neighbors.tree import TreeSum
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.state import State
from mpp_taichi.state.vector_layout import VectorLayout


class Tree:
    """A tree over so many bodies, and the state that it reads and writes; compiled once, for any places and masses."""

    def __init__(self, count, dimensions=3):
        self.count, self.dimensions = count, dimensions
        zeros, every = np.zeros((count, 3)), np.ones((count, 3), bool)
        snapshot = Snapshot(zeros, zeros, np.ones(count), np.zeros(count), np.zeros(count), zeros, every, ("",) * count)
        self.force = NewtonianGravity(strength=1.0, softening=0.0, solver="tree", accuracy=None)
        self.state = State(
            snapshot, dimensions=dimensions, needs=self.force.needs, scratch_count=0, layout=VectorLayout.BY_COMPONENT
        )
        self.sum = TreeSum(self.force, count, dimensions)

    def place(self, position, mass, accuracy=1e-3, *, softening=0.0, strength=1.0):
        places = np.zeros((self.count, 3))
        places[:, : self.dimensions] = position
        self.state.write(places, np.zeros((self.count, 3)))
        self.state.mass.from_numpy(mass.astype(self.state.position.get_scalar_field(0).to_numpy().dtype))
        self.force.softening, self.force.strength, self.sum.accuracy = softening, strength, accuracy
        return self

    def accelerations(self):
        self.state.acceleration.fill(0.0)
        self.sum.add_accelerations(self.state)
        return self.state.acceleration.to_numpy()

    def potentials(self):
        return self.sum.potential_terms(self.state)


def tree_fixtures(count):
    """The fixtures `fresh_runtime`, `trees` and `tree` of a module whose tests share a tree over so many bodies."""

    @pytest.fixture
    def fresh_runtime():
        """Not after each test: what is compiled for a tree serves any places and masses."""

    @pytest.fixture(scope="module")
    def trees():
        """The tree that was made last, with its device."""
        yield (kept := {})
        kept.clear()
        backends.stop()

    @pytest.fixture
    def tree(trees, request):
        """A tree on two threads, in the precision that a test asks for, or in f64; made anew where its device was stopped."""
        device = backends.start("cpu", getattr(request, "param", "f64"), threads=2)
        if trees.get("device") is not device:
            trees.update(device=device, tree=Tree(count))
        return trees["tree"]

    return fresh_runtime, trees, tree


def errors(found, exact):
    """Relative errors of accelerations, (n,)."""
    return np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)


def direct(position, mass, rows, softening=0.0):
    """Accelerations and potentials of some bodies with G = 1, pair by pair."""
    acceleration, potential = np.empty((len(rows), position.shape[1])), np.empty(len(rows))
    for k, i in enumerate(rows):
        d = np.delete(position, i, 0) - position[i]
        inverse = ((d**2).sum(1) + softening**2) ** -0.5
        others = np.delete(mass, i)
        acceleration[k], potential[k] = (others * inverse**3) @ d, -others @ inverse
    return acceleration, potential
