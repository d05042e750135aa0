"""The clock of a run: it counts whole steps, and there is one length of the step."""

import inspect
import math

import pytest

from mpp_taichi import Simulation
from mpp_taichi.simulation.clock import MOST_STEPS_COUNTED, Clock
from scenes import kepler


def test_a_step_of_another_length_keeps_the_time_so_far():
    clock = Clock(0.1)
    clock.move(30, 0.1)
    before = clock.time
    clock.dt = 0.25
    assert clock.time == before == 30 * 0.1 and clock.step_count == 30
    clock.move(4, 0.25)
    assert clock.time == before + 4 * 0.25 and clock.step_count == 34


def test_a_run_whose_step_is_changed_on_the_way_goes_on_from_its_time():
    with Simulation(kepler(dt=0.1), backend="cpu") as simulation:
        simulation.run(steps=10)
        before = simulation.time
        simulation.dt = 0.05
        assert simulation.time == before
        simulation.run(steps=2)
        assert simulation.time == pytest.approx(before + 0.1, rel=1e-15) and simulation.step_count == 12


@pytest.mark.parametrize("integrator", ["leapfrog", "janus"])
@pytest.mark.sampled(3)
def test_a_bookmark_brings_back_the_step_that_the_run_had(integrator):
    with Simulation(kepler(dt=0.1, integrator=integrator), backend="cpu") as simulation:
        simulation.dt = 0.05  # as --rewind does
        moment = simulation.run(steps=3).bookmark()
        expected = simulation.run(steps=4).snapshot()
        simulation.dt = 0.2
        simulation.run(steps=1)
        simulation.go_back(moment)
        assert (simulation.dt, simulation.step_count) == (0.05, 3)
        found = simulation.run(steps=4).snapshot()
        assert found.time == expected.time and (found.position == expected.position).all()


def test_steps_are_counted_from_an_origin_that_kernels_can_count_from():
    clock = Clock(0.5)
    clock.move(MOST_STEPS_COUNTED - 2, 0.5)
    assert clock.origin_of(2, 0.5) == (0.0, MOST_STEPS_COUNTED - 2)
    assert clock.origin_of(3, 0.5) == (clock.time, 0)
    assert clock.origin_of(1, 0.25) == (clock.time, 0)


def test_a_clock_restores_all_that_it_knows():
    clock = Clock(0.1)
    clock.move(7, 0.1)
    clock.move(1, 0.05)
    reading = clock.save()
    later = clock.time, clock.step_count, clock.origin_of(1, 0.1)
    clock.dt = 3.0
    clock.set(5.0, 2)
    clock.restore(reading)
    assert (clock.time, clock.step_count, clock.origin_of(1, 0.1)) == later and clock.dt == 0.1 and math.isfinite(clock.time)


def test_the_public_face_of_a_simulation_is_one_class():
    """Every public member is defined in the class itself, and nothing is derived from it."""
    assert Simulation.__bases__ == (object,) and not Simulation.__subclasses__()
    assert inspect.getsourcefile(Simulation).endswith("simulation/simulation.py")
