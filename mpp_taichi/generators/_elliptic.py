"""Complete elliptic integrals by the arithmetic–geometric mean, and the gravity of a uniform sharp-edged disc."""

import numpy as np

_CONVERGED = 4.0 * np.finfo(float).eps


def elliptic_integrals(k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K(k) and K(k) − E(k) for a modulus 0 ≤ k < 1 (parameter m = k²), to a few units in the last place.

    a₀ = 1, b₀ = √(1−k²), c₀ = k; K = π / 2a∞, K − E = K Σ 2ⁿ⁻¹ cₙ². Source: Abramowitz and Stegun, §17.6.
    """
    k = np.asarray(k, dtype=float)
    a, b = np.ones_like(k), np.sqrt((1.0 - k) * (1.0 + k))
    total, weight = 0.5 * k * k, 0.5
    difference = k
    while np.any(np.abs(difference) > _CONVERGED):
        difference = 0.5 * (a - b)
        a, b = 0.5 * (a + b), np.sqrt(a * b)
        weight *= 2.0
        total = total + weight * difference * difference
    first = np.pi / (2.0 * a)
    return first, first * total


def annulus_pull(r: np.ndarray, inner_radius: float, outer_radius: float) -> np.ndarray:
    """Inward acceleration in the plane of a uniform annulus of surface density 1 and G = 1, at radius r > 0.

    The difference of two discs. From φ = −4 a E(r/a) inside a disc of radius a and φ = −4 r [E(k) − (1−k²) K(k)], k = a/r,
    outside, the pull is 4 (K−E)(k)/k, k = r/a, and 4 (K−E)(k). Diverges like the logarithm of the distance to either rim.
    """
    return _disc_pull(r, outer_radius) - _disc_pull(r, inner_radius)


def _disc_pull(r: np.ndarray, radius: float) -> np.ndarray:
    r = np.asarray(r, dtype=float)
    if radius == 0.0:
        return np.zeros_like(r)
    k = np.where(r < radius, r / radius, radius / r)
    return 4.0 * elliptic_integrals(k)[1] / np.where(r < radius, k, 1.0)
