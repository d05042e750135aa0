"""Gases and racks: no overlaps, the requested number of particles, and the requested velocities."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.distance import cdist

from mpp_taichi.errors import PlacementError, SceneError
from mpp_taichi.generators._base import GeneratorContext, make_group
from mpp_taichi.generators._crowd import close_pairs
from mpp_taichi.generators.gas import Gas
from mpp_taichi.generators.rack import Rack
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble


def context(dimensions=3, placed=(), seed=1):
    return GeneratorContext(np.random.default_rng(seed), 0.0, 0.0, None, dimensions, tuple(placed))


def gas(dimensions=3, placed=(), seed=1, **given):
    given = {"lower": (0, 0, 0), "upper": (7.5, 5.0, 4.0 if dimensions == 3 else 0.0), "radius": 0.1, **given}
    return Gas(**given).generate(context(dimensions, placed, seed))


def smallest_gap(*groups):
    """Between any two spheres, in units of the smaller radius of all; brute force."""
    position = np.concatenate([group.position for group in groups])
    radius = np.concatenate([group.radius for group in groups])
    gap = cdist(position, position) - radius[:, None] - radius[None, :]
    np.fill_diagonal(gap, np.inf)
    return gap.min() / radius.min()


def cube(count, packing, dimensions, radius=0.5):
    """Upper corner of the box at the origin that `count` spheres fill to the packing fraction."""
    volume = math.pi * radius**2 if dimensions == 2 else 4 / 3 * math.pi * radius**3
    edge = (count * volume / packing) ** (1 / dimensions)
    return (edge, edge, edge if dimensions == 3 else 0.0)


ROUNDING = -1e-14  # of a position of some radii


@pytest.mark.parametrize(
    "count, packing, dimensions, spread",
    [
        (1, 0.1, 2, 0.0),
        (250, 0.21, 2, 0.3),
        (600, 0.35, 2, 0.0),
        (250, 0.60, 2, 0.1),
        (900, 0.80, 2, 0.0),
        (1, 0.01, 3, 0.0),
        (700, 0.15, 3, 0.5),
        (500, 0.35, 3, 0.05),
        (500, 0.49, 3, 0.0),
        (1500, 0.55, 3, 0.0),
    ],
)
def test_a_gas_of_any_density_has_all_its_spheres_inside_and_apart(count, packing, dimensions, spread):
    upper = cube(count, packing, dimensions)
    made = gas(dimensions, count=count, upper=upper, radius=0.5, radius_spread=spread)
    assert len(made) == count
    assert count == 1 or smallest_gap(made) >= ROUNDING
    inset = made.radius[:, None]
    for axis in range(dimensions):
        assert np.all(made.position[:, axis] - inset[:, 0] >= ROUNDING)
        assert np.all(made.position[:, axis] + inset[:, 0] <= upper[axis] * (1 - ROUNDING))
    if dimensions == 2:
        assert not made.position[:, 2].any()
    assert np.all(np.abs(made.radius / 0.5 - 1) <= spread)
    assert count == 1 or (np.ptp(made.radius) > 0.0) == (spread > 0.0)


def test_a_dilute_gas_is_even_in_space():
    """Each coordinate against an even distribution at 0.1 %; spheres of 3 % packing hardly know of one another."""
    made = gas(count=2000, radius=0.08)
    for axis, length in enumerate((7.5, 5.0, 4.0)):
        assert stats.kstest((made.position[:, axis] - 0.08) / (length - 0.16), "uniform").pvalue > 1e-3


def test_a_dense_gas_has_random_vacancies_and_is_shaken():
    made = gas(2, count=700, upper=cube(700, 0.7, 2), radius=0.5)
    again = gas(2, count=700, upper=cube(700, 0.7, 2), radius=0.5, seed=2)
    assert np.linalg.norm(made.position - again.position, axis=1).min() > 0.0
    assert len(np.unique(made.position[:, 0])) > 650


@pytest.mark.parametrize("dimensions, packing", [(2, 0.91), (3, 0.745), (2, 0.895), (3, 0.73)])
def test_more_than_fits_is_refused_with_the_reason(dimensions, packing):
    """Beyond the closest packing, and just below it, where walls and whole rows leave no room."""
    with pytest.raises(PlacementError, match=r"no room for 400 spheres of radius 0.5: they would fill 0.[789]"):
        gas(dimensions, count=400, upper=cube(400, packing, dimensions), radius=0.5)


def test_a_sphere_larger_than_the_box_is_refused():
    with pytest.raises(PlacementError, match="radius 3 does not fit into the box from lower to upper, 7.5 × 5"):
        gas(2, count=1, radius=3.0)


@pytest.mark.parametrize("count, radius", [(150, 0.1), (440, 0.105), (440, 0.1275)])
def test_a_gas_leaves_room_for_what_is_placed_before(count, radius):
    """A large ball and another gas: at random, on a lattice that is shaken far, and on a narrow one."""
    ball = make_group(1, position=[[3.0, 2.0, 0.0]], radius=1.0)
    first = gas(2, count=40, radius=0.05, placed=[ball], seed=3)
    second = gas(2, count=count, radius=radius, placed=[ball, first], seed=4)
    assert smallest_gap(ball, first, second) >= ROUNDING * 100  # of positions of 7 against a radius of 0.05


def test_a_gas_without_room_beside_what_is_there_says_so():
    ball = make_group(1, position=[[3.0, 2.0, 0.0]], radius=1.0)
    with pytest.raises(PlacementError, match="no room for 450 spheres of radius 0.15 beside the particles placed before"):
        gas(2, count=450, radius=0.15, placed=[ball])


def test_points_need_no_room():
    assert len(gas(count=1000, radius=0.0)) == 1000


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("count", [2, 3, 250, 251])
def test_one_speed_for_all_in_directions_that_cancel(count, dimensions):
    made = gas(dimensions, count=count, radius=0.02, speed=2.0, zero_momentum=True)
    assert np.linalg.norm(made.velocity, axis=1) == pytest.approx(np.full(count, 2.0), rel=1e-14)
    assert np.abs(made.velocity.sum(axis=0)).max() <= count * 2.0 * 2.0**-52


@pytest.mark.parametrize("dimensions", [2, 3])
def test_directions_are_even(dimensions):
    """Angle in the plane, height over the sphere (Archimedes): even, at 0.1 %."""
    made = gas(dimensions, count=4000, radius=0.0, speed=1.0)
    x, y, z = made.velocity.T
    assert stats.kstest(np.arctan2(y, x) / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3
    if dimensions == 3:
        assert stats.kstest(0.5 + 0.5 * z, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("dimensions, law", [(2, stats.rayleigh), (3, stats.maxwell)])
@pytest.mark.parametrize("balanced", [False, True])
def test_a_temperature_is_met_exactly_by_speeds_of_maxwell_and_boltzmann(dimensions, law, balanced):
    made = gas(dimensions, count=3000, radius=0.0, mass=2.0, temperature=3.0, drift=(1.0, -2.0, 0.0), zero_momentum=balanced)
    thermal = made.velocity - np.array([1.0, -2.0, 0.0])
    energy = np.sum(thermal**2)  # ½ m v² = d/2 k T each, m = 2
    assert energy == pytest.approx(dimensions / 2 * 3.0 * 3000, rel=1e-13)
    speeds = np.linalg.norm(thermal, axis=1)
    assert stats.kstest(speeds, law(scale=math.sqrt(1.5)).cdf).pvalue > 1e-3
    momentum = np.abs(thermal.sum(axis=0)).max()
    assert (momentum < 1e-9) == balanced


def test_velocities_that_exclude_one_another_are_refused():
    with pytest.raises(PlacementError, match="speed 1 and temperature 2 exclude"):
        gas(count=3, speed=1.0, temperature=2.0)
    with pytest.raises(PlacementError, match="zero_momentum: one particle"):
        gas(count=1, speed=1.0, zero_momentum=True)
    with pytest.raises(PlacementError, match="mass 0 has no thermal velocity"):
        gas(count=2, mass=0.0, temperature=2.0)


def test_close_pairs_miss_none():
    """Against brute force, of sets of very different extent, in space and on a line."""
    random = np.random.default_rng(5)
    for scale in (np.array([1.0, 1.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([1e6, 1.0, 1.0])):
        first, second = random.uniform(-1, 1, (60, 3)) * scale, random.uniform(-3, 3, (300, 3)) * scale
        reach = 0.3 * scale.max()
        found = {pair for i, j in close_pairs(first, second, reach) for pair in zip(i.tolist(), j.tolist())}
        near = {(int(i), int(j)) for i, j in np.argwhere(cdist(first, second) < reach)}
        assert near and near <= found
    far = np.array([[1e12, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert [(int(i[0]), int(j[0])) for i, j in close_pairs(np.zeros((1, 3)), far, 1e-6)] == [(0, 1)]


def scene(particles, **changes):
    return load_scene({"particles": particles, "integrator": {"leapfrog": {"dt": 0.1}}, **changes})


def test_a_scene_places_gases_beside_each_other_the_same_every_time():
    left = {"gas": {"name": "left", "count": 90, "lower": [0, 0], "upper": [4, 4], "radius": 0.1, "speed": 1}}
    right = {"gas": {"name": "right", "count": 60, "lower": [0, 0], "upper": [4, 4], "radius": 0.12, "temperature": "1/2"}}
    ball = {"body": {"mass": 5, "position": [2, 2], "radius": 0.7}}
    made = assemble(scene([ball, left, right], dimensions=2, seed=4))
    assert made.particle_count == 151
    assert smallest_gap(made) >= ROUNDING
    assert np.array_equal(made.position, assemble(scene([ball, left, right], dimensions=2, seed=4)).position)
    assert not np.array_equal(made.position, assemble(scene([ball, left, right], dimensions=2, seed=5)).position)


def test_a_scene_without_room_is_refused_at_its_line():
    crowd = {"gas": {"count": 500, "lower": [0, 0, 0], "upper": [1, 1, 1], "radius": 0.1}}
    with pytest.raises(SceneError, match=r"particles\[0\]\.gas: there is no room for 500 spheres"):
        assemble(scene([crowd]))


# --- racks ----------------------------------------------------------------------------------------------------------------


def rack(**given):
    return Rack(**{"apex": (2.0, 0.0, 0.0), "radius": 0.3, **given}).generate(context(2))


def test_a_rack_is_a_triangle_of_touching_balls():
    """15 balls, 30 contacts: 5 rows, each ball but the apex's ends touches its neighbours; rounding of coordinates near 4."""
    made = rack()
    distance = cdist(made.position, made.position)
    assert len(made) == 15 and np.sum(np.triu(np.abs(distance - 0.6) < 4e-15, 1)) == 30
    np.fill_diagonal(distance, np.inf)
    assert distance.min() >= 0.6 - 4e-15
    assert made.position[0] == pytest.approx([2.0, 0.0, 0.0])
    assert made.position[-1] == pytest.approx([2.0 + 4 * 0.6 * math.sqrt(3) / 2, 1.2, 0.0])


@pytest.mark.parametrize("direction, axis", [((1, 0, 0), 1), ((0, -2, 0), 0)])
def test_the_halves_of_a_rack_are_mirror_images_to_the_last_bit(direction, axis):
    place = rack(direction=direction, apex=(0.1, 0.0, 0.0) if axis == 1 else (0.0, 0.1, 0.0), radius=0.1, gap=0.013).position
    mirrored = place * np.where(np.arange(3) == axis, -1.0, 1.0)
    assert {tuple(row) for row in mirrored + 0.0} == {tuple(row) for row in place + 0.0}
    assert np.sum(place[:, axis] != 0.0) == 12


def test_a_gap_keeps_the_balls_of_a_rack_apart_in_any_direction():
    made = rack(rows=3, gap=0.05, direction=(1.0, 2.0, 0.0))
    distance = cdist(made.position, made.position)[np.triu_indices(6, 1)]
    assert np.sort(distance)[:9] == pytest.approx(np.full(9, 0.65), rel=1e-14)
    with pytest.raises(PlacementError, match="x–y plane"):
        rack(direction=(0.0, 0.0, 1.0))
