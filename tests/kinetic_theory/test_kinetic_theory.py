"""Kinetic theory of hard disks and spheres against virial coefficients, published simulations and statistics."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from mpp_taichi.kinetic_theory import collision_rate as rates
from mpp_taichi.kinetic_theory import equation_of_state as state
from mpp_taichi.kinetic_theory import gas_in_box, kolmogorov_smirnov, packing, speeds, transport

# B_n / B₂^(n−1), n = 3 … 10: Clisby & McCoy, J. Stat. Phys. 122 (2006) 15.
DISKS = [0.7820044, 0.5322318, 0.3335560, 0.1988425, 0.1148728, 0.0649930, 0.0362193, 0.0199537]
SPHERES = [0.625, 0.2869495, 0.1102521, 0.0388820, 0.0130235, 0.0041832, 0.0013094, 0.0004035]


def virial_series(eta, dimensions):
    """Z by ten virial coefficients; the rest as a geometric series of the last ratio, which is also returned."""
    reduced = [1.0, *(DISKS if dimensions == 2 else SPHERES)]
    b2 = 2.0 ** (dimensions - 1)
    terms = [b * (b2 * eta) ** (power + 1) for power, b in enumerate(reduced)]
    ratio = terms[-1] / terms[-2]
    return 1.0 + math.fsum(terms) + terms[-1] * ratio / (1.0 - ratio), terms[-1] * ratio / (1.0 - ratio)


# --- equations of state ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions, highest, allowed", [(2, 0.5, 2e-3), (3, 0.4, 1e-3)])
def test_fluids_agree_with_their_virial_series(dimensions, highest, allowed):
    """Luding states 0.1 to 0.2 %, Kolafa 0.05 %; half of the extrapolated rest may be wrong."""
    for eta in np.linspace(0.02, highest, 13):
        series, rest = virial_series(eta, dimensions)
        assert state.compressibility(eta, dimensions) == pytest.approx(series, abs=allowed * series + 0.5 * rest)


@pytest.mark.parametrize("density, z", [(0.6, 4.2952), (0.75, 6.6566)])
def test_hard_spheres_agree_with_published_simulations(density, z):
    """The values that HOOMD-blue is validated by, n σ³ and Z."""
    eta = packing.packing_fraction(density, 0.5, 3)
    assert state.hard_spheres_kolafa(eta) == pytest.approx(z, rel=5e-4)
    assert state.hard_spheres_carnahan_starling(eta) == pytest.approx(z, rel=4e-3)


def test_dense_disks_agree_with_published_simulations():
    """Where the fluid begins to order: β P σ² = 9.17079 at n σ² = 0.88872 (Engel et al., Phys. Rev. E 87 (2013) 042134).

    The join of fluid and crystal is good to 2 % there. Fluid at A/A₀ = 1.4: Z = 8.306 (Erpenbeck & Luban, Phys. Rev. A 32
    (1985) 2920).
    """
    assert 0.88872 * state.hard_disks_global(packing.packing_fraction(0.88872, 0.5, 2)) == pytest.approx(9.17079, rel=0.02)
    assert state.hard_disks_luding(packing.CLOSEST[2] / 1.4) == pytest.approx(8.306, rel=1e-3)
    assert state.hard_disks_global(0.3) == pytest.approx(state.hard_disks_luding(0.3), rel=1e-12)
    free = packing.CLOSEST[2] - 0.9  # a crystal near its closest packing: free volumes, Z → 2 / (1 − η/η_max)
    assert state.hard_disks_global(0.9) * free / packing.CLOSEST[2] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_pressure_and_contact_value_are_one_thing(dimensions):
    eta = np.array([0.05, 0.2, 0.45])
    z = 1.0 + 2 ** (dimensions - 1) * eta * state.contact_value(eta, dimensions)
    assert z == pytest.approx(state.compressibility(eta, dimensions), rel=1e-14)
    if dimensions == 3:  # as the paper has it
        assert z == pytest.approx((1 + eta + eta**2 - 2 / 3 * eta**3 * (1 + eta)) / (1 - eta) ** 3, rel=1e-14)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_mixture_of_one_species_named_twice_is_that_species(dimensions):
    eta, radius = 0.3, 0.7
    n = eta / packing.sphere_volume(radius, dimensions)
    g = state.contact_values_of_mixture(np.array([0.4 * n, 0.6 * n]), np.array([radius, radius]), dimensions)
    single = state.contact_henderson(eta) if dimensions == 2 else state.contact_carnahan_starling(eta)
    assert g == pytest.approx(np.full((2, 2), single), rel=1e-14)


def test_point_particles_among_spheres_meet_a_free_surface():
    """A point is at contact with a sphere as often as a cavity of that place is empty: g = 1 / (1 − η), exactly."""
    for dimensions in (2, 3):
        n = 0.3 / packing.sphere_volume(1.0, dimensions)
        g = state.contact_values_of_mixture(np.array([n, 0.0]), np.array([1.0, 0.0]), dimensions)
        assert g[0, 1] == pytest.approx(1.0 / 0.7, rel=1e-14)


# --- collision rates ------------------------------------------------------------------------------------------------------


def test_the_collision_rate_of_hard_spheres_is_the_published_one():
    """Mean free time 0.13031 at n σ³ = 0.5 (Lue, J. Chem. Phys. 122 (2005) 044513); Enskog theory is good to 0.2 % there."""
    assert 1.0 / rates.enskog_rate(0.5, 0.5, 1.0, 1.0, 3) == pytest.approx(0.13031, rel=2e-3)


def test_the_collision_rate_of_the_gas_of_disks():
    """N = 250, r = 0.1 in 7.5 × 5, b = 1, walls left out: 2 n σ g √(π k T / m), by hand, with Henderson's g 4.86."""
    assert rates.enskog_rate(250 / 37.5, 0.1, 1.0, 0.5, 2) == pytest.approx(4.86, abs=0.005)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_rates_of_a_mixture_add_up_and_balance(dimensions):
    """Species that differ in name only share the rate; n_i Γ_ij = n_j Γ_ji as each collision has two partners."""
    n = 0.25 / packing.sphere_volume(0.5, dimensions)
    both = rates.enskog_rates_of_mixture(n * np.array([0.3, 0.7]), np.full(2, 0.5), np.full(2, 2.0), 1.5, dimensions)
    single = state.contact_value(0.25, dimensions)
    mixture = state.contact_henderson(0.25) if dimensions == 2 else state.contact_carnahan_starling(0.25)
    expected = rates.enskog_rate(n, 0.5, 2.0, 1.5, dimensions) * mixture / single
    assert both.sum(axis=1) == pytest.approx(np.full(2, expected), rel=1e-13)
    densities = np.array([0.3, 0.02])
    unequal = rates.enskog_rates_of_mixture(densities, np.array([0.2, 0.6]), np.array([1.0, 30.0]), 1.0, dimensions)
    flow = densities[:, None] * unequal
    assert flow == pytest.approx(flow.T, rel=1e-14)


