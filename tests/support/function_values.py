"""Values of a function of three numbers that runs within kernels."""

import numpy as np
import taichi as ti


def function_values(function, cases):
    """The values in f32, (n,), of a `ti.func` for n triples of numbers."""
    first, second, third = (np.array(column, np.float32) for column in zip(*cases))
    found = np.zeros(len(cases), np.float32)

    @ti.kernel
    def measure(
        first: ti.types.ndarray(ti.f32, ndim=1),
        second: ti.types.ndarray(ti.f32, ndim=1),
        third: ti.types.ndarray(ti.f32, ndim=1),
        found: ti.types.ndarray(ti.f32, ndim=1),
    ):
        for k in range(found.shape[0]):
            found[k] = function(first[k], second[k], third[k])

    measure(first, second, third, found)
    return found
