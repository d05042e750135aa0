"""Equations of state of hard disks and hard spheres: Z = P V / (N k T) over the packing fraction η.

The contact value g(σ) of the pair distribution and Z are one thing: Z = 1 + 2 η g in two dimensions, 1 + 4 η g in three.
Numbers or arrays; η from 0 to below 1, beyond its range each formula is only a continuation.
"""

import math
from typing import Any

import numpy as np


def compressibility(packing: Any, dimensions: int) -> Any:
    """Z of the fluid by the best formula here: Luding's in two dimensions, Kolafa's in three."""
    return hard_disks_luding(packing) if dimensions == 2 else hard_spheres_kolafa(packing)


def contact_value(packing: Any, dimensions: int) -> Any:
    """g(σ) of the fluid by the same formulas."""
    return contact_luding(packing) if dimensions == 2 else contact_kolafa(packing)


# Hard disks


def contact_henderson(packing: Any) -> Any:
    """g(σ) = (1 − 7η/16) / (1 − η)²; 1 % up to η = 0.6. Source: Henderson, Mol. Phys. 30 (1975) 971."""
    return (1.0 - 7.0 / 16.0 * packing) / (1.0 - packing) ** 2


def hard_disks_henderson(packing: Any) -> Any:
    """Z = (1 + η²/8) / (1 − η)². Source: Henderson, Mol. Phys. 30 (1975) 971."""
    return 1.0 + 2.0 * packing * contact_henderson(packing)


def contact_luding(packing: Any) -> Any:
    """Henderson's g(σ) − η³ / [128 (1 − η)⁴]; of the fluid, η up to 0.67. Source: Luding, Phys. Rev. E 63 (2001) 042201."""
    return contact_henderson(packing) - packing**3 / (128.0 * (1.0 - packing) ** 4)


def hard_disks_luding(packing: Any) -> Any:
    """Z = 1 + 2 η g of the fluid."""
    return 1.0 + 2.0 * packing * contact_luding(packing)


def hard_disks_global(packing: Any) -> Any:
    """Z of hard disks at any density, fluid, transition and crystal; about 2 % around η = 0.70, better elsewhere.

    Fluid and crystal are joined by a Fermi function of η.
    Sources: Luding, Phys. Rev. E 63 (2001) 042201; Luding, Adv. Complex Systems 4 (2001) 379.
    """
    closest, where, width, c1, c3 = math.pi / math.sqrt(12.0), 0.7006, 0.0111, -0.04, 3.25
    free = closest - packing
    fluid = hard_disks_luding(packing) - 1.0
    crystal = 2.0 * closest / free * (1.0 + c1 * free + c3 * free**3) - 1.0
    part = 1.0 / (1.0 + np.exp((where - np.asarray(packing)) / width))
    found = 1.0 + fluid + part * (crystal - fluid)
    return found if np.ndim(packing) else float(found)


# Hard spheres


def hard_spheres_carnahan_starling(packing: Any) -> Any:
    """Z = (1 + η + η² − η³) / (1 − η)³; 0.3 % up to η = 0.49. Source: Carnahan & Starling, J. Chem. Phys. 51 (1969) 635."""
    return (1.0 + packing + packing**2 - packing**3) / (1.0 - packing) ** 3


def contact_carnahan_starling(packing: Any) -> Any:
    """g(σ) = (1 − η/2) / (1 − η)³."""
    return (1.0 - 0.5 * packing) / (1.0 - packing) ** 3


def contact_kolafa(packing: Any) -> Any:
    """g(σ) = (1 − η/2 + η²/12 − η³/6) / (1 − η)³."""
    return (1.0 - packing / 2.0 + packing**2 / 12.0 - packing**3 / 6.0) / (1.0 - packing) ** 3


def hard_spheres_kolafa(packing: Any) -> Any:
    """Z = 1 + 4 η g = [1 + η + η² − 2/3 η³ (1 + η)] / (1 − η)³; 0.05 % in the fluid, η up to 0.49.

    Source: J. Kolafa, in Boublík & Nezbeda, Coll. Czech. Chem. Commun. 51 (1986) 2301.
    """
    return 1.0 + 4.0 * packing * contact_kolafa(packing)


# Mixtures


def contact_values_of_mixture(density: np.ndarray, radius: np.ndarray, dimensions: int) -> np.ndarray:
    """g_ij(σ_ij) of a mixture, shape (k, k), from number densities [length⁻ᵈ] and radii of its k species.

    d = 2: 1/(1−η) + 9/16 z/(1−η)²,                 z = (d_i d_j / d_ij) η ⟨d⟩/⟨d²⟩    (for one species Henderson's)
    d = 3: 1/(1−η) + 3/2 z/(1−η)² + 1/2 z²/(1−η)³,  z = (d_i d_j / d_ij) η ⟨d²⟩/⟨d³⟩   (for one species Carnahan–Starling's)

    with diameters d and d_ij = (d_i + d_j)/2. Sources: Jenkins & Mancini, J. Appl. Mech. 54 (1987) 27; Boublík, J. Chem. Phys.
    53 (1970) 471; Mansoori, Carnahan, Starling & Leland, J. Chem. Phys. 54 (1971) 1523.
    """
    n, d = np.asarray(density, dtype=float), 2.0 * np.asarray(radius, dtype=float)
    eta = float(np.sum(n * (math.pi / 4.0 * d**2 if dimensions == 2 else math.pi / 6.0 * d**3)))
    both = d[:, None] + d[None, :]
    reduced = np.divide(2.0 * d[:, None] * d[None, :], both, out=np.zeros_like(both), where=both > 0.0)  # two points: 0
    z = reduced * eta * float(np.sum(n * d ** (dimensions - 1)) / np.sum(n * d**dimensions))
    if dimensions == 2:
        return 1.0 / (1.0 - eta) + 9.0 / 16.0 * z / (1.0 - eta) ** 2
    return 1.0 / (1.0 - eta) + 1.5 * z / (1.0 - eta) ** 2 + 0.5 * z**2 / (1.0 - eta) ** 3
