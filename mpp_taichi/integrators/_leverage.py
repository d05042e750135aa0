"""The leverage of a pair of bodies: how much an error of a step counts after an orbit of the pair, in parts of the error."""

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_distance, inverse_root
from mpp_taichi.forces._inverse_square import InverseSquareForce
from mpp_taichi.types import Template

NEARLY_FREE = 1e-4  # x below which a pair is as good as unbound
TIDES = 2.5  # how strongly other bodies reduce the leverage of a pair that they disturb at its greatest distance
SLOWEST = 0.01  # of g: least square of a relative speed that errors are compared with, where two bodies are at rest
NOTHING = 1e-30  # keeps 0/0 away, where a pair neither moves nor attracts


@ti.func
def leverage_squared(speed_squared, depth, tide_squared):
    """L² = x⁴ / (4 (x⁶ + (1e-4 x²)² + 2.5 (t/g)²)) with x = 1 − w²/2g, and 0 where x < 0; for numbers and vectors of lanes.

    w is the relative speed of two bodies, g = G (m_i + m_j)/ρ the depth of their potential, and t = ρ |b|, b the part of the
    relative acceleration that other bodies cause; all in units in which the motion is of order one. Undisturbed, L = 1/2x: on
    a circle 1, at the pericentre of an ellipse 1/(1 − e). A relative error δ of ρ or w in a step changes the energy of the
    pair by a part of 2 L δ to 4 L δ, the period by 3/2 of that, and the place after an orbit by up to 12π L δ of the semi-major
    axis. The greatest distance of the pair is at most ρ/x. There, t/g is 1/x³ times as large as here: where other bodies
    would part the two, the pair has no orbit, and L is small.
    """
    bound = ti.max((depth - 0.5 * speed_squared) / (depth + NOTHING), 0.0)
    squared = bound * bound
    four = squared * squared
    tides = TIDES * tide_squared / (depth * depth + NOTHING)
    return 0.25 * four / ((squared + NEARLY_FREE * NEARLY_FREE) * four + tides + NOTHING)


@ti.func
def strength(state: Template, force: Template, i, j):
    """G (m_i + m_j): the pull between two particles times the square of their distance; a held particle does not move."""
    one = force.response(state, i) * force.source(state, j)
    other = force.response(state, j) * force.source(state, i)
    if ti.static(state.has_fixed_axes):
        one *= state.free[i].max()
        other *= state.free[j].max()
    return one + other


def orbit_forces(total_force):
    """The forces of a scene under which two bodies move round each other on conic sections."""
    return [force for force in total_force.pair_forces if isinstance(force, InverseSquareForce)]


@ti.func
def orbit_error_factors(state: Template, total_force: Template, i, j, acceleration):
    """L/ρ and L/w of two particles: errors of separation and relative velocity times these are errors of the pair's orbit.

    `acceleration` is the relative acceleration of the particles. Both factors are 0 for two bodies that are not bound.
    """
    d = state.position[j] - state.position[i]
    speed_squared = (state.velocity[j] - state.velocity[i]).norm_sqr()
    depth, slope, tide = 0.0, 0.0, acceleration
    for force in ti.static(orbit_forces(total_force)):
        inverse = inverse_distance(d.norm_sqr(), force.softening * force.softening)
        strong = strength(state, force, i, j)
        depth += strong * inverse
        slope += strong * inverse * inverse
        tide += (strong * force.shape(inverse)) * d
    result = ti.Vector([0.0, 0.0])
    if speed_squared < 2.0 * depth:
        tide_squared = tide.norm_sqr() / (slope * slope)
        leverage = ti.sqrt(leverage_squared(speed_squared / depth, 1.0, tide_squared))
        result = leverage * ti.Vector([slope / depth, inverse_root(speed_squared + SLOWEST * depth)])
    return result
