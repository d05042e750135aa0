"""Section 4.6, appendix A, figures 5, 6 and 10: the oscillating membrane of the script, and one with modes."""

import math
from xml.sax.saxutils import escape

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

SEEN = 30  # the particle of figure 6
SIDE = 8
MODES = ((1, 1), (2, 1), (2, 2))


def section(*, short):
    """The script's sheet, z of particle 30, and what a tension makes of it."""
    found = Section(
        "Membrane",
        "Section 4.6 and appendix A: a sheet of 8 × 8 masses on springs at rest, displaced by half a sine wave along "
        "x and y, the "
        "particle inspector of figure 6, and the modes of eqs. (19)–(20).",
    )
    span = 20.0 if short else 150.0
    with runs.start("membrane_loose", {"run.duration": span}) as run:
        found.rows += _script(run)
        time, z, away, off = _history(run)
    found.rows.append(_irregular(time, z, off, span))
    found.figures += [_screen(), _inspector(time, z, away, span), _grids(short)]
    found.rows += _loose_periods(short)
    found.rows += _modes(MODES[:1] if short else MODES)
    found.rows.append(_released())
    return found


def _script(run):
    start, spec = run.start, run.spec
    sheet, links = spec.particles[0].parameters, spec.springs[0].parameters
    height = start.position[:, 2]
    rim = ~start.free.any(axis=1)
    where = "App. A"
    middle = 0.1 * math.sin(3 * math.pi / 7) ** 2
    return [
        Row(where, "nx · ny particles", "64", start.particle_count),
        Row(where, "springs, as the two loops over sl make them", "112", len(start.springs)),
        Row(
            where,
            "particles that are static",
            "the boundary",
            f"{int(rim.sum())} of {start.particle_count}",
            holds=int(rim.sum()) == 4 * (SIDE - 1),
        ),
        Row(where, "xStart", "-1.0", float(start.position[0, 0])),
        Row(where, "xEnd", "1.0", float(start.position[SIDE - 1, 0])),
        Row(where, "mass", "1.0", float(start.mass[0])),
        Row(where, "radius", "0.01", float(sheet["radius"])),
        Row(where, "spring constant D", "50.0", float(links["stiffness"])),
        Row(where, "frictional coefficient c", "0.003", float(links["damping"])),
        Row(where, "time step dt", "1e-2", run.dt),
        Row(
            where,
            "largest dis, 0.1 sin x sin y",
            f"{middle:.5f}",
            float(height.max()),
            "The script writes five digits after the point.",
        ),
    ]


def _history(run):
    """Times, z of the seen particle, largest motion along x and y, and the share of what is not the mode (1, 1) in z."""
    start = run.start.position
    shape = start[:, 2] / np.linalg.norm(start[:, 2])
    scale = np.linalg.norm(start[:, 2])

    def look(run):
        place = run.snapshot().position
        z = place[:, 2]
        return run.time, z[SEEN], np.abs(place[:, :2] - start[:, :2]).max(), np.linalg.norm(z - (z @ shape) * shape) / scale

    return runs.follow(run, look, looks=3000)


def _passages(time, z):
    change = np.flatnonzero(np.diff(np.sign(z)))
    return time[change] - z[change] * (time[change + 1] - time[change]) / (z[change + 1] - z[change])


def _irregular(time, z, off, span):
    between = np.diff(_passages(time, z))
    told = f"after {span:.0f} units of time {off.max():.0%} of the amplitude is in other shapes"
    if len(between) > 1:
        told += f"; half periods of particle #{SEEN} between {between.min():.1f} and {between.max():.1f}"
    return Row(
        "§4.6",
        "eigenmodes by displacing particles at rest",
        "not reproduced to an acceptable extent; bounces irregularly after a few oscillations",
        told,
        "Springs at rest resist z only by z³: there is no wave equation, and no mode.",
        holds=bool(off.max() > 0.2) if span > 100 else None,
    )


def _screen():
    text = (runs.SCENES / "membrane_loose.yaml").read_text(encoding="utf-8")
    with runs.start("membrane_loose") as run:
        picture = runs.show(run, [0.0])[0]
    content = (
        f'<div class="pictures"><div><img src="{picture}" alt="membrane_loose.yaml in the window"/><span '
        f'class="quiet">python -m '
        f"mpp_taichi scenes/membrane_loose.yaml; space runs and stops, H shows the "
        f"keys</span></div><div><pre>{escape(text)}</pre></div></div>"
    )
    paper = (
        "Screenshot of QtMPPHys with the main OpenGL window, the script editor, and the system widget with animation control."
    )
    return Figure(
        "Figure 5",
        content,
        "The picture of the scene beside its text, which any editor edits; the keys of the window control it.",
        paper,
    )


