"""A simulation that Ctrl+C ends at any place leaves Taichi as it was: the next one has the same bits."""

import _thread
import random
import threading
import time

import pytest
from interrupts import calls, interrupt, speed

from mpp_taichi import Simulation
from mpp_taichi.device.thread_count import require_threads, start_thread
from scenes import cluster, kepler

PLACES = 3


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside another"])
@pytest.mark.sampled(3)
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


def test_an_interrupt_in_a_trial_of_threads_stays_an_interrupt_and_leaves_no_thread():
    """Cut off within Thread.start, Python's lock raises a RuntimeError, which was taken for a system without threads."""
    before = _thread._count()
    for number in range(1, calls(lambda: require_threads(1)) + 1):
        interrupt(lambda: require_threads(1), number)  # anything else than a KeyboardInterrupt would end the test
    require_threads(1)
    for _ in range(100):  # the system ends a thread a moment after its last line
        if _thread._count() == before:
            break
        time.sleep(0.01)
    assert _thread._count() == before


def test_an_interrupt_at_the_start_of_a_thread_stays_an_interrupt():
    # All threads stay alive: Python swallows an interrupt in the callback by which it forgets a thread that is gone.
    made = [threading.Thread(target=int) for _ in range(40)]
    fresh = iter(made)
    every = calls(lambda: start_thread(next(fresh)))
    for number in range(1, min(every, len(made))):
        interrupt(lambda: start_thread(next(fresh)), number)
