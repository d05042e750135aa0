"""Energies, momenta and centres against plain sums, particle by particle."""

import math
from dataclasses import replace

import numpy as np
import pytest
from compiled import snapshot_of

from mpp_taichi.energy.energy_meter import mechanics
from mpp_taichi.energy.mechanics import mean_by_mass, total
from mpp_taichi.energy.specific_energy import SpecificEnergyMeter
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

POSITION = np.array([[1.0, -2.0, 3.0], [-4.0, 5.0, 0.5], [0.25, -1.5, 2.0], [6.0, 7.0, -8.0]])
VELOCITY = np.array([[0.5, 1.5, -2.5], [3.0, -0.75, 1.25], [-1.0, 2.0, 0.125], [9.0, 9.0, 9.0]])
MASS = [2.0, 3.0, 5.0, 7.0]
FREE = [[True, True, True], [True, False, True], [True, True, True], [False, False, False]]


@pytest.fixture
def snapshot():
    """Four particles: the second is held along one axis, the fourth along all."""
    made = snapshot_of(POSITION, velocity=VELOCITY)
    return replace(made, mass=np.array(MASS), free=np.array(FREE), time=2.5, step=7)


def length(vector):
    return math.sqrt(sum(x * x for x in vector))


def test_every_conserved_quantity_is_its_sum(snapshot):
    kinetic = sum(0.5 * m * sum(v * v for v in row) for m, row in zip(MASS, VELOCITY))
    moving = list(zip(MASS, POSITION, VELOCITY))[:3]  # the particle that is held along all axes belongs to the laboratory
    expected = {
        "time": 2.5,
        "step": 7,
        "kinetic_energy": kinetic,
        "potential_energy": -11.0,
        "total_energy": kinetic - 11.0,
        "momentum": sum(m * v for m, _, v in moving),
        "angular_momentum": [
            sum(m * (x[1] * v[2] - x[2] * v[1]) for m, x, v in moving),
            sum(m * (x[2] * v[0] - x[0] * v[2]) for m, x, v in moving),
            sum(m * (x[0] * v[1] - x[1] * v[0]) for m, x, v in moving),
        ],
        "center_of_mass": sum(m * x for m, x in zip(MASS, POSITION)) / sum(MASS),
        "momentum_scale": sum(m * length(v) for m, _, v in moving),
        "angular_momentum_scale": sum(m * length(x) * length(v) for m, x, v in moving),
    }
    found = mechanics(snapshot, -11.0)
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-14, abs=1e-14), name


def test_scales_count_a_negative_mass_by_its_size(snapshot):
    opposite = mechanics(replace(snapshot, mass=-snapshot.mass), 0.0)
    plain = mechanics(snapshot, 0.0)
    for name in ("momentum_scale", "angular_momentum_scale"):
        assert opposite[name] == plain[name] > 0.0
    assert opposite["momentum"].tolist() == (-plain["momentum"]).tolist()


@pytest.mark.parametrize("count", [1, 512, 513, 1025, 3073, 16385])
def test_a_total_is_rounded_once(count):
    """Terms that cancel: the sum is a thousandth of the largest term, and the sizes of the terms differ by 10¹⁶."""
    random = np.random.default_rng(count)
    terms = random.normal(size=count) * 10.0 ** random.integers(-8, 8, size=count)
    terms[0] -= (1.0 - 1e-3) * terms.sum()
    size = math.log2(count + 1) ** 2 * 2.0**-106 * np.abs(terms).sum()
    exact = math.fsum(terms)
    assert abs(total(terms) - exact) <= 2.0**-53 * abs(exact) + size
    assert total(terms.tolist()) == total(terms)


def test_a_mean_without_mass_is_the_plain_mean_and_a_sum_that_overflows_is_no_number():
    values = np.array([[1.0, 2.0, 3.0], [5.0, 7.0, 11.0]])
    assert mean_by_mass(values, np.zeros(2)).tolist() == [3.0, 4.5, 7.0]
    assert mean_by_mass(values, np.array([1.0, 3.0])).tolist() == [4.0, 5.75, 9.0]
    assert math.isnan(total([1e308, 1e308])) and math.isnan(total([math.inf, -math.inf]))
    assert not math.isfinite(total(np.full(1000, 1e308))) and not math.isfinite(total(np.append(np.ones(999), math.inf)))
    assert total([1e100, 1.0, -1e100]) == 1.0


@pytest.mark.parametrize("strength", [0.0, 2.0])
def test_a_particle_has_an_attractor_exactly_where_gravity_has_a_strength(strength):
    """Without gravity both energies are of the frame of the scene; with it, one is relative to the body that pulls most."""
    scene = {
        "particles": [
            {"body": {"mass": 4, "position": [0, 0, 0], "velocity": [1, 0, 0]}},
            {"body": {"mass": 8, "position": [16, 0, 0]}},
            {"body": {"mass": 0, "position": [0, 2, 0], "velocity": [3, 0, 0]}},
        ],
        "forces": [{"newtonian_gravity": {"strength": strength}}],
        "integrator": {"leapfrog": {"dt": 1}},
    }
    spec = load_scene(scene)
    start = assemble(spec)
    found = SpecificEnergyMeter(spec, start).measure(start)
    assert found.kinetic.tolist() == [[4.5], [2.0 if strength else 4.5]]
    both = -strength * (4 / 2 + 8 / math.hypot(16, 2))
    assert found.potential == pytest.approx(np.array([[both], [-strength * 4 / 2]]), rel=1e-14)
    assert found.attractor.tolist() == [0 if strength else -1]
    assert found.energy == pytest.approx(found.kinetic + found.potential, rel=1e-15)
