"""Contacts for which a gradient iteration takes too long: wedges, columns under a heavy sphere, regular packings."""

import numpy as np
import pytest
from scipy.optimize import nnls

from mpp_taichi.contacts.rest.banded import BandedCholesky, narrow_order
from mpp_taichi.contacts.rest.proximal import ContactProblem, Proximal

ROUND_OFF = 2.0**-52
HELD = -1


@pytest.fixture
def fresh_runtime():
    """Not here: nothing is compiled."""


def group(first, second, normal, mass, velocity, offset, *, allowed=1e-13, impulse=None, yielding=0.0):
    """The contacts of spheres with these masses and velocities; offset 0: touching."""
    first, second = np.asarray(first), np.asarray(second)
    normal, velocity = np.asarray(normal, float), np.asarray(velocity, float)
    beside = np.where(second[:, None] >= 0, velocity[second], 0.0)
    return ContactProblem(
        first=first,
        second=second,
        normal=normal,
        inverse_mass=np.repeat(1 / np.asarray(mass, float)[:, None], normal.shape[1], axis=1),
        approach=(normal * (velocity[first] - beside)).sum(axis=1) + offset,
        impulse=np.zeros(len(first)) if impulse is None else impulse,
        allowed=np.full(len(first), allowed),
        rounded=np.full(len(first), 1e-8),
        yielding=yielding,
    )


def test_a_ball_that_falls_into_a_narrow_wedge_stops():
    """Two held sides whose normals nearly oppose: the impulses are 1 / (2 sin ε)."""
    for angle in (1e-2, 1e-5):
        normal = [(np.cos(angle), np.sin(angle)), (-np.cos(angle), np.sin(angle))]
        found = Proximal(group([0, 0], [HELD, HELD], normal, [1.0], [(0.0, -1.0)], 0.0)).solve()
        assert found.solved
        # The two impulses cancel along x but for a rounding of 1 / angle, which is a speed 1 / angle times as large along y.
        assert found.impulse == pytest.approx(1 / (2 * np.sin(angle)), rel=8 * ROUND_OFF / angle**2)
        assert np.abs(found.velocity - [0.0, 1.0]).max() < 8 * ROUND_OFF / angle**2


def test_a_column_under_a_heavy_sphere_stops_and_bears_it():
    """Ten spheres and a floor, a million times as heavy a sphere on top: all impulses are m_above × speed."""
    count = 10
    mass = np.ones(count)
    mass[-1] = 1e6
    found = Proximal(group(range(count), range(-1, count - 1), [(0.0, 1.0)] * count, mass, [(0.0, -1.0)] * count, 0.0)).solve()
    assert found.solved
    # The velocity of a light sphere is the difference of impulses a million times as large; errors add up along the column.
    assert np.abs(found.velocity[:, 1] - 1.0).max() < count * 1e6 * 4 * ROUND_OFF
    assert found.impulse == pytest.approx(np.cumsum(mass[::-1])[::-1], rel=count * 4e6 * ROUND_OFF)


def crystal(rows, columns, slack, random):
    """Disks in a regular packing on a floor between two walls, with small gaps; more contacts than freedoms."""
    place = np.array([(a + 0.5 * (b % 2), b * np.sqrt(0.75)) for b in range(rows) for a in range(columns)])
    first, second, normal = [], [], []
    for i in range(len(place)):
        for j in range(i):
            way = place[i] - place[j]
            if np.linalg.norm(way) < 1.1:
                first.append(i), second.append(j), normal.append(way / np.linalg.norm(way))
        for wall, reached in (((0, 1), i < columns), ((1, 0), place[i, 0] == 0), ((-1, 0), place[i, 0] == columns - 0.5)):
            if reached:
                first.append(i), second.append(HELD), normal.append(wall)
    velocity = random.normal(size=place.shape) - (0.0, 1.0)
    offset = slack * random.uniform(size=len(first))
    return group(first, second, normal, np.exp(random.normal(size=len(place))), velocity, offset, allowed=1e-12)


