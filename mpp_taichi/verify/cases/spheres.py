"""Hard cases of spheres: collisions one by one and together, grazing hits, fast spheres, walls, and the way back."""

import math
from dataclasses import replace

import numpy as np

from mpp_taichi import component
from mpp_taichi.verify.bounds import rounded
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._flights import (
    BY_EVENT,
    EXACT,
    MERGING,
    REAL,
    STEPPING_PAIRS,
    TOGETHER,
    after,
    balls,
    flight,
    rack,
    solvers,
)
from mpp_taichi.verify.place import Place


@case(
    "Two spheres of any masses leave an oblique contact as the law of impact says",
    "v′ = v ∓ (1 + e) m/(m₁ + m₂) (u·n) n at the exact moment",
    solved_in=REAL,
)
def oblique(place: Place) -> Found:
    """Impact parameters of 0 to 63/64 of the reach, mass ratios of 10⁻⁶, 1 and 10⁶, restitution ¾, in lanes side by side."""
    shares, ratios, e, time = (0.0, 0.25, 0.5, 0.75, 63.0 / 64.0), (1e-6, 1.0, 1e6), 0.75, 4.0
    x, v, mass, left = [], [], [], []
    for k, (b, ratio) in enumerate((b, ratio) for b in shares for ratio in ratios):
        cosine = math.sqrt(1.0 - b * b)
        n = np.array([cosine, -b, 0.0])
        x += [[-2.0, b, 4.0 * k], [0.0, 0.0, 4.0 * k]]
        v += [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        mass += [ratio, 1.0]
        impulse = (1.0 + e) * cosine / (1.0 / ratio + 1.0)
        left += [[1.0, 0.0, 0.0] - impulse / ratio * n, impulse * n]
    pairs, worst, dt = balls(x, v, mass=mass, restitution=e), 0.0, 0.125
    for solver in solvers(place, (*EXACT, "resting")):
        end, report = after(place, pairs.scene(solver, dt=dt), time)
        if report.pair_count != len(shares) * len(ratios):
            return Found(math.inf, 0.0, f"{solver} has to find one contact in each lane")
        worst = max(worst, float(np.abs(end.velocity - np.array(left)).max()))
    cosine = math.sqrt(1.0 - shares[-1] ** 2)
    bound = (1.0 + e) * rounded(time / dt) * 2.0 * place.u / cosine
    why = f"{time / dt:.0f} roundings of places up to 2 turn the normal by that over its cosine, {cosine:.2g}; times 1 + e"
    return Found(worst, bound, why)


@case("A grazing sphere hits or misses as geometry says", "b = δ (1 ± ε)", quick=True, solved_in=REAL)
def grazing(place: Place) -> Found:
    """ε = 2⁻⁴⁰, in single precision 2⁻¹⁶: a miss changes no bit, a hit is one contact."""
    epsilon = 2.0**-40 if place.u < 2.0**-40 else 2.0**-16
    x = [[-1.0, 1.0 + epsilon, 0.0], [0.0, 0.0, 0.0], [-1.0, 1.0 - epsilon, 4.0], [0.0, 0.0, 4.0]]
    v = [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]] * 2
    b = 1.0 - epsilon
    cosine, worst = math.sqrt((1.0 - b) * (1.0 + b)), 0.0
    change = cosine * np.array([cosine, -b, 0.0])
    for solver in solvers(place, ("event_driven", "swept")):
        end, report = after(place, balls(x, v).scene(solver, dt=0.25), 2.0)
        missed = np.array_equal(end.velocity[:2], v[:2])
        if not missed or report.pair_count != 1:
            return Found(math.inf, 0.0, f"{solver} has to keep every bit of a miss, and to find one contact of the hit")
        worst = max(worst, float(np.abs(end.velocity[2:] - [v[0] - change, change]).max()))
    bound = rounded(8) * 2.0 * place.u / cosine
    return Found(worst, bound, f"8 roundings of places up to 2 change the cosine, {cosine:.2g}, by that over itself")


