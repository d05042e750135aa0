"""Repeated launches of kernels skip Taichi's general preparation, and have the same results."""

import gc

import numpy as np
import pytest

from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi import launch_cache
from mpp_taichi.simulation.simulation import Simulation
from scenes import cluster, irregular_network, kepler

ti = backends.import_taichi()
launch_cache.ALSO_SHORT.add(__name__)
pytestmark = pytest.mark.fast_taichi("launch_cache")


@ti.data_oriented
class Counter:
    """A number that a kernel adds to."""

    def __init__(self):
        self.total = ti.field(ti.f64, shape=())

    @ti.kernel
    def add(self, weight: ti.f64, times: ti.i32, kind: ti.template()):
        if ti.static(kind == "twice"):
            self.total[None] += 2.0 * weight * times
        else:
            self.total[None] += weight * times

    @ti.kernel
    def read(self) -> ti.f64:
        return self.total[None]

    @ti.kernel
    def read_whole(self) -> ti.types.vector(2, ti.i32):
        return ti.Vector([-ti.cast(self.total[None], ti.i32), 7])

    @ti.kernel
    def read_large(self) -> ti.u32:
        return ti.u32(4_000_000_000)

    @ti.kernel
    def read_twice(self, factor: ti.f64) -> ti.types.vector(2, ti.f64):
        return ti.Vector([self.total[None], factor * self.total[None]])


@pytest.fixture
def long_ways(monkeypatch):
    """Names of the kernels that were launched by Taichi's own way."""
    from taichi.lang.kernel_impl import Kernel

    backends.start("cpu", "f64")
    taken, short = [], Kernel.__call__
    taichis = short.__wrapped__

    def counted(self, *arguments, **named):
        taken.append(self.func.__name__)
        return taichis(self, *arguments, **named)

    from mpp_taichi.device.fast_taichi.launch_cache import _remembering

    monkeypatch.setattr(Kernel, "__call__", _remembering(counted, lambda error: error))
    return taken


def test_only_the_first_launch_goes_the_long_way(long_ways):
    counter = Counter()
    for _ in range(10):
        counter.add(0.5, 3, "once")
    assert long_ways == ["add"]
    assert counter.read() == 15.0


def test_what_a_kernel_returns_comes_by_the_short_way_too(long_ways):
    counter = Counter()
    for k in range(1, 4):
        counter.add(1.0, 1, "once")
        assert counter.read() == k
        assert list(counter.read_twice(10.0)) == [k, 10.0 * k]
        assert list(counter.read_whole()) == [-k, 7] and counter.read_large() == 4_000_000_000
    assert long_ways == ["add", "read", "read_twice", "read_whole", "read_large"]


def test_other_numbers_and_other_objects_are_told_apart(long_ways):
    one, other = Counter(), Counter()
    for counter, kind, factor in ((one, "once", 1.0), (one, "twice", 2.0), (other, "once", 1.0)):
        for weight, times in ((0.25, 1), (1.5, 2), (2, True), (np.float64(4.0), np.int32(1))):
            before = counter.read()
            counter.add(weight, times, kind)
            assert counter.read() - before == factor * weight * times
    assert long_ways.count("add") == 3 + 3  # each form once, and NumPy's integers


def test_an_object_at_the_place_of_one_that_is_gone_is_another(long_ways):
    gone, counter = Counter(), Counter()
    gone.add(4.0, 1, "once")
    (key, form), known = next(iter(_launches(gone).known.items())), _launches(gone).known
    known.clear()
    known[tuple(id(counter) if part == id(gone) else part for part in key)] = form  # as though it had been made there
    assert _launches(gone).find((counter, 1.0, 1, "once"))[0] in known
    del gone
    gc.collect()
    for _ in range(2):
        counter.add(1.0, 1, "once")
    assert counter.read() == 2.0
    assert long_ways == ["add", "add", "read"]


def _launches(counter):
    """What the kernel `add` remembers."""
    return counter.add._primal.launches


@pytest.mark.parametrize("arguments", [("x", 1, "once"), (1.0, 1.5, "once"), (1.0, 1), (1.0, 1, "once", 1)])
@pytest.mark.sampled(3)
def test_what_taichi_refuses_is_refused(arguments, long_ways):
    counter = Counter()
    counter.add(1.0, 1, "once")
    with pytest.raises((ti.TaichiRuntimeTypeError, ti.TaichiSyntaxError)):
        counter.add(*arguments)
    counter.add(weight=1.0, times=1, kind="once")
    assert counter.read() == 2.0


def test_a_new_start_compiles_anew(long_ways):
    for precision in ("f64", "f32", "f64"):
        backends.start("cpu", precision)
        counter = Counter()
        counter.add(1.0, 1, "once")
        counter.add(0.5, 1, "once")
        assert counter.read() == 1.5
        backends.stop()
    assert long_ways.count("add") == 3


