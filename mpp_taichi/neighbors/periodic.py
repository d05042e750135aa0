"""The nearest image of a separation, and the image of a place inside the box, in a box that repeats."""

import taichi as ti

from mpp_taichi.types import Template


@ti.func
def nearest_image(separation, period: Template):
    """A separation minus whole periods, so that no component exceeds half a period; an axis of period 0 does not repeat.

    A component within half a period is returned bit for bit.
    """
    result = separation
    for axis in ti.static(range(separation.n)):
        if ti.static(period[axis] > 0.0):
            if not ti.abs(result[axis]) <= ti.static(period[axis] / 2.0):  # rare, so most separations need no division
                result[axis] -= period[axis] * ti.floor(result[axis] / period[axis] + 0.5)
    return result


@ti.func
def inside_box(place, corner, period: Template):
    """The image of a place that lies in the box from its lower corner on; an axis of period 0 does not repeat."""
    result = place
    for axis in ti.static(range(place.n)):
        if ti.static(period[axis] > 0.0):
            edge = period[axis]
            beyond = result[axis] - corner[axis]
            if not (0.0 <= beyond and beyond < edge):
                result[axis] -= edge * ti.floor(beyond / edge)
    return result
