"""Universe files of Princeton's N-body assignment: N, R, and N rows `x y vx vy mass picture`, in SI units."""

import itertools
import math
from pathlib import PurePath
from typing import Any

from mpp_taichi.errors import SceneError
from mpp_taichi.importers._title import title_of
from mpp_taichi.importers._words import Word, words

SUFFIXES = (".txt",)
G = 6.67e-11  # the assignment's own [m³ / (kg s²)]
DURATION, STEP = 157_788_000.0, 25_000.0  # of its reference run: five years, in steps of seven hours [s]
RADIUS = "universe_radius"  # name of the constant of a scene that keeps R, which no formula needs
MOST_BODIES = 1_000_000
COLORS = {
    "sun": [1.0, 0.85, 0.3],
    "mercury": [0.6, 0.6, 0.6],
    "venus": [0.9, 0.75, 0.5],
    "earth": [0.3, 0.5, 1.0],
    "mars": [0.9, 0.4, 0.25],
}


def recognises(text: str) -> bool:
    """Whether the text begins with a whole number and a number."""
    first = text.split(None, 2)[:2]
    return len(first) == 2 and first[0].isdigit() and _is_number(first[1])


def read(text: str, source: str) -> dict[str, Any]:
    """The scene: gravity in the plane, kick then drift as in the assignment, whose velocities are half a step behind.

    White space is free; blank lines, text after the last row and quotes around a picture are ignored. A step is taken as
    long as t < T, so the number of steps is T/dt rounded up. SceneError with line and column where the text is no universe
    file, and for a negative mass.
    """
    stream = itertools.chain.from_iterable(words(text, source))
    last: list[Word] = []

    def following(what: str) -> Word:
        word = next(stream, None)
        if word is None:
            where = last[-1].location if last else source
            raise SceneError(f"{where}: the file ends where {what} should follow")
        last.append(word)
        return word

    count = following("the number of bodies").whole("the number of bodies", 1, MOST_BODIES)
    radius_word = following("the radius of the universe")
    radius = radius_word.number("the radius of the universe")
    if not radius > 0.0:
        raise radius_word.fault(f"the radius of the universe must be above 0, not {radius:g}")
    bodies: list[dict[str, Any]] = []
    taken: set[str] = set()
    for k in range(count):
        x, y, vx, vy = (following(f"{each} of body {k}").number(f"{each} of body {k}") for each in ("x", "y", "vx", "vy"))
        mass = following(f"mass of body {k}").number(f"mass of body {k}", least=0.0)
        picture = following(f"the picture of body {k}").text.strip("\"'")
        if _is_number(picture):
            raise last[-1].fault(f"body {k} has no picture: {last[-1].shown} is a number")
        stem = PurePath(picture).stem or "body"
        name = stem if stem not in taken else next(n for i in itertools.count(2) if (n := f"{stem}_{i}") not in taken)
        taken.add(name)
        body = {"name": name, "mass": mass, "position": [x, y, 0.0], "velocity": [vx, vy, 0.0]}
        bodies.append(body | {"radius": radius / 60.0} | ({"color": COLORS[stem]} if stem in COLORS else {}))
    return {
        "title": title_of(source),
        "constants": {RADIUS: radius},
        "dimensions": 2,
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": G}}],
        "integrator": {"symplectic_euler": {"dt": STEP}},
        "run": {"steps": math.ceil(DURATION / STEP)},
        "view": {"camera": {"position": [0.0, 0.0, 3.0 * radius], "look_at": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0]}},
    }


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
