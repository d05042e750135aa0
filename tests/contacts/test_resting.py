"""Resting spheres: columns and piles do not sink, gain no energy, and come to rest; single impacts are exact."""

import numpy as np
import pytest
import taichi as ti
from scipy.optimize import nnls
from spheres import Spheres, plane, setup_of

from mpp_taichi.contacts.resting import Resting
from mpp_taichi.device import backends

ROUND_OFF = 2.0**-52
RADIUS, GRAVITY, STEP = 0.5, 1.0, 0.01
TOLERANCE = 1e-12
E = 0.5
COUNT = 10


@pytest.fixture
def fresh_runtime():
    """Not here: kernels are shared by the tests of this file."""


@pytest.fixture(scope="module", autouse=True)
def taichi():
    backends.start("cpu", "f64")
    yield
    backends.stop()


@ti.kernel
def kick(velocity: ti.template(), change: ti.types.vector(2, ti.f64)):
    ti.loop_config(serialize=True)
    for i in velocity:
        velocity[i] = velocity[i] + change


class Corner:
    """Ten spheres in two dimensions with a floor at y = 0 and an elastic wall at x = 0."""

    def __init__(self, *, parallel=None):
        floors = [plane((0, 0, 0), (0, 1, 0), restitution=E), plane((0, 0, 0), (1, 0, 0))]
        self.setup = setup_of(
            np.full(COUNT, RADIUS), dimensions=2, restitution=E, surfaces=floors, gravity=(0.0, -GRAVITY, 0.0)
        )
        self.spheres = Spheres(np.zeros((COUNT, 2)), np.zeros((COUNT, 2)), 2)
        self.solver = Resting(restitution=E, tolerance=TOLERANCE)
        self.solver.bind(self.setup, self.spheres, parallel=parallel)

    def place(self, position, velocity=None, *, mass=None):
        """Put the first spheres there, and the others far away and far apart; velocities 0 unless given."""
        whole = np.column_stack([50.0 + 5.0 * np.arange(COUNT), np.full(COUNT, 100.0)])
        speed = np.zeros((COUNT, 2))
        whole[: len(position)] = position
        if velocity is not None:
            speed[: len(position)] = velocity
        inverse_mass = np.ones((COUNT + 1, 2))
        if mass is not None:
            inverse_mass[: len(position)] = 1 / np.asarray(mass)[:, None]
        self.solver.step.rows.inverse_mass.from_numpy(inverse_mass)
        self.spheres.write(whole, speed)
        self.solver.collect()

    def run(self, steps, *, gravity=(0.0, -GRAVITY)):
        """Drift, kick, drift."""
        for k in range(steps):
            self.solver.drift(self.spheres, k * STEP, STEP / 2)
            kick(self.spheres.velocity, ti.Vector(gravity) * STEP)
            self.solver.drift(self.spheres, k * STEP, STEP / 2)


@pytest.fixture(scope="module")
def corner(taichi):
    return Corner()


# What a solved drift may leave undone at each contact, as a speed; it adds up along a column.
REST_SPEED = COUNT * TOLERANCE * RADIUS / (STEP / 2)


@pytest.mark.sampled(3)
def test_a_column_comes_to_rest_and_does_not_sink(corner):
    """H15: the depth after ten thousand steps is below 1e-9 of the radius."""
    height = RADIUS + 1.05 * np.arange(COUNT) + 0.3
    corner.place(np.column_stack([np.full(COUNT, 5.0), height]))
    energy = GRAVITY * height.sum()
    for _ in range(20):
        corner.run(500)
        position, velocity = corner.spheres.read()
        now = 0.5 * np.sum(velocity**2) + GRAVITY * position[:, 1].sum()
        assert now <= energy + COUNT * COUNT * TOLERANCE * RADIUS * GRAVITY  # each may be lifted by the tolerance of all below
        energy = now
    report = corner.solver.collect()
    assert report.unresolved == 0
    assert np.abs(velocity).max() < REST_SPEED
    assert np.abs(position[:, 1] - RADIUS - 2 * RADIUS * np.arange(COUNT)).max() < COUNT * TOLERANCE * RADIUS
    assert report.largest_overlap < 1e-9
    assert report.wall_impulse[0] == pytest.approx(COUNT * GRAVITY * 10_000 * STEP, rel=0.05)  # the floor bears the column


