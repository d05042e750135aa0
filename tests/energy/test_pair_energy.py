"""The energy of pairs in tiles of lanes: the sum that NumPy takes in long double, for every remainder of the tiles."""

import math

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.neighbors.pair_energy import LEAST_COUNT

SOFTENING, OTHER = 0.05, 0.2
LANES = 16  # of f32 in a register; in f64, two tiles of 8
COUNTS = (LEAST_COUNT - 1, LEAST_COUNT, LEAST_COUNT + 1, LEAST_COUNT + LANES - 1, 2 * LEAST_COUNT + LANES + 3)


def cloud(count, dimensions, **more):
    """A cloud of charged bodies on their places, which no f32 rounds."""
    random = np.random.default_rng(count + dimensions)
    places = np.round(random.normal(size=(count, dimensions)) * 2**12) / 2**12
    bodies = [
        {"body": {"mass": 0.5 + k % 3, "charge": (-1.0) ** k, "position": place.tolist()}} for k, place in enumerate(places)
    ]
    return {
        "dimensions": dimensions,
        "particles": bodies,
        "forces": [{"newtonian_gravity": {"softening": SOFTENING}}, {"coulomb": {"softening": OTHER}}],
        "integrator": {"leapfrog": {"dt": 1e-3}},
        **more,
    }


def exact(snapshot):
    """The energy of gravity and of charges, and the sum of the sizes of its terms, in long double."""
    i, j = np.triu_indices(snapshot.particle_count, 1)
    place = snapshot.position.astype(np.longdouble)
    squared = ((place[i] - place[j]) ** 2).sum(1)
    mass, charge = snapshot.mass.astype(np.longdouble), snapshot.charge.astype(np.longdouble)
    terms = -mass[i] * mass[j] / np.sqrt(squared + np.longdouble(SOFTENING) ** 2)
    terms += charge[i] * charge[j] / np.sqrt(squared + np.longdouble(OTHER) ** 2)
    return float(terms.sum()), float(np.abs(terms).sum())


def energy(scene, precision="f64", threads=None):
    with Simulation(scene, backend="cpu", precision=precision, threads=threads) as run:
        meter = run.phase.energy_meter
        found = meter.potential_energy(0.0)
        assert (meter._rows is not None) == (run.state.particle_count >= LEAST_COUNT)
        return found, run.start


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_energy_is_the_sum_over_all_pairs(count, dimensions):
    """A body's sum of N terms rounds at random by √N · 2⁻⁵³ of its terms, each of which has some ten roundings of its own."""
    found, start = energy(cloud(count, dimensions))
    expected, size = exact(start)
    assert abs(found - expected) < (math.sqrt(count) + 10) * 2.0**-53 * size


@pytest.mark.parametrize("precision", ["f32c", "ds"])
def test_with_low_parts_the_sum_is_of_f64(precision):
    """The constants of the forces are rounded to f32, which changes each term by 4 · 2⁻²⁴ of itself at most."""
    scene = cloud(LEAST_COUNT + 5, 3)
    found, start = energy(scene, precision)
    expected, size = exact(start)
    assert abs(found - expected) < 4 * 2.0**-24 * size
    assert found == pytest.approx(energy(scene)[0], abs=4 * 2.0**-24 * size)


@pytest.mark.parametrize("count", [LEAST_COUNT, 2 * LEAST_COUNT + LANES + 3])
def test_in_single_precision_distances_round_at_random(count):
    """Inverse distances of f32 round by at most 6 · 2⁻²⁴ of themselves, so that √pairs such roundings add up.

    Each difference of two places rounds by 2⁻²⁴, which its square doubles, and so do three sums and ε². The root halves this
    sum, to 2.5 · 2⁻²⁴, and the inverse root adds 2·10⁻⁷. All constants are numbers of f32. Beside chance, the step of Newton's
    method makes each inverse root too small, by at most 3/2 · (2⁻¹⁴)² of itself.
    """
    scene = cloud(count, 3)
    scene["forces"] = [{"newtonian_gravity": {"softening": 0.5}}, {"coulomb": {"softening": 0.25}}]
    found, start = energy(scene, "f32")
    i, j = np.triu_indices(start.particle_count, 1)
    squared = ((start.position[i] - start.position[j]) ** 2).sum(1)
    gravity = -start.mass[i] * start.mass[j] / np.sqrt(squared + 0.25)
    electric = start.charge[i] * start.charge[j] / np.sqrt(squared + 0.0625)
    chance = 4 * 6 * 2.0**-24 * math.sqrt((gravity**2 + electric**2).sum())
    always = 1.5 * 2.0**-28 * abs(gravity.sum()) + 1.5 * 2.0**-28 * abs(electric).sum()
    assert abs(found - (gravity.sum() + electric.sum())) < chance + always


