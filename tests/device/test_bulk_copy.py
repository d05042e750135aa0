"""Arrays go to fields and back together, bit for bit."""

import numpy as np
import pytest
import taichi as ti

from mpp_taichi.device import backends, bulk_copy


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_numbers_of_several_lengths_and_kinds_come_back_bit_for_bit(precision):
    backends.start("cpu", precision)
    real, random = {"f64": np.float64, "f32": np.float32}[precision], np.random.default_rng(1)
    together, apart, lone = ti.Vector.field(3, float), ti.Vector.field(2, float), ti.field(float)
    number, longer = ti.field(ti.i32), ti.field(float)
    builder = ti.FieldsBuilder()
    builder.dense(ti.i, 7).place(together)
    for k in range(2):
        builder.dense(ti.i, 7).place(apart.get_scalar_field(k))
    builder.dense(ti.i, 7).place(lone)
    builder.dense(ti.i, 9).place(longer)
    builder.finalize()
    integers = ti.FieldsBuilder()
    integers.dense(ti.i, 7).place(number)
    integers.finalize()
    arrays = [random.normal(size=shape).astype(real) for shape in ((7, 3), (7, 2), 7, 9)]
    arrays[0][2] = -0.0, np.nan, -np.inf
    arrays.insert(3, np.array([0, -1, 2**31 - 1, -(2**31), 5, 6, 7], np.int32))
    fields = [together, apart, lone, number, longer]
    bulk_copy.write(fields, [np.asfortranarray(array) for array in arrays])
    assert [field.to_numpy().tobytes() for field in fields] == [array.tobytes() for array in arrays]
    assert [array.tobytes() for array in bulk_copy.read(fields[:3], real)] == [array.tobytes() for array in arrays[:3]]


def test_mixed_fields_come_back_in_their_order_and_cleared_fields_are_zero():
    backends.start("cpu", "f64")
    vector, number, single, long = (
        ti.Vector.field(3, ti.f64, 5),
        ti.field(ti.i32, 5),
        ti.field(ti.f32, 1),
        ti.field(ti.i64, 5000),
    )
    random = np.random.default_rng(2)
    arrays = [random.normal(size=(5, 3)), np.arange(5, dtype=np.int32), np.array([0.1], np.float32), np.arange(5000) << 40]
    fields = (vector, number, single, long)
    bulk_copy.write(fields, arrays)
    found = bulk_copy.MixedFields(fields).read()
    assert [each.dtype for each in found] == [each.dtype for each in arrays]
    assert [each.tobytes() for each in found] == [each.tobytes() for each in arrays]
    bulk_copy.clear(fields)
    assert not any(field.to_numpy().any() for field in fields)