@pytest.mark.sampled(3)
def test_elastic_balls_bounce_for_ever(corner):
    """Gravity towards the elastic wall; a bounce is up to half a step away from a moment at which the energy is defined."""
    height = 1.0 + 0.1 * np.arange(COUNT)
    corner.place(np.column_stack([RADIUS + height, 3.0 + 2 * np.arange(COUNT)]))
    steps = 8_000
    corner.run(steps, gravity=(-GRAVITY, 0.0))
    position, velocity = corner.spheres.read()
    report = corner.solver.collect()
    bounces = np.sum(steps * STEP / (2 * np.sqrt(2 * height / GRAVITY)))
    assert report.wall_count == pytest.approx(bounces, rel=0.02) and report.unresolved == 0
    # Within a drift there is no gravity: the energy at its end is g v dt off at most, and as each drift keeps volumes it does
    # not add up over the 20 to 28 bounces of a ball.
    energy = 0.5 * velocity[:, 0] ** 2 + GRAVITY * (position[:, 0] - RADIUS)
    assert np.abs(energy - GRAVITY * height).max() < 2 * GRAVITY * np.sqrt(2 * GRAVITY * height.max()) * STEP


@pytest.mark.parametrize("masses", [(1.0, 1.0), (1e-3, 5.0)])
def test_two_spheres_collide_as_the_formula_says(corner, masses):
    for across in (0.0, 0.4, 0.9, 0.999):  # at which they still meet faster than what rests
        gap = 0.003
        distance = np.sqrt(1 - across**2) + gap
        corner.place([(10.0, 10.0), (10.0 + distance, 10.0 + across)], [(1.0, 0.3), (0.0, 0.3)], mass=masses)
        corner.solver.drift(corner.spheres, 0.0, STEP)
        _, velocity = corner.spheres.read()
        normal = np.array([np.sqrt(1 - across**2), across])  # from the first to the second when they touch
        impulse = (1 + E) * normal[0] / (1 / masses[0] + 1 / masses[1])
        expected = [[1.0, 0.3] - impulse * normal / masses[0], [0.0, 0.3] + impulse * normal / masses[1]]
        # The normal is known to a rounding over the sine of the angle at which the paths meet, and masses share 1e3.
        assert np.abs(velocity[:2] - expected).max() < 16 * ROUND_OFF / np.sqrt(1 - across**2) * 1.5


def test_one_ball_on_two_is_symmetric(corner):
    half = RADIUS
    position = [(10.0, 10.0), (10.0 + np.sqrt(0.75), 10.0 + half), (10.0 + np.sqrt(0.75), 10.0 - half)]
    corner.place(position, [(1.0, 0.0), (0.0, 0.0), (0.0, 0.0)])
    corner.solver.drift(corner.spheres, 0.0, STEP)
    _, velocity = corner.spheres.read()
    share = (1 + E) / 2  # of the elastic changes (−6/5, 0) and (3/5, ±√0.12)
    expected = [[1 - 1.2 * share, 0.0], [0.6 * share, np.sqrt(0.12) * share], [0.6 * share, -np.sqrt(0.12) * share]]
    assert np.abs(velocity[:3] - expected).max() < 2 * TOLERANCE * RADIUS / STEP


