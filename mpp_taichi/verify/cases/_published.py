"""What the published numbers share: rows made by a function, the comparison with a printed number, and scenes of bodies."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mpp_taichi.precision import PRECISIONS
from mpp_taichi.verify.bounds import half_digit
from mpp_taichi.verify.case import Case, Found
from mpp_taichi.verify.place import Place

DOUBLE_ONLY = ("f64",)
EVERYWHERE: dict[str, Any] = {"on": PRECISIONS, "solved_in": ("f64", "df64", "ds", "f32c", "f32")}
"""Of the rows that are asked in every precision: the CPU has to solve them in each."""
PLAIN: dict[str, Any] = {"on": PRECISIONS, "solved_in": ("f64", "f32")}
"""Of the rows whose method carries no low parts, and is refused where they are asked for."""
FLYING: dict[str, Any] = {"on": ("f64", "f32"), "solved_in": ("f64", "f32")}
"""Of the rows of event-driven spheres."""


def row(
    module: str,
    name: str,
    title: str,
    source: str,
    ask: Callable[[Place], Found],
    *,
    quick: bool = False,
    on: tuple[str, ...] = DOUBLE_ONLY,
    solved_in: tuple[str, ...] = DOUBLE_ONLY,
) -> Case:
    """A case of a family whose members differ by numbers; `module` is the name of its module."""
    return Case(name, module.rpartition(".")[2], title, source, ask, quick, solved_in, on)


def against(reached: float, printed: str, error: float, why: str) -> Found:
    """A number beside the printed number: their distance, within half of the last digit and the error of the method."""
    digit = half_digit(printed)
    told = f"{digit:.1g}, half a unit of the last digit of {printed}, and {error:.2g}: {why}"
    return Found(abs(reached - float(printed)), digit + error, told)


def bodies(mass: ArrayLike, position: ArrayLike, velocity: ArrayLike) -> list[dict[str, Any]]:
    """Entries of `particles:` from masses (n,), positions and velocities (n, 2) or (n, 3)."""
    return [
        {"body": {"mass": float(m), "position": [float(c) for c in x], "velocity": [float(c) for c in v]}}
        for m, x, v in zip(np.asarray(mass, float), np.asarray(position, float), np.asarray(velocity, float), strict=True)
    ]


def gravity(particles: list[dict[str, Any]], integrator: dict[str, Any], strength: float = 1.0) -> dict[str, Any]:
    """A scene of bodies under their own gravity, in the plane where their places have two coordinates."""
    dimensions = len(particles[0]["body"]["position"])
    forces = [{"newtonian_gravity": {"strength": strength}}]
    return {"dimensions": dimensions, "particles": particles, "forces": forces, "integrator": integrator}
