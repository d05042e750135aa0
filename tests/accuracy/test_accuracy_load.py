"""Studies of accuracy on a busy machine: the same quantity, the same reference and the same words as on a quiet machine."""

import json
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from counted_budget import CountedBudget

import mpp_taichi as mpp
from mpp_taichi.accuracy import stepper
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.step_clock import LaunchTime, StepClock
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from scenes import kepler

sys.path.append(str(Path(__file__).parents[2] / "tools" / "benchmarks"))
from long_double_reference import reference_end  # noqa: E402

SLOWED = 20.0  # how many times slower the clock on the wall lets this process seem, as 20 other busy processes do
DURATION, SIZE = 10.0, 1.295  # the size of the system: the root mean square distance of both bodies from their mean place


@pytest.fixture
def busy_machine(monkeypatch):
    """A clock on the wall that runs SLOWED times as fast, while the processor's time goes on as ever."""
    real = time.perf_counter
    monkeypatch.setattr(time, "perf_counter", lambda: SLOWED * real())


def two_springs(target=1e-6):
    """Two bodies that hang on two stiff springs from a third, which is held: chaotic, but not within its run."""
    bodies = [
        {"mass": 1, "position": [0, 0, 0], "free": False},
        {"mass": 1, "position": [1, 0, 0.3]},
        {"mass": 0.7, "position": [1.7, 0, 0.9]},
    ]
    return {
        "title": "Two springs",
        "particles": [{"body": body} for body in bodies],
        "springs": [{"link": {"between": [k, k + 1], "stiffness": stiffness}} for k, stiffness in enumerate((2000, 800))],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -9.81]}}],
        "accuracy": target,
        "run": {"duration": DURATION},
    }


@pytest.mark.sampled(3)
def test_positions_are_chosen_for_and_reached_on_a_busy_machine(busy_machine, tmp_path):
    spec = load_scene(two_springs())
    found = choose(spec, tmp_path, integrators=("leapfrog", "pefrl", "srkn14a"), precisions=("f64",))
    assert found.quantity == "position" and found.quantity_because == "positions at the end are known"
    with mpp.Simulation(found.settle(spec), precision=found.precision) as simulation:
        simulation.run()
        place = simulation.snapshot().position[1:]
    # In long double: the motion enlarges the rounding errors of f64 to 1e-6.
    end = reference_end(spec, pose(spec).start, DURATION)[1:]
    assert np.linalg.norm((place - end).astype(float), axis=1).max() / SIZE < 1e-6


def test_a_budget_is_not_spent_by_waiting():
    budget = Budget(1.0)
    time.sleep(0.3)
    assert budget.spent < 0.1
    budget.wait(0.25)  # for another device
    assert 0.25 <= budget.spent < 0.35
    began = time.process_time()
    while time.process_time() - began < 0.1:
        pass
    assert budget.spent >= 0.35


@pytest.mark.parametrize("threads", [1, 2, 8])
def test_load_changes_no_time_of_steps(threads, monkeypatch):
    """Half a second of work of all threads, on a quiet machine and on a machine that others take most of."""
    clock = StepClock(threads)
    now = {"wall": 0.0, "processor": 0.0}
    monkeypatch.setattr(time, "perf_counter", lambda: now["wall"])
    monkeypatch.setattr(time, "process_time", lambda: now["processor"])

    def launch(slowed):
        now["wall"] += 0.5 * slowed
        now["processor"] += 0.5 * threads

    quiet = clock.seconds(clock.time(lambda: launch(1.0)))
    busy = clock.seconds(clock.time(lambda: launch(SLOWED)))
    assert quiet == pytest.approx(0.5) and busy == pytest.approx(0.5)
    assert StepClock(0).seconds(LaunchTime(wall=0.5, processor=0.1)) == 0.5  # of another device


