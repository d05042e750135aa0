"""Numbers of a kernel that are changed in place: +=, −= and ×= give what +, − and × give."""

from types import SimpleNamespace

import numpy as np
import pytest
import taichi as ti

from mpp_taichi.arithmetic.dual import Dual
from mpp_taichi.device import backends
from mpp_taichi.state.tangent_state import DualField
from mpp_taichi.state.two_part_field import TwoPartField

COUNT = 100


def two_parts():
    """Fields of double-single numbers."""
    return TwoPartField(SimpleNamespace(guards_rounding=False), ti.field(ti.f32, COUNT), ti.field(ti.f32, COUNT))


def duals():
    """Fields of numbers with a change."""
    return DualField(ti.field(ti.f64, COUNT), ti.field(ti.f64, COUNT), Dual)


def parts(field):
    return (field.value, field.change) if isinstance(field, DualField) else (field.high, field.low)


@pytest.mark.parametrize(("make", "precision"), [(duals, "f64"), (two_parts, "df64")])
def test_numbers_that_are_changed_in_place_have_the_bits_of_the_operators(make, precision):
    backends.start("cpu", precision)
    a, b, *results = (make() for _ in range(8))

    @ti.kernel
    def operate():
        for i in range(COUNT):
            results[0][i] = a[i] + b[i]
            results[1][i] = a[i] - b[i]
            results[2][i] = a[i] * b[i]
            for k in ti.static(range(3, 6)):
                results[k][i] = a[i] * 1.0
            results[3][i] += b[i]
            results[4][i] -= b[i]
            results[5][i] *= b[i]

    random = np.random.default_rng(11)
    for field in (a, b):
        for size, part in zip((1.0, 1e-9), parts(field)):
            part.from_numpy(size * random.uniform(1.0, 2.0, COUNT))
    operate()
    for plain, in_place in zip(results[:3], results[3:]):
        for one, other in zip(parts(plain), parts(in_place)):
            np.testing.assert_array_equal(one.to_numpy(), other.to_numpy())
    assert len({parts(field)[0].to_numpy().tobytes() for field in results[:3]}) == 3
