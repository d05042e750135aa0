"""What a step costs by the conventions of the table, and what a device reaches at most: sizes that are counted by hand."""

import sys
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

from mpp_taichi.compare import opencl_peaks, peaks
from mpp_taichi.compare.work import Work, work_of
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from scenes import kepler


@pytest.mark.parametrize(("precision", "width"), [("f32", 4), ("f64", 8)])
@pytest.mark.parametrize(("damped", "numbers"), [(False, 2), (True, 3)])
def test_bytes_of_springs_are_those_that_a_kernel_must_read_and_write(precision, width, damped, numbers):
    work = Work(particles=3, springs=2, interactions=0, evaluations=5, drifts=7, damped=damped)
    half_springs = 4 * (4 + numbers * width)  # index, stiffness, rest length, damping: two half-springs of each spring
    kick = 3 * width * (3 + 3 + 1 + 3)  # position, velocity and mass read, velocity written
    drift = 3 * width * (3 + 3 + 3)  # position read and written, velocity read
    assert work.bytes(precision) == 5 * (half_springs + kick) + 7 * drift


def test_without_springs_or_pairs_nothing_is_counted():
    work = Work(particles=3, springs=0, interactions=6, evaluations=1, drifts=2, damped=False)
    assert work.bytes("f64") == 0.0
    assert (work.flops("f32"), work.flops("f64")) == (120.0, 180.0)


@pytest.mark.parametrize(
    ("method", "evaluations", "drifts"),
    [("leapfrog", 1, 2), ("symplectic_euler", 1, 1), ("velocity_verlet", 1, 1), ("yoshida4", 3, 4), ("rk4", 4, 4)],
)
@pytest.mark.parametrize("pairs", [True, False])
def test_a_step_evaluates_all_ordered_pairs_as_often_as_its_method(method, evaluations, drifts, pairs):
    scene = kepler(integrator=method)
    if not pairs:
        scene["forces"] = [{"uniform_gravity": {"acceleration": [0, 0, -1]}}]
    work = work_of(*loaded(scene), None)
    assert (work.evaluations, work.drifts) == (evaluations, drifts)
    assert (work.particles, work.springs, work.damped) == (2, 0, False)
    assert work.interactions == (2 * evaluations if pairs else 0)


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_damping_of_any_spring_counts(damping):
    scene = kepler()
    scene["springs"] = [{"link": {"between": [0, 1], "stiffness": 1, "damping": each}} for each in (0.0, damping)]
    work = work_of(*loaded(scene), None)
    assert (work.springs, work.damped) == (2, damping > 0.0)


def loaded(scene):
    """A scene and its particles."""
    spec = load_scene(scene)
    return spec, assemble(spec)


@pytest.mark.parametrize("on_gpu", [False, True])
@pytest.mark.parametrize(("precision", "width"), [("f32", 4), ("f64", 8)])
def test_peaks_of_opencl_count_the_sums_and_the_bytes_of_their_arrays(precision, width, on_gpu, monkeypatch):
    """A call that takes a second: every iteration of the first probe counts twice, and the copy lies beyond all caches."""
    cl = MagicMock()
    monkeypatch.setitem(sys.modules, "pyopencl", cl)
    monkeypatch.setattr(opencl_peaks, "fastest", lambda call: call() or 1.0)
    found = opencl_peaks.opencl_peaks(SimpleNamespace(), precision, on_gpu=on_gpu)
    threads, copied = peaks.SUM_THREADS[on_gpu], peaks.COPY_BYTES[on_gpu]
    assert found == {"flops": 2.0 * 8 * peaks.CHAINS * peaks.ROUNDS * threads, "bytes": 2.0 * copied}
    assert [call.args[2] for call in cl.Buffer.call_args_list] == [threads * width, copied, copied]
    assert [call.args[1] for call in cl.Kernel.return_value.call_args_list] == [(threads,), (copied // 4,)]


def test_peaks_of_numpy_count_a_product_and_a_copy(monkeypatch):
    monkeypatch.setattr(peaks, "fastest", lambda call: 1.0)
    assert peaks.numpy_peaks() == {"flops": 2.0 * 1024**3, "bytes": 2.0 * (1 << 26)}