def test_mean_free_path_of_a_dilute_gas_is_maxwells():
    """λ = 1 / (√2 n π σ²) in three dimensions, 1 / (√2 · 2 n σ) in two."""
    n = 1e-10  # g − 1 is of that order
    for dimensions, cross_section in ((2, 2.0), (3, math.pi)):
        rate = rates.enskog_rate(n, 0.5, 3.0, 2.0, dimensions)
        path = rates.mean_free_path(rate, 3.0, 2.0, dimensions)
        assert path * n * cross_section * math.sqrt(2.0) == pytest.approx(1.0, rel=1e-7)


# --- walls ----------------------------------------------------------------------------------------------------------------

# count, box, radius; collisions per particle and pressure on the walls at k T = m = 1, from 2·10⁵ collisions each of an
# event-driven program of its own (every pair looked at, no cells); standard errors of the rates are 0.25 %.
MEASURED = [
    (250, (15.0, 10.0), 0.1, 1.3003, 1.9222, 0.01),
    (250, (7.5, 5.0), 0.1, 6.9994, 11.574, 0.01),
    (256, (5.0, 5.0), 0.1, 13.907, 24.812, 0.01),
    (256, (10.0, 10.0, 10.0), 0.5, 2.9959, 0.66089, 0.02),
    (256, (7.5, 7.5, 7.5), 0.5, 13.456, 4.6323, 0.05),
]


@pytest.mark.parametrize("count, box, radius, rate, pressure, allowed", MEASURED)
def test_a_gas_between_walls_is_that_of_event_driven_runs(count, box, radius, rate, pressure, allowed):
    """The theory leaves out (r S/V)² and more, which makes 0.3 % for the disks, 1 % for the spheres, 4 % for the dense ones."""
    assert gas_in_box.rate_in_box(count, box, radius, 1.0, 1.0) == pytest.approx(rate, rel=allowed)
    assert gas_in_box.pressure_in_box(count, box, radius, 1.0) == pytest.approx(pressure, rel=allowed)