def test_a_drift_solves_the_complementarity_problem(corner):
    """λ ≥ 0 only where a contact ends closed, nothing ends overlapping: checked with SciPy on the outcome alone."""
    random = np.random.default_rng(5)
    place = np.array([(4 + a + 0.5 * b, 0.5 + b * np.sqrt(0.75)) for b in range(3) for a in range(4 - b)])
    mass = random.uniform(0.3, 3.0, len(place))
    start = place * 1.003
    velocity = random.normal(size=place.shape) * 0.4 * GRAVITY * STEP  # slow enough for contacts that do not rebound
    corner.place(start, velocity, mass=mass)
    corner.solver.drift(corner.spheres, 0.0, STEP)
    end, after = (values[: len(place)] for values in corner.spheres.read())
    assert np.abs(after - velocity).max() == 0.0  # gaps of 0.003 are beyond reach: nothing happens

    corner.place(place, velocity, mass=mass)
    corner.solver.drift(corner.spheres, 0.0, STEP)
    end, after = (values[: len(place)] for values in corner.spheres.read())
    columns = []
    closed = 2 * TOLERANCE * RADIUS
    for i in range(len(place)):
        normals = [(j, (place[i] - place[j]) / np.linalg.norm(place[i] - place[j])) for j in range(i)]
        for j, n in normals:
            gap = np.linalg.norm(place[i] - place[j]) - 2 * RADIUS + n @ ((after[i] - after[j]) * STEP)
            assert gap > -closed
            if gap < closed:
                column = np.zeros_like(place)
                column[i], column[j] = n / np.sqrt(mass[i]), -n / np.sqrt(mass[j])
                columns.append(column.ravel())
        if end[i, 1] - RADIUS < closed:
            column = np.zeros_like(place)
            column[i, 1] = 1 / np.sqrt(mass[i])
            columns.append(column.ravel())
    change = ((after - velocity) * np.sqrt(mass)[:, None]).ravel()
    _, residual = nnls(np.array(columns).T, change)
    assert len(columns) > 3 and residual < 1e-6 * np.linalg.norm(change)
    assert np.sum(mass[:, None] * after**2) < np.sum(mass[:, None] * velocity**2)


def test_the_result_does_not_depend_on_the_numbering_of_the_spheres(corner):
    random = np.random.default_rng(6)
    place = np.array([(4 + 1.1 * a + 0.5 * b, 0.6 + b * 1.02) for b in range(3) for a in range(3)])
    place += random.uniform(-0.02, 0.02, place.shape)
    corner.place(place)
    corner.run(100)
    first = corner.spheres.read()[0][:9]
    order = random.permutation(9)
    corner.place(place[order])
    corner.run(100)
    # Tolerances of a thousand drifts at most, in a pile that has hardly begun to amplify them.
    assert np.abs(corner.spheres.read()[0][:9] - first[order]).max() < 1e3 * TOLERANCE


SQUEEZED = [(10.0, 10.0), (10.9, 10.0), (11.8, 10.0)]  # nothing can take the sphere between out of both others


def test_a_sphere_without_room_is_named_with_what_presses_on_it(corner):
    corner.place(SQUEEZED, mass=[np.inf, 1.0, np.inf])
    corner.solver.drift(corner.spheres, 0.0, STEP)
    position, _ = corner.spheres.read()
    assert corner.solver.collect().unresolved > 0
    assert np.isfinite(position).all()
    message = corner.solver.failure(1)
    for part in ("particle 1 at [10.9, 10]", "particle 0", "particle 2", "0.2 of a radius", "compliance"):
        assert part in message
    assert "dt" not in message  # no step is short enough


def test_a_little_less_room_than_a_sphere_needs_presses_it_on_both_sides(corner):
    missing = 1e-5
    corner.place(
        [(10.0, 10.0), (11.0 - missing, 10.0), (12.0 - 2 * missing, 10.0)],
        [(0.0, 0.0), (0.3, 0.2), (0.0, 0.0)],
        mass=[np.inf, 1.0, np.inf],
    )
    corner.solver.drift(corner.spheres, 0.0, STEP)
    position, velocity = corner.spheres.read()
    assert corner.solver.collect().unresolved == 0
    # It stays where both overlap alike, or one of them by all that is missing; along y it slides on.
    assert abs(position[1, 0] - 11.0 + missing) < 1.01 * missing
    assert velocity[1, 1] == pytest.approx(0.2, rel=1e-4)


@pytest.mark.sampled(3)
def test_serial_and_parallel_agree(corner):
    random = np.random.default_rng(7)
    place = np.array([(4 + 1.1 * a + 0.5 * b, 0.6 + b * 1.02) for b in range(3) for a in range(3)])
    place += random.uniform(-0.02, 0.02, place.shape)
    other = Corner(parallel=True)
    for each in (corner, other):
        each.place(place, [(0.0, -1.0 + 0.1 * k) for k in range(9)])
        each.run(30)
    difference = np.abs(corner.spheres.read()[0] - other.spheres.read()[0])[:9].max()
    # The two stop after different numbers of iterations; an impact or two of each sphere enlarge that by a hundred each.
    assert difference < 1e4 * TOLERANCE
    first, second = corner.solver.collect(), other.solver.collect()
    assert (first.pair_count, first.wall_count) == (second.pair_count, second.wall_count) and second.pair_count > 0
    assert first.dissipated_energy == pytest.approx(second.dissipated_energy, rel=1e-6)


