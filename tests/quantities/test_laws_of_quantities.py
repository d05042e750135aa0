"""Laws that every quantity of the catalogue keeps: it scales with its dimension, knows its own rate, and no axis is special."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from measured import MadeUpSample

from mpp_taichi import component
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.quantities._base import NoResultError, Quantity, Setting
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Rods
from mpp_taichi.start.assemble import assemble
from mpp_taichi.state.tangent_growth import TangentGrowth

SCENE = {
    "particles": [
        {"body": {"name": "sun", "mass": 5, "radius": 0.5, "position": [0.5, -0.25, 0.125], "velocity": [0.25, 0, 0.125]}},
        {"body": {"name": "planet", "mass": 2, "radius": 0.25, "position": [3, 2, 1], "velocity": [-0.5, 0.75, 0.25]}},
        {"body": {"name": "moon", "mass": 3, "radius": 0.25, "position": [4, 2.5, 2], "velocity": [0.5, 0.25, -1]}},
        {"body": {"name": "post", "mass": 1, "radius": 0.25, "position": [-4, 1, 3], "free": False}},
        {"body": {"name": "hung", "mass": 4, "radius": 0.25, "position": [-5, 3, 2], "velocity": [1, 0.5, 0.25]}},
    ],
    "springs": [
        {"link": {"between": ["planet", "moon"], "stiffness": 3, "rest_length": 1.25}},
        {"link": {"between": ["hung", "post"], "stiffness": 2, "rest_length": 2}},
        {"link": {"between": ["moon", "hung"], "stiffness": 0.5, "rest_length": 7}},
    ],
    "forces": [{"newtonian_gravity": {}}],
    "contacts": {"hard_spheres": {"solver": "swept"}},
    "integrator": {"leapfrog": {"dt": 1}},
    "run": {"steps": 1},
}
ORBIT = {"of": (1, 1), "around": (0, 1)}
# Parameters of quantities that need some, and a second choice of others; masses, lengths and times among them scale, too.
GIVEN = {
    "angle": [{"of": (1, 1)}, {"of": (1, 1), "around": (0, 1), "axis": "x"}, {"of": (2, 1), "axis": "y", "zero": 0.5}],
    "angular_momentum": [{}, {"of": (1, 2), "axis": "y"}],
    "argument_of_pericentre": [ORBIT],
    "ascending_node": [ORBIT],
    "broken_springs": [{}, {"of": (1, 2)}],
    "collision_count": [{"between": "all"}, {"between": "pairs"}, {"between": "walls"}],
    "dihedral_angle": [
        {"of": ((0, 1), (1, 1), (2, 1), (3, 1))},
        {"of": ((4, 1), (1, 1), (0, 1), (2, 1)), "zero": 0.5},
    ],
    "distance": [{"of": (1, 2)}, {"of": (1, 1), "to": (2, 1)}, {"of": (1, 2), "point": (1.0, 2.0, 0.5)}, {"between": (0, 4)}],
    "eccentricity": [ORBIT],
    "enclosed_area": [{"of": (0, 4)}, {"of": (1, 3)}],
    "enclosed_volume": [{"of": (0, 4)}, {"of": (1, 4)}],
    "inclination": [ORBIT],
    "kinetic_energy": [{}, {"of": (1, 2)}],
    "largest_mass": [{}, {"of": (1, 2)}],
    "mass": [{}, {"of": (1, 2)}],
    "mirror_error": [{"axis": "x", "at": 0.5}, {"axis": "y", "at": 0.5}, {"axis": "z"}],
    "momentum": [{}, {"of": (1, 2), "axis": "x"}],
    "nearest_neighbor_distance": [{}, {"of": (0, 3)}],
    "osculating_period": [ORBIT],
    "position": [{"axis": axis, "of": (1, 2)} for axis in "xyz"],
    "resting_speed": [{}, {"of": (1, 1)}],
    "rod_force": [{"between": (1, 0)}, {"between": (0, 2)}],
    "semi_major_axis": [ORBIT],
    "speed": [{}, {"of": (1, 2)}],
    "speed_distribution_distance": [{}, {"of": (0, 3), "temperature": 0.75}],
    "spheres_left": [{}, {"of": (1, 2)}],
    "spring_force": [{"of": (1, 2), "axis": axis} for axis in "xyz"],
    "spring_length": [{}, {"between": (2, 1)}],
    "spring_strain": [{}, {"between": (3, 4)}],
    "temperature": [{}, {"of": (0, 3), "drift": True}],
    "true_anomaly": [ORBIT],
    "velocity": [{"axis": axis, "of": (0, 3)} for axis in "xyz"],
}
MODES = {"mode_amplitude"}  # of a network at rest: tests/modes, and the rate below
BOXES = {"virial_pressure"}  # of a periodic box: the last test of this file, and tests/neighbors
CASES = [
    (name, given) for name in component.names("quantities") if name not in MODES | BOXES for given in GIVEN.get(name, [{}])
]
LENGTH, TIME, MASS = 8.0, 4.0, 0.5  # powers of two: scaled numbers have the same digits
NOT_SCALED = {"zero"}  # an angle
POWERS = {"point": (1, 0, 0), "at": (1, 0, 0), "temperature": (2, -2, 1)}


@pytest.fixture(scope="module")
def spec():
    return load_scene(SCENE)


@pytest.fixture(scope="module")
def start(spec):
    """The particles of the scene, with two rods that are longer than 1 and a broken spring, all in their motion."""
    rods = Rods(between=np.array([[0, 1], [2, 0]], np.int32), length=np.full(2, np.nan), color=np.ones((2, 3)))
    found = assemble(spec)
    first, second = rods.between.T
    length = np.linalg.norm(found.position[second] - found.position[first], axis=1)
    never = np.full(3, np.inf)
    springs = replace(found.springs, breaking_length=never, yield_stretch=never, broke_at=np.array([np.inf, np.inf, 2.0]))
    return replace(found, rods=replace(rods, length=length), springs=springs, velocity=found.velocity * found.free)


def factor(dimension):
    return LENGTH ** dimension[0] * TIME ** dimension[1] * MASS ** dimension[2]


def scaled(start):
    """The same particles in other units."""
    springs = replace(
        start.springs,
        stiffness=start.springs.stiffness * factor((0, -2, 1)),
        damping=start.springs.damping * factor((0, -1, 1)),
        rest_length=start.springs.rest_length * LENGTH,
    )
    return replace(
        start,
        position=start.position * LENGTH,
        velocity=start.velocity * factor((1, -1, 0)),
        mass=start.mass * MASS,
        radius=start.radius * LENGTH,
        springs=springs,
        rods=replace(start.rods, length=start.rods.length * LENGTH),
    )


def sample_of(snapshot, by=lambda dimension: 1.0, potential_energy=-1.5):
    """A sample with energies, gravity, accelerations and counts that differ from each other."""
    sample = MadeUpSample(
        snapshot,
        time=3.0 * by((0, 1, 0)),
        contact_report=ContactReport(pair_count=5, wall_count=2, largest_overlap=0.125),
        potential_energy=potential_energy * by((2, -2, 1)),
        gravity=0.75 * by((3, -2, -1)),
    )
    sample.acceleration = np.cos(np.arange(15.0)).reshape(5, 3) * by((1, -2, 0))
    sample.tangent = TangentGrowth(*(np.array([number]) for number in (sample.time, 2.0, 2.5, 1.9)), np.diag([2.0, 0.5])[None])
    return sample


def built(name, given, spec, start):
    quantity = component.build("quantities", name, given)
    quantity.begin(Setting(spec, start))
    return quantity


def later(start, time):
    """The particles after a time in which each moves with its velocity."""
    return replace(start, position=start.position + time * start.velocity)


def test_the_cases_are_of_quantities_that_exist():
    assert GIVEN.keys() <= set(component.names("quantities"))


@pytest.mark.parametrize(("name", "given"), CASES, ids=[f"{name}-{k}" for k, (name, _) in enumerate(CASES)])
def test_a_quantity_scales_with_its_dimension(name, given, spec, start):
    """Of the first sample, and of a second sample, which the quantities that remember measure against the first."""
    plain = built(name, given, spec, start)
    in_units = {
        key: np.multiply(value, factor(POWERS[key])).tolist() if key in POWERS else value for key, value in given.items()
    }
    other = built(name, in_units, spec, scaled(start))
    found = []
    for snapshot, energy in ((start, -1.5), (later(start, 0.5), -1.25)):
        found.append(plain.measure(sample_of(snapshot, potential_energy=energy)))
        expected = found[-1] * factor(plain.dimension)
        # Numbers are scaled by powers of two; only functions like the arc tangent and sums in BLAS may round otherwise.
        assert other.measure(sample_of(scaled(snapshot), factor, energy)) == pytest.approx(expected, rel=1e-13, abs=0.0)
    assert np.isfinite(found).all() and any(found), "a zero tells nothing"


@pytest.mark.parametrize("name", sorted(component.names("quantities")))
def test_a_quantity_says_what_it_can_measure(name):
    """A method that is written but not announced would never be called, and an announced method that is missing would fail."""
    kind = component.load("quantities", name)
    for flag, method in (("has_rate", "rate"), ("takes_many", "measure_many")):
        assert getattr(kind, flag) == (getattr(kind, method) is not getattr(Quantity, method)), (flag, method)
    assert (kind.rate_many is not Quantity.rate_many) == (kind.has_rate and kind.takes_many)


RATES = [(name, given) for name, given in CASES if component.flag("quantities", name, "has_rate")]


@pytest.mark.parametrize(("name", "given"), RATES, ids=[f"{name}-{k}" for k, (name, _) in enumerate(RATES)])
def test_a_rate_is_the_derivative_of_its_quantity(name, given, spec, start):
    """By a difference over ±h: it lacks h² times the third derivative, and has the rounding of the quantity over h."""
    quantity, h = built(name, given, spec, start), 1e-5
    rise = quantity.measure(sample_of(later(start, h))) - quantity.measure(sample_of(later(start, -h)))
    assert quantity.rate(sample_of(start)) == pytest.approx(rise / (2 * h), rel=1e-8, abs=1e-9)
    assert quantity.rate(sample_of(start)) != 0.0


MANY = [(name, given) for name, given in CASES if component.flag("quantities", name, "takes_many")]


@pytest.mark.parametrize(("name", "given"), MANY, ids=[f"{name}-{k}" for k, (name, _) in enumerate(MANY)])
def test_many_copies_are_measured_as_each_of_them_alone(name, given, spec, start):
    """Value, rate and interval of three copies with other places, velocities, masses, energies and growth, twice in a row."""
    many, *alone = (built(name, given, spec, start) for _ in range(4))
    for age in (0.0, 0.25):
        starts = [later(start, age), later(start, age + 0.5), later(replace(start, velocity=-2.0 * start.velocity), age)]
        starts[1] = replace(starts[1], mass=start.mass * np.arange(1.0, 6.0))
        copies = [sample_of(each, potential_energy=-1.5 * k) for k, each in enumerate(starts)]
        for k, copy in enumerate(copies):
            copy.tangent = TangentGrowth(*(array * (k + 1.0) for array in vars(copy.tangent).values()))
        arrays = {key: np.stack([getattr(each, key) for each in starts]) for key in ("position", "velocity", "mass")}
        tangent = TangentGrowth(*(np.concatenate(parts) for parts in zip(*(vars(copy.tangent).values() for copy in copies))))
        energies = np.array([copy.potential_energy for copy in copies])
        sample = SimpleNamespace(time=3.0, snapshot=SimpleNamespace(**arrays), potential_energy=energies, tangent=tangent)
        methods = ["measure", *(["rate", "sampling_interval"] if many.has_rate else [])]
        for method in methods:
            expected = [getattr(each, method)(copy) for each, copy in zip(alone, copies)]
            found = getattr(many, f"{method}_many")(sample)
            # Sums of at most five numbers, which may be added in another order.
            assert found is None and set(expected) == {None} or found == pytest.approx(expected, rel=1e-14, abs=1e-15)


def test_two_ends_of_a_distance_move_by_a_tenth_of_it_between_samples(spec, start):
    for given in GIVEN["distance"]:
        quantity = built("distance", given, spec, start)
        interval = quantity.sampling_interval(sample_of(start))
        moved = (
            quantity._relative(sample_of(later(start, interval))).separation - quantity._relative(sample_of(start)).separation
        )
        assert np.linalg.norm(moved) == pytest.approx(0.1 * quantity.measure(sample_of(start)), rel=1e-12)
    at_rest = replace(start, velocity=np.zeros_like(start.velocity))
    assert quantity.sampling_interval(sample_of(at_rest)) == math.inf
    assert quantity.rate(sample_of(replace(start, position=np.zeros_like(start.position)))) == 0.0


@pytest.mark.parametrize("name", sorted({name for name, given in CASES if "axis" in given} - {"angle"}))
def test_an_axis_is_a_column_of_the_arrays(name, spec, start):
    """The columns are turned, x to y, y to z and z to x: what the quantity measures along the axes turns with them."""
    turned = replace(start, position=np.roll(start.position, 1, axis=1), velocity=np.roll(start.velocity, 1, axis=1))
    given = {key: value for key, value in GIVEN[name][-1].items() if key not in ("axis", "at")}
    for axis, after in zip("xyz", "yzx"):
        before = built(name, given | {"axis": axis}, spec, start).measure(sample_of(start))
        assert built(name, given | {"axis": after}, spec, turned).measure(sample_of(turned)) == pytest.approx(before, rel=1e-14)
        assert before != pytest.approx(built(name, given | {"axis": after}, spec, start).measure(sample_of(start)), rel=1e-3)


def test_angles_count_from_the_first_axis_of_their_plane_to_the_second(spec, start):
    x, y, z = start.position[2] - start.position[1]
    for axis, expected in (("x", math.atan2(z, y)), ("y", math.atan2(z, x)), ("z", math.atan2(y, x))):
        quantity = built("angle", {"of": (2, 1), "around": (1, 1), "axis": axis, "zero": 0.25}, spec, start)
        assert quantity.measure(sample_of(start)) == pytest.approx(expected - 0.25, rel=1e-14)


def test_the_forces_of_all_rods_together_keep_their_lengths(spec, start):
    """With T₁ and T₂ on their ends, d·(a_j − a_i) + |v_j − v_i|² − (d·v)²/d² = 0 for each: rods of 4.2 and 4.9 that turn."""
    sample = sample_of(start)
    acceleration = sample.acceleration.copy()
    for ends in start.rods.between:
        force = built("rod_force", {"between": tuple(ends)}, spec, start).measure(sample)
        assert built("rod_force", {"between": tuple(ends[::-1])}, spec, start).measure(sample) == force
        d = start.position[ends[1]] - start.position[ends[0]]
        pull = force * d / np.linalg.norm(d)
        acceleration[ends[0]] += pull / start.mass[ends[0]]
        acceleration[ends[1]] -= pull / start.mass[ends[1]]
    for i, j in start.rods.between:
        d, v, a = (values[j] - values[i] for values in (start.position, start.velocity, acceleration))
        assert d @ a + v @ v - (d @ v) ** 2 / (d @ d) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_a_rod_does_not_pull_along_an_axis_that_is_held(axis, spec, start):
    """An end that is held along an axis takes up no acceleration along it; the other axes keep the length."""
    held = replace(start, free=start.free.copy(), velocity=start.velocity.copy())
    held.free[1, axis], held.velocity[1, axis] = False, 0.0
    only = replace(held, rods=Rods(held.rods.between[:1], held.rods.length[:1], held.rods.color[:1]))
    sample = sample_of(only)
    force = built("rod_force", {"between": (0, 1)}, spec, only).measure(sample)
    d, v = only.position[1] - only.position[0], only.velocity[1] - only.velocity[0]
    acceleration = sample.acceleration[:2] * only.free[:2]
    acceleration[0] += force * d / np.linalg.norm(d) / only.mass[0]
    acceleration[1] -= force * d / np.linalg.norm(d) / only.mass[1] * only.free[1]
    found = d @ (acceleration[1] - acceleration[0]) + v @ v - (d @ v) ** 2 / (d @ d)
    assert found == pytest.approx(0.0, abs=1e-12)


BARE = {
    "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}, {"body": {"mass": 2, "position": [3, 0, 1]}}],
    "integrator": {"leapfrog": {"dt": 1}},
}
NEEDS = {  # what a scene of two free bodies lacks
    "collision_count": "no contacts",
    "largest_overlap": "no contacts",
    "dihedral_angle": "the four groups share particles",
    "enclosed_volume": "1 particles are the corners of no closed skin",
    "spring_length": "no spring",
    "spring_strain": "no spring",
    "spring_force": "no springs",
    "rod_force": "no rod between particle 1 and particle 0",
    "virial_pressure": "is measured in a periodic_box that repeats along every axis, with pair forces",
    **dict.fromkeys(("argument_of_pericentre", "ascending_node", "eccentricity", "inclination"), "needs gravity"),
    **dict.fromkeys(("osculating_period", "semi_major_axis", "true_anomaly"), "needs gravity"),
}


@pytest.mark.parametrize("name", [name for name in component.names("quantities") if name not in MODES])
def test_a_quantity_is_refused_exactly_where_the_scene_lacks_what_it_is_about(name):
    spec = load_scene(BARE)
    bare = assemble(spec)
    given = {"between": (1, 0)} if name in ("distance", "rod_force") else dict(GIVEN.get(name, [{}])[0])
    if "of" in given:
        given["of"] = (0, 1) if name != "dihedral_angle" else ((0, 1), (1, 1), (0, 1), (1, 1))
    bare = replace(bare, velocity=np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))

    def measure():
        sample = MadeUpSample(bare)
        sample.acceleration = np.zeros_like(bare.position)
        sample.tangent = TangentGrowth(*np.zeros((4, 1)), np.eye(2)[None])
        return built(name, given, spec, bare).measure(sample)

    if name in NEEDS:
        with pytest.raises(NoResultError, match=NEEDS[name]):
            measure()
    else:
        assert math.isfinite(measure())


@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_pressure_of_forces_has_the_motion_about_the_centre_and_the_virial(dimensions):
    """P d V = Σ m v² + W; a common velocity adds nothing."""
    edges = [4.0, 5.0, 6.0][:dimensions]
    scene = {
        "dimensions": dimensions,
        "particles": [
            {"body": {"mass": 2.0, "position": [1.0] * dimensions, "velocity": [3.0, *[0.5] * (dimensions - 1)]}},
            {"body": {"mass": 2.0, "position": [2.0] * dimensions, "velocity": [1.0, *[0.5] * (dimensions - 1)]}},
        ],
        "forces": [{"lennard_jones": {"length": 1.0, "cutoff": 1.5}}],
        "walls": [{"periodic_box": {"lower": [0.0] * dimensions, "upper": edges}}],
        "integrator": {"leapfrog": {"dt": 1.0}},
        "run": {"steps": 1},
    }
    spec = load_scene(scene)
    found = assemble(spec)
    quantity = built("virial_pressure", {}, spec, found)
    sample = MadeUpSample(found)
    sample.pair_virial = -1.0
    assert quantity.measure(sample) == pytest.approx((4.0 - 1.0) / (dimensions * np.prod(edges)), rel=1e-14)
    assert quantity.dimension == (2 - dimensions, -2, 1)
    walls = scene["walls"] + [{"plane": {"point": [0.0] * dimensions, "normal": [1.0, *[0.0] * (dimensions - 1)]}}]
    spheres = scene | {"contacts": {"hard_spheres": {"solver": "pairwise"}}, "walls": walls}
    for body in spheres["particles"]:
        body["body"]["radius"] = 0.1
    with pytest.raises(NoResultError, match="no share of collisions"):
        built("virial_pressure", {}, load_scene(spheres), found)
