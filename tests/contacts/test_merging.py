"""Spheres that merge: the merged body has the mass, momentum and volume of both, at the exact time."""

import dataclasses
import json
import math

import numpy as np
import pytest
import rebound

from mpp_taichi import BackendError, SceneError, Simulation, StabilityError
from mpp_taichi.cli.main import main
from mpp_taichi.contacts.mergers import drift
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble
from mpp_taichi.views._base import Frame

UNIT = {"f32": 2.0**-24, "f64": 2.0**-53}


def spheres(bodies, *, integrator="leapfrog", dt=1.0, dimensions=3, duration=1.0, **others):
    return {
        "dimensions": dimensions,
        "particles": [{"body": body} for body in bodies],
        "contacts": {"hard_spheres": {"solver": "merging"}},
        "integrator": {integrator: {"dt": dt}},
        "run": {"duration": duration},
    } | others


def bodies_of(mass, radius, position, velocity):
    rows = zip(
        np.asarray(mass).tolist(), np.asarray(radius).tolist(), np.asarray(position).tolist(), np.asarray(velocity).tolist()
    )
    return [{"mass": m, "radius": r, "position": x, "velocity": v} for m, r, x, v in rows]


def cloud(count, dimensions, seed=3):
    """Spheres of unlike sizes in a box, none touching, on their way to its middle, which moves, where many of them meet."""
    random = np.random.default_rng(seed)
    places, radii = [], []
    while len(places) < count:
        x, r = random.uniform(-1, 1, 3), 0.35 * random.uniform(0.3, 1.0) * count ** (-1 / dimensions)
        x[dimensions:] = 0.0
        if all(np.linalg.norm(x - y) > r + s for y, s in zip(places, radii)):
            places.append(x)
            radii.append(r)
    velocity = 0.4 * random.normal(size=(count, 3)) * (np.arange(3) < dimensions) - np.array(places) + [2.0, 0, 0]
    mass = random.integers(1, 5, count).astype(float)  # some are equal
    return mass, np.array(radii), np.array(places), velocity


def merged_by_hand(mass, radius, position, velocity, h, dimensions):
    """Event by event in NumPy: (time, survivor, gone) of every merger within h, and what is left: index → (m, r, x, v)."""
    there = {i: (m, r, x.copy(), v.copy()) for i, (m, r, x, v) in enumerate(zip(mass, radius, position, velocity))}
    now, events = 0.0, []
    while True:
        best = (math.inf, -1, -1)
        for i in there:
            for j in there:
                if i < j:
                    q, u = there[j][2] - there[i][2], there[j][3] - there[i][3]
                    reach = there[i][1] + there[j][1]
                    a, b, c = u @ u, q @ u, q @ q - reach**2
                    t = 0.0 if c < -1e-9 else math.inf
                    if c >= -1e-9 and b < 0.0 and b * b > a * c:
                        t = max((-b - math.sqrt(b * b - a * c)) / a, 0.0)
                    best = min(best, (t, i, j))
        if now + best[0] > h:
            break
        t, i, j = best
        for k, (m, r, x, v) in there.items():
            there[k] = (m, r, x + v * t, v)
        now += t
        s, g = (i, j) if mass_order(there, i, j) else (j, i)
        (m, r, x, v), (n, q, y, w) = there[s], there.pop(g)
        there[s] = (
            m + n,
            (r**dimensions + q**dimensions) ** (1 / dimensions),
            (m * x + n * y) / (m + n),
            (m * v + n * w) / (m + n),
        )
        events.append((now, s, g))
    return events, {k: (m, r, x + v * (h - now), v) for k, (m, r, x, v) in there.items()}


def mass_order(there, i, j):
    return (there[i][0], -i) > (there[j][0], -j)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", UNIT)