COMPLIANCE, LONG_STEP = 1e-3, 0.1


class Yielding(Corner):
    """The corner, with contacts that yield: each drift follows the kick it bears."""

    def __init__(self):
        super().__init__()
        self.solver = Resting(restitution=E, tolerance=TOLERANCE, compliance=COMPLIANCE)
        self.solver.bind(self.setup, self.spheres)

    def run(self, steps, *, gravity=(0.0, -GRAVITY)):
        """Kick, drift."""
        for k in range(steps):
            kick(self.spheres.velocity, ti.Vector(gravity) * LONG_STEP)
            self.solver.drift(self.spheres, k * LONG_STEP, LONG_STEP)


@pytest.fixture(scope="module")
def yielding(taichi):
    return Yielding()


@pytest.mark.sampled(3)
def test_a_column_yields_by_the_weight_that_each_contact_bears(yielding):
    """The overlap under k spheres is c k m g; they fall, rebound and come to rest there."""
    height = RADIUS + 1.05 * np.arange(COUNT) + 0.3
    yielding.place(np.column_stack([np.full(COUNT, 5.0), height]))
    # The softest way in which ten yield together has ω² = (π/21)²/c: implicit Euler takes it by 1/√(1 + ω² h²) = 0.9 in a step.
    yielding.run(600)
    position, velocity = yielding.spheres.read()
    overlap = COMPLIANCE * GRAVITY * np.arange(COUNT, 0, -1)
    expected = RADIUS + 2 * RADIUS * np.arange(COUNT) - np.cumsum(overlap)
    # What each contact may lack adds up over ten, and of the softest way 1/(π/21)² = 45 times that.
    assert np.abs(position[:, 1] - expected).max() < 45 * COUNT * TOLERANCE * RADIUS
    assert np.abs(velocity).max() < 45 * COUNT * TOLERANCE * RADIUS / LONG_STEP
    report = yielding.solver.collect()
    assert report.unresolved == 0 and report.pair_count > 0
    yielding.run(10)
    report = yielding.solver.collect()
    assert report.wall_impulse[0] == pytest.approx(COUNT * GRAVITY * 10 * LONG_STEP, rel=1e-6)
    assert report.largest_overlap == pytest.approx(COMPLIANCE * GRAVITY * COUNT / RADIUS, rel=1e-6)


@pytest.mark.sampled(3)
def test_a_compliance_lets_a_sphere_without_room_yield(yielding):
    """The remedy that the message for such a sphere names."""
    yielding.place(SQUEEZED, mass=[np.inf, 1.0, np.inf])
    yielding.run(10)
    assert yielding.solver.collect().unresolved == 0
    assert yielding.spheres.read()[0][1, 0] == pytest.approx(10.9, abs=1e-9)  # pressed from both sides alike


def test_an_impact_elsewhere_does_not_disturb_what_has_yielded(yielding):
    """A drift with impacts finds velocities and ways apart: both must leave the overlaps that bear the weight."""
    resting = COUNT - 2
    overlap = COMPLIANCE * GRAVITY * np.arange(resting, 0, -1)
    column = RADIUS + 2 * RADIUS * np.arange(resting) - np.cumsum(overlap)
    place = [*((5.0, height) for height in column), (20.0, 50.0), (21.05, 50.0)]
    yielding.place(place, [*([(0.0, 0.0)] * resting), (1.0, 0.0), (0.0, 0.0)])
    yielding.run(1)
    position, velocity = yielding.spheres.read()
    assert yielding.solver.collect().pair_count == 1
    assert velocity[resting + 1, 0] == pytest.approx((1 + E) / 2, rel=1e-9)
    assert np.abs(position[:resting, 1] - column).max() < 45 * COUNT * TOLERANCE * RADIUS
