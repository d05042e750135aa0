"""The softened distance ρ, ρ² = |d|² + ε², of two particles, its inverse u = 1/ρ, and how u changes along a motion.

d is the separation of the two particles, ε the softening, w the rate of change of d, and q the rate of change of w. This is the
only file that writes the softening down: every pair loop, whatever its shape, calls these functions. The functions take numbers
and vectors of lanes alike.
"""

import taichi as ti

from mpp_taichi.arithmetic.kernel_number import KernelNumber
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.types import Template


@ti.func
def softened_square(squared, softening_squared: Template):
    """ρ² = |d|² + ε². A loop calls this where it needs no 1/ρ, or takes several inverse roots by one division."""
    return squared + softening_squared


@traced
def inverse_root(squared):
    """1/√s for one number s of any kind, or each lane of a vector: a square root, then a division."""
    return squared.inverse_root() if isinstance(squared, KernelNumber) else 1.0 / ti.sqrt(squared)


@ti.func
def inverse_distance(squared, softening_squared: Template):
    """u = 1/ρ = 1/√(|d|² + ε²), from |d|² and ε²."""
    return inverse_root(softened_square(squared, softening_squared))


@ti.func
def change_of_inverse_distance(inverse, approach):
    """u̇ = −u³ d·w, from u and d·w."""
    return -1.0 * approach * (inverse * inverse * inverse)


@ti.func
def second_change_of_inverse_distance(inverse, approach, spread):
    """ü = 3 u⁵ (d·w)² − u³ (w·w + d·q), from u, d·w and w·w + d·q."""
    square = inverse * inverse
    return square * inverse * (3.0 * square * approach * approach - spread)
