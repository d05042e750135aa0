"""Hard cases of heaps: overlaps, dense packings, inelastic collapse, columns at rest, and balls that bounce for ever."""

import math

import numpy as np

from mpp_taichi.verify.bounds import rounded
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._flights import FALLING, REAL, STEPPING_PAIRS, after, balls, solvers, three_in_a_row, weight
from mpp_taichi.verify.place import Place, sound


@case("Spheres that overlap too much are refused, or separated at their velocities", "rules of a scene", solved_in=REAL)
def overlaps(place: Place) -> Found:
    """An overlap of a quarter of a radius, and one of 2⁻³² of it, which is rounding."""
    x, v, worst = np.array([[-0.4375, 0.0], [0.4375, 0.0]]), np.array([[0.0, 0.25]] * 2), 0.0
    touching = x * (1.0 - 2.0**-33) / 0.875 + [0.0, 4.0]
    pairs = balls(np.concatenate([x, touching]), np.concatenate([v, v]))
    for solver in solvers(place, (STEPPING_PAIRS, "resting", "swept")):
        if "overlap" not in place.refusal(pairs.scene(solver, dt=0.125)):
            return Found(math.inf, 0.0, f"{solver} has to refuse two spheres that overlap by an eighth")
        end, _ = after(place, pairs.scene(solver, dt=0.125, contacts={"overlap": "separate"}), 1.0)
        worst = max(worst, float(np.abs(end.velocity[:, :2] - pairs.velocity).max()))
        worst = max(worst, *(abs(float(end.position[k + 1, 0] - end.position[k, 0]) - 1.0) for k in (0, 2)))
    bound = 0.5 * 0.5e-9 * 16.0 + rounded(8) * place.u
    why = (
        "half a billionth of a radius may be left, and drive a pair apart in a drift of 1/16 at a speed that stays; 8 roundings"
    )
    return Found(worst, bound, why)


