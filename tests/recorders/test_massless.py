"""Massless particles have no share of the total energy: a blow-up of their motion is found all the same."""

import json

import numpy as np
import pytest
import yaml

from mpp_taichi import Simulation, StabilityError
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.blow_up import BlowUpWatch
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.simulation import massless_watch


def scene(bodies, dt, duration, integrator="leapfrog"):
    keys = ("mass", "position", "velocity", "free")
    return {
        "particles": [{"body": dict(zip(keys, body, strict=False))} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "integrator": {integrator: {"dt": dt}},
        "run": {"duration": duration},
    }


# Thrown across at a fifth of the speed of a circle: e = 0.96, the pericentre at 0.02 is passed in 0.002.
THROWN = [(1, [0, 0, 0]), (0, [1, 0, 0], [0, 0.2, 0])]
# A planet that passes at the speed 1, at 0.18 from a particle which a held sun pulls more before and after.
PASSED = [(1, [0, 0, 0], [0, 0, 0], False), (0.1, [5, 10, 0], [-1, 0, 0]), (0, [0, 10.3, 0])]


def watched(content, every, precision="f64"):
    """The error that stopped the run, or None; and the speed of the last particle at its end."""
    with Simulation(content, backend="cpu", precision=precision) as simulation:
        table = TableRecorder(every)
        try:
            simulation.run(recorders=[table, BlowUpWatch(table)])
        except StabilityError as error:
            assert simulation.step_count == error.step - 1
            return error, float(np.linalg.norm(simulation.snapshot().velocity[-1]))
        return None, float(np.linalg.norm(simulation.snapshot().velocity[-1]))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("dt, every", [(0.1, 1), (0.1, 3), (0.1, 50), (0.03, 10), (0.01, 30), (0.005, 60)])
def test_a_massless_particle_that_a_step_throws_away_stops_the_run(dt, every):
    error, _ = watched(scene(THROWN, dt, 60), every)
    assert error.particle == 1 and error.time > 0.9  # the first pericentre is at π √(a³) = 1.145
    assert "the energy per mass of particle 1, which is massless, rises from -0." in str(error)
    assert "try dt = 0.0" in str(error)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("integrator, dt", [("leapfrog", 0.001), ("rk4", 0.001)])
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_step_that_holds_raises_no_alarm(integrator, dt, precision):
    assert watched(scene(THROWN, dt, 60, integrator), 300, precision)[0] is None


def test_the_run_ends_with_exit_code_4_and_the_remedy_holds(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "thrown.yaml").write_text(yaml.safe_dump(scene(THROWN, 0.1, 60)), encoding="utf-8")
    assert main(["run", "thrown.yaml", "--headless", "--json"]) == 4
    captured = capsys.readouterr()
    assert json.loads(captured.out)["broke_at"]["particle"] == 1
    remedy = captured.err.split("try dt = ")[1].split(",")[0]
    assert main(["run", "thrown.yaml", "--headless", "--json", "--set", f"integrator.leapfrog.dt={remedy}"]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "ok"


@pytest.mark.parametrize("every", [1, 10, 100])
@pytest.mark.sampled(3)
def test_a_slingshot_past_a_moving_body_is_confirmed_by_smaller_steps(every, monkeypatch):
    examined = []
    original = massless_watch.MasslessWatch._examine
    monkeypatch.setattr(massless_watch.MasslessWatch, "_examine", lambda *given: (examined.append(1), original(*given))[1])
    error, speed = watched(scene(PASSED, 0.005, 12), every)
    assert error is None and examined and speed > 0.5


@pytest.mark.sampled(3)
def test_looking_again_changes_no_bit_of_the_motion():
    ends = []
    for watches in (True, False):
        with Simulation(scene(PASSED, 0.005, 12), backend="cpu", precision="f64") as simulation:
            table = TableRecorder(10)
            simulation.run(recorders=[table, BlowUpWatch(table)] if watches else [table])
            ends.append((simulation.snapshot(), simulation.time, simulation.step_count))
    np.testing.assert_array_equal(ends[0][0].position, ends[1][0].position)
    np.testing.assert_array_equal(ends[0][0].velocity, ends[1][0].velocity)
    assert ends[0][1:] == ends[1][1:]


def test_a_massless_moon_of_a_planet_raises_no_alarm():
    """Its energy in the frame of the scene swings by more than its kinetic energy, in that of its planet by little."""
    moon = (0, [1.02, 0, 0], [0, 1 + (0.05 / 0.02) ** 0.5, 0])
    bodies = [(1, [0, 0, 0], [0, -0.05, 0]), (0.05, [1, 0, 0], [0, 1, 0]), moon]
    assert watched(scene(bodies, 0.0002, 5), 100)[0] is None
