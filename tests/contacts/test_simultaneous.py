"""Groups of touching spheres that are resolved together: exact outcomes, symmetry, numbering, and termination."""

import numpy as np
import pytest
import taichi as ti
from reference.reflections import resolve as reference_resolve
from spheres import Spheres, bound, plane, setup_of

from mpp_taichi.contacts.simultaneous import Simultaneous
from mpp_taichi.contacts.sweep.contact_group import ContactGroup
from mpp_taichi.contacts.sweep.reflections import Reflections
from mpp_taichi.contacts.sweep.sweep import sweep_in_groups
from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation

ROUND_OFF = 2.0**-52
THRESHOLD = 64 * ROUND_OFF  # relative approach that the solver takes for none
SPHERES = 500


@pytest.fixture
def fresh_runtime():
    """Not here: kernels are shared by the tests of this file."""


@pytest.fixture(scope="module", autouse=True)
def taichi():
    backends.start("cpu", "f64")
    yield
    backends.stop()


@ti.data_oriented
class Impact:
    """A group by itself, in two dimensions."""

    def __init__(self):
        self.group = ContactGroup(setup_of(np.ones(SPHERES), dimensions=2), 1500)
        self.reflections = Reflections(self.group)
        self.spheres = Spheres(np.zeros((SPHERES, 2)), np.zeros((SPHERES, 2)), 2)
        self.outcome = ti.Vector.field(2, int, shape=())

    @ti.kernel
    def _resolve(self, count: int):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.outcome[None] = self.reflections.resolve(self.spheres, count)

    def __call__(self, velocity, inverse_mass, pairs, normals, restitution):
        """Velocities after the impact, and the numbers of waves and of contacts that were given up."""
        n, m = len(velocity), len(pairs)
        self._fill(self.spheres.velocity, velocity)
        self._fill(self.group.inverse_mass, inverse_mass)
        self._fill(self.group.first, np.array([p[0] for p in pairs], np.int32))
        self._fill(self.group.second, np.array([p[1] for p in pairs], np.int32))
        self._fill(self.group.normal, normals)
        self._fill(self.group.restitution, restitution)
        self.group.hits.fill(0)
        with quick_compilation():
            self._resolve(m)
        waves, failed = self.outcome[None]
        return self.spheres.velocity.to_numpy()[:n], waves, failed

    @staticmethod
    def _fill(field, values):
        whole = np.zeros_like(field.to_numpy())
        whole[: len(values)] = values
        field.from_numpy(whole)


@pytest.fixture(scope="module")
def impact(taichi):
    return Impact()


def chain(n, incoming, *, mass=None, restitution=1.0):
    """Touching balls in a row along x, numbered along it, the first `incoming` of them at speed 1."""
    velocity = np.zeros((n, 2))
    velocity[:incoming, 0] = 1.0
    inverse_mass = np.ones((n, 2)) / (np.ones(n) if mass is None else np.asarray(mass))[:, None]
    normals = np.tile([-1.0, 0.0], (n - 1, 1))
    return velocity, inverse_mass, [(c, c + 1) for c in range(n - 1)], normals, np.full(n - 1, float(restitution))


def random_cluster(seed, n=14):
    """A patch of the triangular lattice with some mixed masses, velocities and restitutions, and one ball on a wall."""
    random = np.random.default_rng(seed)
    place = np.array([(a + 0.5 * b, b * np.sqrt(0.75)) for a in range(4) for b in range(4)])[:n]
    pairs = [(i, j) for i in range(n) for j in range(i) if np.linalg.norm(place[i] - place[j]) < 1.01]
    normals = np.array([place[i] - place[j] for i, j in pairs])
    on_floor = [i for i in range(n) if place[i, 1] < 0.1]
    pairs += [(i, -1) for i in on_floor]
    normals = np.vstack([normals, np.tile([0.0, 1.0], (len(on_floor), 1))])
    inverse_mass = np.repeat(1 / random.uniform(0.3, 3.0, n), 2).reshape(n, 2)
    inverse_mass[random.integers(n), 0] = 0.0  # one that is held along x
    velocity = random.normal(size=(n, 2)) * (inverse_mass > 0)
    return velocity, inverse_mass, pairs, normals


