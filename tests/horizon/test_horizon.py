"""The horizon of a run: right where it is known, unknown where it cannot be found, and found without a change of any bit."""

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.horizon.horizon import Horizon
from mpp_taichi.horizon.samples import even_and_early, sample_times
from mpp_taichi.horizon.search import compile_step, find
from scenes import kepler


def oscillator(dt=0.05, duration=40.0, integrator="leapfrog", **more):
    """A unit mass on a spring of stiffness 1, which swings by ±0.5 along x."""
    return {
        "particles": [
            {"body": {"mass": 1, "position": [0, 0, 0], "free": False}},
            {"body": {"mass": 1, "position": [1.5, 0, 0]}},
        ],
        "springs": [{"link": {"between": [0, 1], "stiffness": 1, "rest_length": 1}}],
        "integrator": {integrator: {"dt": dt}},
        "run": {"duration": duration},
        **more,
    }


def horizon_of(scene, precision="f64", **wishes):
    with mpp.Simulation(scene, backend="cpu", precision=precision) as simulation:
        return find(simulation, simulation.spec.run.duration, **wishes)


def leapfrog_time(dt):
    """Time at which leapfrog on the unit oscillator is off by 10⁻³ of the size A/√2.

    Leapfrog swings with sin(ω′ dt/2) = ω dt/2, so that its phase is ahead by dt² t/24, and its error A (dt² t/24) |sin t|.
    """
    times = np.linspace(0.0, 100.0, 100_001)
    faster = 2.0 / dt * np.arcsin(dt / 2.0)
    errors = np.sqrt(2.0) * np.abs(np.cos(faster * times) - np.cos(times))
    return times[np.argmax(errors > 1e-3)]


@pytest.mark.parametrize("dt", [0.02, 0.05])
def test_the_horizon_of_leapfrog_on_an_oscillator_is_its_phase_error(dt):
    found = horizon_of(oscillator(dt))
    assert found.found == "before_end" and found.by == "step" and found.part == 1.0
    # Samples are a 48th of the run apart, 0.13 of a period: the error A |sin t| is seen at least at 0.9 of its peak, and half
    # a period before, which is 0.4 of the longer time, it may have been higher than the line between two samples.
    assert found.time == pytest.approx(leapfrog_time(dt), rel=0.3)


def test_a_run_by_a_method_of_high_order_is_valid_to_the_end():
    found = horizon_of(oscillator(integrator="yoshida8"))
    assert found.found == "after_end" and found.time is None
    assert found.line().startswith("positions are valid to the end, t = 40")
    assert not found.is_beyond(40.0) and found.caption() == ""


def test_a_single_precision_run_of_high_order_ends_by_rounding():
    scene = kepler() | {"integrator": {"yoshida8": {"dt": 0.05}}, "run": {"duration": 4000.0}}
    found = horizon_of(scene, "f32")
    assert (found.found, found.by) == ("before_end", "rounding")
    assert horizon_of(scene | {"run": {"duration": 100.0}}).found == "after_end"  # in f64


def test_a_share_of_the_work_extrapolates_the_phase_error():
    found = horizon_of(oscillator(0.005, 2000.0), share=0.1, least=0.0)
    assert found.found == "extrapolated" and found.share < 0.1
    # The error grows as t |sin t|, and is read off at the end of the part, 0.03 of the run and 9 periods: a tenth less or
    # more in the power moves the crossing, 12 times as far, by a factor of 12^0.1 = 1.3.
    assert found.time == pytest.approx(leapfrog_time(0.05) * 100.0, rel=0.3)


def test_a_long_run_is_searched_for_two_hundredths_of_its_work():
    """The part that is followed costs itself, a half of itself by double steps, and a half by half steps in a quarter of it."""
    found = horizon_of(oscillator(0.005, 2000.0), least=0.0)
    assert found.part == pytest.approx(0.02 / (1.0 + 0.5 + 2.0 * 0.25))
    assert 0.015 < found.share <= 0.02  # the half steps are followed as far as they are needed


def test_a_part_too_short_for_an_oscillation_says_nothing():
    found = horizon_of(oscillator(0.001, 40.0), share=0.1, least=0.0)
    assert found.found == "unknown" and "turns 0.5 times" in found.reason and found.time is None


