"""Section 4.7 and figure 11: a beam of springs at its two turning points."""

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

STUDY = {
    "as the scene is": {},
    "dx × 0.5": {"constants.dx": 0.2},
    "dz × 0.5": {"constants.dz": 0.2},
    "D × 2": {"constants.D": 1000},
    "m × 2": {"constants.m": 0.2},
    "g × 0.5": {"constants.g": 1},
    "cross-links × 0.1": {"spring_types.brace.stiffness": 50},
}
FIXED = (0, 6)


def section(*, short):
    """The beam at the start and at its lower turning point, and what its parameters do."""
    found = Section(
        "Cantilever",
        "Section 4.7: two rows of six masses, the left-most of them, ‘0’ and ‘6’, fixed at the wall; at the "
        "beginning the springs have "
        "their rest lengths.",
    )
    with runs.start("cantilever") as run:
        time, tip = runs.follow(run, lambda run: (run.time, run.snapshot().position[5, 2]), duration=5.0, looks=1000)
        held = np.flatnonzero(~run.start.free.any(axis=1)).tolist()
        springs = run.start.springs
        ends = run.start.position[springs.between]
        stretch = np.abs(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - springs.rest_length).max()
    turn = _first_turn(tip)
    back = turn + int(np.argmax(tip[turn : 2 * turn + 20]))
    with runs.start("cantilever") as run:
        shown = runs.show(run, [0.0, time[turn]])
    found.rows += [
        Row("§4.7", "fixed particles", "‘0’ and ‘6’", " and ".join(f"‘{k}’" for k in held), holds=tuple(held) == FIXED),
        Row(
            "§4.7",
            "springs at the beginning",
            "have their rest length",
            f"longest stretch {stretch:.0e}",
            holds=bool(stretch < 1e-14),
        ),
        Row(
            "Fig. 11",
            "lower ‘turning’ point",
            "a lower turning point",
            f"tip at {tip[turn]:.5f} at t = {time[turn]:.3f}",
            f"It rises again to {tip[back]:.5f} at t = {time[back]:.3f}; the beam swings about the bend that it would "
            f"keep at rest.",
            holds=bool(tip[turn] < -0.1 and tip[back] > 0.5 * tip[turn]),
        ),
    ]
    found.rows += _study(dict(list(STUDY.items())[:2]) if short else STUDY)
    found.rows.append(_loose(tip[turn]))
    texts = ("at the beginning", f"at the lower turning point, t = {time[turn]:.3f}")
    found.figures.append(
        Figure(
            "Figure 11",
            pictures(list(zip(shown, texts))),
            "cantilever.yaml; the cross-links are drawn darker.",
            "2D cantilever at beginning of the simulation (upper image) and at the lower ‘turning’ point (lower image).",
        )
    )
    series = [Series("tip", 0, [PlotMark(t, z) for t, z in zip(time, tip)], marked=False)]
    plot = Plot("Tip of the beam", "t", "z of particle ‘5’", series, linear_x=True, linear_y=True)
    found.figures.append(Figure("The tip", drawing(plot), "z of the free lower corner."))
    return found


def _first_turn(z):
    """Index of the bottom of the first swing: where the tip, once it fell, begins to rise by more than a tenth of its way."""
    lowest = np.minimum.accumulate(z)
    rising = np.flatnonzero(z - lowest > 0.1 * (z[0] - lowest))
    end = next((int(k) for k in rising if lowest[k] < 0.1 * z.min()), len(z) - 1)
    return int(np.argmin(z[:end]))


def _study(cases):
    lowest = {}
    for name, changes in cases.items():
        with runs.start("cantilever", changes) as run:
            z = runs.follow(run, lambda run: run.snapshot().position[5, 2], duration=4.0, looks=1000)
        lowest[name] = float(z[_first_turn(z)])
    words = "; ".join(f"{name}: {depth:.3f}" for name, depth in lowest.items())
    first = lowest["as the scene is"]
    # Softer, longer, heavier sags more: each change has one sign for a beam.
    deeper = {"dz × 0.5": True, "m × 2": True, "cross-links × 0.1": True, "dx × 0.5": False, "D × 2": False, "g × 0.5": False}
    holds = all((lowest[name] < first) == deeper[name] for name in lowest if name != "as the scene is")
    return [
        Row(
            "§4.7",
            "lowest place of the tip",
            "masses, spring constants, dx, dy, connections and gravity can be studied",
            words,
            holds=holds,
        )
    ]


def _loose(braced):
    with runs.start("cantilever_loose") as run:
        z = runs.follow(run, lambda run: run.snapshot().position[5, 2], duration=4.0, looks=1000)
    return Row(
        "§4.7",
        "with or without cross-connections",
        "can be studied",
        f"without them the tip falls to {z.min():.3f}, with them to {braced:.3f}",
        "Without them the frame is a mechanism: it shears without any force, and collapses.",
        holds=bool(z.min() < 3.0 * braced),
    )