def energy(velocity, inverse_mass):
    return 0.5 * np.sum(np.where(inverse_mass > 0, velocity**2 / np.where(inverse_mass > 0, inverse_mass, 1), 0))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("n, incoming", [(5, 1), (5, 2), (5, 3), (50, 7), (500, 1), (500, 3)])
def test_as_many_balls_leave_a_cradle_as_come_in(impact, n, incoming):
    velocity, waves, failed = impact(*chain(n, incoming))
    expected = np.zeros((n, 2))
    expected[n - incoming :, 0] = 1.0
    # Each wave hands whole speeds on, 2 roundings in each of fewer than n + incoming waves.
    assert np.abs(velocity - expected).max() <= 2 * (n + incoming) * ROUND_OFF
    assert failed == 0 and waves == n  # n − 1 waves, and the look that finds nothing left


def test_restitution_in_a_cradle_is_that_of_one_contact_after_another(impact):
    e = 0.9
    velocity, _, failed = impact(*chain(3, 1, restitution=e))
    expected = [1.0, 0.0, 0.0]
    for left in (0, 1, 0):  # after the third collision the speeds grow along the row
        mean, half = (expected[left] + expected[left + 1]) / 2, e * (expected[left] - expected[left + 1]) / 2
        expected[left : left + 2] = mean - half, mean + half
    assert expected == sorted(expected)
    assert failed == 0 and np.abs(velocity[:, 0] - expected).max() < 8 * ROUND_OFF


@pytest.mark.parametrize("restitution, together", [(0.05, True), (0.10, False)])
def test_three_balls_stay_together_below_seven_minus_four_root_three(impact, restitution, together):
    velocity, waves, failed = impact(*chain(3, 1, restitution=restitution))
    spread = velocity[:, 0].max() - velocity[:, 0].min()
    # Below 7 − 4√3 = 0.0718 the contacts alternate without end, and only what counts as no approach is left.
    assert (spread <= 2 * THRESHOLD) == together
    assert failed == 0 and velocity[:, 0].sum() == pytest.approx(1.0, abs=8 * waves * ROUND_OFF)


def test_one_ball_on_two_that_touch(impact):
    velocity = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    normals = np.array([[-np.sqrt(0.75), -0.5], [-np.sqrt(0.75), 0.5], [0.0, 1.0]])
    after, _, failed = impact(velocity, np.ones((3, 2)), [(0, 1), (0, 2), (1, 2)], normals, np.ones(3))
    expected = np.array([[-0.2, 0.0], [0.6, np.sqrt(0.12)], [0.6, -np.sqrt(0.12)]])
    assert failed == 0 and np.abs(after - expected).max() < 8 * ROUND_OFF


def test_a_light_ball_between_a_heavy_one_and_a_wall_bounces_as_often_as_pi_has_it(impact):
    """Galperin's billiard with everything touching: 314 collisions at a mass ratio of 100²."""
    velocity = np.array([[1.0, 0.0], [0.0, 0.0]])
    inverse_mass = np.array([[1e-4, 1e-4], [1.0, 1.0]])
    normals = np.array([[-1.0, 0.0], [-1.0, 0.0]])
    after, _, failed = impact(velocity, inverse_mass, [(0, 1), (1, -1)], normals, np.ones(2))
    assert failed == 0 and impact.group.hits.to_numpy()[:2].sum() == 314
    assert energy(after, inverse_mass) == pytest.approx(energy(velocity, inverse_mass), rel=314 * 4 * ROUND_OFF)


