"""How u = 1/ρ changes along a motion, ρ² = |d|² + ε²; d the separation, w its change, q its second change in time."""

import taichi as ti


@ti.func
def change_of_inverse_distance(inverse, approach):
    """u̇ = −u³ d·w, from u and d·w."""
    return -1.0 * approach * (inverse * inverse * inverse)


@ti.func
def second_change_of_inverse_distance(inverse, approach, spread):
    """ü = 3 u⁵ (d·w)² − u³ (w·w + d·q), from u, d·w and w·w + d·q."""
    square = inverse * inverse
    return square * inverse * (3.0 * square * approach * approach - spread)