@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_merger_keeps_mass_momentum_volume_and_centre_of_mass(dimensions, precision):
    mass, radius = np.array([0.7, 3.1]), np.array([0.3, 0.2])
    start = np.array([[-1.0, 0.1, 0.0], [1.0, -0.2, 0.1]]) * (np.arange(3) < dimensions)
    velocity = np.array([[2.0, 0.3, 0.1], [-1.5, 0.2, -0.2]]) * (np.arange(3) < dimensions)
    for order in ([0, 1], [1, 0]):
        bodies = bodies_of(mass[order], radius[order], start[order], velocity[order])
        scene = spheres([body | {"charge": q} for body, q in zip(bodies, (0.25, 0.5))], dimensions=dimensions)
        with Simulation(scene, backend="cpu", precision=precision) as run:
            after, report = run.run().snapshot(), run.contact_report
        s, g = order.index(1), order.index(0)  # the heavier one goes on, whatever its number
        # Numbers of a few units go through some ten operations each.
        near = {"rtol": 0, "atol": 16 * UNIT[precision]}
        assert after.merged_into.tolist() == [s if k == g else -1 for k in range(2)]
        assert after.mass[s] == pytest.approx(mass.sum(), abs=4 * UNIT[precision])
        assert after.radius[s] ** dimensions == pytest.approx((radius**dimensions).sum(), rel=16 * UNIT[precision])
        assert np.allclose(after.mass[s] * after.velocity[s], mass @ velocity, **near)
        assert np.allclose(after.position[s], mass @ (start + velocity) / mass.sum(), **near)
        u = velocity[1] - velocity[0]
        assert report.dissipated_energy == pytest.approx(0.5 * mass.prod() / mass.sum() * (u @ u), rel=16 * UNIT[precision])
        assert (report.merge_count, report.pair_count, report.wall_count, report.unresolved) == (1, 1, 0, 0)
        assert after.charge[s] == 0.75 and after.mass[g] == after.radius[g] == after.charge[g] == 0.0
        assert not after.velocity[g].any() and not after.free[g].any()


@pytest.mark.sampled(3)
@pytest.mark.parametrize("integrator", ["leapfrog", "symplectic_euler", "velocity_verlet"])
def test_fast_spheres_that_meet_merge_and_spheres_that_miss_do_not(integrator):
    """Two drift through each other's place by 10⁵ radii in a step; a pair that misses by 10⁻⁹ of a radius stays two."""
    reach, miss = 0.02, 1e-9 * 0.01
    pair = lambda y, offset: bodies_of(  # noqa: E731
        [1.0, 1.0], [0.01, 0.01], [[-500, y, 0], [500, y + offset, 0]], [[1000, 0, 0], [-1000, 0, 0]]
    )
    scene = spheres(pair(0, reach - miss) + pair(10, reach + miss), integrator=integrator)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
    assert after.merged_into.tolist() == [-1, 0, -1, -1]
    assert after.position[0] == pytest.approx([0.0, (reach - miss) / 2, 0.0], abs=1e-12)  # 500 is rounded to 6e-14
    assert after.position[2] == pytest.approx([500.0, 10.0, 0.0], abs=1e-12)


@pytest.mark.sampled(3)
def test_a_chain_within_one_drift_goes_by_the_order_of_time(tmp_path):
    """A takes up B and then, slower, C; D crosses A's old way where A would have been, and the merged sphere comes too late."""
    names = [(1.0, 0.1, [0, 0, 0], [8, 0, 0]), (1.0, 0.1, [2.2, 0, 0], [0, 0, 0]), (2.0, 0.1, [5, 0, 0], [0, 0, 0])]
    decoy = (1.0, 0.1, [4, -4, 0], [0, 8, 0])  # at (4, 0) at t = 0.5, like A alone; A and B together are at 3.1 then
    scene = spheres(bodies_of(*zip(*[*names, decoy])), integrator="symplectic_euler")
    with Simulation(scene, backend="cpu", precision="f64", event_log=True) as run:
        after = run.run().snapshot()
        log = run.contacts.take_log()
    first = (2.2 - 0.2) / 8  # A touches B
    centre, together = (2.0 + 2.2) / 2, 0.1 * 2 ** (1 / 3)
    second = first + (5 - 0.1 - together - centre) / 4  # A and B, at half the speed, touch C
    # Times of some tenths, places of a few units: a few roundings.
    assert log["time"] == pytest.approx([first, second], abs=1e-14)
    assert (log["i"].tolist(), log["j"].tolist()) == ([0, 0], [1, 2])  # of the equal masses 2 and 2 the lower number goes on
    assert log["impulse"] == pytest.approx([0.5 * 8, 1.0 * 4], rel=1e-14)  # μ u
    assert after.merged_into.tolist() == [-1, 0, 0, -1] and after.mass.tolist() == [4.0, 0.0, 0.0, 1.0]
    assert after.position[0, 0] == pytest.approx((8 + 2.2 + 2 * 5) / 4, abs=1e-14)


