"""Fields that are allocated together lie in one tree for each width of number."""

import pytest
import taichi as ti

from mpp_taichi.device import backends
from mpp_taichi.state.field_group import FieldGroup


@pytest.mark.parametrize("precision, wide", [("f64", 1), ("f32", 0)])
def test_numbers_of_4_and_of_8_bytes_lie_in_trees_of_their_own(precision, wide):
    backends.start("cpu", precision)
    number, vector, index, long = ti.field(float), ti.Vector.field(3, float), ti.field(ti.i32), ti.field(ti.i64)
    group = FieldGroup((5, number, index), (2, vector), (None, long))
    tree = {field: field.snode.ptr.get_snode_tree_id() for field in (number, index, long)}
    assert tree[index] != tree[long]
    assert tree[number] == (tree[long] if wide else tree[index]) == vector.get_scalar_field(0).snode.ptr.get_snode_tree_id()
    group.destroy()
