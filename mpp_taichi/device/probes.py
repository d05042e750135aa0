"""Probes: small kernels that show which numbers and loops the backend that runs computes rightly."""

import math
from typing import Any

LOOP_TRIAL = 70_000  # software Vulkan stops a thread silently after 65,535 iterations
KAHAN_TERMS = 30_000
SUM_TERMS = 1000


def run(ti: Any, backend: str) -> dict[str, Any]:
    """Run every probe on the backend that runs; the keys are the fields of `backends.Probes`."""
    return {
        "loop_limit": _loop_limit(ti),
        "float64": _float64(ti),
        "compensation": _compensation(ti),
        "low_parts": _low_parts(ti),
        "finds_nan": _finds_nan(ti),
    }


def _loop_limit(ti: Any) -> int | None:
    @ti.kernel
    def count_to(n: ti.i32) -> ti.i32:
        ti.loop_config(serialize=True)
        total = 0
        for _ in range(1):
            for k in range(n):
                total += 1 if k >= 0 else 2
        return total

    counted = count_to(LOOP_TRIAL)
    return None if counted == LOOP_TRIAL else int(counted)


def _float64(ti: Any) -> bool:
    @ti.kernel
    def smallest_step(one: ti.f64, step: ti.f64) -> ti.f64:
        return (one + step) - one

    @ti.kernel
    def root(x: ti.f64) -> ti.f64:
        return ti.sqrt(x)

    @ti.kernel
    def ratio(x: ti.f64, y: ti.f64) -> ti.f64:
        return x / y

    @ti.kernel
    def harmonic_sum(n: ti.i32, one: ti.f64) -> ti.f64:
        total = ti.cast(0.0, ti.f64)
        ti.loop_config(serialize=True)
        for _ in range(1):
            for k in range(n):
                total += one / ti.cast(k + 1, ti.f64)
        return total

    try:
        keeps_ulp = smallest_step(1.0, 2.0**-52) == 2.0**-52
        # Some compilers take the root of an f64 in f32, so that 0.64 gives 0.8000002, or divide by a rough inverse.
        keeps_root = abs(root(0.64) - 0.8) <= 2.0**-53
        keeps_ratio = ratio(1.0, 3.0) == 1.0 / 3.0 and ratio(2.0, 0.7) == 2.0 / 0.7
        exact = math.fsum(1.0 / k for k in range(1, SUM_TERMS + 1))
        keeps_sum = abs(harmonic_sum(SUM_TERMS, 1.0) - exact) <= SUM_TERMS * 2.0**-53 * exact
        return keeps_ulp and keeps_root and keeps_ratio and keeps_sum
    except Exception:  # a device without f64: Taichi raises whatever the driver said
        return False


def _compensation(ti: Any) -> bool:
    @ti.kernel
    def kahan(n: ti.i32, term: ti.f32) -> ti.f32:
        total = ti.cast(0.0, ti.f32)
        lost = ti.cast(0.0, ti.f32)
        ti.loop_config(serialize=True)
        for _ in range(1):
            for _k in range(n):
                corrected = term - lost
                raised = total + corrected
                lost = (raised - total) - corrected
                total = raised
        return total

    return abs(kahan(KAHAN_TERMS, 0.1) - 0.1 * KAHAN_TERMS) < 1e-3  # a plain f32 sum is off by about 1


def _low_parts(ti: Any) -> bool:
    from mpp_taichi.device.update_probe import keeps_low_parts  # this module imports Taichi

    return keeps_low_parts(ti, guards_rounding=not _compensation(ti))


def _finds_nan(ti: Any) -> bool:
    @ti.kernel
    def not_finite(zero: ti.f32, one: ti.f32) -> ti.i32:
        nan = zero / zero
        infinity = one / zero
        found = 0
        if ti.math.isnan(nan):
            found += 1
        if ti.math.isinf(infinity):
            found += 2
        if ti.math.isnan(one) or ti.math.isinf(one):
            found += 4
        return found

    return not_finite(0.0, 1.0) == 3
