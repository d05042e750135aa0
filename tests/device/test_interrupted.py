"""A simulation that Ctrl+C ends at any place leaves Taichi as it was: the next one has the same bits."""

import random

import pytest
from interrupts import calls, interrupt, speed

from mpp_taichi import Simulation
from scenes import cluster, kepler

PLACES = 3


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside another"])
def test_the_next_simulation_has_the_same_bits(beside):
    scene, places = kepler(0.5), random.Random(7)
    right = speed(scene)
    with Simulation(cluster(5), backend="cpu", precision="f64") if beside else Simulation(scene, backend="cpu") as other:
        if not beside:
            other.close()
        every = calls(lambda: speed(scene))  # beside another Simulation they are fewer: Taichi is not started again
        for _ in range(PLACES):
            assert interrupt(lambda: speed(scene), places.randrange(1, 9 * every // 10))
            assert speed(scene) == right
        if beside:
            assert other.run(steps=2).step_count == 2


def test_an_interrupted_placement_of_fields_is_forgotten():
    import taichi as ti

    from mpp_taichi.device.interrupted import tidied_after

    with Simulation(kepler(), backend="cpu") as simulation:
        with pytest.raises(KeyboardInterrupt), tidied_after():
            field, builder = ti.field(ti.f64), ti.FieldsBuilder()
            builder.dense(ti.i, 3)
            assert field is not None
            raise KeyboardInterrupt
        assert simulation.run(steps=2).step_count == 2
