"""Fused products and sums with one rounding, and inverse roots, of whole vector registers."""

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import taichi as ti
from pair_sums import started

from mpp_taichi.device.fast_taichi import lane_arithmetic
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.lane_arithmetic import inverse_roots, multiply_add

CPU = Path("/proc/cpuinfo")
FUSES = sys.platform == "linux" and CPU.exists() and " fma " in CPU.read_text(encoding="utf-8")
ROWS = 500
LANES = {"f32": 16, "f64": 8}


@pytest.fixture(params=["f32", "f64"])
def real(request):
    for _ in started(request.param):
        yield request.param, np.float32 if request.param == "f32" else np.float64


def computed(lanes, columns, formula, *, explicit=True):
    """A formula of vectors of lanes for each row of some arrays (rows, lanes)."""
    kind = float
    given = [ti.Vector.field(lanes, kind, len(columns[0])) for _ in columns]
    found = [ti.Vector.field(lanes, kind, len(columns[0])) for _ in range(2)]
    for field, column in zip(given, columns):
        field.from_numpy(column)
    inputs = [[field.get_scalar_field(lane) for lane in range(lanes)] for field in given]
    outputs = [[field.get_scalar_field(lane) for lane in range(lanes)] for field in found]

    @ti.kernel
    def run():
        ti.loop_config(serialize=True)
        for i in range(found[0].shape[0]):
            values = [ti.Vector([field[i] for field in ti.static(row)]) for row in ti.static(inputs)]
            one, other = formula(values)
            for lane in ti.static(range(lanes)):
                outputs[0][lane][i] = one[lane]
                outputs[1][lane][i] = other[lane]

    if explicit:
        with explicit_vectors():
            run()
    else:
        run()
    return [field.to_numpy() for field in found]


@ti.func
def both_sums(values):
    return multiply_add(values[0], values[1], values[2]), values[0] * values[1] + values[2]


@ti.func
def rough_roots(values):
    return inverse_roots(values[0], values[1], False)


@ti.func
def exact_roots(values):
    return inverse_roots(values[0], values[1], True)


@pytest.mark.fast_taichi("explicit_vectors", "lane_arithmetic")
@pytest.mark.skipif(not FUSES, reason="this processor, or this system, joins no product and sum")
@pytest.mark.sampled(3)
def test_a_product_and_a_sum_are_rounded_once(real):
    precision, kind = real
    random = np.random.default_rng(1)
    a, b, c = (random.normal(size=(ROWS, LANES[precision])).astype(kind) for _ in range(3))
    c = -(a * b)  # what is left is the product's own rounding, which two roundings lose
    once, twice = computed(LANES[precision], (a, b, c), both_sums)
    assert not twice.any()
    exact = [Fraction(float(x)) * Fraction(float(y)) + Fraction(float(z)) for x, y, z in zip(a.flat, b.flat, c.flat)]
    assert [Fraction(float(value)) for value in once.flat] == exact


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("share", "explicit"), [(1, False), (2, True)])
def test_other_vectors_are_written_out(share, explicit, real):
    precision, kind = real
    lanes = LANES[precision] // share
    random = np.random.default_rng(2)
    a, b, c = (random.normal(size=(ROWS, lanes)).astype(kind) for _ in range(3))
    once, twice = computed(lanes, (a, b, c), both_sums, explicit=explicit)
    np.testing.assert_array_equal(once, twice)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("formula", [rough_roots, exact_roots])
def test_inverse_roots_of_all_magnitudes(formula, real):
    precision, kind = real
    random = np.random.default_rng(3)
    decades = 18 if precision == "f32" else 150  # the product of two roots is a normal number
    x, y = (10 ** random.uniform(-decades, decades, (ROWS, LANES[precision])) for _ in range(2))
    x, y = x.astype(kind), y.astype(kind)
    found = computed(LANES[precision], (x, y), formula)
    # Written out: two roots, a product, a quotient and a product, each rounded. By the hardware: a twelfth bit's error squared,
    # times 3/2, and two roundings.
    unit = np.finfo(kind).eps / 2
    limit = 5 * unit if precision == "f64" or formula is exact_roots else 1.5 * (1.5 * 2.0**-12) ** 2 + 2 * unit
    for values, inverse in zip((x, y), found):
        wide = values.astype(np.longdouble)
        assert np.abs(inverse * np.sqrt(wide) - 1).max() <= limit * 1.01


@pytest.mark.fast_taichi("explicit_vectors", "lane_arithmetic")
def test_a_vector_of_another_width_is_refused_by_name(monkeypatch):
    for _ in started("f32"):
        monkeypatch.setattr(lane_arithmetic, "in_hardware", lambda *_, **__: True)
        column = np.ones((4, 8), np.float32)
        with pytest.raises(Exception, match="takes vectors of a whole register"):
            computed(8, (column, column, column), both_sums)