@pytest.mark.sampled(6)
@pytest.mark.parametrize(("dimensions", "span"), [(2, 0.4), (3, 1.5)])
def test_a_cloud_merges_as_it_does_event_by_event(dimensions, span, monkeypatch):
    """Against NumPy, which moves everything from event to event; on the grid and on more threads to the same bits."""
    mass, radius, position, velocity = cloud(60, dimensions)
    bodies = bodies_of(mass, radius, position, velocity)
    scene = spheres(bodies, dimensions=dimensions, integrator="symplectic_euler", dt=span, duration=span)
    events, left = merged_by_hand(mass, radius, position, velocity, span, dimensions)
    assert len(events) > 15 and len({s for _, s, _ in events}) < len(events)  # some take part more than once
    bits = []
    for all_pairs_up_to, threads in ((500, 1), (0, 1), (0, 2)):
        monkeypatch.setattr(drift, "ALL_PAIRS_UP_TO", all_pairs_up_to)
        with Simulation(scene, backend="cpu", precision="f64", event_log=True, threads=threads) as run:
            after = run.run().snapshot()
            log = run.contacts.take_log()
        assert list(zip(log["i"], log["j"])) == [(s, g) for _, s, g in events]
        # A time is rounded like the separation it comes from, over the speed across it; grazing pairs lose half the digits.
        assert log["time"] == pytest.approx([t for t, _, _ in events], abs=1e-10)
        for k, (m, r, x, v) in left.items():
            assert after.mass[k] == m and after.radius[k] == pytest.approx(r, rel=1e-14)
            assert np.allclose(after.velocity[k], v, rtol=0, atol=1e-14) and np.allclose(
                after.position[k], x, rtol=0, atol=1e-13
            )
        assert np.flatnonzero(after.present).tolist() == sorted(left)
        bits.append((after.position.tobytes(), after.velocity.tobytes(), after.radius.tobytes(), log.tobytes()))
    assert len(set(bits)) == 1


@pytest.mark.sampled(3)
def test_a_list_without_room_cuts_the_drift_and_changes_nothing(monkeypatch):
    mass, radius, position, velocity = cloud(60, 2)
    scene = spheres(
        bodies_of(mass, radius, position, velocity), dimensions=2, integrator="symplectic_euler", dt=0.4, duration=0.4
    )
    events, left = merged_by_hand(mass, radius, position, velocity, 0.4, 2)
    monkeypatch.setattr(drift, "EVENTS_PER_SPHERE", 0)
    monkeypatch.setattr(drift, "SPARE_EVENTS", 5)
    with Simulation(scene, backend="cpu", precision="f64", event_log=True) as run:
        after = run.run().snapshot()
        log = run.contacts.take_log()
    assert list(zip(log["i"], log["j"])) == [(s, g) for _, s, g in events]
    for k, (_, _, x, _) in left.items():  # places are rounded once more in each piece
        assert np.allclose(after.position[k], x, rtol=0, atol=1e-13)


@pytest.mark.sampled(3)
def test_what_is_symmetric_merges_alike_whatever_the_numbers():
    """Three equal balls meet at one instant from both sides: the one left is at the middle, at rest, for every numbering."""
    places, speeds = [[-1.0, 0, 0], [0.0, 0, 0], [1.0, 0, 0]], [[1.0, 0, 0], [0.0, 0, 0], [-1.0, 0, 0]]
    for order in ([0, 1, 2], [1, 0, 2], [2, 0, 1]):
        scene = spheres(bodies_of([1.0] * 3, [0.1] * 3, [places[k] for k in order], [speeds[k] for k in order]), duration=2.0)
        with Simulation(scene, backend="cpu", precision="f64") as run:
            after = run.run().snapshot()
        (k,) = np.flatnonzero(after.present)
        assert k == 0 or after.mass[k] == 3.0  # the first two that merge outweigh the third
        assert after.mass[k] == 3.0 and np.abs(after.position[k]).max() < 1e-15 and np.abs(after.velocity[k]).max() < 1e-15


