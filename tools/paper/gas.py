"""Section 4.9 and figure 13: a gas of hard disks finds the distribution of Maxwell and Boltzmann; Brownian motion."""

import math

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.kinetic_theory import kolmogorov_smirnov
from mpp_taichi.kinetic_theory.speeds import speed_cumulative, speed_density
from mpp_taichi.kinetic_theory.transport import friction_in_bath
from mpp_taichi.recorders.speed_histogram import SpeedHistogram
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

LAST = 20.0  # the end of the scene
SNAPSHOT = 1.0  # the time of the figure is not given; after this one each disk has met some five others
BROWNIAN = {
    "kinetic_temperature": {"of": "heavy", "near": 1, "within": 1},
    "mean_square_displacement": {"of": "heavy", "near": 1, "within": 99},
}


def section(*, short):
    """Figure 13 with its distribution over time, and a heavy ball in a bath."""
    found = Section(
        "Maxwell–Boltzmann distribution",
        "Section 4.9, eq. (21): 250 disks that start with one speed in random directions. The paper shows the "
        "distribution “at some instance of time”.",
    )
    camera = {"view.camera.projection": "orthographic", "view.camera.height": 5.4}
    with runs.start("maxwell_boltzmann", camera) as run:
        run.look_at_multiples_of(0.05)
        found.rows += _setup(run)
        rows, shown, curve = _approach(run)
    found.rows += rows
    found.figures.append(curve)
    found.figures.append(
        Figure("The gas", pictures(shown), "maxwell_boltzmann.yaml at the start and at the time of figure 13.")
    )
    found.rows += _over_time(10.0 if short else 100.0, found)
    if not short:
        found.rows += _brownian()
    return found


def _setup(run):
    start, scene = run.start, run.spec
    speed = np.linalg.norm(start.velocity, axis=1)
    lower, upper = (np.array(scene.walls[0].parameters[key]) for key in ("lower", "upper"))
    packing = start.particle_count * math.pi * start.radius[0] ** 2 / float(np.prod((upper - lower)[:2]))
    return [
        Row("Fig. 13", "N", "250", start.particle_count),
        Row("Fig. 13", "radii r", "0.1", float(start.radius[0])),
        Row(
            "Fig. 13",
            "initial velocity v of each",
            "1",
            float(speed.mean()),
            f"They differ by {np.ptp(speed):.0e}; packing fraction {packing:.4f}.",
        ),
        Row("Fig. 13", "box, length", "7.5", float(upper[0] - lower[0])),
        Row("Fig. 13", "box, width", "5.0", float(upper[1] - lower[1])),
        Row("eq. (21)", "b = √⟨v²⟩", "1", float(np.sqrt(np.mean(speed**2))), "Kept by every collision."),
    ]


def _approach(run):
    """The start, the instance of the figure, and the histogram there."""
    count = run.start.particle_count
    critical = kolmogorov_smirnov.critical_distance(count)
    first = _distance(run)
    shown = [(runs.show(run, [0.0])[0], "t = 0")]
    shown.append((runs.show(run, [SNAPSHOT])[0], f"t = {SNAPSHOT:g}"))
    later, met = _distance(run), 2.0 * run.contact_report.pair_count / count
    once = SpeedHistogram(run)
    once.look(run.snapshot().velocity)
    often = SpeedHistogram(run, after=2.0 * SNAPSHOT, every=round(SNAPSHOT / run.dt))
    run.run(until=LAST, recorders=[often])
    v = np.linspace(0.0, 3.0, 200)
    series = [
        _dots(once, f"250 disks at t = {SNAPSHOT:g}", 0),
        _dots(often, often.label.replace("particles", "disks"), 2),
        Series("eq. (21)", 4, [PlotMark(x, y) for x, y in zip(v, speed_density(v, 1.0, 2))], marked=False, dashed=True),
    ]
    plot = Plot("Velocity distribution", "v / b", "f(v)", series, linear_x=True, linear_y=True)
    paper = (
        "Velocity distribution simulated by the HardSpheres model (black dots) at some instance of time compared to "
        "the Maxwell–Boltzmann distribution in 2D (dashed curve)."
    )
    said = f"Of 250 disks at one time a dot scatters by a fifth of its height and more; the mean until t = {LAST:g} by less."
    figure = Figure("Figure 13", drawing(plot), said, paper)
    words = (
        f"Kolmogorov–Smirnov distance {first:.3f} at t = 0, {later:.3f} at t = {SNAPSHOT:g}, after {met:.1f} collisions of each"
    )
    row = Row(
        "§4.9",
        "approach to eq. (21)",
        "already after a few collisions per particle",
        words,
        f"Of 250 speeds from eq. (21) itself one sample in twenty is farther than {critical:.3f}; 1 − 1/e = "
        f"{1 - 1 / math.e:.3f} at the start.",
        holds=later < critical < first,
    )
    return [row], shown, figure


