"""Swept contacts: every contact of a drift occurs at its exact time and in order, and no contact is missed."""

from dataclasses import replace

import numpy as np
import pytest
from reference.sequential_contacts import fly
from sphere_gases import Places, box, box_walls, gas, largest_overlap, setup_of

from mpp_taichi.contacts import swept as swept_module
from mpp_taichi.contacts.sweep.sweep import MOST_IN_ONE_THREAD, sweep_in_pairs
from mpp_taichi.contacts.swept import Swept
from mpp_taichi.device import backends
from mpp_taichi.walls._base import Enclosure

EPSILON = 2.0**-52
BOTH = pytest.mark.parametrize("all_pairs", [True, False], ids=["all pairs", "grid"])


def sweep_of(position, velocity, setup, *, all_pairs, event_limit=100_000):
    state = Places(position, velocity)
    return state, sweep_in_pairs(setup, state, event_limit=event_limit, all_pairs=all_pairs)


def swept(position, velocity, setup, h, *, steps=1, all_pairs=True, time=0.0):
    """Positions and velocities after `steps` drifts of h, and the report."""
    state, sweep = sweep_of(position, velocity, setup, all_pairs=all_pairs)
    for step in range(steps):
        sweep.drift(time + step * h, h)
    report = sweep.collect()
    assert report.unresolved == 0
    return *state.read(), report


