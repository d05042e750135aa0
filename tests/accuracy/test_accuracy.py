"""Studies of accuracy: errors of the references, orders, fronts of error and time, budgets, chaos, and the HTML page."""

import html.parser
import json
import math
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from counted_budget import CountedBudget
from PIL import Image
from scipy.integrate import solve_ivp

from mpp_taichi.accuracy import chaos, front
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.ladder import Ladder
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import LOOKS
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.reference import Convergence, converge
from mpp_taichi.accuracy.reference_search import MOST_BUDGETS
from mpp_taichi.accuracy.sample import Configuration, MeasuredError, Sample
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.sweep import StepSweep
from mpp_taichi.accuracy.trace import Trace
from mpp_taichi.accuracy.verdict import duration, factor, sentence, step_ratio
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.cli.main import main
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.scene.load import load_scene
from mpp_taichi.step import adaptive_steps
from scenes import kepler

ECCENTRICITY = 0.3
SPAN = 7.0  # no whole number of periods, at which errors of phase would hide
ORDERS = {"leapfrog": 2, "yoshida4": 4, "rk4": 4}
BUDGET = "120s"  # it needs 3 on a quiet machine, and ends when all is done


def three_bodies(span):
    """A softened planar triple from rest: bound, and chaotic."""
    places, masses = [[1, 3], [-2, -1], [1.4, -1.2]], [1.0, 1.3, 0.8]
    return {
        "title": "Three bodies",
        "dimensions": 2,
        "particles": [{"body": {"mass": mass, "position": place}} for mass, place in zip(masses, places)],
        "forces": [{"newtonian_gravity": {"strength": 1.0, "softening": 0.3}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": span},
    }


def machine_of(scene, integrator):
    import_taichi()
    return Machine(pose(load_scene(scene)), integrator, backend="cpu", precision="f64")


def kepler_end(time):
    """Both bodies by Kepler's equation, about the centre of mass; G (1 + 10⁻³) = μ, so a is not quite 1."""
    mass, e = 1e-3, ECCENTRICITY
    mu, distance, speed = 1.0 + mass, 1.0 - e, math.sqrt((1.0 + e) / (1.0 - e))
    a = 1.0 / (2.0 / distance - speed**2 / mu)
    eccentricity = 1.0 - distance / a
    anomaly = mean = math.sqrt(mu / a**3) * time
    for _ in range(50):  # Newton; the second half of the steps moves nothing
        rest = anomaly - eccentricity * math.sin(anomaly) - mean
        anomaly -= rest / (1.0 - eccentricity * math.cos(anomaly))
    apart = np.array([a * (math.cos(anomaly) - eccentricity), a * math.sqrt(1.0 - eccentricity**2) * math.sin(anomaly), 0.0])
    return np.array([-mass / mu * apart, apart / mu])


def run_verb(*words):
    return main(["accuracy", *map(str, words)])


@pytest.fixture
def kepler_copy(kepler_study, tmp_path):
    """The study with a folder of its own, to go on with."""
    out = shutil.copytree(kepler_study.out, tmp_path / "out")
    words = tuple(out if word == kepler_study.out else word for word in kepler_study.words)
    return SimpleNamespace(out=out, words=words, found=kepler_study.found, rows=kepler_study.rows)


@pytest.fixture(scope="module")
def kepler_study(tmp_path_factory):
    """One study through the command line: its folder, its words to repeat it, and what it wrote."""
    folder = tmp_path_factory.mktemp("accuracy")
    scene = folder / "kepler.yaml"
    scene.write_text(yaml.safe_dump({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": SPAN}}), encoding="utf-8")
    out = folder / "out"
    where = ("--precisions", "f64", "--backends", "cpu")
    words = (scene, "--integrators", ",".join(ORDERS), *where, "--budget", BUDGET, "--out", out, "--quiet")
    assert run_verb(*words) == 0
    found = json.loads((out / "accuracy.json").read_text(encoding="utf-8"))
    return SimpleNamespace(out=out, words=words, found=found, rows=found["rows"])


# --- the reference ----------------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_the_reference_is_as_close_to_the_closed_form_as_its_bar_says(kepler_study):
    reference = kepler_study.found["reference"]
    (samples,) = kepler_study.out.glob("samples-*.json")
    asked = f"-{reference['control']}-{reference['tolerance']:.6g}" if reference["tolerance"] else ""
    name = f"{reference['integrator']}-f64-cpu-{reference['steps']}{asked}.npy"
    end = np.load(samples.with_suffix("") / name)
    true = np.linalg.norm(end - kepler_end(SPAN), axis=1).max() / reference["size"]
    assert reference["trusted"]
    # The closed form itself is good to some ulp of the mean anomaly, 7 × 2⁻⁵² × sin' ≤ 1/(1 − e): below 1e-14.
    assert true < reference["bar"] + 1e-14
    assert reference["bar"] < 1e-10


def test_a_coarse_reference_is_found_out_and_its_bar_still_holds():
    with_leapfrog = machine_of({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": SPAN}}, "leapfrog")
    budget = Budget(1e9)
    for cost in with_leapfrog.stepper.costs.values():
        cost.seconds = 1.0
    runs = Convergence(2, 64)
    converge(runs, with_leapfrog, budget, share=1e-12, add=lambda sample: None)
    alone = runs.reference()
    assert not alone.trusted and math.isinf(alone.bar) and not alone.positions_mean_something
    coarse = Convergence(2, 64)
    for steps in (64, 128, 256):
        coarse.add(*with_leapfrog.run(with_leapfrog.configuration(steps), budget, follow=True))
    reference = coarse.reference()
    true = np.linalg.norm(reference.end - kepler_end(SPAN), axis=1).max() / reference.size
    assert reference.bar >= true > 1e-3  # and so it is of no use for positions, however well it converges
    assert not reference.positions_mean_something


def planted(errors, *, looks=3, order=4):
    """A convergence whose runs end so far from the truth, in a system of size 1."""
    found = Convergence(order, 64)
    places = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    for number, error in enumerate(errors):
        end = places + np.array([error, 0.0, 0.0])
        sample = Sample(Configuration("planted", 64 * 2**number, "f64", "cpu"), 1.0, end=end)
        found.add(sample, Trace(np.linspace(0.0, 1.0, looks), np.stack([places] * (looks - 1) + [end])))
    return found


@pytest.mark.sampled(2)
@pytest.mark.parametrize("falls", [16.0, 4.0, 2.5, 1.5])
def test_bars_hold_for_any_rate_of_convergence(falls):
    found = planted([1e-3 * falls**-k for k in range(5)])
    reference = found.reference()
    assert reference.bar >= 1e-3 * falls**-4 * (1.0 - 1e-9)
    assert reference.trusted == (falls >= 2.0)


def test_the_best_pair_is_the_reference_where_finer_steps_only_add_rounding_errors():
    """Errors fall sixteenfold to 2e-8 and then grow by √2 with each halving, with random signs, as of a sum of roundings."""
    signs, errors = np.random.default_rng(5).choice([-1.0, 1.0], 20), [1e-3 * 16.0**-k for k in range(4)]
    errors += [2e-8 * math.sqrt(2.0) ** k * sign for k, sign in enumerate(signs)]
    runs = next(number for number in range(2, len(errors)) if planted(errors[:number]).is_enough)
    found = planted(errors[:runs])
    reference = found.reference()
    best = [64 * 2**k for k in range(runs)].index(reference.steps)
    assert runs <= best + 5  # of 24
    assert abs(errors[best]) <= reference.bar < 1e-6
    apart = [abs(error - errors[best]) for error in errors[best + 1 : runs]]
    assert reference.bar >= max(apart, default=0.0) * (1.0 - 1e-6)
    assert reference.trusted and reference.differences[best - 1] == min(reference.differences)


def test_a_difference_that_falls_by_less_than_the_order_says_is_no_bar_by_itself():
    """Errors of an eighth-order method on two stiff springs, where the last two are rounding errors that nearly cancel."""
    reference = planted([2.3e-4, 8.6e-7, 2.5e-8, 4.6e-8], order=8).reference()
    assert reference.bar >= 4.6e-8 > reference.differences[-1]
    errors = [1e-3 / 256.0**k for k in range(4)]  # as the order says: the last difference is the bar
    assert planted(errors, order=8).reference().bar == pytest.approx(errors[2] - errors[3])


def test_what_does_not_converge_is_no_reference():
    random = np.random.default_rng(1)
    lost = planted(random.uniform(-1, 1, 6)).reference()
    assert not lost.trusted and not lost.positions_mean_something
    assert lost.meaning == pytest.approx(0.5)  # the traces part after the second of three samples
    rounded = planted([1e-8, 1e-12, *random.uniform(-1e-14, 1e-14, 2)])
    assert rounded.is_enough and rounded.reference().trusted
    assert not planted([1e-8, 1e-8 + 1e-14]).is_enough  # two that agree by chance show nothing
    assert not planted([1e-8, 1e-8 + 1e-14]).reference().trusted


def test_errors_below_the_bar_are_never_numbers(kepler_study):
    bar = kepler_study.found["reference"]["bar"]
    errors = [row["errors"]["position"] for row in kepler_study.rows if row["status"] == "ok"]
    assert any(error["value"] is None and error["at_most"] >= bar for error in errors)
    assert all(error["value"] is None or error["value"] > 2.0 * bar for error in errors)
    assert str(MeasuredError.against(3e-14, 1e-13)) == "≤ 2e-13" and str(MeasuredError.against(3e-12, 1e-13)) == "3.0e-12"
    assert str(MeasuredError.against(0.0, 1e-15)) == "≤ 1e-15"


@pytest.mark.sampled(2)
@pytest.mark.parametrize("apart", [0.0, 0.3, 0.999, 1.001, 1.999, 2.001, 5.0])
@pytest.mark.parametrize("error_of_reference", [-1.0, 1.0])
def test_a_stated_error_is_half_to_twice_the_true_error_whatever_the_error_of_the_reference_is(apart, error_of_reference):
    """On a line: the reference lies a bar away from the truth, to either side; the run lies `apart` bars from the reference."""
    bar = 1e-9
    told, true = MeasuredError.against(apart * bar, bar), abs(apart + error_of_reference) * bar
    if told.value is None:
        assert true * (1.0 - 1e-12) <= told.at_most <= 3.0 * bar
    else:
        assert told.value / 2.0 <= true <= 2.0 * told.value


# --- what is measured -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", ORDERS)
def test_errors_fall_with_the_order_of_the_method(kepler_study, integrator):
    # Below these errors the next term, of dt² more in symmetric methods and 7 dt more in rk4, moves the slope by less than 0.1;
    # thirty times the bar of the reference leaves 3 % in doubt, 0.015 of a slope over one decade of steps.
    largest = {"leapfrog": 1e-3, "yoshida4": 1e-4, "rk4": 1e-6}[integrator]
    # Runs of up to 10⁵ steps round by a few 1e-14, and thirty times as much is 1e-12.
    least = max(30.0 * kepler_study.found["reference"]["bar"], 1e-12)
    mine = [row for row in kepler_study.rows if row["integrator"] == integrator and row["status"] == "ok"]
    points = [(row["dt"], error) for row in mine if (error := row["errors"]["position"]["value"]) and least < error < largest]
    assert max(error for _, error in points) > 99.0 * min(error for _, error in points)
    slope = np.polyfit(*np.log10(points).T, 1)[0]
    assert slope == pytest.approx(ORDERS[integrator], abs=0.1)


def test_evaluations_are_forces_times_steps_and_times_are_medians(kepler_study):
    per_step = {"leapfrog": 1, "yoshida4": 3, "rk4": 4}
    for row in kepler_study.rows:
        if row["integrator"] in per_step:  # the reference is there as well
            assert row["evaluations"] == per_step[row["integrator"]] * row["steps"]
        assert row["median_seconds"] == np.median(row["seconds"])
        if row["tolerance"] is None:  # the steps of an adaptive method are its samples
            assert row["dt"] * row["steps"] == pytest.approx(SPAN, rel=1e-15)


def test_a_run_that_blows_up_is_a_row_with_the_reason():
    scene = {
        "particles": [
            {"body": {"mass": 1.0, "position": [0, 0, 0], "free": False}},
            {"body": {"mass": 1.0, "position": [1.1, 0, 0]}},
        ],
        "springs": [{"link": {"between": [0, 1], "stiffness": 100.0, "rest_length": 1.0}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 100.0},
    }
    # ω = 10, dt = 0.25 is beyond 2/ω: the larger eigenvalue is −(5.25 − ...)⁄2 ± …, modulus 4, so 400 steps overflow any bound.
    machine = machine_of(scene, "leapfrog")
    sample, _ = machine.run(machine.configuration(400), Budget(1e9))
    assert sample.status == "diverged" and "out of bounds before t =" in sample.reason and sample.end is None


def test_a_run_of_more_own_steps_than_can_be_counted_is_a_row_with_the_reason(monkeypatch):
    """The study goes on with other methods."""
    machine = machine_of({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": SPAN}}, "adaptive_bogacki_shampine")
    monkeypatch.setattr(adaptive_steps, "MOST_STEPS", 2)  # of some 10 between two samples
    sample, _ = machine.run(machine.configuration(LOOKS), Budget(1e9))
    assert sample.status == "diverged" and "steps of" in sample.reason and sample.end is None


# --- fronts and words -------------------------------------------------------------------------------------------------


def test_the_front_is_what_brute_force_finds():
    random = np.random.default_rng(4)
    for size in (0, 1, 2, 7, 40):
        points = [(float(e), float(c)) for e, c in zip(random.integers(1, 9, size), random.integers(1, 9, size))]
        points += [(math.inf, 1.0), (0.5, math.nan)]
        finite = [k for k, point in enumerate(points) if all(math.isfinite(x) for x in point)]
        beaten = {
            k
            for k in finite
            for j in finite
            if points[j] != points[k] and points[j][0] <= points[k][0] and points[j][1] <= points[k][1]
        }
        assert set(front.front(points)) == set(finite) - beaten


def test_the_price_of_a_digit_is_that_of_a_power_law():
    errors = [1e-2, 1e-5, 1e-7, 1e-9]
    assert front.price_of_a_digit(errors, [3.0 * error**-0.25 for error in errors]) == pytest.approx(10**0.25)
    assert front.price_of_a_digit(errors[:2], [1.0, 2.0]) is None


def test_the_sentence_says_what_the_rows_say(kepler_study):
    found, rows = kepler_study.found, [row for row in kepler_study.rows if row["status"] == "ok"]

    def bound(row):
        error = row["errors"]["position"]
        return error["value"] if error["value"] is not None else error["at_most"]

    def on_front(row, cost):
        better = [r for r in rows if bound(r) <= bound(row) and r[cost] <= row[cost]]
        return bound(row) < 1.0 and all(bound(r) == bound(row) and r[cost] == row[cost] for r in better)

    said = found["sentence"]
    for cost, word in (("median_seconds", "the time"), ("evaluations", "the force evaluations")):
        points = [
            (bound(row), row[cost]) for row in rows if on_front(row, cost) and row["errors"]["position"]["value"] is not None
        ]
        slope = np.polyfit(-np.log10([error for error, _ in points]), np.log10([price for _, price in points]), 1)[0]
        assert f"{factor(10**slope)} {word}" in said
    fastest = min(row["median_seconds"] for row in rows if bound(row) <= 1e-6)
    alike = [row for row in rows if bound(row) <= 1e-6 and row["median_seconds"] <= 1.1 * fastest]
    best = min(alike, key=bound)
    setting = f"dt = {best['dt']:.3g}" if best["tolerance"] is None else f"{best['control']} = {best['tolerance']:.3g}"
    assert f"for 1e-6 of position take {best['integrator']} in f64 with {setting}, " in said
    assert duration(best["median_seconds"]) in said
    own = next(row for row in rows if row["is_own"])
    assert own["integrator"] == "leapfrog" and own["steps"] == 700
    # Second order: the step that 1e-6 needs is √(1e-6 / error) of the scene's own.
    coarser = math.sqrt(bound(own) / 1e-6)
    assert f"own setting (leapfrog, dt = 0.01) has the error {bound(own):.1e}: its step is {coarser:.0f}× coarser" in said


def test_the_sentence_reports_errors_that_no_run_reached():
    rows = [
        front.StudyRow(
            Sample(Configuration("leapfrog", steps, "f64", "cpu"), 1.0 / steps, evaluations=steps, seconds=[1.0 * steps]),
            *[MeasuredError(1.0 / steps**2)] * 5,
            is_own=steps == 10,
        )
        for steps in (10, 30, 100)
    ]
    from mpp_taichi.accuracy.verdict import verdict

    said = sentence(verdict(rows, "position", 1e-6))
    assert "nothing that was tried reaches 1e-6 of position; leapfrog came to 1.0e-04" in said
    assert "misses 1e-6" in said
    assert step_ratio(rows[0], rows, "position", 1e-3) == pytest.approx(math.sqrt(1e-3 / 1e-2))
    assert "nothing can be compared" in sentence(verdict(rows, None, 1e-6))


def test_the_sentence_says_what_ten_times_less_and_more_time_would_buy():
    rows = [
        front.StudyRow(
            Sample(Configuration("leapfrog", steps, "f64", "cpu"), 1.0 / steps, evaluations=steps, seconds=[1e-3 * steps]),
            *[MeasuredError(1.0 / steps**2)] * 5,
        )
        for steps in (20, 30, 300, 2500, 4000)
    ]
    from mpp_taichi.accuracy.verdict import verdict

    found = verdict(rows, "position", 2e-5)
    assert found["choice"]["error"] == 1.0 / 300**2
    assert found["faster"]["error"] == 1.0 / 30**2 and found["slower"]["error"] == 1.0 / 2500**2
    said = sentence(found)
    assert "a tenth of this time buys 1.1e-03 (leapfrog in f64, dt = 0.0333)" in said
    assert "ten times this time buys 1.6e-07 (leapfrog in f64, dt = 0.0004)" in said
    alone = verdict(rows[2:3], "position", 2e-5)
    assert "faster" not in alone and "this time buys" not in sentence(alone)


def test_the_sentence_says_what_other_precisions_take():
    """Times and floors of errors as they are for few bodies: df64 ten times as dear as f64, f32 at 10⁻⁵."""
    from mpp_taichi.accuracy.verdict import verdict

    rows = [
        front.StudyRow(
            Sample(Configuration("leapfrog", steps, precision, "cpu"), 1.0 / steps, evaluations=steps, seconds=[cost * steps]),
            *[MeasuredError(max(1.0 / steps**2, floor))] * 5,
        )
        for precision, cost, floor in (("f64", 1e-6, 0.0), ("df64", 1e-5, 0.0), ("ds", 3e-6, 1e-5), ("f32", 1e-6, 1e-5))
        for steps in (32, 2000)
    ]
    said = sentence(verdict(rows, "position", 1e-6))
    assert "in df64 the same takes 20 ms (10× as long), in ds and f32 nothing that was tried reaches it" in said
    assert "in df64" not in sentence(verdict(rows[:2], "position", 1e-6))
    by_time = sentence(verdict(rows, "position", 1e-4))
    assert 0 < by_time.find("in ds the same takes") < by_time.find("in df64 the same takes"), "the fastest is told first"


@pytest.mark.parametrize("along", [1.0, 2.0])
def test_the_sentence_says_what_other_backends_take_and_what_a_film_needs(along):
    from mpp_taichi.accuracy.verdict import verdict

    rows = [
        front.StudyRow(
            Sample(
                *(Configuration("leapfrog", steps, "f64", backend), 1.0 / steps),
                **{"evaluations": steps, "seconds": [cost * steps], "along": along * 1.0 / steps**2},
            ),
            *[MeasuredError(1.0 / steps**2)] * 5,
        )
        for backend, cost in (("cpu", 1e-3), ("vulkan", 4e-3), ("cuda", 1e-4))
        for steps in (32, 2000)
        if (backend, steps) != ("cuda", 2000)
    ]
    found = verdict(rows, "position", 1e-6)
    said = sentence(found)
    assert "on vulkan in f64 the same takes 8 s (4.0× as long)" in said
    assert "on cuda it takes" not in said  # no run there reaches the target
    # Within 1e-3 at the end, 2e-3 on the way: then the finer run is enough, and no faster than the choice.
    film = "for a film, in which the eye sees 1e-3, leapfrog in f64 on cuda with dt = 0.0312 is enough, 625× faster"
    assert (film in said) == (along == 1.0) and ("film" in said) == (along == 1.0)
    assert [row["backend"] for row in found["elsewhere"]] == ["vulkan"]
    assert "film" not in verdict(rows, "position", 1e-3) and "film" not in verdict(rows, "energy", 1e-6)


def test_ladders_end_where_nothing_is_gained():
    ladder = Ladder("leapfrog", 2, anchor=100.0, least=20.0, floor=1e-12)
    tried = {}
    while rungs := ladder.open_rungs():
        rung = rungs[0]
        steps = ladder.steps(rung)
        tried[rung] = max(1e-2 * (100 / steps) ** 2, 3e-9)  # round-off at 3e-9
        ladder.note(rung, tried[rung])
    assert min(tried) == -1 and ladder.steps(-2) < 20
    # 1e-2 / 10^k reaches 3e-9 between k = 6 and 7; the one after shows that nothing is gained.
    assert max(tried) == 8


# --- resumption and budget --------------------------------------------------------------------------------------------


def test_a_second_study_measures_nothing_twice(kepler_copy, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("a sample was made twice")

    monkeypatch.setattr(Machine, "__init__", refuse)
    assert run_verb(*kepler_copy.words) == 0
    again = json.loads((kepler_copy.out / "accuracy.json").read_text(encoding="utf-8"))
    assert again["rows"] == kepler_copy.rows and again["resumed_samples"] == len(kepler_copy.rows)
    assert again["sentence"] == kepler_copy.found["sentence"]


def test_a_study_goes_on_where_it_ended(kepler_copy, monkeypatch):
    (path,) = kepler_copy.out.glob("samples-*.json")
    kept = json.loads(path.read_text(encoding="utf-8"))
    lost = [facts for facts in kept["samples"] if facts["integrator"] == "rk4"][-2:]
    kept["samples"] = [facts for facts in kept["samples"] if facts not in lost]
    path.write_text(json.dumps(kept), encoding="utf-8")
    made = []
    run = Machine.run
    monkeypatch.setattr(
        Machine, "run", lambda self, asked, *rest, **more: made.append(asked.steps) or run(self, asked, *rest, **more)
    )
    assert run_verb(*kepler_copy.words) == 0
    assert sorted(made) == sorted(facts["steps"] for facts in lost)
    again = json.loads((kepler_copy.out / "accuracy.json").read_text(encoding="utf-8"))
    errors = {row["key"]: row["errors"] for row in again["rows"]}
    assert errors == {row["key"]: row["errors"] for row in kepler_copy.rows}  # the same bits


def test_a_study_ends_with_its_budget_and_keeps_what_there_is(tmp_path):
    problem = pose(load_scene({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": SPAN}}))
    store = Store(tmp_path, identity(problem, SPAN, "test"))
    budget = CountedBudget(700.0)  # a run is 64 launches: some 10 runs
    study = Study(problem, store, budget, StudyWishes(("leapfrog",), (("cpu", "f64"),), reference="leapfrog"))
    study.run()
    assert study.status in ("out of time", "partial")
    assert budget.spent <= budget.seconds + 1
    assert 3 <= len(study.rows()) and study.quantity == "position"
    again = Store(tmp_path, identity(problem, SPAN, "test"))
    assert again.resumed == len(study.rows())


def test_ladders_that_an_ended_budget_leaves_are_said(tmp_path, monkeypatch):
    def end(*_, **__):
        raise OutOfTime

    monkeypatch.setattr(StepSweep, "climb", end)
    problem = pose(load_scene({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": SPAN}}))
    store = Store(tmp_path, identity(problem, SPAN, "test"))
    study = Study(problem, store, CountedBudget(2000.0), StudyWishes(("leapfrog",), (("cpu", "f64"),), reference="leapfrog"))
    study.run()
    assert study.status == "out of time"
    assert study.remarks == ["cpu f64: the budget cut 1 ladders of steps short"]


def test_a_run_is_left_when_the_budget_is_spent(tmp_path):
    problem = pose(load_scene({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": SPAN}}))
    budget = CountedBudget(10.0)  # with MOST_BUDGETS of it for the reference, less than the 64 launches of a run
    study = Study(problem, Store(tmp_path, identity(problem, SPAN, "test")), budget, StudyWishes(reference="leapfrog"))
    study.run()
    assert study.status == "out of time" and budget.spent == MOST_BUDGETS * 10.0
    assert study.rows() == [] and study.quantity is None
    assert study.reason == "the budget ended before the first run was done"


def test_another_scene_machine_or_version_is_another_store(tmp_path):
    problems = [pose(load_scene({**kepler(e, dt=0.01), "run": {"duration": SPAN}})) for e in (0.3, 0.3, 0.31)]
    paths = [Store(tmp_path, identity(problem, SPAN, "1")).path for problem in problems]
    assert paths[0] == paths[1] != paths[2]
    assert Store(tmp_path, identity(problems[0], SPAN, "2")).path != paths[0]


# --- chaos ------------------------------------------------------------------------------------------------------------


def lyapunov_time_by_variation(scene, span):
    """1/λ from the linearised equations of motion, by SciPy: an independent way and program."""
    bodies = [entry["body"] for entry in scene["particles"]]
    mass = np.array([body["mass"] for body in bodies])
    softening = scene["forces"][0]["newtonian_gravity"]["softening"]
    count = len(mass)

    def rate(_, y):
        x, v, dx, dv = y.reshape(4, count, 2)
        d, e = x[None] - x[:, None], dx[None] - dx[:, None]
        r2 = np.sum(d * d, axis=2) + softening**2
        a = np.einsum("j,ij,ijk->ik", mass, r2**-1.5, d)
        da = np.einsum("j,ij,ijk->ik", mass, r2**-1.5, e) - 3.0 * np.einsum(
            "j,ij,ij,ijk->ik", mass, r2**-2.5, np.sum(d * e, axis=2), d
        )
        return np.concatenate([each.ravel() for each in (v, a, dv, da)])

    x = np.array([body["position"] for body in bodies], float)
    tangent = np.random.default_rng(7).standard_normal((2, count, 2))
    state, growth, pieces = np.concatenate([x.ravel(), np.zeros(2 * count), tangent.ravel()]), [], 40
    for _ in range(pieces):
        state[4 * count :] /= np.linalg.norm(state[4 * count :])
        state = solve_ivp(rate, (0.0, span / pieces), state, method="DOP853", rtol=1e-9, atol=1e-12).y[:, -1]
        growth.append(math.log(np.linalg.norm(state[4 * count :])))
    return 0.75 * span / sum(growth[pieces // 4 :])


def test_lyapunov_time_agrees_with_the_variational_equations():
    span = 200.0
    scene = three_bodies(span)
    machine = machine_of(scene, "pefrl")
    found = chaos.measure(machine, 20_000, 2.0, Budget(1e9))
    expected = lyapunov_time_by_variation(scene, span)
    assert expected / 2.0 < found.lyapunov_time < 2.0 * expected
    assert found.horizon("f32") == pytest.approx(found.lyapunov_time * math.log(1e-3 * 2**23))


def test_an_orbit_is_not_chaotic():
    machine = machine_of({**kepler(ECCENTRICITY, dt=0.01), "run": {"duration": 60.0}}, "yoshida4")
    found = chaos.measure(machine, 6000, 0.7, Budget(1e9))
    assert found.lyapunov_time is None and found.horizon("f64") is None


@pytest.mark.sampled(3)
def test_beyond_the_horizon_energies_are_compared(tmp_path):
    problem = pose(load_scene(three_bodies(400.0)))
    store = Store(tmp_path, identity(problem, 400.0, "test"))
    study = Study(problem, store, CountedBudget(1000.0), StudyWishes(("leapfrog",), (("cpu", "f64"),)))
    study.run()
    assert study.quantity == "energy" and not study.reference.positions_mean_something
    assert study.reference.meaning < 400.0 and study.chaos.lyapunov_time is not None
    assert all(row.position.value is None and row.position.at_most is None for row in study.rows())


# --- the verb and its page --------------------------------------------------------------------------------------------


def test_a_tree_beyond_direct_sums_is_refused_in_a_line(capfd, tmp_path):
    path = tmp_path / "galaxy.yaml"
    tree = {"newtonian_gravity": {"strength": 1, "softening": 0.1, "solver": "tree"}}
    path.write_text(
        yaml.safe_dump(
            {
                "title": "Galaxy",
                "particles": [{"plummer": {"count": 100_001, "total_mass": 1}}],
                "forces": [tree],
                "integrator": {"leapfrog": {"dt": 0.01}},
                "run": {"duration": 1},
            }
        ),
        encoding="utf-8",
    )
    assert run_verb(path) == 2
    told = capfd.readouterr().err.strip()
    assert "a tree is measured against the direct sum, of up to 100,000 particles, not 100,001" in told and "\n" not in told


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "words", [("--budget", "60 parsecs"), ("--budget", "-1s"), ("--integrators", "runge"), ("--backends", ",")]
)
def test_wrong_words_are_wrong_usage(kepler_study, words):
    assert run_verb(kepler_study.words[0], *words) == 2


def test_the_page_is_whole_and_needs_nothing_else(kepler_study):
    text = (kepler_study.out / "accuracy.html").read_text(encoding="utf-8")
    tree = ElementTree.fromstring(text)  # as strict as XML
    tags = [element.tag.rpartition("}")[2] for element in tree.iter()]
    methods = {row["integrator"] for row in kepler_study.rows}
    assert tags.count("svg") == 3 + len(methods) and "script" not in tags  # plots, and a legend entry for each method
    assert not [element for element in tree.iter() for name in element.attrib if name in ("src", "href")]
    assert "prefers-color-scheme: dark" in text and "@import" not in text and "url(" not in text
    rows = [element for element in tree.iter() if element.tag.endswith("}tr")]
    assert len(rows) == 1 + len(kepler_study.rows)
    title, heading, every_run = tags.index("h1"), tags.index("h2"), tags.index("table")
    assert title < tags.index("svg") < heading < every_run, "the heading stands above its table"


def test_the_page_opens_in_a_browser(kepler_study, tmp_path):
    browser = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no browser here: chromium is not installed")
    picture = tmp_path / "page.png"
    page = (kepler_study.out / "accuracy.html").as_uri()
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--window-size=1000,1400",
        f"--user-data-dir={tmp_path / 'profile'}",
    ]
    command = [browser, *options, "--virtual-time-budget=1000", f"--screenshot={picture}", page]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert picture.is_file(), done.stderr
    colors = Image.open(picture).convert("RGB").getcolors(maxcolors=2**24)
    ink = {color for count, color in colors if count >= 20}
    assert (255, 255, 255) in ink
    # The lines of the three methods, in the colours of the style sheet.
    assert {(0x2A, 0x6F, 0xCF), (0x0F, 0x8A, 0x5F), (0xB9, 0x7A, 0x00)} <= ink


class _Texts(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.found = []

    def handle_data(self, data):
        self.found.append(data)


def test_the_page_says_the_sentence_and_the_machine(kepler_study):
    reader = _Texts()
    reader.feed((kepler_study.out / "accuracy.html").read_text(encoding="utf-8"))
    text = " ".join(reader.found)
    assert kepler_study.found["sentence"][1:] in text
    for fact in (kepler_study.found["known"]["cpu"], "taichi 1.7.4", f"{len(kepler_study.rows)} runs"):
        assert fact in text


def test_a_workbench_of_one_precision_ends_before_the_next(tmp_path):
    problem = pose(load_scene({**kepler(ECCENTRICITY, dt=0.05), "run": {"duration": SPAN}}))
    import_taichi()
    ends = {}
    for precision in ("f64", "f32"):
        with Workbench(problem, backend="cpu", precision=precision) as bench:
            machine = bench.machine("leapfrog")
            sample, _ = machine.run(machine.configuration(140), Budget(1e9))
            ends[precision] = sample.end
    apart = np.abs(ends["f64"] - ends["f32"]).max()
    assert 0.0 < apart < 140 * 2.0**-23 * 10.0  # 140 steps, each rounded, errors of phase grow with time
