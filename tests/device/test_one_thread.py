"""Threads of Python: simulations that are open at the same time belong to one thread, and every other thread is refused."""

import threading

import pytest

from mpp_taichi import MppError, Simulation
from scenes import kepler


def simulation():
    return Simulation(kepler(0.5), backend="cpu", precision="f64")


def in_thread(call, name="worker"):
    """What a call returns, or the MppError that it raises, in a thread of its own."""
    found = []

    def work():
        try:
            found.append(call())
        except MppError as error:
            found.append(error)

    thread = threading.Thread(target=work, name=name)
    thread.start()
    thread.join()
    return found[0]


def speed():
    with simulation() as made:
        return float(abs(made.run(steps=20).snapshot().velocity).max()).hex()


@pytest.mark.sampled(3)
def test_one_thread_after_another_makes_and_runs_with_the_same_bits():
    assert len({speed(), in_thread(speed), in_thread(speed), speed()}) == 1


@pytest.mark.parametrize("act", ["run", "snapshot", "picture", "restart", "diagnostics"])
@pytest.mark.sampled(3)
def test_another_thread_is_refused_in_one_line_and_the_owner_goes_on(act):
    with simulation() as made:
        made.run(steps=2)
        refused = in_thread(getattr(made, act))
        assert isinstance(refused, MppError) and "'MainThread'" in str(refused) and "\n" not in str(refused)
        assert made.run(steps=2).step_count == 4


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.sampled(3)
def test_a_second_thread_makes_no_simulation_beside_an_open_one(precision):
    with simulation() as made:
        refused = in_thread(lambda: Simulation(kepler(), backend="cpu", precision=precision))
        assert isinstance(refused, MppError) and "one thread at a time" in str(refused)
        assert made.is_alive and made.run(steps=2).step_count == 2
    assert isinstance(in_thread(speed), str)


def test_four_threads_at_once_get_a_result_or_a_refusal():
    right, found, together = speed(), [], threading.Barrier(4)

    def work():
        together.wait()
        try:
            found.append(speed())
        except MppError as error:
            found.append("refused" if "one thread at a time" in str(error) else str(error))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4 and set(found) <= {right, "refused"} and right in found


@pytest.mark.sampled(3)
def test_a_simulation_of_a_thread_that_has_ended_is_in_nobodys_way():
    left = in_thread(lambda: simulation().run(steps=2))
    with pytest.raises(MppError, match="belongs to the thread 'worker'"):
        left.run(steps=1)
    assert isinstance(speed(), str) and not left.is_alive
    left.close()


def test_any_thread_may_close():
    with simulation() as made, simulation() as other:
        in_thread(made.close)
        assert not made.is_alive and other.run(steps=2).step_count == 2