def pairs_that_hit(impact, seed=2):
    """Pairs of spheres far from each other, of all mass ratios, radii and directions, that meet with the given b / δ.

    Returned with the velocities after the contact by Eq. 9, in 80-bit floats from the rounded start.
    """
    random = np.random.default_rng(seed)
    count = len(impact)
    side = int(np.ceil(count ** (1 / 3)))
    centre = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)[:count] * 12.0 - 6.0 * side
    along = random.normal(size=(count, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(along, random.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1)[:, None]
    radius = 10.0 ** random.uniform(-1.0, 0.0, (count, 2))
    reach = radius.sum(1)
    mass = 10.0 ** random.uniform(-6.0, 6.0, (count, 2))
    speed = random.uniform(1.0, 3.0, count)[:, None]
    drift = random.normal(size=(count, 3)) * 0.3
    x_i = centre
    x_j = centre + 3.0 * along + (impact * reach)[:, None] * across
    position = np.concatenate([x_i, x_j])
    velocity = np.concatenate([drift, drift - speed * along])
    x, v = position.astype(np.longdouble), velocity.astype(np.longdouble)
    d, u = x[count:] - x[:count], v[count:] - v[:count]
    a, b, c = (u * u).sum(1), (d * u).sum(1), (d * d).sum(1) - radius.astype(np.longdouble).sum(1) ** 2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    n = d + u * (c / (root - b))[:, None]
    n /= np.sqrt((n * n).sum(1))[:, None]
    impulse = (-2.0 * (u * n).sum(1) / (1.0 / mass.astype(np.longdouble)).sum(1))[:, None] * n
    after = np.concatenate([v[:count] - impulse / mass[:, :1], v[count:] + impulse / mass[:, 1:]])
    return position, velocity, radius.T.ravel(), mass.T.ravel(), after.astype(float)


@BOTH
@pytest.mark.sampled(3)
def test_two_spheres_at_any_angle_mass_and_radius(all_pairs):
    """Eq. 9 at the exact time.

    Coordinates up to 60 round the separation by 60 ε √3 · 4, which relative to δ ≥ 0.2 turns n by 2100 ε, and by
    1 / √(1 − (b/δ)²) < 7.1 times that where the impact is oblique. The velocity turns twice as far, by at most 2·4 in size.
    """
    backends.start("cpu", "f64", threads=2)
    impact = np.random.default_rng(1).uniform(0.0, 0.99, 300)
    position, velocity, radius, mass, expected = pairs_that_hit(impact)
    _, found, report = swept(position, velocity, setup_of(radius, mass), 4.0, all_pairs=all_pairs)
    assert report.pair_count == 300
    assert np.abs(found - expected).max() < 2100 * 7.1 * 8 * EPSILON


@BOTH
@pytest.mark.sampled(3)
def test_grazing_contacts_are_told_from_misses(all_pairs):
    """b = δ (1 ± 1e-9): a hit or not by the digits. A miss changes no bit; a hit bounces once and keeps the energy."""
    backends.start("cpu", "f64", threads=2)
    impact = np.where(np.arange(200) % 2 == 0, 1.0 - 1e-9, 1.0 + 1e-9)
    position, velocity, radius, _, _ = pairs_that_hit(impact)
    _, found, report = swept(position, velocity, setup_of(radius), 4.0, all_pairs=all_pairs)
    assert report.pair_count == 100
    changed = (found != velocity).any(axis=1).reshape(2, -1)
    assert not changed[:, 1::2].any() and changed[:, ::2].all()
    assert abs((found**2).sum() - (velocity**2).sum()) <= 8 * EPSILON * (velocity**2).sum()


@BOTH
@pytest.mark.sampled(3)
def test_nothing_tunnels_at_a_thousand_radii_a_step(all_pairs):
    """A ball hits one at rest after 997.5 of 1000 radii, which takes over its velocity; both move along x alone."""
    backends.start("cpu", "f64", threads=2)
    position = np.array([[-999.5, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 50.0, 0.0]])
    velocity = np.array([[1000.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    x, v, report = swept(position, velocity, setup_of(np.ones(3)), 1.0, all_pairs=all_pairs)
    assert report.pair_count == 1
    assert (v == velocity[[1, 0, 2]]).all()
    assert np.abs(x - [[-2.0, 0.0, 0.0], [2.5, 0.0, 0.0], [0.0, 50.0, 0.0]]).max() < 4 * 1000 * EPSILON


@pytest.mark.sampled(2)
@BOTH
def test_a_coordinate_between_walls_is_a_triangle_wave_at_any_speed(all_pairs):
    """Between walls a coordinate is a triangle wave. Each of up to some 7000 bounces rounds by a few ulps of the edge."""
    backends.start("cpu", "f64", threads=2)
    edges = np.array([7.0, 5.0, 3.0])
    start, velocity, radius = np.array([[2.0, 3.0, 1.0]]), np.array([[123456.789, -54321.0, 98765.4321]]), 0.25
    h = 0.1 if all_pairs else 1e-4  # a lone sphere on a grid goes by quarters of its radius
    x, v, report = swept(start, velocity, setup_of([radius], enclosure=box(edges)), h, all_pairs=all_pairs)
    room = (edges - 2 * radius).astype(np.longdouble)
    unfolded = (start - radius + velocity.astype(np.longdouble) * h) / room
    cells = np.floor(unfolded)
    expected = radius + room * np.where(cells % 2 == 0, unfolded - cells, 1 - (unfolded - cells))
    assert report.wall_count == np.abs(cells).sum()
    # A bounce at the wrong time by one rounding of 0.1 moves the ball by ε · 0.1 · 123456.
    assert np.abs(x - expected).max() < 4 * report.wall_count * (7 + 0.1 * 123456.789) * EPSILON
    assert (v == velocity * np.where(cells % 2 == 0, 1, -1)).all()


@pytest.mark.sampled(2)
@BOTH
def test_a_ball_into_a_corner_comes_straight_back(all_pairs):
    backends.start("cpu", "f64", threads=2)
    edges = (4.0, 4.0, 4.0)
    x, v, report = swept([[2.0] * 3], [[1.0] * 3], setup_of([0.5], enclosure=box(edges)), 2.0, all_pairs=all_pairs)
    assert report.wall_count == 3
    assert (v == -1.0).all() and np.abs(x - 3.0).max() < 64 * EPSILON  # some thirty flights, two bounces


def condition(position, velocity, radius, mass, time, **where):
    """By how much a change of the start grows, from two runs of the reference."""
    moved = position + 1e-9 * np.random.default_rng(4).normal(size=position.shape)
    one, two = (fly(x, velocity, radius, mass, time, **where) for x in (position, moved))
    assert [c[1:] for c in one[2]] == [c[1:] for c in two[2]]
    return one, max(np.abs(one[0] - two[0]).max(), np.abs(one[1] - two[1]).max()) / 1e-9


@pytest.mark.sampled(3)
@BOTH
@pytest.mark.parametrize("steps", [1, 40])
def test_a_gas_follows_the_reference_through_some_ten_contacts_each(all_pairs, steps):
    """27 balls of unlike masses in a box: all contacts of the reference, in one drift or in forty.

    What each contact rounds, some 8 ulps of the edge, grows as a change of the start does, at most.
    """
    backends.start("cpu", "f64", threads=2)
    position, velocity, edges = gas(3, 0.2)
    radius, mass = np.random.default_rng(3).uniform(0.6, 1.0, 27), np.random.default_rng(3).uniform(0.5, 2.0, 27)
    (x, v, contacts), growth = condition(position, velocity, radius, mass, 6.0, walls=box_walls(edges))
    setup = setup_of(radius, mass, enclosure=box(edges))
    x_found, v_found, report = swept(position, velocity, setup, 6.0 / steps, steps=steps, all_pairs=all_pairs)
    tolerance = growth * len(contacts) * 8 * edges[0] * EPSILON
    assert report.pair_count == sum(j >= 0 for _, _, j in contacts) > 100
    assert report.wall_count == sum(j < 0 for _, _, j in contacts)
    assert tolerance < 1e-3
    assert max(np.abs(x_found - x).max(), np.abs(v_found - v).max()) < tolerance


@pytest.mark.sampled(2)
@BOTH
def test_fast_balls_of_a_box_that_repeats_meet_every_image(all_pairs):
    """Speeds of several periods a drift, so that the nearest image changes on the way."""
    backends.start("cpu", "f64", threads=2)
    random = np.random.default_rng(8)
    period = (9.0, 8.0)
    position = np.array([[1.0, 1.0], [4.0, 5.0], [7.0, 3.0], [3.5, 2.0]])
    velocity = random.normal(size=(4, 2)) * 10.0
    radius = np.array([1.0, 1.3, 0.8, 1.2])
    (x, v, contacts), growth = condition(position, velocity, radius, np.ones(4), 2.4, period=period)
    enclosure = Enclosure(period=(*period, 0.0))
    x_found, v_found, report = swept(
        position, velocity, setup_of(radius, dimensions=2, enclosure=enclosure), 2.4, all_pairs=all_pairs
    )
    shift = (x_found - x) / period
    assert report.pair_count == len(contacts) > 8
    tolerance = growth * len(contacts) * 8 * 20.0 * EPSILON
    assert tolerance < 1e-3
    assert np.abs(v_found - v).max() < tolerance
    # The reference keeps the image that hit, so that positions agree as they are.
    assert np.abs(shift).max() * max(period) < tolerance


@pytest.mark.sampled(3)
def test_what_a_bullet_throws_out_is_followed_beyond_its_margin():
    """A heavy fast sphere among light ones at rest, which leave at twice its speed: farther than partners were looked for."""
    backends.start("cpu", "f64", threads=2)
    position, velocity, edges = gas(6, 0.2)
    velocity[:] = 0.0
    mass = np.ones(len(position))
    velocity[0], mass[0] = [60.0, 59.0, 57.0], 1e4
    setup = setup_of(np.ones(len(position)), mass, enclosure=box(edges))
    x, v, report = swept(position, velocity, setup, 0.06, all_pairs=True)
    x_grid, v_grid, of_grid = swept(position, velocity, setup, 0.06, all_pairs=False)
    assert report.pair_count == of_grid.pair_count > 10
    assert np.linalg.norm(v, axis=1).max() > 1.5 * 102.0  # a margin for 1.25 times the fastest does not do
    # Some tens of contacts of spheres in free space: each multiplies errors by a few.
    assert max(np.abs(x - x_grid).max(), np.abs(v - v_grid).max()) < 1e-9


@pytest.mark.parametrize(("h", "steps"), [(0.1, 5), (0.02, 12)], ids=["partners anew", "partners kept"])
def test_the_bits_do_not_depend_on_the_threads_nor_on_chance(h, steps):
    position, velocity, edges = gas(10, 0.3)
    results = set()
    for threads in (1, 3):
        backends.start("cpu", "f64", threads=threads)
        setup = setup_of(np.ones(len(position)), enclosure=Enclosure(period=edges))
        x, v, report = swept(position, velocity, setup, h, steps=steps, all_pairs=False)
        assert report.pair_count > 200
        results.add((x.tobytes(), v.tobytes(), report))
        backends.stop()
    assert len(results) == 1


def count_builds(sweep, built):
    """Have the sweep note in `built` each time its grid is built."""
    build = sweep.parts.grid.build
    sweep.parts.grid.build = lambda *given: (built.append(1), build(*given))


@pytest.mark.sampled(3)
def test_partners_that_are_kept_change_no_bit_of_the_motion():
    """On a lattice with velocities along x at first, where spheres are hit from both sides at one time; then all are kicked."""
    backends.start("cpu", "f64", threads=2)
    position = np.stack(np.meshgrid(*[np.arange(7) * 2.5] * 3, indexing="ij"), -1).reshape(-1, 3)
    velocity = np.round(np.random.default_rng(6).normal(size=(343, 3))) * [1.0, 0.0, 0.0]
    mass = np.random.default_rng(5).integers(1, 4, 343)
    kick = np.random.default_rng(7).normal(size=velocity.shape)
    results, builds = set(), []
    for forgets in (False, True):
        state, sweep = sweep_of(
            position, velocity, setup_of(np.ones(343), mass, enclosure=Enclosure(period=(17.5,) * 3)), all_pairs=False
        )
        built = []
        count_builds(sweep, built)
        for step in range(32):
            if forgets:
                sweep.forget()
            sweep.drift(step / 64, 1 / 64)
            if step == 24:
                state.write(state.read()[0], state.read()[1] + kick)
        report = sweep.collect()
        assert report.unresolved == 0 and report.pair_count > 100
        results.add(tuple(field.tobytes() for field in state.read()))
        builds.append(len(built))
    assert len(results) == 1
    assert 2 <= builds[0] <= 16 < 32 <= builds[1]


@pytest.mark.sampled(6)
def test_spheres_that_stay_in_their_slots_move_bit_for_bit_as_those_taken_from_the_state():
    """Nothing else moves them: looked at now and then, kicked once with a word to the solver; one drift is of pieces."""
    backends.start("cpu", "f64", threads=2)
    position, velocity, edges = gas(8, 0.3)
    kick = np.random.default_rng(7).normal(size=velocity.shape)
    results, reports, builds = [], [], []
    for stays in (False, True):
        setup = setup_of(np.ones(512), contact_time=1e-6, restitution=0.9, enclosure=Enclosure(period=edges))
        state, sweep = sweep_of(position, velocity, replace(setup, force_free=stays), all_pairs=False)
        seen, built = [], []
        count_builds(sweep, built)
        for step in range(30):
            before = state.read()[0]
            sweep.drift(step * 0.02, 0.02 if step != 20 else 2.0)
            assert (state.read()[0] == before).all() == stays
            if step in (0, 1, 7, 12, 19, 20, 29):
                sweep.write_back()
                seen.append([field.tobytes() for field in state.read()])
            if step == 12:
                state.write(state.read()[0], state.read()[1] + kick)
                sweep.forget()
        results.append(seen)
        reports.append(sweep.collect())
        builds.append(len(built))
    assert results[0] == results[1]
    assert reports[0].pair_count == reports[1].pair_count > 1000 and reports[0].elastic_count == reports[1].elastic_count
    # Sums of so many numbers of one sign, in another order.
    assert reports[0].virial == pytest.approx(reports[1].virial, rel=reports[0].pair_count * EPSILON)
    assert builds[0] == builds[1] < 40


@pytest.mark.sampled(3)
def test_contacts_at_one_time_come_by_number_wherever_the_spheres_are():
    """A sphere is hit from both sides at once; with unlike masses the order matters, and 0 comes before 2."""
    backends.start("cpu", "f64", threads=2)
    position = np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-3.0, 0.0, 0.0]])
    velocity = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    mass = np.array([1.0, 2.0, 4.0])
    ways = [swept(position, velocity, setup_of(np.ones(3), mass), 1.5, all_pairs=all_pairs)[1] for all_pairs in (True, False)]
    mirrored = swept(-position, -velocity, setup_of(np.ones(3), mass), 1.5, all_pairs=False)[1]
    assert ways[0] == pytest.approx(ways[1], abs=8 * EPSILON)
    assert -ways[0] == pytest.approx(mirrored, abs=8 * EPSILON)


@pytest.mark.sampled(3)
def test_spheres_that_are_put_elsewhere_between_drifts_are_noticed():
    """All change places, without a word to the solver."""
    backends.start("cpu", "f64", threads=2)
    position, velocity, edges = gas(8, 0.3)
    setup = setup_of(np.ones(512), enclosure=Enclosure(period=edges))
    state, sweep = sweep_of(position, velocity, setup, all_pairs=False)
    for step in range(20):
        sweep.drift(0.03 * step, 0.03)
    assert sweep.parts.candidates.is_listed
    sweep.collect()
    position, velocity = state.read()
    state.write(position[::-1], velocity)
    other, fresh = sweep_of(position[::-1], velocity, setup, all_pairs=False)
    for solver in (sweep, fresh):
        solver.drift(0.0, 0.03)
    assert sweep.collect().pair_count == fresh.collect().pair_count > 5
    assert [field.tobytes() for field in state.read()] == [field.tobytes() for field in other.read()]


@pytest.mark.parametrize(("precision", "limit"), [("f64", 1e-9), ("f32", 1e-5)])
@pytest.mark.sampled(3)
def test_a_dense_gas_does_not_overlap(precision, limit):
    """Packing 0.49, 500 spheres on a close-packed lattice that melts; overlaps looked for in NumPy after every step."""
    backends.start("cpu", precision, threads=2)
    edge = (4.0 * np.pi / 3.0 * 500 / 0.49) ** (1 / 3)
    corners = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    base = np.array([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]])
    position = (corners[:, None, :] + base).reshape(-1, 3) * edge / 5
    velocity = np.random.default_rng(9).normal(size=position.shape)
    setup = setup_of(np.ones(500), enclosure=Enclosure(period=(edge,) * 3))
    state, sweep = sweep_of(position, velocity, setup, all_pairs=False)
    energy = (state.read()[1] ** 2).sum()
    worst = -1.0
    for step in range(15):
        sweep.drift(0.1 * step, 0.1)
        worst = max(worst, largest_overlap(state.read()[0], np.ones(500), (edge,) * 3))
    report = sweep.collect()
    assert report.unresolved == 0 and report.pair_count > 4000
    assert worst < limit and report.largest_overlap < limit
    unit = EPSILON if precision == "f64" else 2.0**-23
    assert abs((state.read()[1] ** 2).sum() / energy - 1.0) < 4 * np.sqrt(report.pair_count) * unit


@pytest.mark.sampled(2)
@BOTH
def test_inelastic_contacts_take_the_energy_that_is_reported(all_pairs):
    """Kinetic energy lost is the report's sum, the impulse on the walls is 2 m v each where e = 1."""
    backends.start("cpu", "f64", threads=2)
    position, velocity, edges = gas(3, 0.2)
    mass = np.random.default_rng(3).uniform(0.5, 2.0, 27)
    setup = setup_of(np.ones(27), mass, restitution=0.7, enclosure=box(edges, restitution=0.5))
    x, v, report = swept(position, velocity, setup, 0.5, steps=4, all_pairs=all_pairs)
    (xr, vr, contacts), growth = condition(position, velocity, np.ones(27), mass, 0.0, walls=box_walls(edges))
    lost = 0.5 * (mass[:, None] * (velocity**2 - v**2)).sum()
    assert report.pair_count > 20 and report.wall_count > 10
    assert report.dissipated_energy == pytest.approx(lost, rel=1e-12)


@pytest.mark.sampled(3)
def test_too_many_contacts_are_counted_and_a_contact_time_resolves_them():
    """Three balls on a line, e below 7 − 4√3 = 0.0718: infinitely many contacts in a finite time (inelastic collapse).

    Source: Bernu & Mazighi, J. Phys. A 23 (1990) 5745.
    """
    backends.start("cpu", "f64", threads=2)
    position = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [5.5, 0.0, 0.0]])
    velocity = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    for all_pairs in (True, False):
        state, sweep = sweep_of(position, velocity, setup_of(np.ones(3), restitution=0.01), all_pairs=all_pairs, event_limit=5)
        sweep.drift(0.0, 10.0)
        assert sweep.collect().unresolved >= 1
        assert np.isfinite(state.read()[0]).all()
        setup = setup_of(np.ones(3), restitution=0.01, contact_time=0.01)
        x, v, report = swept(position, velocity, setup, 10.0, all_pairs=all_pairs)
        assert report.elastic_count > 0
        assert largest_overlap(x, np.ones(3)) < 1e-12
        assert v.sum() == pytest.approx(0.0, abs=8 * EPSILON)


