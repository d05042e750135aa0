"""Precision: the ladder of numbers that a run can be computed in.

f32    single precision
f32c   single precision whose rounding of positions and velocities is carried along and made good (compensated updates)
ds     positions and velocities as sums of two single-precision numbers, high + low; forces of their exact differences
f64    double precision

In f32c and ds the arithmetic of the forces stays single; both need no f64 of the device.
"""

PRECISIONS = ("f32", "f32c", "ds", "f64")


def number_type(precision: str) -> str:
    """The type that forces are computed in: f32 or f64."""
    return "f64" if precision == "f64" else "f32"


def carries_low_parts(precision: str) -> bool:
    """Whether positions and velocities have a low part."""
    return precision in ("f32c", "ds")


def forces_see_low_parts(precision: str) -> bool:
    """Whether separations are taken of both parts."""
    return precision == "ds"
