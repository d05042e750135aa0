"""Steps that are too long for a wall of segments: a sphere could come to the other side without a contact. Host side."""

from collections.abc import Iterator

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.start.contact_setup import ContactSetup
from mpp_taichi.walls._base import Surface

STEPS_TRIED = 2000  # of a run, evenly, of which the motion of walls is looked at


def check_wall_steps(spec: SceneSpec, setup: ContactSetup) -> None:
    """Refuse a step in which a segment moves in a way that the contact solver does not see.

    Segments have particles on both sides. `swept` takes the motion of a wall along tangents of a bounded error, and of the
    formulas it reads the values and the first two derivatives at the begin of each: within a step a formula must not be
    farther from its parabola than the smallest sphere is wide. `pairwise` looks at the end of a step only, at which the wall
    must not have moved by more than a radius. SceneError, at the wall.
    """
    assert spec.contacts is not None
    movable = setup.inverse_mass.any(axis=1) & (setup.radius > 0.0)
    step = spec.integrator.parameters.get("dt")
    movers = [each for each in setup.enclosure.segments if each.has_motion or each.has_turning]
    if not movers or not movable.any() or step is None:
        return
    radius, end = float(setup.radius[movable].min()), spec.run.duration or (spec.run.steps or 0) * float(step)
    times = float(step) * np.unique(np.linspace(0.0, max(end / step - 1.0, 0.0), STEPS_TRIED).astype(int))
    jumps = not spec.contacts.solver.flag("contacts", "sees_flights")
    for surface in movers:
        for time, way in _ways(surface, times, float(step), jumps=jumps):
            if way > radius:
                told = f"moves by {way:.3g}" if jumps else f"leaves its parabola by {way:.3g}"
                entry = spec.walls[int(surface.label.partition("[")[2].partition("]")[0])]
                cure = "take a smaller dt" + (", or solver: swept" if jumps else "")
                raise SceneError(
                    f"{entry.location}: {surface.label} {told} in the step of {step:g} at t = {time:g}, more than {radius:g}, "
                    f"the radius of the smallest sphere, which could come through it: {cure}"
                )


def _ways(surface: Surface, times: np.ndarray, step: float, *, jumps: bool) -> Iterator[tuple[float, float]]:
    """Each of some times with the way of the ends of a segment in the step that begins there, or beyond the parabola."""
    ends = np.array([surface.point, surface.end])
    reach = 0.0 if surface.turning is None else float(surface.turning.distance(ends).max())
    for time in times:
        if jumps:
            moved = surface.carried(ends, time + step) - surface.carried(ends, time)
            yield float(time), float(np.linalg.norm(moved[:, :2], axis=1).max())
            continue
        beyond = 0.0
        if surface.motion is not None:
            (place, speed), later = surface.motion.at(time), surface.motion.at(time + step)[0]
            rest = later - place - step * speed - 0.5 * step * step * surface.motion.acceleration_at(time)
            beyond += float(np.linalg.norm(rest))
        if surface.turning is not None:
            law = surface.turning.angle
            (angle, rate), later = law.at(time), law.at(time + step)[0]
            beyond += reach * abs(float((later - angle - step * rate)[0] - 0.5 * step * step * law.acceleration_at(time)[0]))
        yield float(time), beyond