@pytest.mark.parametrize("restitution", [0.0, 0.6, 1.0])
def test_random_clusters_agree_with_the_reference_whatever_the_numbering(impact, restitution):
    for seed in range(6):
        velocity, inverse_mass, pairs, normals = random_cluster(seed)
        m, n = len(pairs), len(velocity)
        e = np.full(m, restitution)
        after, waves, failed = impact(velocity, inverse_mass, pairs, normals, e)
        assert failed == 0
        # Rounding of one wave, times the waves; masses differ by a factor of 10 and parts are well conditioned.
        tolerance = 1e3 * ROUND_OFF * waves
        if restitution > 0:
            expected, _ = reference_resolve(velocity, inverse_mass, pairs, normals, e)
            assert np.abs(after - expected).max() < tolerance + 2 * THRESHOLD
        before, left = energy(velocity, inverse_mass), energy(after, inverse_mass)
        assert left <= before * (1 + tolerance)
        if restitution == 1.0:
            assert left == pytest.approx(before, rel=1e-12)
        assert min(np.dot(normals[c], after[i] - (after[j] if j >= 0 else 0)) for c, (i, j) in enumerate(pairs)) > -1e-12

        random = np.random.default_rng(seed + 100)
        number, order = random.permutation(n), random.permutation(m)
        other_velocity, other_mass = np.empty_like(velocity), np.empty_like(inverse_mass)
        other_velocity[number], other_mass[number] = velocity, inverse_mass
        turned = random.integers(2, size=m).astype(bool)
        other_pairs, other_normals = [], []
        for c in order:
            i, j = pairs[c]
            swap = turned[c] and j >= 0
            i, j = (j, i) if swap else (i, j)
            other_pairs.append((number[i], number[j] if j >= 0 else -1))
            other_normals.append(-normals[c] if swap else normals[c])
        other, _, failed = impact(other_velocity, other_mass, other_pairs, np.array(other_normals), e[order])
        assert failed == 0 and np.abs(other[number] - after).max() < tolerance


def test_disjoint_pairs_have_the_same_bits_in_any_order(impact):
    random = np.random.default_rng(4)
    velocity = random.normal(size=(40, 2))
    normals = random.normal(size=(20, 2))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    inverse_mass = np.repeat(random.uniform(0.1, 10, 40), 2).reshape(40, 2)
    pairs = [(2 * c, 2 * c + 1) for c in range(20)]
    after, _, _ = impact(velocity, inverse_mass, pairs, normals, np.ones(20))
    order = random.permutation(20)
    number = random.permutation(40)
    other_velocity, other_mass = np.empty_like(velocity), np.empty_like(inverse_mass)
    other_velocity[number], other_mass[number] = velocity, inverse_mass
    renumbered = [(number[pairs[c][1]], number[pairs[c][0]]) for c in order]
    other, _, _ = impact(other_velocity, other_mass, renumbered, -normals[order], np.ones(20))
    assert np.array_equal(other[number], after)


@pytest.mark.parametrize("restitution", [0.3, 1.0])
def test_a_jammed_ball_stops_and_the_group_ends(impact, restitution):
    """Between two walls that both touch it nothing can open: the ball keeps only its motion along them."""
    velocity = np.array([[1.0, 2.0]])
    normals = np.array([[1.0, 0.0], [-1.0, 0.0]])
    after, waves, failed = impact(velocity, np.ones((1, 2)), [(0, -1), (0, -1)], normals, np.full(2, restitution))
    assert failed == 0 and waves < 100
    assert abs(after[0, 0]) <= THRESHOLD * 2 and after[0, 1] == 2.0


# In time -------------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def table(taichi):
    """Sixteen balls of radius 1/2 in two dimensions, between four cushions."""
    cushions = [
        plane((-5, 0, 0), (1, 0, 0)),
        plane((8, 0, 0), (-1, 0, 0)),
        plane((0, -6, 0), (0, 1, 0)),
        plane((0, 6, 0), (0, -1, 0)),
    ]
    setup = setup_of(np.full(16, 0.5), dimensions=2, surfaces=cushions)
    return bound(Simultaneous(), setup, np.zeros((16, 2)), np.zeros((16, 2)))


def play(table, position, velocity, *, step, steps):
    solver, spheres = table
    spheres.write(position, velocity)
    for k in range(steps):
        solver.drift(spheres, k * step, step)
    return *spheres.read(), solver.collect()


@pytest.mark.sampled(3)
def test_a_break_stays_its_own_mirror_image_and_does_not_know_the_numbers(table):
    position = np.array([(-3.0, 0.0)] + [(np.sqrt(0.75) * c, r - c / 2) for c in range(5) for r in range(c + 1)])
    velocity = np.zeros((16, 2))
    velocity[0, 0] = 1.0
    after, speed, report = play(table, position, velocity, step=1.0, steps=30)
    assert (
        report.unresolved == 0 and report.pair_count > 28 and report.wall_count >= 8
    )  # the break, and more after the cushions
    mirror = after * [1.0, -1.0]
    assert max(np.abs(after - image).max(axis=1).min() for image in mirror) < 1e-12
    assert np.sum(speed**2) == pytest.approx(1.0, rel=1e-12)
    number = np.random.default_rng(2).permutation(16)
    other, _, _ = play(table, position[number], velocity[number], step=1.0, steps=30)
    # Round-off grows a hundredfold from one collision of a ball to its next; here each has had two or three.
    assert np.abs(other - after[number]).max() < 1e-11


