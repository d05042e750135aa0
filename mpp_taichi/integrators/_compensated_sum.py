"""Kahan's sum: what a sum was rounded by is kept, and taken from the next change."""

import taichi as ti


@ti.func
def compensated_sum(total, rest, change):
    """(total + change, rest) where `rest` is by how much the sum is too large; at first it is 0.

    Source: Kahan, Comm. ACM 8 (1965) 40.
    """
    corrected = change - rest
    summed = total + corrected
    return summed, (summed - total) - corrected
