"""The volume of spheres: disks and areas in two dimensions, spheres and volumes in three."""

import math

import numpy as np

CLOSEST = {2: math.pi / math.sqrt(12.0), 3: math.pi / math.sqrt(18.0)}
"""Packing fraction of the hexagonal lattice of disks, and of the face-centred cubic lattice of spheres."""
UNIT_SURFACE = {2: 2.0 * math.pi, 3: 4.0 * math.pi}
"""Circumference of the unit circle, surface of the unit sphere."""


def sphere_volume(radius: float | np.ndarray, dimensions: int) -> float | np.ndarray:
    """π r² [length²] of a disk, or 4/3 π r³ [length³] of a sphere."""
    return math.pi * np.square(radius) if dimensions == 2 else 4.0 / 3.0 * math.pi * np.power(radius, 3)


def packing_fraction(density: float, radius: float, dimensions: int) -> float:
    """η, the part of the volume that equal spheres fill, from their number density n = N / V [length⁻ᵈ]."""
    return float(density * sphere_volume(radius, dimensions))
