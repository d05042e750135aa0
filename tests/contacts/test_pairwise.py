"""Pairwise contacts: overlapping spheres bounce by Eq. 9 and are separated, the same for each search of pairs."""

import numpy as np
import pytest
from sphere_gases import Places, box, gas, largest_overlap, setup_of

from mpp_taichi.contacts.overlap.overlaps import FEW, Overlaps
from mpp_taichi.contacts.pairwise import Pairwise
from mpp_taichi.device import backends
from mpp_taichi.walls._base import Enclosure

EPSILON = 2.0**-52


@pytest.mark.sampled(3)
def test_an_overlapping_pair_bounces_and_is_moved_apart_by_inverse_mass():
    """Eq. 9 along the line of centres at the end of the step; centre of mass, momentum and energy stay, the overlap goes."""
    backends.start("cpu", "f64", threads=2)
    start, velocity = np.array([[0.0, 0.0, 0.0], [2.5, 0.7, -0.3]]), np.array([[1.0, 0.5, 0.2], [-2.0, 0.1, 0.4]])
    radius, mass, h = np.array([1.0, 1.2]), np.array([3.0, 0.5]), 0.3
    state = Places(start, velocity)
    solver = Pairwise()
    solver.bind(setup_of(radius, mass), state)
    solver.drift(state, 0.0, h)
    x, v = state.read()
    moved = start + h * velocity
    d = moved[1] - moved[0]
    n = d / np.linalg.norm(d)
    reduced = mass.prod() / mass.sum()
    impulse = -2.0 * reduced * (velocity[1] - velocity[0]).dot(n)
    assert np.allclose(v, velocity + np.outer([-1.0, 1.0] * (impulse / mass), n), rtol=0, atol=16 * EPSILON)
    assert np.allclose(mass @ x, mass @ moved, rtol=0, atol=32 * EPSILON)
    assert np.linalg.norm(x[1] - x[0]) == pytest.approx(2.2, abs=8 * EPSILON)
    report = solver.collect()
    assert report.pair_count == 1 and report.unresolved == 0
    assert report.largest_overlap == pytest.approx(2.2 - np.linalg.norm(d), abs=8 * EPSILON)
    solver.destroy()


@pytest.mark.parametrize("walls", [True, False], ids=["walls", "periodic"])
def test_the_bits_depend_neither_on_how_pairs_are_found_nor_on_the_threads(walls):
    """And the energy of an elastic gas stays, whatever is moved where."""
    position, velocity, edges = gas(8, 0.35)
    results = set()
    for threads, all_pairs in ((2, True), (1, False), (4, False)):
        backends.start("cpu", "f64", threads=threads)
        state = Places(position, velocity)
        enclosure = box(edges) if walls else Enclosure(period=edges)
        solver = Overlaps(setup_of(np.ones(len(position)), enclosure=enclosure), state, all_pairs=all_pairs)
        for step in range(10):
            solver.drift(0.05 * step, 0.05)
        x, v = state.read()
        report = solver.collect()
        assert report.pair_count > 300
        assert (v**2).sum() == pytest.approx((velocity**2).sum(), rel=1e-13)
        results.add((x.tobytes(), v.tobytes(), report.pair_count, report.wall_count, report.largest_overlap))
        if walls:
            assert x.min() > 1.0 - 0.2 and x.max() < edges[0] - 1.0 + 0.2  # pushed back in by no more than a neighbour
        backends.stop()
    assert len(results) == 1


@pytest.mark.sampled(3)
def test_few_pairs_come_in_the_order_of_their_numbers_too():
    """Few pairs are sorted in a way of their own, which leaves out the spheres that touch nothing: here all but ten rows of
    three that overlap."""
    random = np.random.default_rng(5)
    lattice = 6.0 * np.stack(np.meshgrid(*[np.arange(1, 13)] * 3, indexing="ij"), -1).reshape(-1, 3)
    ends = [lattice[60:70] + [offset, 0.0, 0.0] for offset in (-1.8, 1.8)]
    position = np.concatenate([random.permutation(lattice), random.permutation(np.concatenate(ends))])
    velocity = 0.01 * random.normal(size=position.shape)
    results = set()
    for all_pairs in (True, False):
        backends.start("cpu", "f64", threads=2)
        state = Places(position, velocity)
        solver = Overlaps(setup_of(np.ones(len(position)), enclosure=box([80.0] * 3)), state, all_pairs=all_pairs)
        solver.drift(0.0, 1.0)
        if not all_pairs:
            found = solver.found.to_numpy()[: solver.found_count[0]].tolist()
            assert found == sorted(found) and len(found) == 20 < len(position) // FEW
        x, v = state.read()
        results.add((x.tobytes(), v.tobytes(), solver.collect().pair_count))
        backends.stop()
    assert len(results) == 1


@pytest.mark.sampled(3)
def test_the_largest_overlap_before_separation_is_reported():
    """The largest overlap seen is that before spheres are moved apart; a fast ball tunnels."""
    backends.start("cpu", "f64", threads=2)
    state = Places(np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([[3.0, 0.0], [0.0, 0.0]]))
    solver = Overlaps(setup_of(np.ones(2), dimensions=2), state)
    solver.drift(0.0, 1.0)
    assert solver.collect().largest_overlap == 1.0
    assert largest_overlap(state.read()[0], np.ones(2)) < 4 * EPSILON
    state.write(np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([[30.0, 0.0], [0.0, 0.0]]))
    solver.drift(0.0, 1.0)
    assert solver.collect().pair_count == 0


@pytest.mark.parametrize("given", [float("nan"), 0.75], ids=["of the solver", "of the scene"])
@pytest.mark.sampled(3)
def test_a_solver_reads_its_own_restitution_where_the_scene_gives_none(given):
    """Equal disks head on: each leaves with e times half of the approach speed, in the frame of their centre of mass."""
    backends.start("cpu", "f64", threads=1)
    setup = setup_of(np.ones(2), dimensions=2, restitution=given)
    state = Places([[0.0, 0.0], [2.5, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    solver = Pairwise(restitution=0.25, contact_time=0.5)
    solver.bind(setup, state)
    solver.drift(state, 0.0, 0.5)
    e = 0.25 if np.isnan(given) else given
    assert state.read()[1][:, 0].tolist() == [-e, e]
    assert solver.setup.contact_time == 0.5
