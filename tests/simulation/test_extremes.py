"""Extreme masses, places and steps in every integrator and contact solver: right, told, or refused with the reason."""

import json
import subprocess
import sys
from datetime import date
from pathlib import Path

import pytest

from mpp_taichi import component
from mpp_taichi.errors import CapacityError, PrecisionError, StabilityError
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.simulation.verdict import ENERGY_LIMIT

ROOT = Path(__file__).parents[2]
SECONDS = 600  # for one process, whose kernels take seconds each to compile: some ten times what it takes on an idle core
COMPONENTS = [(kind, name) for kind in ("integrators", "contacts") for name in component.names(kind)]
GROUPS = ("steps", "masses")
EACH_DAY = 1  # component, another on every day; `--thorough` tries all
ALWAYS = [("integrators", "leapfrog")]


def chosen():
    """The component of today, and those of every day."""
    first = date.today().toordinal() * EACH_DAY % len(COMPONENTS)
    return list(dict.fromkeys([*ALWAYS, *(COMPONENTS + COMPONENTS)[first : first + EACH_DAY]]))


def pytest_generate_tests(metafunc):
    if "tried" in metafunc.fixturenames:
        every = metafunc.config.getoption("--thorough")
        tried = [(kind, name, "f64") for kind, name in (COMPONENTS if every else chosen())]
        tried += [(kind, name, "f32") for kind, name in (COMPONENTS if every else ALWAYS)]
        metafunc.parametrize("tried", tried, ids="-".join)


def cases(kind, name, precision, group):
    """What each case of a component came to; a case that never ends is named."""
    command = [sys.executable, "tests/support/extreme_runs.py", kind, name, precision, group]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired as ended:
        pytest.fail(f"no end after {SECONDS} s: {(ended.stdout or b'').decode().splitlines()[-1:]}")
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-2000:]
    return [found for found in map(json.loads, done.stdout.splitlines()) if "case" in found]


def is_sound(found):
    """Whether the numbers of a run are right as far as its energy tells, K + U of the masses as they are."""
    (kinetic, potential), (end_kinetic, end_potential) = found["energies"]
    size = abs(kinetic + potential) or max(kinetic + abs(potential), end_kinetic + abs(end_potential))
    return abs(end_kinetic + end_potential - kinetic - potential) <= ENERGY_LIMIT * size


@pytest.mark.sampled(2)
@pytest.mark.parametrize("group", GROUPS)
def test_extremes_are_right_or_told_or_refused_in_one_line(tried, group):
    kind, name, precision = tried
    for found in cases(kind, name, precision, group):
        what = f"{name}, {precision}, {found['case']}: {found}"
        if "refused" in found:
            assert found["refused"].count("\n") == 0 and len(found["refused"]) > 20, what
            assert found["case"] not in ("usual", "one body"), what
            continue
        assert found["finite"], what
        assert found["kinds"] or is_sound(found) or name == "merging", what
        assert found["case"] != "usual" or not found["kinds"], what


def orbit(**integrator):
    bodies = [{"mass": 1.0, "position": [0, 0, 0]}, {"mass": 1e-3, "position": [1, 0, 0], "velocity": [0, 1, 0]}]
    return {
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": integrator or {"leapfrog": {"dt": 1e-300}},
    }


def test_a_run_of_more_steps_than_a_clock_tells_apart_is_refused():
    with Simulation(orbit(), backend="cpu") as simulation, pytest.raises(CapacityError, match="1e.300 steps of dt = 1e-300"):
        simulation.run(until=1.0, judge="off")


@pytest.mark.sampled(3)
def test_a_sample_of_more_own_steps_than_can_be_counted_is_refused():
    with Simulation(orbit(ias15={"dt": 1e30}), backend="cpu") as simulation, pytest.raises(CapacityError, match="shorter dt"):
        simulation.run(steps=1)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("speed", [1e-9, 1e-20])
@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("method", ["adaptive_bogacki_shampine", "adaptive_dop853", "ias15"])
def test_a_speed_next_to_nothing_refuses_no_motion_and_stalls_none(method, held, speed):
    """A body that falls, alone or beside a held one, from a phase that does not begin at t = 0; y = −g t²/2."""
    moving = {"body": {"mass": 1.0, "position": [1, 0], "velocity": [speed, 0]}}
    scene = {
        "dimensions": 2,
        "particles": [moving, *([{"body": {"mass": 1.0, "position": [0, 0], "free": False}}] if held else [])],
        "forces": [{"uniform_gravity": {"acceleration": [0, -9.81]}}],
        "integrator": {method: {"dt": 0.1}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.launcher.prepare(8.0, 0.1)  # at which a step of 1e-20 would not change the time
        simulation.launcher.advance(8.0, 0.1, 0, 10)
        assert simulation.snapshot().position[0] == pytest.approx([1.0, -0.5 * 9.81, 0.0], abs=2e-9)
        assert simulation.launcher.facts()["step_control"]["steps"] < 1000  # 400 are enough for the lowest order


@pytest.mark.parametrize("mass", [1e-300, 1e300])
def test_a_mass_that_single_precision_does_not_have_is_refused_by_name(mass):
    scene = orbit(leapfrog={"dt": 0.1})
    scene["particles"][1]["body"] |= {"mass": mass, "name": "moon"}
    with pytest.raises(PrecisionError, match=r"particle 1 \('moon'\) has a mass of 1e.300, and f32 has numbers"):
        Simulation(scene, backend="cpu", precision="f32")


def test_bodies_whose_force_single_precision_would_take_for_nothing_are_refused():
    scene = orbit(leapfrog={"dt": 0.1})
    scene["particles"][1]["body"]["position"] = [1e15, 0, 0]
    with pytest.raises(PrecisionError, match="lengths apart"):
        Simulation(scene, backend="cpu", precision="f32")


def test_coincident_bodies_are_refused_before_a_step_and_named():
    scene = orbit(symplectic_euler={"dt": 0.1})  # whose kick comes before any drift
    with Simulation(scene, backend="cpu") as simulation:
        simulation.state.write(simulation.start.position * 0.0, simulation.start.velocity)
        with pytest.raises(StabilityError, match="distance"):
            simulation.run(steps=3, judge="off")
