"""Steps that are too long for a wall with two sides: a sphere could come to the other side without a contact. Host side."""

from typing import Any

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.path_checks import end_of_run
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.start.contact_setup import ContactSetup
from mpp_taichi.walls._base import Surface

STEPS_TRIED = 2000  # of a run, evenly, of which the motion of walls is looked at


def check_wall_steps(spec: SceneSpec, setup: ContactSetup) -> None:
    """Refuse a step in which a wall with two sides moves in a way that the contact solver does not see.

    Segments have particles on both sides, and spheres may come around a round wall. `swept` takes the motion of a wall along
    tangents of a bounded error, and of the formulas it reads the values and the first two derivatives at the begin of each:
    within a step a formula must not be farther from its parabola than the smallest sphere is wide. `pairwise` looks at the end
    of a step only, at which the wall must not have moved by more than a radius. SceneError, at the wall.
    """
    assert spec.contacts is not None
    movable = setup.inverse_mass.any(axis=1) & (setup.radius > 0.0)
    step = spec.integrator.parameters.get("dt")
    movers = [each for each in setup.enclosure.surfaces if _has_two_sides(each)]
    if not movers or not movable.any() or step is None:
        return
    radius, end = float(setup.radius[movable].min()), end_of_run(spec)
    times = float(step) * np.unique(np.linspace(0.0, max(end / step - 1.0, 0.0), STEPS_TRIED).astype(int))
    jumps = not spec.contacts.solver.flag("contacts", "sees_flights")
    for surface in movers:
        ways = _ways(surface, times, float(step)) if jumps else _beyond_parabolas(surface, times, float(step))
        room = radius + surface.radius
        which = int(np.argmax(ways > room))
        if ways[which] > room:
            told = f"moves by {ways[which]:.3g}" if jumps else f"leaves its parabola by {ways[which]:.3g}"
            entry = spec.walls[int(surface.label.partition("[")[2].partition("]")[0])]
            where = f"in the step of {step:g} at t = {times[which]:g}, more than {room:g}"
            cure = "take a smaller dt" + (", or solver: swept" if jumps else "")
            raise SceneError(
                f"{entry.location}: {surface.label} {told} {where}, so that the smallest sphere could come through it: {cure}"
            )


def _has_two_sides(surface: Surface) -> bool:
    """Whether a sphere could come to the other side of a surface in motion: of a segment, or of a round wall that turns."""
    if surface.kind == "segment":
        return surface.has_motion or surface.has_turning
    return surface.is_carried and surface.kind != "plane" and not surface.inside


def _ways(surface: Surface, times: np.ndarray, step: float) -> np.ndarray:
    """At most so far a surface moves in the step that begins at each of some times [length]."""
    if surface.kind == "segment":
        moved = [_places(surface, times + later) for later in (0.0, step)]
        return np.abs(moved[1] - moved[0]).max(axis=0)
    result = np.full(len(times), step * float(np.linalg.norm(surface.velocity)))
    for law, size in _laws(surface):
        now, later = law.rows_at(times), law.rows_at(times + step)
        result = result + size * np.linalg.norm((later - now)[: law.dimensions], axis=0)
    return result


def _places(surface: Surface, times: np.ndarray) -> np.ndarray:
    """Both ends of a segment in the x–y plane, as complex numbers x + i y, (2, number of times) [length]."""
    ends = np.array([complex(*surface.point[:2]), complex(*surface.end[:2])])[:, None]
    shift = complex(*surface.velocity[:2]) * times
    if surface.motion is not None:
        found = surface.motion.rows_at(times)
        shift = shift + found[0] + 1j * found[1]
    if surface.turning is None:
        return ends + shift
    about, sense = complex(*surface.turning.about[:2]), surface.turning.axis[2]
    return about + (ends - about) * np.exp(1j * sense * surface.turning.angle.rows_at(times)[0]) + shift


def _beyond_parabolas(surface: Surface, times: np.ndarray, step: float) -> np.ndarray:
    """By how much a segment leaves, in the step that begins at each time, what two derivatives of its formulas say [length]."""
    result = np.zeros(len(times))
    for law, size in _laws(surface):
        now, later, count = law.rows_at(times), law.rows_at(times + step), law.dimensions
        rates = now[count:]
        rest = later[:count] - now[:count] - step * rates[:count] - 0.5 * step * step * rates[count:]
        result = result + size * np.linalg.norm(rest, axis=0)
    return result


def _laws(surface: Surface) -> list[tuple[Any, float]]:
    """The motion and the angle of a surface, each with the way that it makes of a unit [length]."""
    found = [] if surface.motion is None else [(surface.motion, 1.0)]
    if surface.turning is not None:
        ends = np.array([surface.point, surface.end if surface.kind == "segment" else surface.point])
        found.append((surface.turning.angle, float(surface.turning.distance(ends).max())))
    return found
