"""Rough functions: powers and exponentials in f64, on Vulkan as well, to the digits that are promised."""

import numpy as np
import pytest

from mpp_taichi.arithmetic.rough_functions import rough_exponential, rough_power
from mpp_taichi.device import backends

NUMBERS = np.array([1e-280, 1e-60, 3e-7, 0.5, 1.0, 7.0, 1e12, 1e150])
EXPONENTS = (-0.5, -1 / 8, 0.05, 1 / 3)


def computed(backend):
    """Powers by exponent, exponentials of −40 … 3, and 0 to a negative and to a positive power."""
    backends.start(backend, "f64")
    import taichi as ti

    count = len(NUMBERS)
    found = ti.field(ti.f64, (len(EXPONENTS), count))
    grown, zeros = ti.field(ti.f64, 44), ti.field(ti.f64, 2)
    given = ti.field(ti.f64, count)
    given.from_numpy(NUMBERS)

    @ti.kernel
    def compute(zero: ti.f64):
        for k in range(count):
            for e in ti.static(range(4)):
                found[e, k] = rough_power(given[k], EXPONENTS[e])
        for k in range(44):
            grown[k] = rough_exponential(ti.cast(k, ti.f64) - 40.0)
        zeros[0], zeros[1] = rough_power(zero, -0.25), rough_power(zero, 0.25)

    compute(0.0)
    return found.to_numpy(), grown.to_numpy(), zeros.to_numpy()


@pytest.mark.parametrize(("backend", "rounding"), [("cpu", 2.0**-52), ("vulkan", 2.0**-23)])
def test_powers_and_exponentials(backend, rounding, request):
    """By the standard of Vulkan a power y has 3 + 2 |log₂ y| roundings, and e^x has 3 + 2 |x|; an argument is rounded before.

    The argument x^(1/8) of a power is raised by 8 p. Numbers beyond f32 are 0 or infinity on Vulkan.
    """
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    powers, exponentials, zeros = computed(backend)
    for row, exponent in zip(powers, EXPONENTS):
        exact = NUMBERS**exponent
        fits = np.abs(np.log2(exact)) < 126
        allowed = (3 + 2 * np.abs(np.log2(exact)) + 8 * abs(exponent)) * rounding
        assert fits.sum() >= 5 and (np.abs(row / exact - 1) < allowed)[fits].all()
    x = np.arange(44) - 40.0
    assert (np.abs(exponentials / np.exp(x) - 1) < (3 + 3 * np.abs(x)) * rounding).all()
    assert zeros[0] == np.inf and zeros[1] == 0.0
