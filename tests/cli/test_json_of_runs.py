"""Every key of `--json` of `run`, `record` and `check` against NumPy, the text of the scene and the files that were written.

A whole object is compared, so that a new key makes a test red until a test says what its value must be. No independent number
is there for times, which are bounded by each other, and for the name of the processor, which the system tells.
"""

import math
import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from json_facts import SECONDS, Between, asked, processor
from sprung_bodies import DT, MASS, ROUNDING, SCENE, STEPS, conserved_errors, energies, flight, frequencies

from mpp_taichi import Snapshot

pytestmark = pytest.mark.skipif(bool(os.environ.get("MPP_TAICHI_FAST")), reason="parts that are off have keys of their own")
FIELD = (0.0, 0.0, -2.0)
WHERE = ("--backend", "cpu", "--precision", "f64", "--plan", "serial", "--threads", "1", "--quiet")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    write("s.yaml")


def write(name, **changes):
    Path(name).write_text(yaml.safe_dump({**SCENE, **changes}, sort_keys=False), encoding="utf-8")


def near(value):
    return pytest.approx(value, abs=ROUNDING / abs(sum(energies(*flight()[0]))))


def leapfrog_error(frequency):
    """The frequency of leapfrog, 2/dt · asin(ω dt/2), over ω, less 1: Birdsall & Langdon (1985), section 4-2."""
    return 2.0 / DT * math.asin(0.5 * frequency * DT) / frequency - 1.0


PARTS = ("setup", "compile", "step", "diagnostics", "encode")


def expected(found, field=(0.0, 0.0, 0.0), files=(), parts=PARTS):
    """The whole object of a run of the scene, with samples after each step, so that each step is a launch."""
    *_, (places, velocities) = states = flight(field)
    errors = conserved_errors(field)
    kinetic, potential = energies(places, velocities, field)
    omega = frequencies()
    fastest = float(omega.max())
    still = int(np.sum(omega < 1e-7))  # the root of the rounding of an eigenvalue of size 1
    assert (still, len(omega)) == (5, 6)
    is_closed = not any(field)
    row = {"angular_frequency": near(fastest), "energy_loss_per_oscillation": 0.0}
    row["relative_frequency_error"] = pytest.approx(leapfrog_error(fastest), rel=1e-9)  # 2⁻⁵² over an error of 10⁻³
    rate = (STEPS - 1) / found["step_seconds"]  # the first step's time is the compiler's
    work = found["wall_seconds"] - found["setup_seconds"] - found["compile_seconds"]
    return {
        "scene": "s.yaml",
        "title": SCENE["title"],
        "units": SCENE["units"],
        "backend": "cpu",
        "device": processor(),
        "threads": 1,
        "precision": "f64",
        "plan": "serial",
        "plan_reason": "asked for",
        "integrator": "leapfrog",
        "dt": DT,
        "effects": ["newtonian_gravity", *([] if is_closed else ["uniform_gravity"]), "spring"],
        "particle_count": len(MASS),
        "spring_count": 1,
        "rod_count": 0,
        "steps": STEPS,
        "time": DT * STEPS,
        "wall_seconds": Between(sum(found[f"{name}_seconds"] for name in parts)),
        **{f"{name}_seconds": SECONDS for name in parts},
        "steps_per_second": pytest.approx(rate, rel=1e-12),
        "steps_per_second_overall": pytest.approx((STEPS - 1) / work, rel=1e-9),
        "pair_interactions_per_second": pytest.approx(2 * rate, rel=1e-12),
        "launches_per_step": 1.0,
        "conserves_energy": True,
        "conserves_momentum": is_closed,
        "conserves_angular_momentum": is_closed,
        "phases": [],
        "total_energy_initial": near(sum(energies(*states[0], field))),
        "total_energy_final": near(kinetic + potential),
        "kinetic_energy_final": near(kinetic),
        "potential_energy_final": near(potential),
        "conserved_energy_error_max": near(errors["relative_energy"]),
        **{f"{name}_error_max": near(error) for name, error in errors.items()},
        "zero_frequency_modes": still,
        "rigid_motions": 5,  # three ways to move and two to turn: bodies on a line have no third
        "mechanism_modes": 0,
        "second_order_modes": 0,
        "unstable_modes": 0,
        "vibrating_modes": len(omega) - still,
        "lowest_angular_frequencies": [near(fastest)],
        "highest_angular_frequency": near(fastest),
        "predicted_damping": [{"at": at, **row} for at in ("lowest", "highest")],
        "status": "ok",
        "findings": [],
        "expect": [verdict(found, errors["relative_energy"])],
        "files": list(files),
        "exit_code": 0,
    }