@pytest.mark.parametrize("box", [(7.0, 5.0), (6.0, 7.0, 8.0)])
def test_a_gas_between_walls_obeys_the_virial_theorem(box):
    """d P V_c = d N k T + N Γ/2 · √(π k T m) σ holds exactly; theory keeps it to second order in S r / V."""
    count, radius, mass, temperature = 40, 0.05, 2.0, 1.5
    rate = gas_in_box.rate_in_box(count, box, radius, mass, temperature)
    inner = math.prod(length - 2 * radius for length in box)
    virial = 0.5 * count * rate * math.sqrt(math.pi * temperature * mass) * 2 * radius
    by_virial = (count * temperature + virial / len(box)) / inner
    assert gas_in_box.pressure_in_box(count, box, radius, temperature) == pytest.approx(by_virial, rel=1e-4)


def test_points_between_walls_are_an_ideal_gas():
    assert gas_in_box.pressure_in_box(100, (2.0, 3.0, 4.0), 1e-9, 1.5) == pytest.approx(100 * 1.5 / 24, rel=1e-7)
    assert gas_in_box.bulk_density(10, (2.0, 3.0), 0.01) == pytest.approx(10 / (1.98 * 2.98), rel=2e-3)
    with pytest.raises(ValueError, match="no fluid in a box of 1 × 1"):
        gas_in_box.bulk_density(100, (1.0, 1.0), 0.1)


# --- speeds and statistics ------------------------------------------------------------------------------------------------


def test_speeds_are_those_of_maxwell_and_boltzmann():
    v, mass, temperature = np.linspace(0.0, 6.0, 41), 2.0, 3.0
    scale, width = speeds.speed_scale(mass, temperature), math.sqrt(temperature / mass)
    for dimensions, known in ((2, stats.rayleigh(scale=width)), (3, stats.maxwell(scale=width))):
        assert speeds.speed_density(v, scale, dimensions) == pytest.approx(known.pdf(v), rel=1e-12, abs=1e-15)
        assert speeds.speed_cumulative(v, scale, dimensions) == pytest.approx(known.cdf(v), rel=1e-12, abs=1e-15)
        assert speeds.mean_speed(mass, temperature, dimensions) == pytest.approx(known.mean(), rel=1e-12)


def test_kinetic_temperature_is_per_freedom():
    random = np.random.default_rng(1)
    mass, drift = random.uniform(1, 2, 5000), np.array([3.0, -1.0, 0.0])
    velocity = random.normal(size=(5000, 3)) * np.sqrt(0.7 / mass)[:, None] * [1.0, 1.0, 0.0]
    error = 4 * 0.7 * math.sqrt(2 / 10_000)  # four standard errors of a mean of 10⁴ squares
    assert speeds.kinetic_temperature(velocity, mass, 2) == pytest.approx(0.7, abs=error)
    moving = speeds.kinetic_temperature(velocity + drift, mass, 2, drift=True)
    assert moving == pytest.approx(speeds.kinetic_temperature(velocity, mass, 2, drift=True), rel=1e-12)
    assert speeds.kinetic_temperature(np.array([[1.0, 2.0, 0.0]]), np.array([1.0]), 2, drift=True) == 0.0


def test_kolmogorov_smirnov_agrees_with_scipy():
    random = np.random.default_rng(3)
    for count in (5, 250, 4000):
        sample = random.rayleigh(size=count)
        found = kolmogorov_smirnov.distance(stats.rayleigh.cdf(sample))
        expected = stats.kstest(sample, stats.rayleigh.cdf)
        assert found == pytest.approx(expected.statistic, rel=1e-12)
        assert kolmogorov_smirnov.probability(found, count) == pytest.approx(expected.pvalue, abs=0.06 / count**0.5)
        assert kolmogorov_smirnov.critical_distance(count) == pytest.approx(stats.kstwo.isf(0.05, count), rel=5e-3)
    with pytest.raises(ValueError, match="nothing"):
        kolmogorov_smirnov.distance(np.array([]))


def test_equal_speeds_are_far_from_equilibrium():
    """All v = b: half the distribution's way up, 1 − 1/e = 0.632, is below them."""
    equal = speeds.speed_cumulative(np.ones(250), 1.0, 2)
    assert kolmogorov_smirnov.distance(equal) == pytest.approx(1 - math.exp(-1), rel=1e-12)
    assert kolmogorov_smirnov.critical_distance(250) == pytest.approx(0.086, abs=1e-3)


