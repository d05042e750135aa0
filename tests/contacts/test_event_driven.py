"""Event-driven hard spheres against exact solutions, and against their own backward runs."""

import numpy as np
import pytest
from event_runs import EventRun, box, plane
from reference import event_by_event

from mpp_taichi.contacts.events.queue import ABSENT, FIRST_BUCKET
from mpp_taichi.errors import StabilityError

ULP = 2.0**-52


@pytest.mark.sampled(3)
def test_galperin_billiard_counts_the_digits_of_pi():
    """A ball of 100^k times the mass of another drives it into a wall: ⌊π 10^k⌋ contacts (Galperin, 2003).

    Six billiards on lines far apart hit the same wall. The log is smaller than the number of contacts, so it fills on the way.
    """
    ratios = 100.0 ** np.arange(6)
    y = 10.0 * np.arange(6)
    position = np.concatenate([np.stack([np.ones(6), y], 1), np.stack([2 * np.ones(6), y], 1)])
    velocity = np.zeros((12, 2))
    velocity[6:, 0] = -1.0
    wall = plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    run = EventRun(position, velocity, 0.1, inverse_mass=np.r_[np.ones(6), 1 / ratios], surfaces=(wall,), log_capacity=10_000)
    report = run.to(100.0)
    log = run.solver.take_log()
    counts = np.bincount(log["i"] % 6, minlength=6)
    assert counts.tolist() == [3, 31, 314, 3141, 31415, 314159]
    assert report.pair_count + report.wall_count == counts.sum() and report.unresolved == 0
    assert (np.diff(log["time"]) >= 0).all()
    assert np.isclose(log["impulse"][log["j"] < 0].sum(), report.wall_impulse[0], rtol=1e-12)


