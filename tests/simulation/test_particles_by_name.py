"""Particles by name, index, slice and group; calls every so much time; and the names that a notebook completes."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi import ArgumentError, MppError, SceneError, Simulation, load_scene, run
from mpp_taichi.cli.main import main
from mpp_taichi.simulation.inner_names import INNER_NAMES
from scenes import kepler

GROUPS = {
    "particles": [
        {"body": {"name": "sun", "mass": 1.0, "radius": 0.1, "position": [0, 0, 0]}},
        {"ring": {"name": "dust", "count": 5, "inner_radius": 1.0, "outer_radius": 2.0, "around": "sun"}},
        {"body": {"name": "earth", "mass": 3e-6, "charge": 2.0, "position": [3, 0, 0], "velocity": [0, 0.5, 0]}},
    ],
    "forces": ["newtonian_gravity"],
    "integrator": {"leapfrog": {"dt": 0.01}},
    "run": {"duration": 1.0},
}


@pytest.mark.sampled(3)
def test_particles_are_found_and_read_at_the_present_time():
    with Simulation(GROUPS, backend="cpu") as simulation:
        earth, dust = simulation.particles["earth"], simulation.particles["dust"]
        assert (earth.index, earth.name, earth.mass, earth.charge) == (6, "earth", 3e-6, 2.0)
        assert list(earth.position) == [3, 0, 0] and list(earth.velocity) == [0, 0.5, 0]
        assert list(earth.momentum) == [0, 3e-6 * 0.5, 0]
        assert len(simulation.particles) == 7 and len(dust) == 5 and dust.indices == range(1, 6)
        for part, rows in (("dust[1:3]", [2, 3]), (slice(None, None, 3), [0, 3, 6]), (slice(0, 0), [])):
            found = simulation.particles[part]
            assert list(found.indices) == rows and [each.index for each in found] == rows
            assert np.array_equal(found.position, simulation.snapshot().position[rows])
        assert simulation.particles["dust[4]"].index == 5 and simulation.particles[-1].name == "earth"
        assert simulation.particles[0].radius == 0.1 and simulation.particles[:1].radius.tolist() == [0.1]
        assert simulation.particles.name[6] == "earth" and "dust" in simulation.particles and "mars" not in simulation.particles
        simulation.run(steps=10)
        now = simulation.snapshot()
        assert np.array_equal(earth.position, now.position[6]) and np.array_equal(dust.velocity, now.velocity[1:6])
        assert np.array_equal(earth.acceleration, simulation.accelerations()[6]) and "particle 6 'earth'" in repr(earth)
        for wrong, error, said in (
            ("erth", ArgumentError, "no particle is called 'erth', did you mean 'earth'"),
            ("dust[5]", ArgumentError, r"allowed: dust\[0\] to dust\[4\]"),
            (7, IndexError, "there is no particle 7, allowed: -7 to 6"),
            (1.5, ArgumentError, "by its index, a slice or a name"),
        ):
            with pytest.raises(error, match=said):
                simulation.particles[wrong]


def test_a_function_is_called_every_so_much_time_and_changes_no_bit():
    """Steps of 0.02: a call comes with the first step that reaches a multiple."""
    with Simulation(kepler(dt=0.02), backend="cpu") as plain, Simulation(kepler(dt=0.02), backend="cpu") as watched:
        plain.run(duration=1.0)
        times = []
        watched.run(duration=1.0, every=0.15, call=lambda simulation: times.append(simulation.time))
        assert np.array_equal(plain.snapshot().position, watched.snapshot().position)
        # Multiples of 0.15 on or just before a multiple of 0.02: 0.16, 0.30, 0.46, 0.60, 0.76, 0.90.
        assert times == pytest.approx([0.02 * math.ceil(0.15 * k / 0.02 - 1e-9) for k in range(1, 7)], abs=1e-12)
        times.clear()
        watched.run(duration=0.1, every=0.001, call=lambda simulation: times.append(simulation.time))
        assert times == pytest.approx([1.0 + 0.02 * k for k in range(1, 6)], abs=1e-12), "no call without a step"
        for wrong in ({"every": 1.0}, {"call": print}, {"every": 0.0, "call": print}, {"every": math.nan, "call": print}):
            with pytest.raises(ArgumentError, match="every|call"):
                watched.run(duration=1.0, **wrong)
        with pytest.raises(ZeroDivisionError):
            watched.run(duration=1.0, every=0.5, call=lambda simulation: 1 / 0)


def test_whole_runs_are_called_too():
    times = []
    with run(kepler(dt=0.02), duration=1.0, samples=5, backend="cpu", every=0.25, call=lambda now: times.append(now.time)):
        assert len(times) == 4


# --- runs whose scene says neither dt nor run.duration -----------------------------------------------------------------------


def without_length(integrator="ias15", **more):
    """Two bodies, and a method that chooses its own steps."""
    return {**{key: value for key, value in kepler().items() if key != "run"}, "integrator": integrator, **more}


HEAD_ON = {
    "particles": [
        {"body": {"mass": 1.0, "radius": 0.1, "position": [0, 0, 0]}},
        {"body": {"mass": 1.0, "radius": 0.1, "position": [1, 0, 0], "velocity": [-1, 0, 0]}},
    ],
    "contacts": {"hard_spheres": {"solver": "event_driven"}},
}


@pytest.mark.sampled(3)
def test_a_method_that_chooses_its_steps_needs_only_an_end():
    """The time between samples changes no bit of the motion, so that a thousandth of the run serves."""
    known = without_length() | {"run": {"duration": 3.0}}
    with Simulation(without_length(), backend="cpu") as open_ended, Simulation(known, backend="cpu") as closed:
        assert np.array_equal(open_ended.run(until=3.0).snapshot().position, closed.run().snapshot().position)
        assert open_ended.dt == closed.dt == 0.003
        assert open_ended.run(duration=1.0).time == 4.0 and open_ended.dt == 0.001
        with pytest.raises(MppError, match="give duration or until"):
            open_ended.run(steps=5)
    with pytest.raises(SceneError, match="needs dt, the time between samples, or run.duration"):
        load_scene(without_length())
    with pytest.raises(SceneError, match="needs dt"):
        Simulation(without_length(timeline=[{"at": 1.0, "set": {"particles[0].body.mass": 2.0}}]), backend="cpu")


@pytest.mark.sampled(3)
def test_free_flight_needs_only_an_end():
    with Simulation(HEAD_ON, backend="cpu") as simulation:
        simulation.run(until=2.0)
        assert simulation.snapshot().velocity[:, 0].tolist() == [-1.0, 0.0]
        simulation.set("particles[0].body.mass", 2.0)
        assert simulation.run(duration=1.0).time == 3.0
    with run(HEAD_ON, duration=2.0, backend="cpu", samples=10) as result:
        assert result.time[-1] == 2.0 and 10 <= len(result.time) <= 12


def test_the_command_line_divides_the_run_that_it_was_given(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(json.dumps(without_length()), encoding="utf-8")
    assert main(["run", "s.yaml", "--headless", "--until", "2", "--json", "--quiet"]) == 0
    assert json.loads(capsys.readouterr().out)["dt"] == 0.002
    assert main(["run", "s.yaml", "--headless", "--steps", "5"]) == 2
    assert "needs dt, the time between samples" in capsys.readouterr().err


# --- names -------------------------------------------------------------------------------------------------------------------


def test_dir_has_what_documents_name_and_no_inner_part():
    texts = [Path("README.md"), *Path("docs").rglob("*.md")]
    named = {
        word for path in texts for word in re.findall(r"\b(?:simulation|sheet)\.([a-z_]+)\(?", path.read_text(encoding="utf-8"))
    }
    with Simulation(kepler(), backend="cpu") as simulation:
        shown = set(dir(simulation))
        assert {word for word in named if word in vars(Simulation)} <= shown
        assert not shown & set(INNER_NAMES) and not [name for name in shown if name.startswith("_")]
        assert {"run", "snapshot", "diagnostics", "time", "step_count", "close", "particles"} <= shown
        for name in (*shown, *INNER_NAMES):
            getattr(simulation, name)  # each of them exists