@pytest.mark.sampled(3)
def test_a_held_sphere_stays_and_a_held_axis_too():
    bodies = [
        {"mass": 5.0, "radius": 0.1, "position": [0, 0, 0], "velocity": [1, 0.5, 0]},
        {"mass": 1.0, "radius": 0.1, "position": [0.5, 0.2, 0], "free": False},
        {"mass": 5.0, "radius": 0.1, "position": [0, 5, 0], "velocity": [1, 0, 0]},
        {"mass": 1.0, "radius": 0.1, "position": [0.5, 5.1, 0], "free": [True, False, True]},
    ]
    with Simulation(spheres(bodies), backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
        assert after.merged_into.tolist() == [-1, 0, -1, 2]
        assert after.position[0].tolist() == [0.5, 0.2, 0.0] and not after.velocity[0].any() and not after.free[0].any()
        assert after.position[2, 1] == 5.1 and after.velocity[2, 0] == pytest.approx(5 / 6, abs=1e-15)
        assert after.position[2, 0] == pytest.approx((5 * 1.0 + 0.5) / 6, abs=1e-15) and after.free[2].tolist() == [
            True,
            False,
            True,
        ]
        lost = 0.5 * 5.0 * 1.25 + 0.5 * 5 / 6
        assert run.contact_report.dissipated_energy == pytest.approx(lost, rel=1e-15)
        again = run.run(duration=1.0).snapshot()
        assert again.position[0].tolist() == [0.5, 0.2, 0.0] and not run.phase.conserves_momentum


@pytest.mark.sampled(6)
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_gravity_after_a_merger_is_that_of_the_merged_body_alone(plan):
    """And what is gone is felt by nobody, even by a body at its very place: there 0 · 1/0 would be no number.

    One pair is in a full tile of eight bodies, the other in the five that are left.
    """
    random, count = np.random.default_rng(1), 13
    pair = [[0.5, 0.2, 0], [-0.1, 0.2, 0.3]]
    places, velocities = random.normal(size=(count - 4, 3)) * 2.0 + [0, 8, 0], 0.1 * random.normal(size=(count - 4, 3))
    position = np.concatenate([[[0.0, 0, 0], [0.25, 0, 0]], places, [[0, 16, 0], [0.25, 16, 0]]])
    velocity = np.concatenate([pair, velocities, pair])
    mass, radius = random.uniform(0.5, 2.0, count), np.full(count, 0.1)
    mass[[0, 1, -2, -1]] = 0.6, 1.5, 1.6, 0.7
    forces = [{"newtonian_gravity": {"strength": 1.0}}, {"linear_drag": {"coefficient": 0.1}}]
    scene = spheres(bodies_of(mass, radius, position, velocity), integrator="velocity_verlet", dt=0.01, forces=forces)
    with Simulation(scene, backend="cpu", precision="f64", plan=plan) as run:
        start = run.run(steps=40).snapshot()
        gone, kept = np.flatnonzero(~start.present), np.flatnonzero(start.present)
        assert gone.tolist() == [0, 12]
        after = run.run(steps=60).snapshot()
        assert (after.position[gone] == start.position[gone]).all() and not after.velocity[gone].any()
        mechanics = run.mechanics()
    rows = [getattr(start, key)[kept] for key in ("mass", "radius", "position", "velocity")]
    alone = spheres(bodies_of(*rows), integrator="velocity_verlet", dt=0.01, forces=forces)
    # Sums are taken in another order: 60 steps of a rounding each of places up to 20, doubled by the motion at most.
    tolerance = 2 * 60 * 20 * UNIT["f64"]
    with Simulation(alone, backend="cpu", precision="f64", plan=plan) as run:
        expected = run.run(steps=60).snapshot()
        assert np.allclose(after.position[kept], expected.position, rtol=0, atol=tolerance)
        assert mechanics["total_energy"] == pytest.approx(run.mechanics()["total_energy"], rel=1e-13)
    for companions in ([0, -1], [-1, 0]):  # each with one of its own tile, and with one of the other
        start.position[gone] = start.position[kept[companions]]
        with Simulation(scene, backend="cpu", precision="f64", plan=plan, start=start) as run:
            assert math.isfinite(run.mechanics()["total_energy"])
            coincident = run.run(steps=60).snapshot()
            assert np.allclose(coincident.position[kept], expected.position, rtol=0, atol=tolerance)


def collapse(count=30, *, dt=0.01, **others):
    mass, radius, position, velocity = cloud(count, 2, seed=5)
    return spheres(
        bodies_of(mass / mass.sum(), radius, position, 0.3 * velocity),
        dimensions=2,
        integrator="velocity_verlet",
        dt=dt,
        forces=[{"newtonian_gravity": {"strength": 1.0}}],
        **others,
    )


@pytest.mark.sampled(3)
def test_a_saved_run_goes_on_bit_for_bit_and_a_restart_repeats(tmp_path):
    def bits(snapshot):
        return [getattr(snapshot, key).tobytes() for key in ("position", "velocity", "mass", "radius", "free", "merged_into")]

    with Simulation(collapse(), backend="cpu", precision="f64") as run:
        run.run(steps=40).snapshot().save(tmp_path / "half.npz")
        half = run.contact_report.merge_count
        mark = run.mark()
        run.run(steps=60)
        end, merged = run.snapshot(), run.contact_report.merge_count
        assert 0 < half < merged
        run.return_to(mark)
        assert bits(run.run(steps=60).snapshot()) == bits(end)
        run.restart()
        assert run.snapshot().present.all() and run.contact_report.merge_count == 0
        assert bits(run.run(steps=100).snapshot()) == bits(end)
    saved = Snapshot.load(tmp_path / "half.npz")
    with Simulation(collapse(), backend="cpu", precision="f64", start=saved) as run:
        assert bits(run.run(steps=60).snapshot()) == bits(end)
        assert run.contact_report.merge_count == merged - half


@pytest.mark.sampled(3)
def test_energy_balances_to_first_order_of_the_step():
    """K + U + what merging took − what it changed of U stays, but for what U changes on the way of a merger within a step."""
    residuals = []
    for dt in (0.01, 0.0025):
        bodies = bodies_of(
            [1.0, 2.0, 0.5], [0.1, 0.15, 0.1], [[0, 0, 0], [1, 0.1, 0], [0, 1.5, 0]], [[0.5, 0, 0], [0, 0, 0], [0, 0, 0.2]]
        )
        scene = spheres(bodies, integrator="velocity_verlet", dt=dt, forces=[{"newtonian_gravity": {"strength": 0.3}}])
        with Simulation(scene, backend="cpu", precision="f64") as run:
            run.keep_energy_balance()
            run.run()
            assert run.contact_report.merge_count == 1
            residuals.append(abs(run.diagnostics()["energy_balance_residual"]))
            # The pair's own energy −G m₁ m₂ / (r₁ + r₂) is gone; the third, far off, hardly notices.
            assert run.contact_report.potential_change == pytest.approx(0.3 * 2.0 / 0.25, rel=1e-2)
            # Within a step dt the pair falls by u dt under F = G m₁ m₂ / (r₁ + r₂)²; the other half of the step undoes as much.
            force, speed = 0.3 * 2.0 / 0.25**2, math.sqrt(2 * run.contact_report.dissipated_energy / (2 / 3))
            assert residuals[-1] < force * speed * dt


@pytest.mark.sampled(3)
def test_mergers_of_two_bodies_agree_with_rebound():
    """REBOUND notices a merger at the end of a step, so places differ by what a step does; masses, momenta, radii agree."""
    mass, radius = [1.0, 1e-3, 1e-4], [0.02, 0.05, 0.04]
    start = [[0.0, 0, 0], [1.0, 0, 0], [-1.0, 0.03, 0.01]]
    velocity = [[0.0, 0, 0], [0, 1.0, 0], [0, 1.0, 0]]  # one goes round the other way: they meet a quarter of a turn on
    dt = 0.001
    reference = rebound.Simulation()
    reference.integrator, reference.dt, reference.collision = "leapfrog", dt, "direct"
    reference.collision_resolve = "merge"
    for m, r, x, v in zip(mass, radius, start, velocity):
        reference.add(m=m, r=r, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    reference.integrate(3.0, exact_finish_time=0)
    with Simulation(
        spheres(
            bodies_of(mass, radius, start, velocity), dt=dt, duration=3.0, forces=[{"newtonian_gravity": {"strength": 1.0}}]
        ),
        backend="cpu",
        precision="f64",
    ) as run:
        after = run.run().snapshot()
    assert reference.N == 2 and after.present.tolist() == [True, True, False]
    other = reference.particles[1]
    assert after.mass[1] == pytest.approx(other.m, rel=1e-15) and after.radius[1] == pytest.approx(other.r, rel=1e-14)
    momentum = sum(p.m * np.array(p.vxyz) for p in reference.particles)
    assert np.allclose(after.mass @ after.velocity, momentum, rtol=0, atol=1e-15)
    # The centre of mass goes on as it did, whenever the two are joined; but for up to a step longer the star has pulled at two
    # places d = 0.09 apart. By that tide, 3/2 m₁ m₂ / M² d² = 10⁻³ of the star's pull of 1, the velocity differs by 10⁻³ dt.
    assert np.allclose(after.position[1], other.xyz, rtol=0, atol=4e-3 * dt)


@pytest.mark.sampled(3)
def test_off_walls_spheres_bounce_with_the_restitution_of_the_wall():
    """Down, off the floor at half the speed, and on the way up into another one."""
    bodies = bodies_of([1.0, 3.0], [0.1, 0.2], [[0, 1.1, 0], [0, 2.0, 0]], [[0, -4.0, 0], [0, 0, 0]])
    walls = [{"plane": {"point": [0, 0, 0], "normal": [0, 1, 0], "restitution": 0.5}}]
    with Simulation(spheres(bodies, walls=walls, duration=2.0, dt=2.0), backend="cpu", precision="f64", event_log=True) as run:
        after, report = run.run().snapshot(), run.contact_report
        log = run.contacts.take_log()
    assert log["time"] == pytest.approx([0.25, 0.25 + 1.6 / 2], abs=1e-15) and log["j"].tolist() == [-1, 0]
    assert log["impulse"] == pytest.approx([6.0, 0.75 * 2], rel=1e-15)
    assert report.wall_impulse == pytest.approx((6.0,), rel=1e-15) and report.wall_count == 1
    assert report.dissipated_energy == pytest.approx(0.5 * (16 - 4) + 0.5 * 0.75 * 4, rel=1e-15)
    touched = (1.7 + 3 * 2.0) / 4
    assert after.position[1, 1] == pytest.approx(touched + 0.5 * (2.0 - 1.05), abs=1e-14)


@pytest.mark.sampled(3)
def test_walls_are_met_as_often_as_a_drift_is_long():
    """To and fro between walls, for the centre 0.8 apart, 0.1 each way: ten bounces in a drift, a triangular wave."""
    walls = [{"plane": {"point": [0, y, 0], "normal": [0, n, 0]}} for y, n in ((0.0, 1.0), (1.0, -1.0))]
    bodies = bodies_of([2.0], [0.1], [[0, 0.5, 0]], [[0.25, 8.0, 0]])
    scene = spheres(bodies, walls=walls, integrator="symplectic_euler")
    with Simulation(scene, backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
        # Ten bounces, each rounded like its place and time.
        assert np.allclose(after.position[0], [0.25, 0.5, 0], rtol=0, atol=1e-14) and after.velocity[0].tolist() == [
            0.25,
            8.0,
            0.0,
        ]
        assert run.contact_report.wall_count == 10 and run.contact_report.wall_impulse == pytest.approx(
            (160.0, 160.0), rel=1e-14
        )


@pytest.mark.sampled(3)
def test_what_is_gone_is_neither_drawn_nor_written_nor_counted(tmp_path, capsys):
    scene = collapse(
        expect={"spheres_left": {"below": 30}, "total_mass": {"near": 1, "within": 1e-14}, "collision_count": {"above": 0}}
    )
    path = tmp_path / "scene.yaml"
    path.write_text(json.dumps(scene))
    outputs = [
        f"--trajectory={tmp_path / 'way.npz'}",
        f"--events={tmp_path / 'events.csv'}",
        f"--snapshot={tmp_path / 'end.npz'}",
    ]
    assert main(["run", str(path), "--headless", "--json", "--backend", "cpu", *outputs]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    end = Snapshot.load(tmp_path / "end.npz")
    gone = int((~end.present).sum())
    assert gone > 5 and found["contacts"]["merge_count"] == gone and found["contacts"]["spheres_left"] == 30 - gone
    assert f"contact merging: {gone} merged, {30 - gone} spheres left" in printed.err
    assert len((tmp_path / "events.csv").read_text().splitlines()) == 1 + gone
    assert found["momentum_error_max"] < 100 * 4 * UNIT["f64"]  # a hundred steps, a few roundings each
    path.write_text("particles: [{file: {path: end.npz}}]\nintegrator: {leapfrog: {dt: 1}}\n")
    assert np.array_equal(assemble(load_scene(path)).mass, end.mass[end.present])
    drawn = np.isfinite(Frame.of(end).position).all(axis=1)
    assert (drawn == end.present).all()
    with np.load(tmp_path / "way.npz") as way:
        assert (way["mass"][0] > 0).all() and (way["mass"][-1] > 0).sum() == 30 - gone
        assert np.allclose(way["mass"].sum(axis=1), 1.0, rtol=0, atol=1e-14) and (way["merged_into"] == end.merged_into).all()


@pytest.mark.sampled(3)
def test_more_at_once_than_there_is_room_for_ends_the_run(monkeypatch):
    """Ten in one heap, 45 pairs where 5 have room: no piece of the drift is short enough, and none is left out in silence."""
    monkeypatch.setattr(drift, "EVENTS_PER_SPHERE", 0)
    monkeypatch.setattr(drift, "SPARE_EVENTS", 5)
    scene = spheres(bodies_of([1.0] * 10, [0.1] * 10, [[k, 0, 0] for k in range(10)], np.zeros((10, 3))))
    heap = dataclasses.replace(assemble(load_scene(scene)), position=0.001 * np.arange(30.0).reshape(10, 3))
    with Simulation(scene, backend="cpu", precision="f64", start=heap) as run:
        with pytest.raises(StabilityError, match="more contacts than there is room for"):
            run.run()
    with (
        Simulation(scene, backend="cpu", precision="f64") as run,
        pytest.raises(BackendError, match="replicas has no contacts"),
    ):
        Simulation(scene, backend="cpu", precision="f64", replica_starts=[run.start] * 2)


WALL = {"periodic_box": {"lower": [-9, -9, -9], "upper": [9, 9, 9]}}
FAULTS = [
    ({"springs": [{"link": {"between": [0, 1], "stiffness": 1.0}}]}, "a spring would lose its end"),
    ({"walls": [WALL]}, "walls[0].periodic_box: cannot be where spheres merge"),
    ({"timeline": [{"at": 0.5, "set": {"particles[0].body.mass": 2.0}}]}, "timeline: cannot be where spheres merge"),
    ({"contacts": {"hard_spheres": {"solver": "merging", "restitution": 0.5}}}, "restitution"),
    (
        {"integrator": {"rk4": {"dt": 0.1}}},
        "goes with the integrators langevin, leapfrog, symplectic_euler, velocity_verlet, not rk4",
    ),
]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("change", "message"), FAULTS)
def test_what_merging_does_not_go_with_is_refused_in_one_line(change, message):
    scene = spheres(bodies_of([1.0, 1.0], [0.1, 0.1], [[0, 0, 0], [3, 0, 0]], np.zeros((2, 3)))) | change
    with pytest.raises(SceneError) as caught:
        load_scene(scene)
    assert message in str(caught.value) and len(caught.value.faults) == 1