@case(
    "As many balls leave a row of touching balls as come in: 1, 2 and 3 of 5",
    "momentum, energy, and no ball that approaches another",
    quick=True,
    solved_in=REAL,
)
def cradle(place: Place) -> Found:
    """Three rows side by side; all numbers are exact, but for the solution of the group."""
    x, v, left = [], [], []
    for lane, count in enumerate((1, 2, 3)):
        x += [[k - (1.0 if k < count else 0.0), 0.0, 4.0 * lane] for k in range(5)]
        v += [[float(k < count), 0.0, 0.0] for k in range(5)]
        left += [[float(k >= 5 - count), 0.0, 0.0] for k in range(5)]
    end, _ = after(place, balls(x, v).scene(TOGETHER, dt=0.125), 2.0)
    worst = float(np.abs(end.velocity - np.array(left)).max())
    return Found(worst, 4.0 * 4.0 * place.u * rounded(4), "four contacts of a row, each of four roundings, in four waves")


@case(
    "A ball that hits two touching balls at once returns with a fifth of its speed",
    "v₀ = −1/5, v₁ = v₂ = (3/5, ±√3/5): symmetry, momentum, energy",
    quick=True,
    solved_in=REAL,
)
def one_on_two(place: Place) -> Found:
    """By the solver for groups; one ball after the other would end otherwise."""
    three = balls([[-2.0, 0.0], [0.0, 0.5], [0.0, -0.5]], [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    end, _ = after(place, three.scene(TOGETHER, dt=0.125), 3.0)
    expected = np.array([[-0.2, 0.0], [0.6, math.sqrt(0.12)], [0.6, -math.sqrt(0.12)]])
    worst = float(np.abs(end.velocity[:, :2] - expected).max())
    return Found(worst, rounded(24 + 8) * 2.0 * place.u, "24 steps round places up to 2, and the contact rounds eight times")


@case(
    "The break of 15 touching balls is symmetric and keeps energy and momentum",
    "mirror image; conservation",
    solved_in=REAL,
)
def rack_break(place: Place) -> Found:
    """All 30 contacts are one group; the largest of three errors."""
    places = np.concatenate([[[-2.0, 0.0]], rack(5)])
    velocity = np.zeros((16, 2))
    velocity[0, 0] = 1.0
    end, _ = after(place, balls(places, velocity).scene(TOGETHER, dt=0.125), 2.0)
    v = end.velocity[:, :2]
    rows = [k * (k + 1) // 2 + 1 for k in range(5)]
    mirrored = np.concatenate([[0]] + [np.arange(first + k, first - 1, -1) for k, first in enumerate(rows)])
    errors = np.abs(v[mirrored] * [1.0, -1.0] - v).max(), abs((v**2).sum() - 1.0), np.abs(v.sum(0) - [1.0, 0.0]).max()
    bound = rounded(30 * 16) * 4.0 * place.u
    return Found(float(max(errors)), bound, "16 steps and waves of 30 contacts, each of which rounds four velocities")


@case("A break with small gaps is the same as contact by contact", BY_EVENT, solved_in=REAL)
def separated_break(place: Place) -> Found:
    """Six balls of masses 1 and ½ and 3 in turn, a sixteenth of a radius apart, and a ball that hits them off the axis."""
    places = np.concatenate([[[-1.5, 0.125]], rack(3, gap=1.0 / 32.0)])
    velocity = np.zeros((7, 2))
    velocity[0, 0] = 1.0
    return flight(
        place,
        balls(places, velocity, mass=[2.0] + [1.0, 0.5, 3.0] * 2),
        time=2.0,
        dt=0.0625,
        size=2.5,
        least=5,
        names=EXACT[:3],
    )


@case(
    "No sphere passes through a thin wall or another sphere, however fast",
    "x = 2 (1 − r) − v t, and two equal spheres exchange velocities",
    solved_in=REAL,
)
def tunnelling(place: Place) -> Found:
    """Spheres of ⅛ at speeds of 1, 2¹⁰ and 2¹⁷, against a wall without thickness, and against a sphere."""
    radius, worst, dt, time = 0.125, 0.0, 0.25, 1.5
    x, v, ends, sizes = [], [], [], []
    for lane, speed in enumerate((1.0, 2.0**10, 2.0**17)):
        x += [[0.0, 16.0 * lane], [0.0, 16.0 * lane + 8.0], [-0.5, 16.0 * lane + 8.0]]
        v += [[speed, 0.0], [-speed, 0.0], [0.0, 0.0]]
        ends += [2.0 * (1.0 - radius) - speed * time, -0.5 + 2.0 * radius, -2.0 * radius - speed * time]
        sizes += [speed * time + 1.0] * 3
    wall = [{"segment": {"from": [1.0, -1.0, 0.0], "to": [1.0, 41.0, 0.0]}}]
    for solver in solvers(place, EXACT):
        end, _ = after(place, balls(x, v, radius=radius).scene(solver, dt=dt, walls=wall), time)
        worst = max(worst, float((np.abs(end.position[:, 0] - ends) / sizes).max()))
    bound = 2.0 * (time / dt + 2.0) * place.u
    return Found(worst, bound, "each of six steps rounds a place and its way, and a contact its time: in parts of the way v t")


@case("A sphere that falls onto another at great speed merges with it", "momentum, mass and area", quick=True, solved_in=REAL)
def mergers(place: Place) -> Found:
    """At 2¹⁰ radii in a step onto a sphere three times as heavy, and with it onto a third; then there is one."""
    three = balls(
        [[0.0, 0.0], [16.0, 0.0], [96.0, 0.0]], [[64.0, 0.0], [0.0, 0.0], [0.0, 0.0]], mass=[1.0, 3.0, 12.0], radius=0.0625
    )
    end, report = after(place, three.scene(MERGING, dt=0.5), 8.0)
    left = int(end.mass.argmax())
    centre = (3.0 * 16.0 + 12.0 * 96.0 + 64.0 * 8.0) / 16.0
    together = math.sqrt(3.0) * 0.0625  # the area of three disks
    errors = [abs(end.velocity[left, 0] / 4.0 - 1.0), abs(end.position[left, 0] / centre - 1.0)]
    errors += [abs(end.mass[left] / 16.0 - 1.0), abs(end.radius[left] / together - 1.0), abs(report.merge_count - 2.0)]
    return Found(float(max(errors)), rounded(16 + 8) * place.u, "16 steps and two mergers, each of which rounds four times")


@case("A large sphere meets all small ones", BY_EVENT, solved_in=REAL)
def unlike_sizes(place: Place) -> Found:
    """Radius 1 and mass 2³⁰ among 24 spheres of radius 2⁻¹⁰ and mass 1 that fly at it from all sides."""
    random = np.random.default_rng(4)
    way = random.normal(size=(24, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    aside = 0.5 * np.cross(way, random.normal(size=(24, 3)))
    x = np.concatenate([[[0.0, 0.0, 0.0]], 2.0 * way + 0.25 * aside])
    v = np.concatenate([[[0.0, 0.0, 0.0]], -way])
    mixed = balls(x, v, radius=[1.0] + [2.0**-10] * 24, mass=[2.0**30] + [1.0] * 24)
    return flight(place, mixed, time=2.0, dt=0.125, size=3.0, least=20, names=("event_driven", "located"))


@case("Spheres that turn round come back to where they began", "reversibility; growth by a second start", solved_in=REAL)
def balls_there_and_back(place: Place) -> Found:
    """27 spheres in a box, forward, reversed, and back."""
    x = np.stack(np.meshgrid(*[np.arange(3.0) * 1.25 + 0.75] * 3, indexing="ij"), -1).reshape(-1, 3)
    v = np.random.default_rng(3).normal(size=x.shape)
    planes = tuple((axis, side, at) for axis in range(3) for side, at in ((1, 0.0), (-1, 4.0)))
    gas, time, dt = balls(x, v, planes=planes), 0.5, 0.0625
    _, _, contacts = gas.fly(time)
    growth = gas.growth(time)
    solver = solvers(place, ("event_driven", "swept"))[0]
    there, _ = after(place, gas.scene(solver, dt=dt), time)
    ends, _ = after(place, replace(gas, position=there.position, velocity=-there.velocity).scene(solver, dt=dt), time)
    worst = float(np.abs(ends.position - x).max())
    steps = 2.0 * (time / dt + contacts)
    why = f"{steps:.0f} roundings of places up to 4, growing {growth:.3g} times by the {contacts} contacts"
    return Found(worst, growth * rounded(steps) * place.u * 4.0, why)


@case("A ball in a box follows its unfolded path, at any speed", "a straight line, folded at the walls", solved_in=REAL)
def folded_path(place: Place) -> Found:
    """At 0.7 and at 123,456.789 lengths in a time of 1, and straight into a corner; each bounce gives 2 m v to a wall."""
    side, radius, worst = np.array([3.0, 2.0, 1.5]), 0.125, 0.0
    walls = [{"box": {"lower": [0.0] * 3, "upper": side.tolist()}}]
    oblique, corner = (0.6, -0.64, 0.48), (-1.0, -1.0, -1.0)
    paths = ((0.75, oblique, 16.0), (123_456.789, oblique, 2.0**-8), (123_456.789, oblique, 2.0**-8), (1.0, corner, 7.0))
    for solver, (speed, way, time) in zip((MERGING, "located", "swept", "event_driven"), paths):
        if solver not in solvers(place, (solver, "swept")):
            continue  # on this backend two of the paths are left
        start, v, dt = np.array([0.75, 0.75, 0.75]), speed * np.array(way), time / 64.0
        room, free = side - 2.0 * radius, start - radius + v * time
        phase = np.mod(free, 2.0 * room)
        bounces = np.abs(np.floor(free / room))
        expected = radius + np.where(phase < room, phase, 2.0 * room - phase)
        end, report = after(place, balls([start], [v], radius=radius).scene(solver, dt=dt, walls=walls), time)
        if report.wall_count != bounces.sum():
            return Found(math.inf, 0.0, f"{solver} found {report.wall_count} bounces of {bounces.sum():.0f}")
        count = 64.0 + float(bounces.sum())
        worst = max(worst, float(np.abs(end.position[0] - expected).max()) / (3.0 + speed * time) / count)
        worst = max(worst, abs(sum(report.wall_impulse) / float((2.0 * np.abs(v) * bounces).sum()) - 1.0) / count)
    return Found(
        worst, 2.0 * place.u, "each of 64 steps and each bounce rounds a place of 3 and the way v t: in parts of their sum"
    )


@case(
    "Pairs that meet at one moment part as mirror images, in any order of their numbers",
    "v′ = −v to the last bit; merged, 0",
    solved_in=REAL,
)
def symmetric_pairs(place: Place) -> Found:
    """Four pairs, head on, for every contact solver; four more in the opposite order of their numbers."""
    side = np.tile([-1.0, 1.0], 8) * np.repeat([1.0, -1.0], 8)
    lane = np.concatenate([np.repeat(np.arange(4.0), 2), np.repeat(np.arange(7.0, 3.0, -1.0), 2)])
    x, v, worst = np.stack([0.75 * side, 2.0 * lane], axis=1), np.stack([-side, 0.0 * side], axis=1), 0.0
    for solver in solvers(place, component.names("contacts")):
        merges = component.flag("contacts", solver, "merges")
        end, _ = after(place, balls(x, v).scene(solver, dt=0.125), 1.0)
        left = end.mass > 0.0
        wrong = end.velocity[:, :2] + (0.0 if merges else 1.0) * v
        worst = max(worst, float(np.abs(wrong[left]).max()), abs(float(left.sum()) - (8.0 if merges else 16.0)))
    return Found(worst, 0.0, "all numbers are exact in binary, so that nothing is rounded")


@case(
    "The solver that looks at the end of a step lets a pair bounce along the line that it sees then",
    "v′ = v ∓ (1 + e) m/(m₁ + m₂) (u·n) n at the end of the step",
    quick=True,
    solved_in=REAL,
)
def noticed_late(place: Place) -> Found:
    """Oblique, of unlike masses; the pair ends as far apart as it reaches, about the same centre of mass."""
    pair, dt = balls([[-1.0, 0.25], [0.25, 0.0]], [[1.0, 0.0], [0.0, 0.5]], mass=[3.0, 0.5], restitution=0.75), 0.5
    scene = pair.scene(STEPPING_PAIRS, dt=dt) | {"integrator": {"symplectic_euler": {"dt": dt}}}
    end, _ = after(place, scene, dt)
    moved = pair.position + dt * pair.velocity
    n = (moved[1] - moved[0]) / np.linalg.norm(moved[1] - moved[0])
    impulse = 1.75 * float(n @ (pair.velocity[0] - pair.velocity[1])) / (1.0 / 3.0 + 2.0)
    expected = pair.velocity + np.outer([-impulse / 3.0, impulse / 0.5], n)
    errors = [np.abs(end.velocity[:, :2] - expected).max(), abs(np.linalg.norm(end.position[1] - end.position[0]) - 1.0)]
    errors.append(np.abs(pair.mass @ end.position[:, :2] - pair.mass @ moved).max() / 3.5)
    return Found(float(max(errors)), rounded(16) * 2.0 * place.u, "sixteen roundings of numbers up to 2")
