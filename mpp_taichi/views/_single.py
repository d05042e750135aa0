"""Numbers and vectors in single precision on the device, whatever the precision of the simulation."""

import taichi as ti


@ti.func
def single(number):
    """A literal in single precision; Taichi gives literals the precision of the simulation."""
    return ti.cast(number, ti.f32)


@ti.func
def direction(vector):
    """The vector at length one; not normalized(), whose default argument is in the simulation's precision."""
    return vector * (single(1) / ti.sqrt(vector.dot(vector)))