@pytest.mark.parametrize("asked", [1e-6, {"position": 1e-6}])
@pytest.mark.sampled(3)
def test_a_budget_that_ends_before_a_run_is_said_and_changes_no_quantity(asked, tmp_path):
    scene = {**kepler(0.3), "run": {"duration": 20.0}, "accuracy": asked}
    with pytest.raises(mpp.StabilityError, match="the budget ended before the first run was done") as caught:
        choose(load_scene(scene), tmp_path, precisions=("f64",), seconds=1e-3)
    assert "energy" not in str(caught.value)
    assert not (tmp_path / "choice.json").exists()


def test_a_budget_that_ends_before_a_run_is_said_where_energies_are_asked_for(tmp_path):
    scene = {**kepler(0.3), "run": {"duration": 20.0}, "accuracy": {"energy": 1e-6}}
    with pytest.raises(mpp.StabilityError, match="the budget ended before a run was done"):
        choose(load_scene(scene), tmp_path, precisions=("f64",), seconds=1e-3)


def test_the_verb_says_that_the_budget_ended_and_not_that_energy_is_lost(tmp_path, capsys):
    path = tmp_path / "kepler.yaml"
    path.write_text(json.dumps({**kepler(0.3), "run": {"duration": 20.0}}), encoding="utf-8")
    assert main(["accuracy", str(path), "--budget", "0.001s", "--out", str(tmp_path / "out"), "--json", "-q"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["quantity"] is None and "does not keep its energy" not in told["sentence"]
    assert told["sentence"] == "nothing can be compared: the budget ended before the first run was done"


@pytest.mark.sampled(3)
def test_a_reference_that_needs_more_than_its_share_gets_it(tmp_path):
    """A run is 64 launches: the share of a budget of 300 has one, and a reference needs three; four budgets have eighteen."""
    problem = pose(load_scene({**kepler(0.3), "run": {"duration": 20.0}}))
    store, told = Store(tmp_path, identity(problem, 20.0, "test")), []
    wishes = StudyWishes(("pefrl",), (("cpu", "f64"),), reference="yoshida8", aim=1e-5)
    study = Study(problem, store, CountedBudget(300.0), wishes, told.append)
    study.run()
    assert study.quantity == "position" and study.reference.trusted
    assert any("up to 4 budgets are spent to find it" in line for line in told)


@pytest.mark.sampled(3)
def test_a_choice_without_its_budget_and_its_reason_is_made_anew(tmp_path, monkeypatch):
    spec = load_scene({**kepler(0.3), "run": {"duration": 20.0}, "accuracy": 1e-4})
    found = choose(spec, tmp_path, integrators=("pefrl",), precisions=("f64",))
    kept = json.loads((tmp_path / "choice.json").read_text(encoding="utf-8"))
    assert kept["budget"] > 0.0 and kept["asked"] is None and kept["quantity"] == "position" and kept["quantity_because"]
    assert choose(spec, tmp_path, precisions=("f64",)) == found
    for key in ("budget", "quantity_because"):
        del kept[key]
    (tmp_path / "choice.json").write_text(json.dumps(kept), encoding="utf-8")
    monkeypatch.setattr(Study, "run", lambda self: (_ for _ in ()).throw(InterruptedError))
    with pytest.raises(InterruptedError):
        choose(spec, tmp_path, precisions=("f64",))


def test_a_launch_is_timed_from_an_idle_device_until_the_device_has_done_it(monkeypatch):
    """Devices work on what was launched before, and return from a launch before it is done."""
    told = []
    monkeypatch.setattr(stepper.backends, "import_taichi", lambda: SimpleNamespace(sync=lambda: told.append("wait")))
    launcher = SimpleNamespace(advance=lambda *given: told.append(given))
    clock = SimpleNamespace(time=lambda launch: told.append("begin") or launch() or told.append("end"))
    made = SimpleNamespace(cost=SimpleNamespace(clock=clock), simulation=SimpleNamespace(launcher=launcher))
    stepper.Stepper.launch(made, 1.0, 0.5, 3)
    assert told == ["wait", "begin", (1.0, 0.5, 0, 3), "wait", "end"]