def verdict(found, error, *, below=1, passed=True):
    """The row of the expectation; its text has nine digits of the value."""
    return {
        "quantity": "relative_energy_error_max",
        "parameters": {},
        "value": near(error),
        "bound": f"< {below:g}",
        "passed": passed,
        "reason": "",
        "named": "relative_energy_error_max",
        "told": f"{found['relative_energy_error_max']:.9g}",
        "label": "relative_energy_error_max",
    }


@pytest.mark.parametrize("field", [(0.0, 0.0, 0.0), FIELD], ids=["closed", "falling"])
@pytest.mark.sampled(3)
def test_every_key_of_a_run_is_what_numpy_computes(field, capsys):
    if any(field):
        write("s.yaml", forces=[*SCENE["forces"], {"uniform_gravity": {"acceleration": list(field)}}])
    found = asked(capsys, "run", "s.yaml", "--headless", "--every", "1", "--snapshot", "a.npz", *WHERE)
    assert found == expected(found, field, ["a.npz"])
    state, (places, velocities) = Snapshot.load("a.npz"), flight(field)[-1]
    np.testing.assert_allclose(state.position, places, atol=ROUNDING)
    np.testing.assert_allclose(state.velocity, velocities, atol=ROUNDING)


def test_every_key_of_a_check_is_that_of_its_runs(capsys):
    """A check takes samples as a run does, after each step of a short run."""
    Path("other.yaml").write_text(Path("s.yaml").read_text().replace("below: 1.0", "below: 1.0e-06"))
    found = asked(capsys, "check", "s.yaml", "other.yaml", "--no-archive", *WHERE, code=4)
    good, bad = found["scenes"]
    assert good == expected(good)
    error = conserved_errors()["relative_energy"]
    failed = {"status": "failed", "exit_code": 4, "expect": [verdict(bad, error, below=1e-6, passed=False)]}
    assert error > 1e-6 and bad == expected(bad) | {"scene": "other.yaml"} | failed
    assert {key: value for key, value in found.items() if key != "scenes"} == {
        "passed": 1,
        "failed": 1,
        "not_possible_here": 0,
        "went_on": None,
        "status": "failed",
        "exit_code": 4,
    }


def test_every_key_of_a_check_of_a_faulty_scene_is_that_of_the_fault(capsys):
    write("faulty.yaml", integrator={"leapfrog": {"dt": -1}})
    (row,) = asked(capsys, "check", "faulty.yaml", *WHERE, code=2)["scenes"]
    fault = row["error"]
    assert fault.startswith("faulty.yaml:") and "integrator.leapfrog.dt" in fault
    expected_row = {"scene": "faulty.yaml", "status": "failed", "error": fault, "faults": [fault], "expect": [], "exit_code": 2}
    assert row == expected_row


@pytest.mark.sampled(3)
def test_every_key_of_a_film_is_that_of_its_run(capsys):
    """A film has a key more, the time of its pictures."""
    found = asked(capsys, "record", "s.yaml", "--frames", "f", "--every", "1", "--no-archive", *WHERE)
    assert found == expected(found, files=["f"], parts=[*PARTS, "capture"])
    assert len(list(Path("f").glob("*.png"))) == 2