@case("Dense packings do not overlap, and keep their energy", "distances of all pairs, by NumPy", solved_in=REAL)
def packing(place: Place) -> Found:
    """108 spheres on a close-packed lattice of packing 0.60, in a box that repeats, for some ten contacts of each."""
    corners = np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    x = (corners + [[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]).reshape(-1, 3)
    edge, radius = 3.0, float((0.60 * 27.0 / 108.0 * 0.75 / math.pi) ** (1.0 / 3.0))
    v = np.random.default_rng(2).normal(size=x.shape)
    gas, worst, energy, time, dt = balls(x, v, radius=radius), 0.0, 0.0, 0.25, 2.0**-6
    walls, most = [{"periodic_box": {"lower": [0.0] * 3, "upper": [edge] * 3}}], 0
    for solver in solvers(place, ("event_driven", "swept")):
        end, report = after(place, gas.scene(solver, dt=dt, walls=walls), time)
        q = end.position[:, None] - end.position
        q -= edge * np.round(q / edge)
        nearest = float(np.linalg.norm(q, axis=2)[~np.eye(len(x), dtype=bool)].min())
        worst = max(worst, 1.0 - nearest / (2.0 * radius))
        energy = max(energy, abs(float((end.velocity**2).sum() / (v**2).sum()) - 1.0))
        most = max(most, report.pair_count)
    if most < 5 * len(x):
        return Found(math.inf, 0.0, f"{most} contacts are too few for a dense packing")
    bound = 4.0 * place.u * (rounded(time / dt + 20) * edge / (2.0 * radius) + math.sqrt(most))
    why = f"places up to {edge:g} are rounded in {time / dt:.0f} steps and some 20 contacts, energies in {most} contacts"
    return Found(max(worst, energy), bound, why)


@case(
    "Three balls that lose their speed in ever more contacts end in a finite time",
    "infinitely many contacts for e < 7 − 4√3 = 0.0718; energy never grows",
    solved_in=REAL,
)
def collapse(place: Place) -> Found:
    """e = 1/16, with a contact time: the momentum stays, the energy falls, and the balls keep their order."""
    three, worst = three_in_a_row(), 0.0
    for solver in solvers(place, ("event_driven", "located", "resting", "simultaneous")):
        with place.simulation(three.scene(solver, dt=0.0625, contacts={"contact_time": 2.0**-10})) as simulation:
            before = 0.5 * (1.0 + 0.75**2)
            for _ in range(8):
                simulation.run(duration=0.5)
                end = simulation.snapshot()
                energy = 0.5 * float((end.velocity**2).sum())
                gap = float(np.diff(end.position[:, 0]).min()) - 1.0
                worst = max(worst, energy - before, -gap, abs(float(end.velocity[:, 0].sum()) - 0.25))
                before = energy
            sound(simulation)
        if before > 0.25:
            return Found(math.inf, 0.0, f"{solver} leaves more energy than three contacts do")
    bound = (rounded(64 + 2.0**10 * 3.0) + 64.0) * place.u * 2.0
    return Found(worst, bound, "64 steps, and a contact in each contact time of 2⁻¹⁰ after they meet, round places up to 2")


@case(
    "A collapse without a contact time is told, or ends with the three balls together",
    "momentum: all at a third of the sum of the velocities",
    quick=True,
)
def endless(place: Place) -> Found:
    """Event by event: in single precision the balls soon have one velocity, and the cascade ends."""
    scene, bound = three_in_a_row().scene("event_driven", dt=0.5), rounded(64) * place.u
    if "collapse" in place.refusal(scene, steps=8):
        return Found(0.0, bound, "0: the program says so in words")
    end, _ = after(place, scene, 4.0)
    wrong = np.abs(end.velocity[:, 0] - 0.25 / 3.0).max(), 1.0 - np.diff(end.position[:, 0]).min()
    return Found(float(max(wrong)), 8.0 * bound, "64 roundings of velocities up to 1 and of places up to 4, of the two errors")


@case("A column of ten spheres neither sinks nor moves", "statics", solved_in=REAL)
def column(place: Place) -> Found:
    """At rest on a floor under gravity, for a thousand steps, by the solver for resting spheres."""
    count, dt = 10, 1.0 / 64.0
    stack = balls([[0.0, 0.5 + k] for k in range(count)], [[0.0, 0.0]] * count, planes=((1, 1, 0.0),), restitution=0.5)
    end, _ = after(place, stack.scene("resting", dt=dt, forces=weight(1.0)), 1000 * dt)
    moved = float(np.abs(end.position[:, :2] - stack.position).max())
    exact = 1e-12 if place.backend == "cpu" else 1e-10  # the solver's own, by one thread and by many
    tolerance = exact if place.u < 1e-12 else 1e-5
    return Found(
        moved, count * tolerance * 0.5, f"ten contacts, each with the tolerance of the solver, {tolerance} of a radius"
    )


@case("A ball bounces for ever to the height from which it fell", "parabolas, 2 √(2h/g) long", solved_in=REAL)
def bouncing(place: Place) -> Found:
    """46 bounces from a height of 1.21 with g = 2: a bounce each 2.2, the first at 1.1; the end is half way up."""
    ball, worst = balls([[0.0, 1.71]], [[0.0, 0.0]], planes=((1, 1, 0.0),)), 0.0
    for solver in solvers(place, FALLING):
        end, report = after(place, ball.scene(solver, dt=0.5, forces=weight(2.0)), 100.65)
        if report.wall_count != 46:
            return Found(math.inf, 0.0, f"{solver} found {report.wall_count} bounces of 46")
        worst = max(worst, abs(end.position[0, 1] - 1.4075))
    # A time t is rounded by 2 u t; the speed by g times that, and with it the length of each later bounce by twice as much.
    bound = 1.1 * 2.0 * 2.0 * place.u * (2.2 * 46.0**3 / 6.0)
    return Found(worst, bound, "46 bounces round their times t by 2 u t, each later bounce by twice that, at worst all one way")


@case("A ball that loses half its speed comes to rest on the floor", "Σ of the bounces: (1 + e)/(1 − e) falls", solved_in=REAL)
def settling(place: Place) -> Found:
    """e = ½ from a height of 1 with g = 2: at rest from 3 on, by solvers for contacts that last."""
    ball = balls([[0.0, 1.5]], [[0.0, 0.0]], planes=((1, 1, 0.0),), restitution=0.5)
    gravity, worst, short = weight(2.0), 0.0, 2.0**-10
    for solver in solvers(place, ("located", "resting")):
        scene = ball.scene(solver, dt=2.0**-7, forces=gravity, contacts={"contact_time": short})
        end, _ = after(place, scene, 4.0)
        worst = max(worst, abs(float(end.position[0, 1]) - 0.5))
    bound = short**2 + 8.0 * place.u
    return Found(worst, bound, "hops of at most the contact time, 2⁻¹⁰, under g = 2: ¼ of its square high, or at rest, rounded")
