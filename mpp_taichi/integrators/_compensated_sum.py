"""Kahan's sum: the rounding error of a sum is kept, and subtracted from the next change."""

import taichi as ti


@ti.func
def compensated_sum(total, rest, change):
    """(total + change, rest), where `rest` is the amount by which the sum is too large; it is 0 at first.

    Source: Kahan, Comm. ACM 8 (1965) 40.
    """
    corrected = change - rest
    summed = total + corrected
    return summed, (summed - total) - corrected
