"""Plummer's sphere: its density, its velocities and its position."""

import numpy as np
import pytest
from scipy.stats import kstest

from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Center, GeneratorContext
from mpp_taichi.generators.plummer import Plummer


def context(dimensions=3):
    nobody = Center(np.zeros(3), np.zeros(3), 0.0)
    return GeneratorContext(np.random.default_rng(3), 2.0, 0.0, lambda index: nobody, dimensions)


def plummer(**changed):
    given = {"count": 20_000, "total_mass": 3.0, "scale_radius": 0.5} | changed
    return Plummer(**given).generate(context())


def test_a_plummer_sphere_has_its_mass_profile_and_is_isotropic():
    """Kolmogorov–Smirnov at 1e-3 against M(r)/M = r³ (r² + a²)^(−3/2), cut off at the extent; the shift to the mean is 1/√n."""
    group = plummer(extent=50.0)
    distance = np.linalg.norm(group.position, axis=1)
    profile = kstest(distance, lambda r: (r / np.sqrt(r**2 + 0.25)) ** 3 / (50.0 / np.sqrt(50.0**2 + 0.25)) ** 3)
    assert profile.pvalue > 1e-3
    for part in (group.position, group.velocity):
        cosine = part[:, 2] / np.linalg.norm(part, axis=1)
        assert kstest(cosine, "uniform", args=(-1.0, 2.0)).pvalue > 1e-3
        assert np.abs(part.mean(axis=0)).max() < 1e-12
    assert group.mass.sum() == pytest.approx(3.0, rel=1e-12)


def test_a_plummer_sphere_is_in_equilibrium():
    """Kinetic energy 3π/64 G M²/a and σ² = G M / (6 √(r² + a²)) in each direction at every radius."""
    group = plummer(extent=50.0)
    squared = np.sum(group.velocity**2, axis=1)
    assert 0.5 * np.sum(group.mass * squared) == pytest.approx(3 * np.pi / 64 * 2.0 * 9.0 / 0.5, rel=5 / np.sqrt(20_000))
    distance = np.linalg.norm(group.position, axis=1)
    for low, high in ((0.0, 0.3), (0.3, 0.6), (0.6, 1.2), (1.2, 5.0)):
        there = (distance >= low) & (distance < high)
        ratio = squared[there] / (3 * 2.0 * 3.0 / (6 * np.sqrt(distance[there] ** 2 + 0.25)))
        assert abs(ratio.mean() - 1.0) < 5 * ratio.std() / np.sqrt(there.sum())


def test_a_plummer_sphere_ends_at_its_extent_and_is_where_it_is_put():
    group = plummer(count=500, extent=2.0, center=(5.0, 0.0, 0.0), drift=(0.0, 1.0, 0.0))
    assert group.position.mean(axis=0) == pytest.approx((5.0, 0.0, 0.0), abs=1e-12)
    assert group.velocity.mean(axis=0) == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    away = np.linalg.norm(group.position - group.position.mean(axis=0), axis=1)
    assert 1.0 < away.max() < 2.0 + 5 * 2.0 / np.sqrt(500)
    with pytest.raises(PlacementError, match="three dimensions"):
        Plummer(count=3).generate(context(dimensions=2))
