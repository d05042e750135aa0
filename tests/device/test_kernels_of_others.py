"""Kernels of other programs behave beside this package as with Taichi alone."""

import pytest

from mpp_taichi.device import backends

ti = backends.import_taichi()


@ti.kernel
def pair(x: ti.f64) -> ti.types.vector(2, ti.f64):
    return ti.Vector([x, 2.0 * x])


@ti.data_oriented
class Several:
    """Kernels bound in every way."""

    @staticmethod
    @ti.kernel
    def seven(x: ti.i32) -> ti.i32:
        return 7 * x

    @property
    @ti.kernel
    def eight(self) -> ti.i32:
        return 8

    @ti.kernel
    def nine(self) -> ti.types.vector(2, ti.i32):
        return ti.Vector([9, 9])

    @classmethod
    def name(cls):
        return cls.__name__


@ti.data_oriented
class Static:
    """A static kernel and nothing else."""

    @staticmethod
    @ti.kernel
    def six() -> ti.i32:
        return 6


def test_a_static_kernel_belongs_to_no_object():
    backends.start("cpu", "f64")
    assert [Static().six() for _ in range(3)] == [6, 6, 6]


@pytest.mark.parametrize("times", [1, 3])
def test_a_vector_is_a_vector_at_every_call(times):
    backends.start("cpu", "f64")
    for _ in range(times):
        found = pair(1.5)
        assert isinstance(found, ti.Matrix) and found.to_list() == [1.5, 3.0]


def test_kernels_of_a_class_are_bound_as_taichi_binds_them():
    backends.start("cpu", "f64")
    several = Several()
    for _ in range(3):
        assert several.seven(2) == 14 and several.eight == 8 and several.name() == "Several"
        assert isinstance(several.nine(), ti.Matrix)
    assert "__getattribute__" in vars(Several)