@pytest.mark.parametrize("slack", [0.0, 1e-7, 1e-1])
def test_a_regular_packing_stops_as_the_least_squares_say(slack):
    """The velocities are the closest in the metric of the kinetic energy: SciPy's non-negative least squares on the dual."""
    chosen = crystal(5, 6, slack, np.random.default_rng(3))
    found = Proximal(chosen).solve()
    assert found.solved
    assert found.impulse.min() >= 0.0 and found.speeds.min() > -1e-11
    assert (np.minimum(found.impulse, np.abs(found.speeds))).max() < 1e-11
    # ½ |y|² with N y + f ≥ 0 by one more row: Lawson & Hanson's least distance problem.
    rows = np.zeros((len(chosen.first), 2 * len(chosen.inverse_mass)))
    for k in range(len(rows)):
        rows[k, 2 * chosen.first[k] : 2 * chosen.first[k] + 2] = chosen.normal[k]
        if chosen.second[k] >= 0:
            rows[k, 2 * chosen.second[k] : 2 * chosen.second[k] + 2] = -chosen.normal[k]
    rows *= np.sqrt(chosen.inverse_mass.ravel())
    target = np.zeros(rows.shape[1] + 1)
    target[-1] = 1.0
    whole = np.vstack([rows.T, -chosen.approach])
    weight, _ = nnls(whole, target, maxiter=100_000)
    rest = whole @ weight - target
    expected = -rest[:-1] / rest[-1] * np.sqrt(chosen.inverse_mass.ravel())
    assert np.abs(found.velocity.ravel() - expected).max() < 1e-7 * np.abs(expected).max()


def test_without_a_solution_the_overlap_is_shared():
    """A ball between two held things that are too close by 0.02: each side gets half."""
    chosen = group([0, 0], [HELD, HELD], [(1.0, 0.0), (-1.0, 0.0)], [2.0], [(0.3, 0.1)], -0.01)
    search = Proximal(chosen)
    assert not search.solve().solved
    share = 1e-6
    found = search.pressed(share)
    # Contacts that yield let a share of the speed pass.
    assert found.speeds == pytest.approx([-0.01, -0.01], abs=share * 0.3)
    assert found.velocity[0] == pytest.approx([-0.3, 0.0], abs=share * 0.3)


def test_contacts_that_yield_end_where_their_equation_says():
    """One contact with ε: λ = u / (1/m + ε)."""
    found = Proximal(group([0], [HELD], [(0.0, 1.0)], [2.0], [(0.0, -1.0)], 0.0, yielding=3.0)).solve()
    assert found.solved and found.impulse == pytest.approx([1 / 3.5], rel=1e-12)


def test_the_banded_factors_solve_a_grid_of_springs():
    random = np.random.default_rng(2)
    across, count = 7, 63
    number = random.permutation(count).reshape(-1, across)
    edges = np.array(
        [(a, b) for line in number for a, b in zip(line, line[1:], strict=False)]
        + [(a, b) for line in number.T for a, b in zip(line, line[1:], strict=False)]
    )
    order = narrow_order(count, edges[:, 0], edges[:, 1])
    assert sorted(order) == list(range(count))
    place = np.argsort(order)
    near, far = np.sort(place[edges], axis=1).T
    width = int((far - near).max())
    assert width < 2 * across  # of the numbers as they came it is near 60
    matrix = np.eye(count)
    for a, b in zip(near, far, strict=True):
        stiffness = 10 ** random.uniform(0, 6)
        matrix[[a, b, a, b], [a, b, b, a]] += stiffness * np.array([1, 1, -1, -1])
    band = np.zeros((count, 2 * width + 1))
    for p in range(count):
        for q in range(max(0, p - width), min(count, p + width + 1)):
            band[p, width + q - p] = matrix[p, q]
    last = np.arange(count)
    np.maximum.at(last, near, far)
    right = random.normal(size=count)
    found = BandedCholesky(band, np.maximum.accumulate(last) + 1).solve(right)
    # The backward error of Cholesky's method is a rounding of the matrix for each entry of a row.
    assert np.abs(matrix @ found - right).max() < count * ROUND_OFF * np.abs(matrix).max() * np.abs(found).max()
    with pytest.raises(FloatingPointError):
        BandedCholesky(-np.ones((3, 1)), np.arange(1, 4))
