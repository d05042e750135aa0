"""`accuracy:` in a scene: the chosen method reaches the target, is stored, and repeats bit for bit."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import mpp_taichi as mpp
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.choice import _why, choose
from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.offers import Offer, offers_for
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.sample import Configuration, MeasuredError, Sample
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.sweep import StepSweep
from mpp_taichi.accuracy.trials import SAFETY, Trial, as_run, try_offer
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from scenes import kepler

SPAN = 20.0
METHODS = ("leapfrog", "pefrl")


def scene_of(target):
    scene = {**kepler(0.3), "run": {"duration": SPAN}, "accuracy": target}
    del scene["integrator"]  # chosen
    return scene


def row(steps, error, *, seconds, integrator="leapfrog"):
    sample = Sample(Configuration(integrator, steps, "f64", "cpu"), 1.0 / steps, evaluations=steps, seconds=[seconds])
    return StudyRow(sample, *[MeasuredError(error)] * 5)


def relative_separation(snapshot):
    return snapshot.position[1] - snapshot.position[0]


def kepler_separation(time):
    """From pericentre 1 − e with the speed √((1 + e)/(1 − e)), where μ = 1.001: a is not quite 1."""
    mu, distance, speed = 1.001, 0.7, math.sqrt(1.3 / 0.7)
    a = 1.0 / (2.0 / distance - speed**2 / mu)
    e = 1.0 - distance / a
    anomaly = mean = math.sqrt(mu / a**3) * time
    for _ in range(60):
        anomaly -= (anomaly - e * math.sin(anomaly) - mean) / (1.0 - e * math.cos(anomaly))
    return np.array([a * (math.cos(anomaly) - e), a * math.sqrt(1.0 - e * e) * math.sin(anomaly), 0.0])


@pytest.fixture(scope="module")
def chosen(tmp_path_factory):
    """A choice for 1e-6 of positions, among two methods in f64."""
    folder = tmp_path_factory.mktemp("choice")
    spec = load_scene(scene_of(1e-6))
    found = choose(spec, folder, integrators=METHODS, precisions=("f64",), seconds=90.0)
    return SimpleNamespace(folder=folder, spec=spec, found=found)


@pytest.mark.sampled(3)
def test_the_choice_reaches_its_target_and_not_much_more(chosen):
    found = chosen.found
    assert (found.integrator, found.quantity, found.precision) == ("pefrl", "position", "f64")  # as cheap, and of fourth order
    with mpp.Simulation(found.settle(chosen.spec), precision=found.precision) as simulation:
        simulation.run()
        error = np.linalg.norm(relative_separation(simulation.snapshot()) - kepler_separation(SPAN))
    # The planet has all but 10⁻³ of the separation's error; the size of the system, √(⟨r²⟩/2) of both bodies, is 0.70 to 0.72.
    assert 1e-6 / 3.0 < error / 0.71 < 1.1e-6
    assert found.error < 1e-6 and "no other method that was tried reaches the target in 4 times that" in found.why


def test_a_settled_scene_is_a_scene_without_target(chosen):
    settled = chosen.found.settle(chosen.spec)
    again = load_scene(settled.resolved)
    assert again.accuracy is None and settled.accuracy is None
    assert again.integrator.name == "pefrl" and again.integrator.parameters == settled.integrator.parameters


def test_the_choice_is_kept(chosen, monkeypatch):
    monkeypatch.setattr(Study, "run", lambda self: pytest.fail("chosen anew"))
    assert choose(chosen.spec, chosen.folder, precisions=("f64",)) == chosen.found
    settled, precision = mpp.settle(chosen.spec, folder=chosen.folder)
    assert (settled.integrator.parameters["dt"], precision) == (chosen.found.dt, "f64")
    kept = json.loads((chosen.folder / "choice.json").read_text(encoding="utf-8"))
    assert kept["integrator"] == "pefrl" and kept["target"] == 1e-6


def test_a_step_that_misses_is_made_finer_until_it_does_not(chosen):
    problem = pose(chosen.spec)
    store = Store(chosen.folder, identity(problem, SPAN, mpp.__version__))
    steps = SPAN / chosen.found.dt
    too_coarse = Offer("pefrl", "f64", "cpu", steps / 2.0, 1.0)  # of fourth order: an error 16 times too large
    found = []
    wishes = StudyWishes(METHODS, (("cpu", "f64"),), aim=0.7e-6)
    study = Study(
        *(problem, store, Budget(20.0), wishes),
        after_sweep=lambda study, bench: found.append(try_offer(study, bench, too_coarse, 1e-6)),
    )
    study.run()
    (trial,) = found
    assert trial.error.bound <= 1e-6 and trial.dt == SPAN / trial.configuration.steps
    assert trial.configuration.steps == pytest.approx(steps, rel=0.1)


def test_a_changed_target_makes_a_new_choice(chosen, monkeypatch):
    monkeypatch.setattr(Study, "run", lambda self: (_ for _ in ()).throw(InterruptedError))
    with pytest.raises(InterruptedError):
        choose(load_scene(scene_of(1e-5)), chosen.folder)


@pytest.mark.sampled(3)
def test_a_run_takes_the_choice_and_repeats_it(chosen, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kepler.yaml").write_text(yaml.safe_dump(scene_of(1e-6)), encoding="utf-8")
    folder = tmp_path / "out" / "kepler.accuracy"
    folder.mkdir(parents=True)
    (folder / "choice.json").write_bytes((chosen.folder / "choice.json").read_bytes())
    ends = []
    for name in ("a.npz", "b.npz"):
        assert main(["run", "kepler.yaml", "--headless", "--json", "-q", "--snapshot", name]) == 0
        told = json.loads(capsys.readouterr().out)
        assert told["integrator"] == "pefrl" and told["accuracy"]["dt"] == told["dt"] == chosen.found.dt
        ends.append(np.load(name)["position"])
    assert np.array_equal(*ends)


def test_an_energy_is_reached_as_well(tmp_path):
    spec = load_scene(scene_of({"energy": 1e-5}))
    found = choose(spec, tmp_path, integrators=("leapfrog",), precisions=("f64",), seconds=60.0)
    assert found.quantity == "energy"
    with mpp.Simulation(found.settle(spec), precision="f64") as simulation:
        start = simulation.diagnostics()["total_energy"]
        errors = []
        for _ in range(97):  # other times than the pilot's 64
            simulation.run(duration=SPAN / 97)
            errors.append(abs(simulation.diagnostics()["total_energy"] / start - 1.0))
    assert 1e-5 / 3.0 < max(errors) < 1.5e-5


@pytest.mark.sampled(3)
def test_no_step_beyond_what_the_springs_allow_is_chosen(tmp_path):
    """Of sixth order at the largest stable step the error is far below 1e-2; a coarser one would not hold."""
    spring = {"link": {"between": [0, 1], "stiffness": 100.0, "rest_length": 1.0}}
    bodies = [{"body": {"mass": 1.0, "position": [0, 0, 0], "free": False}}, {"body": {"mass": 1.0, "position": [1.1, 0, 0]}}]
    scene = {"title": "Oscillator", "particles": bodies, "springs": [spring], "run": {"duration": 2.0}, "accuracy": 1e-2}
    spec = load_scene(scene)
    found = choose(spec, tmp_path, integrators=("srkn14a",), precisions=("f64",), seconds=60.0)
    with mpp.Simulation(found.settle(spec), precision=found.precision) as simulation:
        simulation.run()


def test_offered_steps_are_those_whose_error_equals_the_target():
    slow = [row(steps, 1.0 / steps**2, seconds=1e-3 * steps) for steps in (10, 100, 1000)]
    fast = [row(steps, 1.0 / steps**4, seconds=3e-3 * steps, integrator="pefrl") for steps in (3, 30)]
    never = [row(10, 1e-2, seconds=1e-9, integrator="euler")]
    offers = {offer.integrator: offer for offer in offers_for([*slow, *fast, *never], "position", 1e-5)}
    assert set(offers) == {"leapfrog", "pefrl"}
    for name, cost, order in (("leapfrog", 1e-3, 2), ("pefrl", 3e-3, 4)):
        offer = offers[name]
        assert offer.fineness == pytest.approx(1e5 ** (1 / order)) and offer.power == pytest.approx(order)
        assert offer.seconds == pytest.approx(cost * offer.fineness)


def test_a_ladder_that_ends_close_to_the_target_is_offered_beyond_its_last_run():
    close = [row(steps, 1.0 / steps**4, seconds=1e-3 * steps) for steps in (10, 30)]
    far = [row(steps, 1.0 / steps**2, seconds=1e-9, integrator="pefrl") for steps in (10, 30)]
    rising = [row(steps, 1e-6 * steps, seconds=1e-9, integrator="rk4") for steps in (10, 30)]
    (offer,) = offers_for([*close, *far, *rising], "position", 1e-7)
    assert offer.integrator == "leapfrog" and offer.fineness == pytest.approx(1e7 ** (1 / 4))
    assert offer.seconds == pytest.approx(1e-3 * offer.fineness)


def test_a_budget_that_ends_while_methods_are_tried_does_not_end_the_trials(tmp_path, monkeypatch):
    def climb_and_end(sweep, ladders, *, share, first, climb=StepSweep.climb):
        climb(sweep, ladders, share=share, first=first)
        raise OutOfTime

    monkeypatch.setattr(StepSweep, "climb", climb_and_end)
    found = choose(load_scene(scene_of(1e-4)), tmp_path, integrators=("pefrl",), precisions=("f64",), seconds=60.0)
    assert found.integrator == "pefrl" and 1e-4 / 3.0 < found.error <= 1e-4


@pytest.mark.sampled(3)
def test_the_tolerance_of_a_reference_is_made_coarser_for_a_target(tmp_path, monkeypatch):
    """The budget ended after the reference, whose tolerances are 1e-14 and below: nothing coarser is known."""

    def end(sweep, ladders, *, share, first):
        raise OutOfTime

    monkeypatch.setattr(StepSweep, "climb", end)
    found = choose(load_scene(scene_of(1e-6)), tmp_path, integrators=("taylor",), precisions=("f64",), seconds=60.0)
    assert found.integrator == "taylor" and found.tolerance > 1e-9 and 1e-8 < found.error <= 1e-6


def test_a_run_that_reaches_the_target_as_it_is_counts_where_no_step_can_be_interpolated():
    """The bar of a reference is 9e-10: between two runs nothing tells where the error is 1e-9, yet the reference reaches it."""
    made = {steps: row(steps, error, seconds=1e-3 * steps) for steps, error in ((10, 2e-9), (20, 9e-10), (40, 9.5e-10))}
    wishes = SimpleNamespace(integrators=None, devices=[("cpu", "f64")])
    problem = SimpleNamespace(span=2.0)
    study = SimpleNamespace(
        quantity="position", wishes=wishes, methods={"leapfrog": None}, problem=problem, whole=2.0, values=None
    )
    study.allowed, study.rows = lambda target, quantity: target, lambda: list(made.values())
    found = as_run(study, 1e-9)
    assert found.configuration.steps == 20 and found.dt == 0.1 and found.error.bound == 9e-10
    assert as_run(study, 1e-10) is None
    made[20].sample.status = made[40].sample.status = "diverged"
    assert as_run(study, 1e-9) is None


@pytest.mark.sampled(3)
def test_an_impossible_target_ends_with_the_best_there_was(tmp_path):
    spec = load_scene(scene_of({"energy": 1e-18}))
    with pytest.raises(mpp.StabilityError, match="nothing that was tried reaches 1e-18 of energy; the best was"):
        choose(spec, tmp_path, integrators=("leapfrog",), precisions=("f64",), seconds=4.0)


def test_a_target_must_be_settled_before_a_simulation():
    with pytest.raises(mpp.SceneError, match="still to be chosen"):
        mpp.Simulation(scene_of(1e-6))
    assert SAFETY < 1.0


@pytest.mark.parametrize(
    ("is_known", "measured", "told"),
    [
        (True, None, "; pefrl in f64 would take 3 times as long"),  # from two runs, between which the target lies
        (False, 4.0, "; pefrl in f64 would take 2 times as long"),  # a trial counts more than what was expected of it
        (True, 4.0, "; pefrl in f64 would take 2 times as long"),
        (False, None, "; no other method that was tried reaches the target in"),  # only extrapolated, and not tried
    ],
)
def test_the_reason_names_other_methods_that_are_known_or_were_tried(is_known, measured, told):
    def offer(integrator, seconds, known):
        return Offer(integrator, "f64", "cpu", 100.0, seconds, is_known=known)

    def trial(of, seconds):
        return Trial(of, Configuration(of.integrator, 100, "f64", "cpu"), 0.1, MeasuredError(1e-6), seconds)

    own, other = offer("leapfrog", 1.0, True), offer("pefrl", 6.0, is_known)
    chosen = trial(own, 2.0)
    reached = [chosen] if measured is None else [chosen, trial(other, measured)]
    rows = [row(10, 1e-3, seconds=1.0, integrator=name) for name in METHODS]
    study = SimpleNamespace(value_reference=None, problem=SimpleNamespace(span=1.0), whole=1.0, rows=lambda: rows)
    assert told in _why(SimpleNamespace(reached=reached, offers=[own, other]), chosen, study)