def test_energies_of_masses_in_kilograms_do_not_overflow():
    """Products of two masses of 10³⁰ kg are no numbers of f32."""
    scene = cloud(LEAST_COUNT, 3)
    scene["forces"] = [{"newtonian_gravity": {"softening": 0.5}}]
    plain, _ = energy(scene, "f32")
    for entry in scene["particles"]:
        entry["body"]["mass"] *= 2.0**100
    found, _ = energy(scene, "f32")
    assert found == plain * 2.0**200


@pytest.mark.parametrize("precision", ["f32c", "ds"])
def test_low_parts_of_places_are_seen(precision):
    """Constants that f32 holds exactly, and places of 48 bits: without low parts each place would be off by 2⁻²⁵ of itself."""
    scene = cloud(LEAST_COUNT + 5, 3)
    scene["forces"] = [{"newtonian_gravity": {"softening": 0.5}}]
    random = np.random.default_rng(5)
    for entry in scene["particles"]:
        entry["body"]["position"] = random.normal(size=3).tolist()
    with Simulation(scene, backend="cpu", precision=precision) as run:
        found, start = run.phase.energy_meter.potential_energy(0.0), run.start
    i, j = np.triu_indices(start.particle_count, 1)
    squared = ((start.position[i] - start.position[j]) ** 2).sum(1)
    expected = -(start.mass[i] * start.mass[j] / np.sqrt(squared + 0.25)).sum()
    assert abs(found / expected - 1) < 2.0**-44


def test_the_bits_do_not_depend_on_the_threads():
    scene = cloud(LEAST_COUNT + 77, 3)
    assert energy(scene, threads=1)[0] == energy(scene, threads=2)[0]


def test_other_forces_are_added():
    """Uniform gravity −m g·x, whose term is in the first kernel."""
    plain, start = energy(cloud(LEAST_COUNT, 3))
    scene = cloud(LEAST_COUNT, 3)
    scene["forces"].append({"uniform_gravity": {"acceleration": [0, 0, -2.0]}})
    found, _ = energy(scene)
    expected = 2.0 * (start.mass * start.position[:, 2]).sum()
    assert found - plain == pytest.approx(expected, abs=1e-12 * abs(plain))


def test_a_lost_pair_is_noticed():
    """The tiles leave out no pair: the energy without one pair is off by more than the bound of the first test."""
    _, start = energy(cloud(LEAST_COUNT + 1, 3))
    _, size = exact(start)
    i, j = np.triu_indices(start.particle_count, 1)
    apart = ((start.position[i] - start.position[j]) ** 2).sum(1)
    terms = -start.mass[i] * start.mass[j] / np.sqrt(apart + SOFTENING**2)
    terms += start.charge[i] * start.charge[j] / np.sqrt(apart + OTHER**2)
    assert np.median(np.abs(terms)) > (math.sqrt(start.particle_count) + 10) * 2.0**-53 * size


@pytest.mark.parametrize(
    ("method", "precision"), [("hermite4", "f64"), ("hermite6", "f64"), ("hermite4", "f32"), ("leapfrog", "df64")]
)
def test_sums_of_other_kinds_have_the_same_energy(method, precision):
    """Sums with derivatives and sums of double-single numbers are built on the sum of all pairs, and lend its energy."""
    count = LEAST_COUNT + 3
    found, start = energy({**cloud(count, 3), "integrator": {method: {"dt": 1e-3}}}, precision)
    expected, size = exact(start)
    rounding = 2.0**-24 if precision == "f32" else 2.0**-46 if precision == "df64" else 2.0**-53  # of constants, such as ε
    assert abs(found - expected) < (math.sqrt(count) + 10) * rounding * size
