"""Precision: the ladder of numbers that a run can be computed in.

f32    single precision
f32c   single precision whose rounding of positions and velocities is carried along and made good (compensated updates)
ds     positions and velocities as sums of two single-precision numbers, high + low; forces of their exact differences
df64   double-float: all of ds, and constants, separations, roots and sums of forces as sums of two such numbers as well
f64    double precision

In f32c and ds the arithmetic of the forces stays single; df64 has 48 bits throughout. All three need no f64 of the device.
"""

PRECISIONS = ("f32", "f32c", "ds", "df64", "f64")

SMALLEST_IN_TWO_PARTS = 2.0**-78
"""Least size of a number whose products keep 48 bits in two parts: their rounding errors are above 2⁻¹²⁶, the least f32."""
FARTHEST_PAIR = 2.0**26
"""Largest distance whose inverse cube is above `SMALLEST_IN_TWO_PARTS`."""
SMALLEST_SINGLE, LARGEST_SINGLE = 2.0**-126, 2.0**128 - 2.0**104
"""The least f32 with all its digits, below which kernels take a number for 0, and the largest f32."""
FARTHEST_PAIR_IN_SINGLE = 2.0**42
"""Largest distance whose inverse cube is an f32 with all its digits."""


def number_type(precision: str) -> str:
    """The type of the numbers on the device, of which some precisions take two for one number: f32 or f64."""
    return "f64" if precision == "f64" else "f32"


def carries_low_parts(precision: str) -> bool:
    """Whether positions and velocities have a low part."""
    return precision in ("f32c", "ds", "df64")


def forces_see_low_parts(precision: str) -> bool:
    """Whether separations are taken of both parts."""
    return precision in ("ds", "df64")


def forces_have_low_parts(precision: str) -> bool:
    """Whether forces are computed in double-single arithmetic, of constants that have a low part."""
    return precision == "df64"
