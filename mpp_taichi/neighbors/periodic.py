"""The nearest image of a separation in a box that repeats."""

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