# --- transport ------------------------------------------------------------------------------------------------------------


def test_diffusion_is_chapman_and_enskogs():
    n, radius, mass, temperature = 0.2, 0.5, 2.0, 1.5
    for dimensions, bare in ((2, 1 / (2 * n)), (3, 3 / (8 * n))):
        g = state.contact_value(packing.packing_fraction(n, radius, dimensions), dimensions)
        expected = bare / g * math.sqrt(temperature / (math.pi * mass))
        assert transport.self_diffusion(n, radius, mass, temperature, dimensions) == pytest.approx(expected, rel=1e-13)


def test_a_heavy_sphere_feels_the_friction_of_free_molecules():
    """ξ M = (8/3) √(2π m k T) n σ² g for M ≫ m; and a sphere of the bath feels 2 Γ/d, mixture's g."""
    n, mass = 0.05, 1e9
    given = {"density": n, "bath_mass": 1.0, "bath_radius": 0.5, "temperature": 2.0}
    found = transport.friction_in_bath(mass, 1.5, dimensions=3, **given)
    g = state.contact_values_of_mixture(np.array([0.0, n]), np.array([1.5, 0.5]), 3)[0, 1]
    assert found * mass == pytest.approx(8 / 3 * math.sqrt(2 * math.pi * 2.0) * n * 4.0 * g, rel=1e-8)
    same = transport.friction_in_bath(1.0, 0.5, dimensions=3, **given)
    like = rates.enskog_rates_of_mixture(np.array([n]), np.array([0.5]), np.array([1.0]), 2.0, 3)[0, 0]
    assert same == pytest.approx(2 / 3 * like, rel=1e-13)


def test_brownian_motion_begins_straight_and_ends_diffusive():
    mass, friction, temperature = 3.0, 2.0, 1.5
    early = transport.brownian_square_displacement(1e-4, mass, friction, temperature, 2)
    assert early == pytest.approx(2 * temperature / mass * 1e-8, rel=1e-4)
    late = transport.brownian_square_displacement(1e6, mass, friction, temperature, 2)
    assert late == pytest.approx(4 * temperature / (mass * friction) * 1e6, rel=1e-5)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_haffs_law_solves_the_balance_of_energy(dimensions):
    """d/2 N dT/dt = −N Γ/2 · (1 − e²) ⟨μ v_n²/2⟩, the mean over collisions being k T; Γ ∝ √T, integrated numerically."""
    temperature, restitution, rate = 2.0, 0.9, 5.0

    def slope(_, t):
        return -(1 - restitution**2) * rate * math.sqrt(t[0] / temperature) * t / dimensions

    tau = transport.haff_time(rate, restitution, dimensions)
    solved = integrate.solve_ivp(slope, (0, 7.0), [temperature], rtol=1e-10, atol=1e-12).y[0, -1]
    assert transport.haff_temperature(7.0, temperature, tau) == pytest.approx(solved, rel=1e-7)
    assert transport.haff_time(rate, 1.0, dimensions) == math.inf


def test_the_energy_a_collision_takes_is_that_of_sampled_collisions():
    """⟨½ μ v_n²⟩ = k T over collisions: normal velocities weighted by their own size, 10⁶ samples, five standard errors."""
    v = np.random.default_rng(2).normal(size=1_000_000) * math.sqrt(2.0 * 1.5 / 3.0)  # k T = 1.5, μ = m/2 = 1.5
    energy = np.sum(np.abs(v) * 0.5 * 1.5 * v**2) / np.sum(np.abs(v))
    assert energy == pytest.approx(1.5, rel=5 * 1.5e-3)


def test_slow_compression_heats_along_the_adiabat():
    """Points: T V^(2/d). Carnahan and Starling's spheres: ∫ (Z − 1) dη/η = (4η − 3η²)/(1 − η)², in closed form."""
    assert transport.adiabatic_temperature_ratio(1e-12, 2e-12, 2) == pytest.approx(2.0, rel=1e-10)

    def carnahan_starling(eta, _):
        return state.hard_spheres_carnahan_starling(eta)

    def excess(eta):
        return (4 * eta - 3 * eta**2) / (1 - eta) ** 2

    expected = math.exp(2 / 3 * (math.log(2.0) + excess(0.4) - excess(0.2)))
    assert transport.adiabatic_temperature_ratio(0.2, 0.4, 3, carnahan_starling) == pytest.approx(expected, rel=1e-12)