def _dots(histogram, name, number):
    columns = histogram.columns()
    middle = 0.5 * (columns["edge"][1:] + columns["edge"][:-1])
    rows = zip(middle, columns["density"], columns["standard_error"])
    return Series(name, number, [PlotMark(x, y, f"{y:.3f} ± {e:.3f}") for x, y, e in rows if x < 3.0], joined=False)


def _distance(run):
    speed = np.linalg.norm(run.snapshot().velocity, axis=1)
    return kolmogorov_smirnov.distance(speed_cumulative(speed, 1.0, 2))


def _over_time(duration, found):
    with runs.start("maxwell_boltzmann", {"run.duration": duration}) as run:
        run.look_at_multiples_of(0.05)
        time, distance = runs.follow(run, lambda run: (run.time, _distance(run)), looks=int(duration / 0.05))
        rate = 2.0 * run.contact_report.pair_count / run.start.particle_count / run.time
    critical = kolmogorov_smirnov.critical_distance(250)
    early = time <= 5.0
    series = [
        Series("distance", 0, [PlotMark(t, d) for t, d in zip(time[early], distance[early])], marked=False),
        Series("5 % critical", 4, [PlotMark(0.0, critical), PlotMark(5.0, critical)], marked=False, dashed=True),
    ]
    plot = Plot("Distance from eq. (21)", "t", "Kolmogorov–Smirnov distance", series, linear_x=True)
    found.figures.append(
        Figure("How fast", drawing(plot), f"{rate:.2f} collisions of a disk in a unit of time, over t = {duration:g}.")
    )
    share = float(np.mean(distance[time > 2.0] < critical))
    words = f"{share:.0%} of the looks after t = 2 are within the distance that 95 % of samples from eq. (21) keep"
    return [
        Row(
            "§4.9",
            "the distribution stays that of eq. (21)",
            "approaches the two-dimensional Maxwell–Boltzmann distribution",
            words,
            holds=share > 0.85,
        )
    ]


def _brownian():
    found = runs.measure("brownian_motion", BROWNIAN)
    with runs.start("brownian_motion") as run:
        mass, radius = run.start.mass, run.start.radius
        duration = run.spec.run.duration
    heavy = int(np.count_nonzero(mass == mass[0]))
    edge = 12.0  # of the periodic square, less what the heavy balls keep free
    density = (len(mass) - heavy) / (edge**2 - heavy * math.pi * (radius[0] + radius[-1]) ** 2)
    friction = friction_in_bath(
        mass[0], radius[0], density=density, bath_mass=mass[-1], bath_radius=radius[-1], temperature=1.0, dimensions=2
    )
    # From rest: Langevin's equation, Ornstein and Uhlenbeck, Phys. Rev. 36 (1930) 823.
    once, twice = math.exp(-friction * duration), math.exp(-2.0 * friction * duration)
    theory = 4.0 / (mass[0] * friction) * (duration - (3.0 - 4.0 * once + twice) / (2.0 * friction))
    # The squares of two components of each ball scatter by √2 of their mean, and a mean over all balls by 1/√balls of it.
    measured, bar = found["mean_square_displacement"], theory / math.sqrt(heavy)
    apart = abs(measured - theory) / bar
    words = (
        f"⟨x²⟩ = {measured:.1f} ± {bar:.1f} of {heavy} heavy balls after t = {duration:g}, {theory:.1f} by Enskog’s friction"
    )
    note = f"{apart:.1f} standard errors apart; so few balls in one run cannot tell more. It holds up to three."
    return [
        Row(
            "§4.9",
            "a massive particle in a bath of small ones",
            "can be studied with the same setup",
            words,
            note,
            holds=apart < 3.0,
        )
    ]