CASES = {
    "leapfrog": (oscillator(), "f64"),
    "f32c": (oscillator(), "f32c"),
    "newmark": (oscillator(integrator="newmark"), "f64"),
    "janus": (kepler() | {"integrator": {"janus": {"dt": 0.01}}, "run": {"duration": 3.0}}, "f64"),
    "taylor": (kepler() | {"integrator": {"taylor": {}}, "run": {"duration": 20.0}}, "f64"),
    "timeline": (
        oscillator(
            timeline=[
                {"at": 1.03, "set": {"springs[0].link.stiffness": 2}},
                {"at": 2.0, "set": {"integrator.leapfrog.dt": 0.01}},
            ]
        ),
        "f64",
    ),
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", CASES)
def test_the_search_changes_no_bit_of_the_run(name):
    scene, precision = CASES[name]
    with mpp.Simulation(scene, backend="cpu", precision=precision) as simulation:
        until = simulation.spec.run.duration
        simulation.run(until=until)
        plain, steps = simulation.snapshot(), simulation.step_count
        simulation.restart()
        launches = simulation.timings.launch_count
        compile_step(simulation)
        found = find(simulation, until)
        assert (simulation.time, simulation.step_count, simulation.timings.launch_count) == (0.0, 0, launches)
        assert found.found != "unknown"
        simulation.run(until=until)
        searched = simulation.snapshot()
        assert simulation.step_count == steps
    assert searched.position.tobytes() == plain.position.tobytes()
    assert searched.velocity.tobytes() == plain.velocity.tobytes()


def test_the_change_of_a_timeline_counts_in_the_horizon():
    calm = oscillator(0.01, 20.0)
    assert horizon_of(calm).found == "after_end"
    stiffer = calm | {"timeline": [{"at": 10.0, "set": {"springs[0].link.stiffness": 400}}]}
    found = horizon_of(stiffer)  # 20 times as many radians a step: the phase is off 8,000 times as fast
    assert found.found == "before_end" and 10.0 < found.time < 11.0


def test_scenes_in_which_reruns_show_nothing_right_have_no_horizon():
    by_tree = kepler() | {"forces": [{"newtonian_gravity": {"strength": 1, "solver": "tree"}}], "run": {"duration": 0.1}}
    assert "tree" in horizon_of(by_tree).reason


@pytest.mark.sampled(3)
def test_a_method_that_damps_stiff_springs_at_every_step_is_not_called_valid():
    stiff = oscillator(0.1, 20.0, "implicit_euler")
    stiff["springs"][0]["link"]["stiffness"] = 1e6  # ω dt = 100: a step leaves a hundredth of the swing that should go on
    found = horizon_of(stiff)
    assert found.found == "unknown" and "implicit_euler leaves 0.01 of the stiffest oscillation" in found.reason
    assert horizon_of(oscillator(0.1, 20.0, "implicit_midpoint")).found == "before_end"


def test_a_coarse_rerun_that_blows_up_leaves_the_run_as_it_was():
    scene = oscillator(1.2, 60.0)  # twice the step is beyond the limit ω dt = 2 of leapfrog
    found = horizon_of(scene)
    assert found.found == "before_end" and found.time <= 2.4


def test_samples_lie_at_even_distances_and_early():
    assert even_and_early(480, 4) == [1, 2, 4, 8, 16, 32, 64, 120, 240, 360, 480]
    assert even_and_early(3, 3) == [1, 2, 3]
    assert even_and_early(0, 0) == []


def test_a_method_that_chooses_its_steps_is_looked_at_at_even_times():
    with mpp.Simulation(kepler(integrator="ias15"), backend="cpu", precision="f64") as simulation:
        times = sample_times(simulation, 2.0, 8)
    np.testing.assert_array_equal(times, np.arange(1, 9) / 4)


def test_the_sentences_say_what_was_found():
    step = Horizon("before_end", 20.0, 12.34, "step", 1e-3, 1.0, 0.02)
    assert step.line() == "positions are valid until t ≈ 12.3; then the error by the step exceeds 0.001 of the system's size"
    assert step.caption() == "valid until t ≈ 12.3" and step.is_beyond(12.4) and not step.is_beyond(12.3)
    guess = Horizon("extrapolated", 20.0, 12.34, "rounding", 1e-3, 0.1, 0.02)
    assert guess.line().endswith("by rounding exceeds 0.001 of the system's size; extrapolated from the first 10.0% of the run")
    assert "not found: spheres merge" in Horizon("unknown", 20.0, reason="spheres merge").line()