def pairs(count, seed):
    """Couples in lanes far apart, in the middle of a cell of 30 each: one at rest or moving, the other aimed at it."""
    rng = np.random.default_rng(seed)
    centre = 30.0 * np.stack(np.meshgrid(*[np.arange(round(count ** (1 / 3)))] * 3, indexing="ij"), -1).reshape(-1, 3)
    radius = rng.uniform(0.1, 1.0, (2, count))
    mass = 10.0 ** rng.uniform(-6, 6, (2, count))
    reach = radius.sum(0)
    share = rng.uniform(0.0, 0.999, count)
    share[: count // 4] = 1 + rng.choice([-1e-9, 1e-9], count // 4)  # grazing, on both sides of a miss
    share[count // 4] = 0.0
    along = rng.normal(size=(count, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(along, rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1)[:, None]
    speed = rng.uniform(1.0, 2.0, count)
    common = rng.normal(size=(count, 3)) * rng.integers(0, 2, count)[:, None]
    position = np.stack([centre, centre - along * 4.0 + across * (share * reach)[:, None]])
    velocity = np.stack([common, common + along * speed[:, None]])
    return position, velocity, radius, mass, share


@pytest.mark.sampled(3)
def test_two_spheres_of_any_angle_mass_and_radius():
    """Δv = (2 m_other / (m + m_other)) (u · n) n at the exact time of impact, in long double; grazing to 1e-9 decides right."""
    count = 512
    position, velocity, radius, mass, share = pairs(count, seed=3)
    run = EventRun(position.reshape(-1, 3), velocity.reshape(-1, 3), radius.ravel(), inverse_mass=1 / mass.ravel())
    report = run.to(6.0)
    x, v = position.astype(np.longdouble), velocity.astype(np.longdouble)
    q, u, reach = x[1] - x[0], v[1] - v[0], radius.sum(0).astype(np.longdouble)
    a, b, c = (u * u).sum(1), (q * u).sum(1), (q * q).sum(1) - reach**2
    hit = b * b > a * c
    assert hit[: count // 4].any() and not hit[: count // 4].all()
    s = np.where(hit, c / (np.sqrt(np.where(hit, b * b - a * c, 0)) - b), 0)
    n = (q + u * s[:, None]) / reach[:, None]
    n[~hit] = 0
    total = mass.sum(0)
    change = (2 * (u * n).sum(1))[:, None] * n
    expected = np.stack([v[0] + change * (mass[1] / total)[:, None], v[1] - change * (mass[0] / total)[:, None]])
    found = run.velocity.reshape(2, count, 3)
    # The normal turns by the error of the place along the flight, which for a sideways error of the place is 1 / cos larger;
    # places are up to 250 from the origin and are rounded a few times.
    cosine = np.sqrt(np.maximum(1 - np.minimum(share, 1) ** 2, 1e-9))
    limit = 16 * 250 * ULP / (reach * cosine) * np.linalg.norm(u, axis=1) + 16 * ULP
    assert (np.abs(found - expected).max((0, 2)) < limit).all()
    assert np.array_equal(found[:, ~hit], velocity[:, ~hit])  # a miss changes nothing, not even a bit
    assert report.pair_count == hit.sum()


@pytest.mark.sampled(3)
def test_head_on_at_a_thousand_radii_per_step_and_far_from_where_the_cells_were_made():
    """Nothing tunnels, however fast; the grid has no end, so spheres meet as well 1e6 cells away."""
    position = np.array([[0.0, 0.0], [500.0, 0.0], [0.0, 40.0], [1.0, 40.0], [2.0, 44.0], [3.0, 47.0]])
    velocity = np.array([[1000.0, 0.0], [0.0, 0.0], [3.0, 0.0], [2.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    velocity[3] = [3.0 - 1e-6, 0.0]
    run = EventRun(position, velocity, np.r_[1.0, 1.0, np.full(4, 0.1)])
    report = run.to(1.0)
    assert report.pair_count == 1
    assert np.array_equal(run.velocity[:2], [[0.0, 0.0], [1000.0, 0.0]])
    assert run.position[:2, 0].tolist() == pytest.approx([498.0, 1002.0], abs=1e-9)
    report = run.to(1e6)  # a gap of 0.8 closes at 1e-6 within 8e5, by then 2.4e6 from the start
    assert report.pair_count == 1
    assert np.allclose(run.velocity[2:4, 0], [3.0 - 1e-6, 3.0], rtol=0, atol=4 * ULP * 3)


@pytest.mark.sampled(3)
def test_contacts_at_one_time_come_in_the_order_of_the_scene():
    """Wherever the spheres are, and so whatever cells they are in: five head-on pairs, and a ball between two at once."""
    for way in (1, -1):
        lane = np.repeat(1.5 * np.arange(5)[::way], 2)
        position = np.stack([np.tile([-3.0, 3.0], 5), lane], 1)
        velocity = np.stack([np.tile([1.0, -1.0], 5), np.zeros(10)], 1)
        # In a last lane a ball at rest is first in the scene, and is met by the last two from either side.
        position = np.concatenate([[[0.0, -1.5]], position, [[-2.5 * way, -1.5], [2.5 * way, -1.5]]])
        velocity = np.concatenate([[[0.0, 0.0]], velocity, [[0.5 * way, 0.0], [-0.5 * way, 0.0]]])
        run = EventRun(position, velocity, 0.5, log_capacity=100)
        run.to(2.75)
        log = run.solver.take_log()
        assert log["time"].tolist() == [2.5] * 5
        assert [sorted(pair) for pair in zip(log["i"].tolist(), log["j"].tolist())] == [[k, k + 1] for k in range(1, 10, 2)]
        run.to(3.0)
        log = run.solver.take_log()
        assert (log["time"][0], {log["i"][0], log["j"][0]}) == (3.0, {0, 11})


def folded(x, side):
    """A point on a line, in a box 0 … side whose walls reflect."""
    x = np.mod(x, 2 * side)
    return np.where(x > side, 2 * side - x, x)


@pytest.mark.sampled(3)
def test_a_ball_in_a_box_follows_the_folding_formula():
    """Any speed, and corners, where two or three walls are hit at once."""
    side, r = np.array([3.0, 2.0, 1.5]), 0.1
    run = EventRun([[1.0, 1.0, 1.0]], [[0.0, 0.0, 0.0]], r, surfaces=box(*side))
    for x, v, end in (
        ([1.0, 0.7, 0.3], [123456.789, -98765.4321, 3.0], 0.01),
        ([0.7, 0.7, 0.7], [-1.0, -1.0, -1.0], 7.3),  # straight into the corner
        ([0.5, 0.5, 0.6], [-4.0, -4.0, 0.0], 7.3),  # into an edge
    ):
        report = run.start([x], [v]).to(end)
        free = np.array(x) + np.array(v) * end - r
        # Each bounce rounds the place to an ulp of 3 and the time to one of `end`, and these add along the way.
        limit = (report.wall_count + 1) * ULP * (4 * 3 + 2 * np.abs(v).max() * end)
        assert np.abs(run.position[0] - r - folded(free, side - 2 * r)).max() < limit
        assert np.array_equal(np.abs(run.velocity[0]), np.abs(v))
        assert report.largest_overlap * r < limit


@pytest.mark.sampled(3)
def test_against_all_pairs_with_unequal_spheres_and_a_piston():
    """Seven spheres, radii 1 : 30, between five walls at rest and one that comes nearer, contact by contact."""
    rng = np.random.default_rng(5)
    radius = np.array([0.6, 0.2, 0.2, 0.1, 0.05, 0.02, 0.02])
    mass = radius**3
    position = np.array([[1.0, 1, 1], [2.2, 1, 1], [1, 2.2, 1], [2.2, 2.2, 1], [1, 1, 2.2], [2.2, 1, 2.2], [2.2, 2.2, 2.2]])
    velocity = rng.normal(size=(7, 3))
    surfaces = list(box(3.0, 3.0, 3.0))
    surfaces[1] = plane((3.0, 0.0, 0.0), (-1.0, 0.0, 0.0), velocity=(-0.1, 0.0, 0.0))
    end = 4.0
    run = EventRun(position, velocity, radius, inverse_mass=1 / mass, surfaces=surfaces, log_capacity=64)
    run.to(end)
    log = run.solver.take_log()
    planes = [(np.array(s.point), np.array(s.direction), np.array(s.velocity)) for s in surfaces]
    x, v, expected = event_by_event.run(position, velocity, radius, mass, planes, end)
    near, _, _ = event_by_event.run(position + 1e-12, velocity, radius, mass, planes, end)
    assert len(log) == len(expected) > 30
    assert [(max(a, b), min(a, b)) for a, b in zip(log["i"], log["j"])] == [(i, j) for _, i, j in expected]
    assert np.abs(log["time"] - [t for t, _, _ in expected]).max() < 1e-11
    # What a shift by 1e-12 grows to is what a hundred roundings may grow to.
    growth = np.abs(near - x).max()
    assert np.abs(run.position - x).max() < growth and np.abs(run.velocity - v).max() < 10 * growth


def cubic(count_per_side, packing):
    """A simple cubic lattice of spacing 1, and the radius that fills space so."""
    x = np.stack(np.meshgrid(*[np.arange(count_per_side) + 0.5] * 3, indexing="ij"), -1).reshape(-1, 3)
    return x, (packing * 6 / np.pi) ** (1 / 3) / 2


@pytest.mark.sampled(3)
def test_an_elastic_gas_is_reversible_and_samples_change_no_bit():
    """32 balls in a periodic box; the return error is within what the motion multiplies round-off by."""
    rng = np.random.default_rng(1)
    x = np.stack(np.meshgrid(*[np.arange(4) + 0.5] * 3, indexing="ij"), -1).reshape(-1, 3)[::2]
    v = rng.normal(size=(32, 3))
    run = EventRun(x, v, 0.35, period=(4.0, 4.0, 4.0))
    end = 2.5
    report = run.to(end)
    there, speed = run.position, run.velocity
    assert report.pair_count > 50
    near = run.start(x + 1e-10 * rng.normal(size=x.shape), v)
    near.to(end)
    growth = np.abs(near.position - there).max() / 1e-10
    run.start(there, -speed).to(end)
    # Positions up to 4 are rounded at each of the contacts that a ball has on both ways.
    rounding = 2 * report.pair_count * 4 * ULP
    assert np.abs(run.position - x).max() < growth * rounding < 1e-6
    assert np.abs(run.velocity + v).max() < 10 * growth * rounding
    run.start(x, v)
    for k in range(1, 1001):
        run.to(end * k / 1000 if k < 1000 else end)
    assert np.array_equal(run.position, there) and np.array_equal(run.velocity, speed)
    assert abs(run.energy / (np.sum(v**2) / 2) - 1) < report.pair_count * ULP
    assert np.abs(run.velocity.sum(0) - v.sum(0)).max() < report.pair_count * 4 * ULP


@pytest.mark.sampled(3)
def test_prefetching_changes_no_bit(monkeypatch):
    """What is fetched early for large numbers of spheres is only fetched: a few move the same with and without."""
    rng = np.random.default_rng(7)
    x = np.stack(np.meshgrid(*[np.arange(20) + 0.5] * 2, indexing="ij"), -1).reshape(-1, 2)
    v = rng.normal(size=x.shape)
    found = []
    for fewest in (1, len(x) + 1):
        monkeypatch.setattr("mpp_taichi.contacts.events.lookahead.FEWEST", fewest)
        run = EventRun(x, v, 0.4, period=(20.0, 20.0, 0.0))
        report = run.to(1.0)
        around = run.solver.look_ahead.fetches.ring.to_numpy()
        assert report.pair_count > len(x) and (run.solver.look_ahead.last[None] > 1) == (fewest == 1)
        assert (len(np.unique(around)) > len(x) // 2) == (fewest == 1)
        found.append((run.position, run.velocity))
    assert all(np.array_equal(a, b) for a, b in zip(*found))


@pytest.mark.sampled(3)
def test_one_sphere_that_waits_for_ever_does_not_put_all_events_into_one_bucket():
    """It hardly moves in a dilute gas, and leaves its cell in a billion; the heap is to hold the events of the present."""
    rng = np.random.default_rng(3)
    x = np.stack(np.meshgrid(*[np.arange(4) * 2.0 + 1.0] * 3, indexing="ij"), -1).reshape(-1, 3)
    v = rng.normal(size=x.shape)
    v[0] = 1e-9
    run = EventRun(x, v, 0.05, period=(8.0, 8.0, 8.0))
    run.to(0.02)
    assert run.solver.queue.time.to_numpy().max() > 1e6
    assert run.solver.queue.heap_size[None] < len(x) // 4


@pytest.mark.sampled(3)
def test_an_event_waits_in_the_bucket_of_its_time_or_behind_the_window():
    """Else the order may still be right, but every event costs a look at all spheres."""
    rng = np.random.default_rng(5)
    x = np.stack(np.meshgrid(*[np.arange(10) + 0.5] * 2, indexing="ij"), -1).reshape(-1, 2)
    run = EventRun(x, rng.normal(size=x.shape), 0.3, period=(10.0, 10.0, 0.0))
    noted = 0
    for end in (1.0, 1.3, 1.7, 2.0):
        run.to(end)
        queue = run.solver.queue
        time, place = queue.time.to_numpy(), queue.place.to_numpy()
        assert queue.start[None] > 0.0 and queue.width[None] > 0.0
        passed = (time - queue.start[None]) / queue.width[None]  # in buckets
        bucket = FIRST_BUCKET - place
        in_bucket = (place != ABSENT) & (place < 0)
        noted += in_bucket.sum()
        assert time[in_bucket].max() < 1e5 * queue.width[None]  # rounding of times, 1e-16 of each, is 1e-11 of a bucket or less
        assert (np.abs(passed - bucket - 0.5)[in_bucket] <= 0.5 + 1e-10).all()
        assert (passed[place == ABSENT] > queue.bucket_count - 1e-10).all()
    assert noted > len(x), "in four windows, each of which begins with the events of most spheres"


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision, limit", [("f64", 1e-9), ("f32", 1e-5)])
def test_dense_packing_does_not_overlap(precision, limit):
    """Packing 0.49 in space: after twenty contacts of each sphere no two overlap, as seen from outside."""
    x, r = cubic(6, 0.49)
    rng = np.random.default_rng(2)
    run = EventRun(x, rng.normal(size=x.shape), r, period=(6.0, 6.0, 6.0), precision=precision)
    energy = run.energy
    contacts = 0
    for k in range(1, 9):
        report = run.to(0.04 * k)
        contacts += report.pair_count
        q = run.position[:, None].astype(float) - run.position
        q -= 6 * np.round(q / 6)
        nearest = np.linalg.norm(q, axis=2)[~np.eye(len(x), dtype=bool)].min()
        assert 1 - nearest / (2 * run.real(r)) < limit / 2 and report.largest_overlap < limit
    assert contacts > 10 * len(x)
    assert abs(run.energy / energy - 1) < contacts * (ULP if precision == "f64" else 2.0**-23)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision, limit", [("f64", 1e-9), ("f32", 1e-5)])
def test_dense_disks_do_not_overlap(precision, limit):
    """Packing 0.80 in the plane, from a triangular lattice."""
    columns, rows = 12, 14
    j, i = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    x = np.stack([i + 0.5 * (j % 2) + 0.25, (j + 0.5) * np.sqrt(0.75)], -1).reshape(-1, 2)
    period = (float(columns), rows * float(np.sqrt(0.75)), 0.0)
    r = float(np.sqrt(0.80 * period[0] * period[1] / (len(x) * np.pi)))
    rng = np.random.default_rng(2)
    run = EventRun(x, rng.normal(size=x.shape), r, period=period, precision=precision)
    contacts = 0
    for k in range(1, 11):
        report = run.to(0.1 * k)
        contacts += report.pair_count
        q = run.position[:, None].astype(float) - run.position
        q -= np.array(period[:2]) * np.round(q / np.array(period[:2]))
        nearest = np.linalg.norm(q, axis=2)[~np.eye(len(x), dtype=bool)].min()
        assert 1 - nearest / (2 * run.real(r)) < limit / 2 and report.largest_overlap < limit and report.unresolved == 0
    assert contacts > 15 * len(x)


@pytest.mark.sampled(3)
def test_a_large_sphere_among_many_small_ones_meets_all_of_them():
    """Radii 1 : 25 in a periodic box, cells made for the small ones: a contact that is missed would show as an overlap."""
    side, large = 12.0, 1.0
    x = np.stack(np.meshgrid(*[np.arange(24) * 0.5 + 0.25] * 2, indexing="ij"), -1).reshape(-1, 2)
    x = np.concatenate([x[np.linalg.norm(x - side / 2, axis=1) > large + 0.1], [[side / 2, side / 2]]])
    radius = np.r_[np.full(len(x) - 1, 0.04), large]
    rng = np.random.default_rng(6)
    v = rng.normal(size=x.shape)
    v[-1] = [1.0, 0.7]
    run = EventRun(x, v, radius, inverse_mass=1 / radius**2, period=(side, side, 0.0), log_capacity=1000)
    assert len(run.solver.cells.grid.big) == 1
    energy, contacts = run.energy, 0
    for k in range(1, 41):
        contacts += run.to(0.5 * k).pair_count
        q = run.position[:, None] - run.position
        gap = np.linalg.norm(q - side * np.round(q / side), axis=2) - radius - radius[:, None]
        assert gap[~np.eye(len(x), dtype=bool)].min() > -1e-9 * 0.04
    log = run.solver.take_log()
    assert (np.maximum(log["i"], log["j"]) == len(x) - 1).sum() > 100
    assert abs(run.energy / energy - 1) < contacts * ULP


def three_balls(contact_time=0.0):
    """Two lanes of three balls, the outer ones moving in; restitution just above and just below 7 − 4√3 = 0.0718."""
    position = [[-2.0, 0.0], [0.0, 0.0], [2.0, 0.0], [-2.0, 9.0], [0.0, 9.0], [2.0, 9.0]]
    velocity = [[1.0, 0.0], [0.0, 0.0], [-0.9, 0.0], [1.0, 0.0], [0.0, 0.0], [-0.9, 0.0]]
    table = [[0.08, 0.0], [0.0, 0.06]]
    return EventRun(
        position, velocity, 0.5, restitution=table, material=[0, 0, 0, 1, 1, 1], contact_time=contact_time, log_capacity=100
    )


@pytest.mark.sampled(3)
def test_inelastic_collapse_is_named_and_the_contact_time_ends_it():
    """Above 7 − 4√3 three balls part after few contacts, below they never do (McNamara and Young, Phys. Fluids A 4, 1992)."""
    run = three_balls()
    with pytest.raises(StabilityError, match=r"collapse.*particle [345] and particle [345].*contact_time"):
        run.to(10.0)
    assert run.solver.collect().unresolved == 1
    log = run.solver.take_log()
    assert 3 <= (log["i"] < 3).sum() < 20 and np.isfinite(run.position).all()
    run = three_balls(contact_time=1e-3)
    report = run.to(10.0)
    assert report.unresolved == 0 and report.elastic_count > 0
    assert (np.diff(run.velocity[3:, 0]) >= 0).all()


@pytest.mark.sampled(3)
def test_a_thousand_cooling_balls_lose_what_is_dissipated():
    """Restitution 0.9, a million contacts; what is missing is what contacts took.

    By then 10⁻⁵⁰ of the energy would be left, and rounding of the common motion more than that. As a gas of hard spheres
    knows no scale of time, it is taken faster, and to rest as a whole, again and again.
    """
    position, r = cubic(10, 0.2)
    velocity = np.random.default_rng(4).normal(size=position.shape)
    run = EventRun(position, velocity, r, period=(10.0, 10.0, 10.0), restitution=[[0.9]], contact_time=1e-6)
    contacts = 0
    while contacts < 1_000_000:
        velocity -= velocity.mean(axis=0)
        run.start(position, velocity / np.sqrt(np.mean(velocity**2)))
        before = run.energy
        report = run.to(200.0)
        position, velocity = run.position, run.velocity
        contacts += report.pair_count
        assert report.pair_count > 5e4 and report.unresolved == 0
        assert run.energy < 0.05 * before
        assert abs((before - run.energy) / report.dissipated_energy - 1) < report.pair_count * ULP
        assert report.largest_overlap < 1e-9


@pytest.mark.sampled(3)
def test_gravity_floor_and_held_spheres():
    """Balls on a floor and on a held ball bounce as the closed form says, and keep their energy over a thousand bounces."""
    g, r = 9.81, 0.25
    floor = plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    position = np.array([[0.0, 1.25], [5.0, 4.0], [5.0, 5.5], [10.0, 3.0], [11.0, 3.0]])
    velocity = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
    weight = np.ones((5, 3))
    weight[1] = 0.0
    run = EventRun(position, velocity, r, inverse_mass=weight, surfaces=(floor,), gravity=(0.0, -g, 0.0))
    # Two that fall together meet as if there were no gravity: at a distance of 0.5, after (1 − 0.5) / 2.
    run.to(0.3)
    assert np.allclose(run.velocity[3:, 0], [-1.0, 1.0], rtol=0, atol=4 * ULP)
    assert np.allclose(run.position[3:, 1], 3.0 - g * 0.3**2 / 2, rtol=0, atol=1e-14)
    bounces = 1000
    fall = np.sqrt(2 * 1.0 / g)
    end = 2 * fall * bounces
    position[3:] = [[100.0, 3.0], [110.0, 3.0]]
    report = run.start(position, np.zeros((5, 2))).to(end)
    assert np.array_equal(run.position[1], [5.0, 4.0]) and np.array_equal(run.velocity[1], [0.0, 0.0])
    # After whole periods both are at the top again; the period's rounding adds up over the bounces.
    assert abs(run.position[0, 1] - 1.25) < (bounces * 16 * ULP * end / fall) ** 2 + bounces * 16 * ULP
    assert abs(run.position[2, 1] - 5.5) < (bounces * 16 * ULP * end / fall) ** 2 + bounces * 16 * ULP
    energy = run.velocity[[0, 2], 1] ** 2 / 2 + g * (run.position[[0, 2], 1] - [0.25, 4.5])
    assert np.abs(energy / g - 1).max() < bounces * 16 * ULP
    assert report.largest_overlap < 1e-9


@pytest.mark.sampled(3)
def test_a_ball_in_a_round_cavity_follows_its_polygon():
    """Inside a sphere each chord is as long as the first, and a ball that grazes the wall goes round it."""
    from mpp_taichi.walls._base import Surface

    radius, r = 2.0, 0.5
    hole = Surface("sphere", (1.0, 1.0, 1.0), (0.0, 0.0, 1.0), radius, True, (0.0, 0.0, 0.0), 1.0, "hole")
    run = EventRun([[1.0, 1.0, 1.0]], [[0.0, 0.0, 0.0]], r, surfaces=(hole,), log_capacity=1000)
    reach = radius - r
    for angle in (np.pi / 2, np.pi / 3, 0.5, 0.01):  # of a chord with the wall
        x = np.array([1.0, 1.0 - reach, 1.0])
        v = np.array([np.cos(angle), np.sin(angle), 0.0])
        chord = 2 * reach * np.sin(angle)
        run.start([x], [v]).to(chord * 200.5)
        times = run.solver.take_log()["time"]
        # Each bounce turns the direction by a few roundings over the sine of the angle, and these add.
        limit = 200**2 * 8 * ULP / np.sin(angle) ** 2
        times = times[times > chord / 2]
        assert len(times) == 200
        assert np.abs(times / chord - np.arange(1, 201)).max() < limit
