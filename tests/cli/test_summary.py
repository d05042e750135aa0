"""The summary of a run: errors of conserved quantities only, refusals in one line, columns that are distinct."""

import pytest
import yaml

from mpp_taichi import CapacityError, SceneError, Simulation
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._session import run_scene
from mpp_taichi.cli.explain import _share
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.report.summary import Stopwatch, summarize
from mpp_taichi.scene.load import load_scene
from mpp_taichi.simulation import refusals
from scenes import kepler

FALL = [{"uniform_gravity": {"acceleration": [0.0, -1.0, 0.0]}}]


def errors_of(scene):
    """The summary of a short run, and its line of errors."""
    outcome = run_scene(load_scene(scene), Request(backend="cpu", quiet=True, steps=3))
    (line,) = [line for line in outcome.lines() if line.strip().startswith("errors")]
    return outcome.as_json(), line


def held():
    """The sun held in place."""
    scene = kepler() | {"move_to_center_of_mass": False}
    scene["particles"][0]["body"]["free"] = [False, False, False]
    return scene


@pytest.mark.parametrize(
    ("scene", "kept"), [(kepler(), True), (kepler() | {"forces": [*kepler()["forces"], *FALL]}, False), (held(), False)]
)
def test_momentum_is_an_error_only_where_nothing_outside_changes_it(scene, kept):
    found, line = errors_of(scene)
    assert found["conserves_momentum"] is kept and ("momentum changes by" in line) is not kept
    assert ("angular momentum" in line) is kept
    assert found["momentum_error_max"] >= 0.0  # the number stays, for programs


def test_an_effect_that_seems_to_cost_less_than_nothing_is_not_measured():
    assert _share({"share": -0.72, "noise": 0.23, "seconds": -1.2e-7}, " of it") == "not measurable (timings differ by 23 %)"
    assert _share({"share": 0.64, "noise": 0.3, "seconds": 1e-6}, " of it") == "64 % ± 30 %, 1 µs of it"


def oscillator(*, mass=1.0, integrator="leapfrog", forces=(), **spring):
    """Two bodies and perhaps a spring."""
    link = [{"link": {"between": [0, 1], "rest_length": 1.0, **spring}}] if spring else []
    return {
        "particles": [{"body": {"mass": 1.0, "position": [0, 0, 0]}}, {"body": {"mass": mass, "position": [1, 0, 0]}}],
        "springs": link,
        "forces": list(forces),
        "integrator": {integrator: {"dt": 0.01}},
        "run": {"duration": 1.0},
    }


def test_a_dry_run_keeps_names_and_values_apart_and_names_the_limit(tmp_path, capsys):
    path = tmp_path / "drag.yaml"
    path.write_text(yaml.safe_dump(oscillator(forces=[{"linear_drag": {"coefficient": 1.0}}])), encoding="utf-8")
    assert main(["run", str(path), "--dry-run", "--headless", "--backend", "cpu"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (pairs,) = [line for line in lines if "pair interactions" in line]
    assert pairs.split()[-1] == "0"
    (decided,) = [line for line in lines if "decided by" in line]
    assert "damping" in decided and "springs" not in decided  # there are none


@pytest.mark.parametrize("integrator", ["leapfrog", "rk4", "euler", "implicit_midpoint"])
@pytest.mark.parametrize(
    ("scene", "what"),
    [
        (dict(stiffness=1e300, mass=1e-300), "stiffness 1e+300"),
        (dict(stiffness=1.0, mass=1e-300), "mass 1e-300"),
        (dict(stiffness=1.0, damping=1e70), "damping 1e+70"),
        (dict(forces=[{"linear_drag": {"coefficient": 1e70}}]), "drag of the coefficient 1e+70"),
    ],
)
def test_rates_that_overflow_are_refused_with_the_particle(scene, what, integrator):
    with pytest.raises(SceneError, match="ratio must be at most") as refused:
        Simulation(oscillator(integrator=integrator, **scene), backend="cpu", force=True)
    assert what in str(refused.value) and "particle 1" in str(refused.value)


def test_a_band_beyond_memory_or_index_is_refused_before_it_is_allocated(monkeypatch):
    with pytest.raises(CapacityError, match="band has 2,147,483,648 numbers.*conjugate_gradients"):
        refusals.check_room({"band": ("scalar", 2**31)}, dimensions=3, replica_count=1, on_cpu=False)
    monkeypatch.setattr(refusals, "available_bytes", lambda: 1000)
    direct = oscillator(stiffness=1.0) | {"integrator": {"implicit_midpoint": {"dt": 0.01, "solver": "direct"}}}
    with pytest.raises(CapacityError, match="work fields need"):
        Simulation(direct, backend="cpu")


@pytest.mark.sampled(3)
def test_modes_and_damping_are_told_of_the_time_before_a_change():
    """The method of the second phase is another, so its predictions are not those that were made at the start."""
    change = {"at": 0.5, "set": {"integrator": {"implicit_midpoint": {"dt": 0.01}}}}
    spec = load_scene(oscillator(stiffness=1.0) | {"timeline": [change]})
    lines = run_scene(spec, Request(backend="cpu", quiet=True)).lines(verbose=True)
    assert [line for line in lines if "predicted at" in line and "as the run began" not in line] == []
    assert any("as the run began: predicted at the highest" in line for line in lines)


def test_a_run_that_goes_on_counts_its_own_steps_in_its_rates():
    """The first step of a phase is the compiler's."""
    stopwatch = Stopwatch()
    with Simulation(oscillator(), backend="cpu") as simulation:
        simulation.run(steps=100)
        whole, rest = (
            summarize(simulation, TableRecorder(10), stopwatch, plan_asked="auto", first_step=first) for first in (0, 50)
        )
        window = summarize(simulation, TableRecorder(10), stopwatch, plan_asked="auto", keeps_pace=True)
    assert whole["steps_per_second"] / rest["steps_per_second"] == pytest.approx(99 / 49, rel=1e-12)
    assert 0.0 < whole["steps_per_second_overall"] <= whole["steps_per_second"]
    assert window["steps_per_second_overall"] is None and window["steps_per_second"] == whole["steps_per_second"]
