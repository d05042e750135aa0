"""Reductions in arrays are those of a single run, sample by sample."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpp_taichi import component
from mpp_taichi.diagnostics._reductions import reduced
from mpp_taichi.energy.energy_error import EnergyError
from mpp_taichi.energy.mechanics import kinetic_of_copies
from mpp_taichi.sweep.gauges import _in_arrays, below
from mpp_taichi.sweep.reductions import EnergyErrors

COPIES, PARTICLES, SAMPLES = 5, 3, 60
KEYS = [
    {},
    {"when": "largest"},
    {"when": "smallest"},
    {"when": "mean"},
    {"at": 3.3},
    {"until": 2.0},
    {"when": "largest", "after": 1.0, "until": 4.0},
    {"when": "mean", "after": 1.0, "until": 4.0},
    {"when": "smallest", "until": 100.0},
]
QUANTITIES = [
    ("distance", {"between": (0, 2)}),
    ("distance", {"of": (1, 1), "point": (0.5, 0.0, 0.0)}),
    ("distance", {"of": (0, 2)}),
    ("position", {"of": (0, 3), "axis": "y"}),
    ("position", {"of": (2, 1), "axis": "x"}),
    ("speed", {"of": (1, 2)}),
    ("kinetic_energy", {"of": None}),
    ("total_energy", {}),
    ("potential_energy", {}),
]


def courses():
    """Times, and positions, velocities (samples, copies, particles, 3), masses and potential energies of smooth motions."""
    random = np.random.default_rng(3)
    times = np.cumsum(random.uniform(0.02, 0.15, SAMPLES)) - 0.02
    frequency, phase, size = (random.uniform(low, high, (COPIES, PARTICLES, 3)) for low, high in ((0.5, 3), (0, 6), (0.1, 2)))
    angle = frequency * times[:, None, None, None] + phase
    mass = random.uniform(0.5, 2.0, (COPIES, PARTICLES))
    return times, size * np.sin(angle), size * frequency * np.cos(angle), mass, random.normal(size=(SAMPLES, COPIES))


@pytest.mark.parametrize("keys", KEYS, ids=str)
@pytest.mark.parametrize(("name", "parameters"), QUANTITIES, ids=lambda each: str(each))
def test_each_copy_has_the_result_of_a_run_of_its_own(name, parameters, keys):
    times, position, velocity, mass, potential = courses()
    declared = {each.name: None for each in component.declaration("quantities", name).parameters}
    quantity = component.build("quantities", name, {**declared, **parameters})
    together = _in_arrays(COPIES, quantity, **keys)
    apart = [reduced(component.build("quantities", name, {**declared, **parameters}), **keys) for _ in range(COPIES)]
    random = np.random.default_rng(4)
    for step, time in enumerate(times):
        # MemberParticles are sampled at times of their own; all have the first and the last sample.
        who = np.flatnonzero(random.random(COPIES) < 0.7) if 0 < step < SAMPLES - 1 else np.arange(COPIES)
        if not len(who):
            continue
        many = SimpleNamespace(position=position[step][who], velocity=velocity[step][who], mass=mass[who])
        together.observe(SimpleNamespace(time=time, snapshot=many, potential_energy=potential[step][who]), who)
        for k in who:
            one = SimpleNamespace(
                position=position[step, k],
                velocity=velocity[step, k],
                mass=mass[k],
                particle_count=PARTICLES,
                present=np.ones(PARTICLES, bool),
                merged_into=None,
                time=time,
            )
            apart[k].observe(SimpleNamespace(time=time, snapshot=one, potential_energy=float(potential[step, k])))
            assert together.interval[k] == pytest.approx(apart[k].interval, rel=1e-12)
    for k, result in enumerate(together.results()):
        try:
            expected = apart[k].result()
        except Exception:
            assert np.isnan(result)
            continue
        # Both add and multiply some tens of numbers of size 1 to 10, each rounded to 1.1e-16.
        assert result == pytest.approx(expected, rel=1e-13, abs=1e-13)


def test_the_energy_error_of_each_copy_is_that_of_a_run_of_its_own():
    """Also of a copy whose energy is zero at the start, and of one that has no sample."""
    times, _, velocity, mass, potential = courses()
    potential[0, 1] = -kinetic_of_copies(SimpleNamespace(velocity=velocity[0], mass=mass))[1]
    together, apart, largest = EnergyErrors(COPIES), [EnergyError() for _ in range(COPIES)], np.full(COPIES, np.nan)
    random = np.random.default_rng(4)
    for step, time in enumerate(times):
        who = np.flatnonzero(random.random(COPIES - 1) < 0.7) if step > 0 else np.arange(COPIES - 1)
        many = SimpleNamespace(velocity=velocity[step][who], mass=mass[who])
        together.observe(SimpleNamespace(time=time, snapshot=many, potential_energy=potential[step][who]), who)
        for k, kinetic in zip(who, kinetic_of_copies(many), strict=True):
            error = apart[k].see(kinetic, potential[step, k], phase_number=0, phase_energy=None)
            largest[k] = np.fmax(largest[k], error)
    # The same sums, differences and quotients of the same numbers, each rounded once, in both.
    assert np.array_equal(together.results(), largest, equal_nan=True)
    assert np.isnan(largest).tolist() == [False] * (COPIES - 1) + [True] and (largest[:-1] > 0.0).all()


def test_a_stride_is_the_largest_power_of_two_that_fits():
    assert below(np.array([0.0, 0.7, 1.0, 1.9, 2.0, 7.9, 8.0, 1000.0, np.inf])).tolist() == [1, 1, 1, 1, 2, 4, 8, 512, 2**40]