@pytest.mark.sampled(3)
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_steps_go_the_short_way_and_keep_their_bits(plan, long_ways):
    with Simulation(cluster(40), backend="cpu", precision="f64", plan=plan) as simulation:
        start = simulation.run(steps=2).mark()
        long_ways.clear()
        short = simulation.run(steps=20).snapshot()
        assert not [name for name in long_ways if "advance" in name or "step" in name or "stage" in name]
        simulation.return_to(start)
        from taichi.lang.kernel_impl import Kernel  # the same kernels by the long way

        remembered, Kernel.__call__ = Kernel.__call__, Kernel.__call__.__wrapped__
        try:
            long = simulation.run(steps=20).snapshot()
        finally:
            Kernel.__call__ = remembered
    assert len(long_ways) >= (20 if plan == "parallel" else 1)
    assert np.array_equal(short.position, long.position) and np.array_equal(short.velocity, long.velocity)


@ti.kernel
def copy_columns(fields: ti.template(), values: ti.types.ndarray(ndim=2)):
    for i in range(values.shape[0]):
        for k, field in ti.static(enumerate(fields)):
            values[i, k] = 2 * values[i, k] + field[i]


def test_arrays_and_tuples_of_fields_go_the_short_way_and_are_told_apart(long_ways):
    one, two = ti.field(ti.f64, 3), ti.field(ti.f64, 3)
    one.from_numpy(np.array([1.0, 2.0, 3.0]))
    two.from_numpy(np.array([10.0, 20.0, 30.0]))
    long_ways.clear()
    for _ in range(3):
        for fields, expected in (((one, two), [1, 10]), ((two, one), [10, 1])):
            for dtype in (np.float64, np.int32):
                values = np.array([[1, 2], [3, 4]], dtype)
                before = values.copy()
                copy_columns(fields, values)
                assert values.tolist() == (2 * before + np.outer([1, 2], expected)).astype(dtype).tolist()
    assert long_ways == ["copy_columns"] * 4  # a form for each order of the fields and each type of numbers
    across = np.asfortranarray(np.zeros((2, 2)))
    copy_columns((one, two), across)  # Taichi copies it
    assert across.tolist() == [[1, 10], [2, 20]] and len(long_ways) == 5


SHORT_RUNS = {
    "leapfrog": kepler(dt=0.01),
    "adaptive": kepler(dt=0.1, integrator="ias15"),
    "springs": irregular_network(10, 20, integrator="newmark"),
}


@pytest.mark.parametrize("name", SHORT_RUNS)
@pytest.mark.sampled(3)
def test_a_run_of_a_few_steps_launches_few_kernels_and_all_by_the_short_way(name, long_ways, monkeypatch):
    """The state is kept, the steps are taken, their counts are read, and every number is tested: at most two launches each."""
    from taichi.lang.kernel_impl import Kernel

    with Simulation(SHORT_RUNS[name], backend="cpu", precision="f64") as simulation:
        for _ in range(4):
            simulation.run(steps=10)
        launched, call = [], Kernel.__call__

        def counted(self, *arguments, **named):
            launched.append(self.func.__name__)
            return call(self, *arguments, **named)

        monkeypatch.setattr(Kernel, "__call__", counted)
        long_ways.clear()
        simulation.run(steps=10)
        simulation.run(until=simulation.time + 10 * simulation.dt)
        assert long_ways == [] and len(launched) <= 2 * 8
        launched.clear()
        simulation.restart()
        simulation.run(steps=10)
        assert long_ways == [] and len(launched) <= 16


@ti.data_oriented
class Odd(Counter):
    """What a class with kernels may have beside them, and one that comes after another."""

    scale = 2.0

    @property
    def doubled(self):
        return self.scale * self.total[None]

    @staticmethod
    def three():
        return 3

    @ti.kernel
    def read(self) -> ti.f64:
        return -self.total[None]


@ti.data_oriented
class WithStatic:
    """A kernel that belongs to no object is left to Taichi."""

    @staticmethod
    @ti.kernel
    def seven() -> ti.i32:
        return 7

    @property
    @ti.kernel
    def eight(self) -> ti.i32:
        return 8


def test_kernels_are_bound_as_methods_are():
    backends.start("cpu", "f64")
    plain, odd = Counter(), Odd()
    for counter in (plain, odd):
        counter.add(2.0, 3, "once")
    assert (plain.read(), odd.read(), odd.doubled, odd.three()) == (6.0, -6.0, 12.0, 3)
    assert super(Odd, odd).read() == 6.0
    assert Counter.read is vars(Counter)["read"].kernel and odd.read.__name__ == "read"
    assert "__getattribute__" not in vars(Odd)  # which would be asked for every attribute
    assert WithStatic().seven() == 7 and WithStatic().eight == 8


def test_a_class_without_the_mark_is_refused():
    class Unmarked:
        @ti.kernel
        def one(self) -> ti.i32:
            return 1

    with pytest.raises(Exception, match="data_oriented"):
        Unmarked().one()


def test_a_class_overrides_a_property_of_a_base_class_that_was_marked_by_taichi():
    from taichi.lang import kernel_impl

    class Base:
        @property
        def number(self):
            return 1

    class Special(kernel_impl.data_oriented(Base)):
        @property
        def number(self):
            return 2

    assert ti.data_oriented(Special)().number == 2