def test_two_balls_meet_exactly_when_and_as_they_should(table):
    """Head-on at a thousand radii a step would pass through; here oblique, with the others out of the way."""
    others = np.array([(-4.4 + 1.05 * k, 5.0) for k in range(12)] + [(-4.4 + 1.05 * k, -5.0) for k in range(2)])
    position = np.vstack([[(-4.0, 0.0), (0.0, 0.6)], others])
    velocity = np.zeros((16, 2))
    velocity[0, 0] = 1.0
    after, speed, report = play(table, position, velocity, step=5.0, steps=1)
    normal = np.array([-0.8, -0.6])  # centres one apart, 0.6 of it across: at x = −0.8, after 3.2
    expected = [1.0, 0.0] - normal * normal[0]
    assert report.pair_count == 1 and report.largest_overlap < 8 * ROUND_OFF
    assert np.abs(speed[0] - expected).max() < 32 * ROUND_OFF
    assert np.abs(after[0] - ([-0.8, 0.0] + 1.8 * expected)).max() < 64 * ROUND_OFF


@pytest.mark.sampled(3)
def test_the_cell_grid_finds_the_same_groups_as_all_pairs(taichi):
    """Two racks far apart, each with its ball, on the grid; the groups grow by the spheres that touch them."""
    rack = [(np.sqrt(0.75) * c, r - c / 2) for c in range(4) for r in range(c + 1)]
    position = np.array([(-2.0, 0.0), *rack])
    position = np.vstack([position, position + [0.3, 20.0]])
    velocity = np.zeros_like(position)
    velocity[[0, 11], 0] = 1.0, 2.0
    outcomes = []
    for all_pairs in (True, False):
        spheres = Spheres(position, velocity, 2)
        sweep = sweep_in_groups(setup_of(np.full(22, 0.5), dimensions=2), spheres, event_limit=1000, all_pairs=all_pairs)
        with quick_compilation():
            for k in range(4):
                sweep.drift(k * 1.0, 1.0)
        outcomes.append((*spheres.read(), sweep.collect()))
        sweep.destroy()
    (place, speed, report), (other_place, other_speed, other_report) = outcomes
    assert report.unresolved == other_report.unresolved == 0
    assert report.pair_count == other_report.pair_count > 20
    # The same groups at the same instants, with other roundings; nobody collides more than a few times.
    assert np.abs(place - other_place).max() < 1e-11 and np.abs(speed - other_speed).max() < 1e-11
    assert np.sum(other_speed**2) == pytest.approx(5.0, rel=1e-13)


@pytest.mark.sampled(3)
def test_inelastic_collapse_ends_in_contact_and_none_above_the_threshold_does(taichi):
    """Two balls close in on one between them: below e = 7 − 4√3 = 0.0718 infinitely often in finite time."""
    solver, spheres = bound(
        Simultaneous(), setup_of(np.full(3, 0.5), dimensions=2, restitution=0.05), np.zeros((3, 2)), np.zeros((3, 2))
    )
    collisions = {}
    for e in (0.05, 0.10):
        solver.sweep.parts.bounce.restitution.fill(e)
        spheres.write([(0.0, 0.0), (1.3, 0.0), (2.7, 0.0)], [(1.0, 0.0), (0.0, 0.0), (-0.2, 0.0)])
        solver.drift(spheres, 0.0, 10.0)
        place, speed = spheres.read()
        report = solver.collect()
        assert report.unresolved == 0 and np.isfinite(place).all()
        assert speed[:, 0].sum() == pytest.approx(0.8, rel=1e-14)
        gaps = np.diff(place[:, 0]) - 1.0
        collisions[e] = report.pair_count
        if e == 0.05:
            # They stay within the gap up to which spheres count as touching, ε^(2/3) of a reach of 1.
            assert gaps.max() <= ROUND_OFF ** (2 / 3) and gaps.min() > -16 * ROUND_OFF
            assert np.ptp(speed[:, 0]) < 1e-12
        else:
            assert gaps.min() > 1e-4
    assert collisions[0.10] < 10 < collisions[0.05] < 100
