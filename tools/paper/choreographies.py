"""Section 4.3, table 1 and figure 7, right: equal bodies on one circle, and other choreographies."""

import math

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

# v² R 2^(3/2) / k² for N = 2 … 9, as printed.
TABLE = {2: "0.707107", 3: "1.632993", 4: "2.707107", 5: "3.892996", 6: "5.168527", 7: "6.518859", 8: "7.933369", 9: "9.404033"}
LOST = 0.05  # of the radius
TURNS = 9.0
OTHERS = ("figure_eight", "butterfly", "moth", "dragonfly")


def section(*, short):
    """Table 1 from runs, how long the circles last, and choreographies on other curves."""
    found = Section(
        "Gravitational choreographies",
        "Section 4.3: N equal bodies on one circle by their own pull, eqs. (15)–(16) and table 1. Each speed is that "
        "of a run, 2π R over "
        "the measured time of one turn.",
    )
    for n, printed in TABLE.items():
        speed, exact = _speed(n)
        note = f"Eq. (16): {exact:.6f}."
        correct = f"{exact:.6f}" if abs(exact - float(printed)) > 0.51e-6 else ""
        found.rows.append(Row(f"Table 1, N = {n}", "v² R 2^(3/2) / k²", printed, speed, note, correct=correct))
    found.rows.append(_faster(found.rows))
    kinds = (9,) if short else tuple(TABLE)
    curves = {(n, precision): _radius_error(n, precision) for n in kinds for precision in ("f64", "f32")}
    found.rows.append(_broken(curves))
    found.figures.append(_plot(curves))
    found.figures.append(_ring_pictures((5,) if short else (3, 5, 9)))
    found.rows += _others(OTHERS[:1] if short else OTHERS, found)
    return found


def _speed(n):
    """v² R 2^(3/2) / k² of a run, and by eq. (16)."""
    expect = {"orbital_period": {"of": "ring[0]", "around": "ring[1]", "near": 1.0, "within": 1.0}}
    period = runs.measure("choreography_ring", expect, {"constants.n": n})["orbital_period"]
    exact = sum(1.0 / math.sqrt(1.0 - math.cos(2.0 * math.pi * j / n)) for j in range(1, n))
    return (2.0 * math.pi / period) ** 2 * 2.0**1.5, exact


def _faster(rows):
    speeds = [row.ours for row in rows]
    return Row(
        "§4.3",
        "speed and number",
        "the velocity is higher the more particles are considered",
        f"v from {math.sqrt(speeds[0] / 2**1.5):.4f} to {math.sqrt(speeds[-1] / 2**1.5):.4f} k/√R",
        holds=speeds == sorted(speeds),
    )


def _radius_error(n, precision):
    """Turns, and until then the largest relative error of a radius, and the largest difference of two radii over R."""
    changes = {"constants.n": n, "constants.turns": TURNS, "integrator": {"leapfrog": {"dt": "period / 1000"}}}
    with runs.start("choreography_ring", changes, precision=precision) as run:
        turn = run.spec.run.duration / TURNS
        time, error, apart = runs.follow(run, lambda run: (run.time / turn, *_off(run)), looks=450)
    return time, np.maximum.accumulate(error), np.maximum.accumulate(apart)


def _off(run):
    radius = np.linalg.norm(run.snapshot().position, axis=1)
    return float(np.abs(radius - 1.0).max()), float(np.ptp(radius))


def _broken(curves):
    words, kept = [], True
    for n, precision in curves:
        if precision == "f64":
            first, single = (_lasts(*curves[n, each]) for each in ("f64", "f32"))
            kept &= n == 2 or (math.isfinite(first) and single <= first)
            words.append(f"N = {n}: {first:.1f} ({single:.1f})" if math.isfinite(first) else f"N = {n}: more than {TURNS:.0f}")
    return Row(
        "§4.3",
        f"turns until a radius is off by {LOST:.0%}",
        "the circle is followed only for a limited number of orbits, because of instability",
        "; ".join(words),
        "In f64, in brackets in f32. The step does not matter: what grows is the rounding of the first steps, in f32 from 5e8 "
        "times as high. So it breaks earlier there.",
        holds=kept,
    )


def _lasts(turns, error, _):
    beyond = np.flatnonzero(error > LOST)
    return float(turns[beyond[0]]) if len(beyond) else math.inf


def _plot(curves):
    series = [
        Series(
            f"N = {n}, {precision}",
            n - 2,
            [PlotMark(t, e) for t, e in zip(turns, apart) if 1e-17 < e < 3.0],
            marked=False,
            dashed=precision == "f32",
        )
        for (n, precision), (turns, _, apart) in curves.items()
    ]
    plot = Plot("How long the circles last", "turns", "largest difference of two radii / R", series, linear_x=True)
    said = "Leapfrog, 1000 steps a turn; dashed: f32. Straight lines are the instability, from round-off up."
    return Figure("Instability of the ring", drawing(plot), said)


def _ring_pictures(kinds):
    shown = []
    for n in kinds:
        with runs.start("choreography_ring", {"constants.n": n, "view.trails": 80}) as run:
            shown.append((runs.show(run, [0.12 * run.spec.run.duration], frames=40, size=(400, 400))[0], f"N = {n}"))
    return Figure(
        "Figure 7, right",
        pictures(shown),
        "Bodies of equal mass after a tenth of a turn, with the way that they came.",
        "Particles of equal mass M that are uniformly distributed on a circle of radius R keep on this orbit due to "
        "their mutual gravitational attraction.",
    )


def _others(names, found):
    rows, shown = [], []
    for name in names:
        missed = runs.measure(name, {"return_error": {"below": 1.0}})["return_error"]
        with runs.start(name) as run:
            period = run.spec.run.duration
            shown.append((runs.show(run, [period], frames=300, size=(400, 300))[0], f"{name}, period {period:.6f}"))
        rows.append(
            Row(
                "§4.3",
                f"{name}: all bodies are back after one period",
                "even more complicated choreographies",
                f"off by {missed:.1e} after t = {period:.6f}",
                holds=missed < 1e-6,
            )
        )
    found.figures.append(
        Figure(
            "Other choreographies",
            pictures(shown),
            "One period each; Montgomery’s eight, and orbits of Šuvakov and Dmitrašinović.",
        )
    )
    return rows
