"""First bad step: where a run broke, the first step with a number that is not finite, and its particle and pair."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from mpp_taichi.errors import StabilityError
from mpp_taichi.integrators._trouble import Trouble
from mpp_taichi.snapshot import Snapshot


def first_bad_step(steps: int, advance: Callable[[int], bool], keep: Callable[[], None], rewind: Callable[[], None]) -> int:
    """Number k in 1 … steps such that k − 1 steps are finite and k are not, by bisection; leaves the state at k − 1 steps.

    `advance(n)` steps and says whether all is finite, `keep` stores the state, `rewind` goes back to the stored one. The stored
    state is at 0 steps at first, and `steps` steps from there are known to end badly. Costs at most 2·steps steps.
    """
    good, bad = 0, steps
    while bad - good > 1:
        middle = (good + bad) // 2
        rewind()
        if advance(middle - good):
            keep()
            good = middle
        else:
            bad = middle
    rewind()
    return bad


def label(snapshot: Snapshot, i: int) -> str:
    """`particle 3 ('earth')`, or `particle 3`."""
    name = snapshot.name[i] if i < len(snapshot.name) else ""
    return f"particle {i} ({name!r})" if name else f"particle {i}"


def unresolved(count: int, contacts: Any, *, step: int, time: float) -> StabilityError:
    """The error for contacts that their solver could not resolve, in a launch that began after `step`."""
    error = StabilityError(f"after step {step}, time {time:.9g}: {contacts.failure(count)}")
    error.step, error.time = step, time
    return error


def unsolved(before: Snapshot, particle: int, *, dt: float, step: int, time: float) -> StabilityError:
    """The error for a step whose implicit equations were not solved; `before` is the state after the last solved step."""
    cure = "try a smaller dt" if dt * dt >= sys.float_info.min else f"the square of dt = {dt:g} is 0: try a longer dt"
    error = StabilityError(
        f"step {step}, time {time:.9g}: Newton's method does not solve the equations of the step, "
        f"{label(before, particle)} is the furthest from its place; {cure}"
    )
    error.step, error.time, error.particle = step, time, particle
    return error


def bent_rod(before: Snapshot, trouble: Trouble, *, step: int, time: float) -> StabilityError:
    """The error for a step that could not keep the length of a rod; `before` is the state before the step."""
    particle, other = trouble.particle % before.particle_count, trouble.other
    rod = f"the rod between {label(before, particle)} and {label(before, other)}"
    if trouble.singular:
        message = f"{rod} is in line with other rods, which fix its length already: its force is not determined there"
    else:
        message = (
            f"no force along {rod} keeps its length: rods turn too far in one step, or come into line with rods that fix their "
            "lengths already; try a smaller dt"
        )
    error = StabilityError(f"step {step}, time {time:.9g}: {message}")
    error.step, error.time, error.particle = step, time, particle
    return error


def unsolved_orbit(before: Snapshot, particle: int, *, step: int, time: float) -> StabilityError:
    """The error for a step in which Kepler's equation of an orbit was not solved; `before` is the state before the step."""
    error = StabilityError(
        f"step {step}, time {time:.9g}: Kepler's equation of {label(before, particle)} has no solution that could be found"
    )
    error.step, error.time, error.particle = step, time, particle
    return error


def stalled(now: Snapshot, particle: int, *, step: int, time: float) -> StabilityError:
    """The error for an adaptive method whose next step is too short to change the time; `now` is its present state."""
    message = f"step {step + 1}, after time {time:.9g}: the step that the error asks for is too short for the time to go on"
    if now.particle_count > 1:
        distance = np.linalg.norm(now.position - now.position[particle], axis=1)
        distance[particle] = np.inf
        other = int(np.argmin(distance))
        message += (
            f"; {label(now, particle)} and {label(now, other)} meet, {distance[other]:.3g} apart: give the force a softening"
        )
    error = StabilityError(message)
    error.step, error.time, error.particle = step, time, particle
    return error


def left_lattice(before: Snapshot, particle: int, reason: str, *, step: int, time: float) -> StabilityError:
    """The error for a particle that leaves the range of its method; `reason` completes the sentence."""
    error = StabilityError(f"step {step}, time {time:.9g}: {label(before, particle)} {reason}")
    error.step, error.time, error.particle = step, time, particle
    return error


def explained(
    before: Snapshot, trouble: Trouble, particle: int, *, step: int, time: float, pairs_singular: bool, ends: str = ""
) -> StabilityError:
    """The error for a step after which a particle is not finite, from the trouble that was found after it.

    `ends` says where the points of functions end that the forces call.
    """
    if trouble.kind == "off_lattice":
        return left_lattice(before, particle, trouble.reason, step=step, time=time)
    if trouble.kind == "lost":
        return unsolved_orbit(before, particle, step=step, time=time)
    return diagnose(before, particle, step=step, time=time, pairs_singular=pairs_singular, ends=ends)


def diagnose(
    before: Snapshot, particle: int, *, step: int, time: float, pairs_singular: bool, ends: str = ""
) -> StabilityError:
    """The error for a step that turned `particle` into NaN or infinity; `before` is the last finite state.

    `ends` says where the points of functions end that the forces call.
    """
    message = (
        f"step {step}, time {time:.9g}: the position or velocity of {label(before, particle)} is no longer a finite number"
    )
    if before.particle_count > 1:
        apart = before.position - before.position[particle]
        scale = float(np.abs(apart).max()) or 1.0  # the last finite places may be so large that their squares are infinite
        distance = scale * np.linalg.norm(apart / scale, axis=1)
        distance[particle] = np.inf
        other = int(np.argmin(distance))
        message += f"; its nearest neighbour is {label(before, other)} at distance {distance[other]:.3g}"
        if pairs_singular and distance[other] == 0.0:
            message += ", a zero distance, where unsoftened forces are infinite: give the force a softening"
        elif pairs_singular:
            message += "; a close encounter of unsoftened particles needs a smaller dt or a softening"
        else:
            message += "; the step is probably too large: try a smaller dt"
    if ends:
        message += f"; {ends}, beyond which a formula is no number"
    error = StabilityError(message)
    error.step, error.time, error.particle = step, time, particle
    return error
