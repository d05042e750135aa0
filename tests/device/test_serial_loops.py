"""Short loops on the calling thread: the order of the iterations, and the bits of parallel loops."""

import numpy as np
import pytest

from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi.serial_loops import SerialLoops
from mpp_taichi.device.heavy_loops import loop_grain
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.step import choose

ti = backends.import_taichi()
COUNT, WORK = 1 << 18, 50  # so much that another thread is awake long before the end, on a busy machine too


@ti.data_oriented
class Ticket:
    """Numbers drawn one after the other by the iterations of two loops."""

    def __init__(self):
        self.drawn, self.number = ti.field(ti.i32, shape=()), ti.field(ti.i32, shape=2 * COUNT)

    @ti.kernel
    def draw(self) -> ti.i32:
        self.draw_all(0)
        for i in range(COUNT):
            for part in ti.static(range(2)):
                for k in range(part, part + 1):  # an inner loop
                    if k == 0:
                        self.number[COUNT + i] = ti.atomic_add(self.drawn[None], 1)
        return ti.static(loop_grain())

    @ti.func
    def draw_all(self, first):
        for i in range(COUNT):
            x = float(i)
            for k in range(WORK):
                x = ti.sqrt(x + k)
            self.number[first + i] = ti.atomic_add(self.drawn[None], 1 if x >= 0.0 else 2)


@pytest.mark.fast_taichi("serial_loops")
def test_loops_run_in_order_and_so_do_those_of_functions():
    backends.start("cpu", "f64", threads=4)
    serial, parallel = Ticket(), Ticket()
    with SerialLoops():
        assert serial.draw() == 1
    assert parallel.draw() == 512
    assert np.array_equal(serial.number.to_numpy(), np.arange(2 * COUNT))
    assert not np.array_equal(parallel.number.to_numpy(), np.arange(2 * COUNT))


@pytest.mark.sampled(6)
@pytest.mark.parametrize("solver", ["pairwise", "swept"])
def test_spheres_move_by_the_same_bits(solver, monkeypatch):
    edge = 0.1 * 1.25 * 8  # 512 spheres, more than are looked at pair by pair
    row = {"name": "gas", "shape": [8, 8, 8], "lower": [0.06] * 3, "upper": [edge - 0.06] * 3, "mass": 1.0, "radius": 0.05}
    scene = {
        "particles": [{"lattice": row}],
        "contacts": {"hard_spheres": {"solver": solver, "restitution": 0.9}},
        "walls": [{"box": {"lower": [0, 0, 0], "upper": [edge] * 3}}],
        "forces": [{"newtonian_gravity": {"strength": 1e-3, "softening": 0.1}}],
        "integrator": {"leapfrog": {"dt": 5e-3}},
    }
    ends, counts = [], []
    for few in (choose.FEW, 0):
        monkeypatch.setattr(choose, "FEW", few)
        with Simulation(scene, backend="cpu", precision="f64", plan="parallel") as simulation:
            start = simulation.start
            simulation.state.write(start.position, np.random.default_rng(1).normal(size=start.position.shape))
            ends.append(simulation.run(steps=15).snapshot())
            counts.append(
                simulation.contact_report.pair_count
            )  # its sums are grouped by launches, whose length is a matter of time
    assert counts[0] == counts[1] > 100
    assert np.array_equal(ends[0].position, ends[1].position) and np.array_equal(ends[0].velocity, ends[1].velocity)