@pytest.mark.sampled(2)
@BOTH
def test_held_spheres_are_infinitely_heavy(all_pairs):
    """A ball comes back from a held one, and two held ones that move pass through each other."""
    backends.start("cpu", "f64", threads=2)
    position = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 9.0, 0.0], [5.0, 9.0, 0.0]])
    velocity = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    setup = setup_of(np.ones(4), held=[False, True, True, True])
    x, v, report = swept(position, velocity, setup, 4.0, all_pairs=all_pairs)
    assert report.pair_count == 1
    assert np.abs(v - [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-1, 0, 0]]).max() < 4 * EPSILON
    assert np.abs(x[0] - [2.0, 0.0, 0.0]).max() < 16 * EPSILON


@pytest.mark.sampled(3)
def test_the_component_binds_drifts_and_collects():
    backends.start("cpu", "f64", threads=2)
    solver = Swept(event_limit=10)
    state = Places(np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([[1.0, 0.0], [0.0, 0.0]]))
    solver.bind(setup_of(np.ones(2), dimensions=2), state)
    solver.drift(state, 0.0, 2.0)
    report = solver.collect()
    assert (report.pair_count, report.virial) == (1, 2.0)  # Δp = 1 over a distance of 2
    assert solver.collect().pair_count == 0
    assert np.allclose(state.read()[0], [[1.0, 0.0], [4.0, 0.0]], atol=1e-14)
    solver.destroy()


@pytest.mark.parametrize(
    ("on_cpu", "count", "in_pairs"),
    [(True, MOST_IN_ONE_THREAD + 1, True), (False, MOST_IN_ONE_THREAD, True), (False, MOST_IN_ONE_THREAD + 1, False)],
)
def test_one_thread_plays_all_spheres_of_a_cpu_and_few_spheres_of_another_device(on_cpu, count, in_pairs, monkeypatch):
    chosen = []
    monkeypatch.setattr(swept_module, "on_cpu", lambda: on_cpu)
    for name in ("sweep_in_pairs", "sweep_on_device"):
        monkeypatch.setattr(swept_module, name, lambda *places, name=name, **others: chosen.append(name))
    Swept().bind(setup_of(np.ones(count)), None)
    assert chosen == ["sweep_in_pairs" if in_pairs else "sweep_on_device"]


def test_a_period_too_short_for_its_spheres_is_refused():
    backends.start("cpu", "f64", threads=2)
    state = Places(np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="period of 3 is too short"):
        sweep_in_pairs(setup_of(np.ones(2), enclosure=Enclosure(period=(3.0, 0.0, 0.0))), state, event_limit=10)