def _inspector(time, z, away, span):
    series = [Series(f"z of #{SEEN}", 0, [PlotMark(t, x) for t, x in zip(time, z)], marked=False)]
    plot = Plot(f"z of particle #{SEEN}", "simulation time", f"z of particle #{SEEN}", series, linear_x=True, linear_y=True)
    said = f"membrane_loose.yaml, z from {z[0]:.5f} on; particles move along x and y by {away.max():.4f} at most."
    paper = (
        "The particle inspector shows particle properties in relation to each other. Here, the z-coordinate "
        "(ordinate) of particle #30 is related to the simulation time (abscissa)."
    )
    return Figure("Figure 6", drawing(plot), said, paper)


def _grids(short):
    shown = []
    for name, changes, moment in (
        ("membrane_loose", {}, 0.0),
        ("membrane_loose", {"run.duration": 138}, 2.0 if short else 138.0),
        ("membrane", {}, 0.0),
    ):
        with runs.start(name, changes) as run:
            shown.append((runs.show(run, [moment])[0], f"{name}.yaml, t = {moment:g}"))
    return Figure(
        "Figure 10",
        pictures(shown),
        "The grid at the start, later, when it has lost its shape, and the stretched one of membrane.yaml.",
        "A 2D rectangular membrane with the boundary points being fixed. The interior points can move in all three "
        "directions or only along the z-axis.",
    )


def _loose_periods(short):
    periods = {}
    for amplitude in (0.1,) if short else (0.1, 0.05):
        with runs.start("membrane_loose", {"constants.amplitude": amplitude, "springs[0].lattice_links.damping": 0}) as run:
            time, z = runs.follow(
                run, lambda run: (run.time, run.snapshot().position[27, 2]), duration=4.0 / amplitude, looks=4000
            )
        down = _passages(time, z)
        periods[amplitude] = float(down[2] - down[0])
    words = ", ".join(f"{period:.1f} at {amplitude:g}" for amplitude, period in periods.items())
    row = Row(
        "§4.6",
        "period of the script’s sheet, by amplitude",
        "eigenmodes cannot be reproduced to an acceptable extent",
        words,
        "Between passages of particle 27. That of a mode is the same at any amplitude; this one goes as its inverse. "
        "A tension cures it, below.",
        holds=abs(periods[0.05] / periods[0.1] - 2.0) < 0.1 if len(periods) == 2 else None,
    )
    return [row]


def _modes(modes):
    rows = []
    for r, s in modes:
        expect = {
            "mode_frequency": {"of": "sheet", "mode": [r, s], "near": 1.0, "within": 1.0},
            "mode_leakage": {"of": "sheet", "mode": [r, s], "below": 1.0},
        }
        changes = {
            "constants.r": r,
            "constants.s": s,
            "particles[0].lattice.displacement": ["0", "0", "0.003 * sin(r * pi * u) * sin(s * pi * v)"],
        }
        found = runs.measure("membrane", expect, changes, duration=10.0)
        tension, spacing = 50.0 * (1.0 - 1.0 / 1.5), 2.0 / 7.0
        lattice = math.sqrt(tension * sum(4.0 * math.sin(k * math.pi / 14.0) ** 2 for k in (r, s)))
        # c² = tension per length over mass per area = (T/d)/(m/d²) = T d/m, with T = D d (1 − 1/1.5)
        wave = math.sqrt(tension * spacing**2) * math.pi / 2.0 * math.hypot(r, s)
        period = math.tau / found["mode_frequency"]
        words = f"period {period:.4f} in the run, {math.tau / lattice:.4f} of the lattice, {math.tau / wave:.4f} of eq. (19)"
        rows.append(
            Row(
                "eq. (20)",
                f"mode ({r}, {s}) of the stretched sheet",
                "u = sin(kx) sin(k̂y), ω = c √(k² + k̂²)",
                words,
                f"{found['mode_leakage']:.0e} of the energy leaves the mode in ten units of time.",
                holds=abs(period * lattice / math.tau - 1.0) < 1e-3 and found["mode_leakage"] < 1e-3,
            )
        )
    return rows


def _released():
    with runs.start("membrane_release") as run:
        time, z, speed = runs.follow(
            run, lambda run: (run.time, run.snapshot().position[27, 2], run.snapshot().velocity[27, 2]), looks=1500
        )
    still = float(np.abs(speed[(time > 9.5) & (time < 9.99)]).max())
    after = time > 10.0
    period = 2.0 * float(np.diff(_passages(time[after], z[after])).mean())
    swing = float(z[after].max())
    depth = float(-z[time < 10.0].min())
    return Row(
        "§4.6",
        "gravity and strong friction, then both set to zero",
        "the membrane particles oscillate only due to their mutual spring-connections",
        f"hangs {depth:.4f} deep with speeds of {still:.0e}, then swings to {swing:+.4f} with period {period:.3f}",
        "membrane_release.yaml: a timeline changes both at t = 10.",
        holds=bool(still < 1e-3 * depth and swing > 0.8 * depth),
    )
