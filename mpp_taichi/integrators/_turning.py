"""Turning: the exact change of the velocity in a kick where forces only turn it, as a magnetic field does."""

from functools import reduce
from operator import add
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.elementary_functions import are_precise, elementary
from mpp_taichi.arithmetic.force_numbers import components, is_above_zero, parameter_vector, root, vector_of, where
from mpp_taichi.arithmetic.kernel_number import KernelNumber
from mpp_taichi.arithmetic.particle_update import velocity_seen
from mpp_taichi.arithmetic.traced import entry_of, traced

SMALL = 1e-10  # of θ²: below it the next terms of the series are below round-off
AXES = 3


def only_turns(total_force: Any) -> bool:
    """Whether kicks turn the velocity: each force that depends on velocity is linear in it and across it, apart from a push.

    Double-single numbers have no sines, nor has Vulkan in f64; rods make the velocities depend on each other.
    """
    velocity_dependent = [force for force in total_force.external if force.depends_on_velocity]
    if total_force.two_parts or total_force.has_rods or any(bond.depends_on_velocity for bond in total_force.bonds):
        return False
    return bool(velocity_dependent) and all(force.turns for force in velocity_dependent) and are_precise()


@traced
def turned_acceleration(state: Any, total_force: Any, i: Any, time: Any, h: Any, still: Any) -> Any:
    """The mean acceleration of particle i in a kick of the time h at a fixed place, so that v + h × mean is exact.

    v' = A + v × Ω, A being `still`, the acceleration by all other forces, and what the turning forces push a particle at rest.
    With a = A + v × Ω at the start and θ = |Ω| h the mean is a + h (1 − cos θ)/θ² a×Ω + h² (θ − sin θ)/θ³ (a×Ω)×Ω, Rodrigues'
    rotation, integrated. |v| stays where A is 0. A step made of such kicks and of drifts has the order of its table.
    Source: Boris, Proc. 4th Conf. Num. Sim. Plasmas (1970) 3; He, Sun, Liu & Qin, J. Comput. Phys. 281 (2015) 135.
    """
    dimensions = state.dimensions
    at_rest, *pushed = (_push(state, total_force, i, time, unit) for unit in _units(state))
    # The acceleration A + v × Ω is A + (0, −Ω_z, Ω_y) for v = e_x, and A + (Ω_z, 0, −Ω_x) for v = e_y.
    turn = [_kept(pushed[-1][0] - at_rest[0])]
    if dimensions == AXES:
        turn = [_kept(at_rest[2] - pushed[1][2]), _kept(pushed[0][2] - at_rest[2]), *turn]
    if state.has_fixed_axes:  # a turn about an axis needs both other axes
        free = [entry_of(entry_of(state.free, i), k) for k in range(dimensions)]
        turn = [where(_all_free(free, k), each, 0.0) for k, each in enumerate(turn, AXES - len(turn))]
        at_rest = [where(each != 0.0, push, 0.0) for each, push in zip(free, at_rest)]
    velocity = components(velocity_seen(state, i), dimensions)
    others = components(still, dimensions)
    across = _cross(velocity, turn)
    start = [_kept(other + push + side) for other, push, side in zip(others, at_rest, across)]
    square = _kept(h * h * reduce(add, [each * each for each in turn]))
    by_cosine, by_sine = _rotation(square)
    first, second = _kept(h * by_cosine), _kept(h * h * by_sine)
    once = [_kept(each) for each in _cross(start, turn)]
    twice = _cross(once, turn)
    return vector_of(state, [a + first * b + second * c for a, b, c in zip(start, once, twice)])


def _units(state: Any) -> list[Any]:
    """Velocities at which the turning forces are asked: rest, e_x in three dimensions, e_y."""
    units = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    return [parameter_vector(state, unit) for unit in (units if state.dimensions == AXES else (units[0], units[2]))]


def _push(state: Any, total_force: Any, i: Any, time: Any, velocity: Any) -> list[Any]:
    """The acceleration by all forces that depend on velocity, at a velocity."""
    found = [force.accelerate(state, i, velocity, time) for force in total_force.external if force.depends_on_velocity]
    each = [components(one, state.dimensions) for one in found]
    return [_kept(reduce(add, parts)) for parts in zip(*each)]


def _cross(vector: list[Any], turn: list[Any]) -> list[Any]:
    """vector × Ω, in two dimensions with Ω along z."""
    if len(vector) < AXES:
        return [vector[1] * turn[0], -(vector[0] * turn[0])]
    x, y, z = vector
    return [y * turn[2] - z * turn[1], z * turn[0] - x * turn[2], x * turn[1] - y * turn[0]]


def _rotation(square: Any) -> tuple[Any, Any]:
    """(1 − cos θ)/θ² and (θ − sin θ)/θ³ of θ².

    Both come from p = sin(θ/2) and q = cos(θ/2) over p² + q², so that they are the sine and the cosine of one angle, which
    differs from θ by rounding: |v| stays but for the rounding of the two numbers. The second number has few digits for small
    angles, where it counts for as little.
    """
    angle = _kept(root(square))
    sine, cosine = (_kept(elementary(name, _kept(0.5 * angle))) for name in ("sin", "cos"))
    norm = _kept(sine * sine + cosine * cosine)
    is_small = is_above_zero(SMALL - square)
    first = where(is_small, 0.5 - square / 24.0, 2.0 * sine * sine / (norm * square))
    second = where(is_small, 1.0 / 6.0 - square / 120.0, (1.0 - 2.0 * sine * cosine / (norm * angle)) / square)
    return _kept(first), _kept(second)


def _all_free(free: list[Any], axis: int) -> Any:
    first, second = (entry for k, entry in enumerate(free) if k != axis)
    return first * second != 0.0


def _kept(number: Any) -> Any:
    """A local variable of the kernel, so that an expression that is used twice is computed once."""
    return number if isinstance(number, KernelNumber) else ti.lang.impl.expr_init(number)
