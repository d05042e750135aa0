"""The pair sum that evaluates each pair once: the same forces for any number of bodies and threads."""

import numpy as np
import pytest
import taichi as ti
from pair_sums import Charges, Gravity, Screened, bodies_of, launcher_of, reference, rounding, started

from mpp_taichi.device.fast_taichi import bitcode, lane_arithmetic
from mpp_taichi.neighbors.all_pairs import SYMMETRIC_COUNT
from mpp_taichi.neighbors.symmetric_pairs import BLOCK


@pytest.fixture
def fresh_runtime():
    """Not here: Taichi is started without the program."""


CASES = {
    "a lone force, whole tiles and blocks": (3, lambda: (Gravity(0.0),), 8 * BLOCK),
    "bodies left over, an odd one among them": (3, lambda: (Gravity(0.125),), SYMMETRIC_COUNT + 15),
    "one body left over, in a block of its own": (2, lambda: (Gravity(0.0),), 5 * BLOCK + 1),
    "forces that point both ways, two softenings": (3, lambda: (Gravity(0.0), Charges(0.125)), SYMMETRIC_COUNT + 34),
}


@pytest.mark.sampled(6)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", ["f32", "f64"])
def test_it_is_the_sum_over_all_pairs_and_gives_no_momentum(case, name):
    dimensions, make, count = CASES[case]
    for precision in started(name):
        forces, bodies = make(), bodies_of(count, dimensions, precision)
        expected, scale = reference(forces, *bodies)
        launcher = launcher_of(forces, bodies, precision)
        assert launcher.pairs.is_symmetric(launcher.state)
        found = launcher.run("launch")
        assert (np.abs(found - expected) <= 2 * rounding(count, precision) * scale).all()
        assert np.abs(found - launcher.run("lanes")).max() > 0.0, "it was not the symmetric sum that ran"
        # What a pair gives is rounded on both sides alike but for the last product: a sum of terms of both signs.
        momentum = np.abs(bodies[1] @ found)
        assert (momentum <= 2 * rounding(count, precision) * (bodies[1] @ scale)).all()


@pytest.mark.sampled(3)
def test_a_force_that_is_no_mere_arithmetic_is_taken_lane_by_lane():
    for precision in started("f64"):
        launcher = launcher_of((Screened(0.0),), bodies_of(SYMMETRIC_COUNT, 3, precision), precision)
        found, lanes = launcher.run("launch"), launcher.run("lanes")
        # Terms exp(−r)/r of d are of one sign along no axis, at most one in size, and as many as bodies.
        assert np.abs(found - lanes).max() <= 2 * rounding(SYMMETRIC_COUNT, precision) * SYMMETRIC_COUNT


def test_the_bits_do_not_depend_on_the_number_of_threads():
    found = []
    for threads in (1, 3):
        for precision in started("f64", cpu_max_num_threads=threads):
            launcher = launcher_of((Gravity(0.01),), bodies_of(5 * SYMMETRIC_COUNT + 7, 3, precision), precision)
            found.append(launcher.run("launch"))
            np.testing.assert_array_equal(launcher.run("launch"), found[0])
    assert np.isfinite(found[0]).all() and found[0].any()


@pytest.mark.parametrize("has_root", [True, False], ids=["as this processor does it", "written out"])
@pytest.mark.sampled(3)
def test_bodies_at_one_place_leave_the_others_alone(monkeypatch, has_root):
    """Also with that one which shares a division, where the processor has no inverse roots."""
    if not has_root:
        monkeypatch.setattr(bitcode, "has_avx512", lambda: False)
    for precision in started("f64"):
        bodies = bodies_of(SYMMETRIC_COUNT + 3, 3, precision)
        launcher = launcher_of((Gravity(0.0),), bodies, precision)
        for first, second in ((0, 1), (7, 8), (3, SYMMETRIC_COUNT + 2), (11, 400), (SYMMETRIC_COUNT, SYMMETRIC_COUNT + 2)):
            position = bodies[0].copy()
            position[second] = position[first]
            launcher.state.position.from_numpy(position)
            bad = set(np.flatnonzero(~np.isfinite(launcher.run("launch")).all(axis=1)))
            assert bad == {first, second}


def test_few_bodies_and_merging_bodies_are_summed_without_symmetry(monkeypatch):
    monkeypatch.setattr(lane_arithmetic, "in_hardware", lambda *_, **__: False)  # which only a launch of its own would use
    for precision in started("f64"):
        launcher = launcher_of((Gravity(0.0),), bodies_of(SYMMETRIC_COUNT - 1, 3, precision), precision)
        np.testing.assert_array_equal(launcher.run("launch"), launcher.run("lanes"))
        assert ti.lang.impl.current_cfg().real_matrix_scalarize
