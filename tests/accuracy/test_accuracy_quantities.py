"""`accuracy: {of: NAME, below: E}`: errors of quantities of `expect:`, against closed forms, and their scatter in gases."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import mpp_taichi as mpp
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.collisions import meaning_ends
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.value_reference import STUDENT, ValueConvergence, ValueReference, scales_of
from mpp_taichi.accuracy.wanted import Wanted
from mpp_taichi.cli.main import main
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.quantities._base import Setting
from mpp_taichi.scene.load import load_scene

METHODS = ("leapfrog", "pefrl")
PERIOD = {"of": "planet", "around": "sun", "near": 6.28, "within": 1e-2}


def ellipse(**more):
    """Half an axis of 1 about a held body with G m = 1, so that a revolution takes 2π; e = 0.6."""
    bodies = [
        {"name": "sun", "mass": 1, "position": [0, 0, 0], "free": False},
        {"name": "planet", "mass": 1, "position": [0.4, 0, 0], "velocity": [0, 2, 0]},
    ]
    return {
        "title": "Ellipse",
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "run": {"duration": 7},
        "integrator": {"leapfrog": {"dt": 0.02}},
        "expect": {"orbital_period": PERIOD},
    } | more


def gas(**more):
    """Twenty-four disks in a box, some hundred collisions of each."""
    return {
        "title": "Gas",
        "dimensions": 2,
        "seed": 3,
        "particles": [{"gas": {"count": 24, "lower": [0, 0], "upper": [10, 10], "radius": 0.6, "speed": 1}}],
        "contacts": {"hard_spheres": {"solver": "event_driven"}},
        "walls": [{"box": {"lower": [0, 0], "upper": [10, 10]}}],
        "run": {"duration": 40},
        "expect": {"relative_energy_error_max": {"below": 1e-9}, "pressure": {"by": "walls", "near": 0.3, "within": 1}},
    } | more


def study_of(scene, folder, of, methods, *, aim=None, seconds=100.0):
    problem = pose(load_scene(scene), of=of)
    store = Store(folder, identity(problem, problem.span, "test"))
    study = Study(problem, store, Budget(seconds), StudyWishes(methods, (("cpu", "f64"),), aim=aim))
    study.run()
    return study


def chosen_for(target, folder, *, methods=METHODS, **more):
    spec = load_scene(ellipse(**{"accuracy": target} | more))
    return spec, choose(spec, folder, integrators=methods, precisions=("f64",), seconds=30.0)


@pytest.fixture(scope="module")
def ellipse_study(tmp_path_factory):
    return study_of(ellipse(), tmp_path_factory.mktemp("ellipse"), "orbital_period", METHODS, seconds=25.0)


# --- the reference and the errors -------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_the_reference_period_is_that_of_kepler_within_its_bar(ellipse_study):
    found = ellipse_study.value_reference
    assert found.trusted and found.scales == [pytest.approx(2.0 * math.pi)]
    # The bar holds the error of the value; 2π itself is rounded.
    assert abs(found.values[0] - 2.0 * math.pi) <= found.bars[0] + 4.0 * math.ulp(6.0)
    assert found.bar < 1e-13


def test_every_error_that_is_told_is_within_a_factor_of_two_of_the_true_error(ellipse_study):
    told = []
    for row in ellipse_study.rows():
        if row.wanted.value is not None:
            true = abs(row.sample.values[0][0] / (2.0 * math.pi) - 1.0)
            assert 0.5 < row.wanted.value / true < 2.0
            told.append(row.wanted.value)
    assert min(told) < 1e-7 < 1e-3 < max(told)  # over four decades at least


def test_a_row_measures_what_the_run_verb_measures(ellipse_study):
    row = next(row for row in ellipse_study.rows() if row.sample.configuration.integrator == "pefrl" and row.sample.values)
    scene = ellipse(integrator={"pefrl": {"dt": row.sample.dt}})
    with mpp.run(scene, precision="f64") as result:
        (verdict,) = result.verdicts
    assert verdict.value == row.sample.values[0][0]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("target", [1e-3, 1e-6])
def test_the_chosen_setting_delivers_when_it_is_run(target, tmp_path):
    spec, found = chosen_for({"of": "orbital_period", "below": target}, tmp_path)
    with mpp.run(found.settle(spec), precision=found.precision) as result:
        (verdict,) = result.verdicts
    true = abs(verdict.value / (2.0 * math.pi) - 1.0)
    assert found.quantity == found.asked == "orbital_period"
    assert target / 10.0 < true < target
    assert found.error == pytest.approx(true, rel=1e-3)  # bar 1e-15 of an error of 1e-7 and more


@pytest.fixture
def kept(tmp_path):
    spec, found = chosen_for({"of": "orbital_period", "below": 1e-2}, tmp_path, methods=("leapfrog",))
    return SimpleNamespace(folder=tmp_path, spec=spec, found=found)


@pytest.mark.sampled(3)
def test_a_choice_is_kept_with_its_quantity_and_another_quantity_makes_a_new_choice(kept, monkeypatch):
    monkeypatch.setattr(Study, "run", lambda self: (_ for _ in ()).throw(InterruptedError))
    assert choose(kept.spec, kept.folder, precisions=("f64",)) == kept.found
    assert json.loads((kept.folder / "choice.json").read_text(encoding="utf-8"))["asked"] == "orbital_period"
    others = (
        ellipse(accuracy={"of": "relative_energy_error_max", "below": 1e-2}),
        ellipse(accuracy=1e-2),
        ellipse(
            accuracy={"of": "orbital_period", "below": 1e-2},
            expect={"orbital_period": PERIOD | {"of": "sun", "around": "planet"}},
        ),
    )
    for scene in others:
        with pytest.raises(InterruptedError):
            choose(load_scene(scene), kept.folder, precisions=("f64",))


def test_a_period_longer_than_the_run_is_refused_with_the_reason(tmp_path):
    with pytest.raises(mpp.StabilityError, match="orbital_period is not known: particle 1 did not complete a turn"):
        chosen_for({"of": "orbital_period", "below": 1e-3}, tmp_path, run={"duration": 3})


@pytest.mark.sampled(3)
def test_a_quantity_that_is_an_error_itself_is_not_divided_by_its_value(tmp_path):
    target, expect = {"of": "relative_energy_error_max", "below": 1e-4}, {"relative_energy_error_max": {"below": 1e-4}}
    spec, found = chosen_for(target, tmp_path, methods=("pefrl",), expect=expect)
    with mpp.run(found.settle(spec), precision="f64") as result:
        (verdict,) = result.verdicts
    assert 1e-5 < verdict.value < 1e-4 and found.error == pytest.approx(verdict.value, rel=1e-6)


def test_of_two_entries_the_larger_error_counts():
    ends = {"end_position": [{"of": "planet", "axis": axis, "below": 9} for axis in "xyx"]}
    problem = pose(load_scene(ellipse(expect=ends)), of="end_position")
    wanted, setting = problem.wanted, Setting(problem.spec, problem.start)
    told = ["end_position(of=planet, axis=x)", "end_position(of=planet, axis=y)"]  # the third entry repeats the first
    assert wanted.labels(setting) == told
    known = reference(wanted, values=[2.0, 0.5], bars=[0.0, 0.0])
    assert known.error(sample_with([[2.0 + 2e-3, 0.5 + 1e-3]])).value == pytest.approx(2e-3)
    assert known.error(sample_with([[2.0 + 2e-3, 0.5 + 1e-9]])).value == pytest.approx(1e-3)


def reference(wanted, *, values, bars, scatters=(0.0, 0.0), runs=1):
    scales = [float(scale) for scale in scales_of(wanted, np.array(values), np.array(bars))]
    return ValueReference(
        wanted.name, ["x", "y"], values, bars, list(scatters), scales, runs, 1024, trusted=True, integrator="pefrl", steps=64
    )


def sample_with(values):
    return Sample(Configuration("leapfrog", 8, "f64", "cpu"), 0.1, values=values)


def test_the_error_of_a_value_that_is_zero_within_its_bar_is_absolute():
    ends = {"end_position": {"of": "planet", "axis": "y", "below": 9}}
    wanted = Wanted.of(load_scene(ellipse(expect=ends)), "end_position")
    assert list(scales_of(wanted, np.array([1e-9]), np.array([1e-9]))) == [1.0]
    assert list(scales_of(wanted, np.array([1e-9]), np.array([1e-12]))) == [1e-9]
    energy = Wanted.of(load_scene(ellipse()), "relative_energy_error_max")
    assert list(scales_of(energy, np.array([0.3]), np.array([0.0]))) == [1.0]


def test_values_that_agree_by_chance_do_not_shorten_the_bar():
    """Two terms of opposite sign: c₁ h⁴ − c₂ h⁸ vanishes in the third difference; the value is off by 3e-6 there."""
    wanted = Wanted.of(load_scene(ellipse()), "orbital_period")
    found = ValueConvergence(wanted, 4, enough=0.0)
    values = [1.0 + error for error in (1e-3, 5e-5, 3e-6, 3e-6 + 1e-13)]
    for number, value in enumerate(values):
        found.add(Sample(Configuration("rk4", 8 * 2**number, "f64", "cpu"), 0.1), np.array([value]))
    # The fall before was (9.5e-4) to (4.7e-5), 20 times: the chance difference is taken to be a 20th of the difference before.
    assert found.bars()[0] > 2e-6 and not found.is_enough


# --- gases ------------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_positions_in_a_gas_lose_their_meaning_and_in_a_short_run_they_do_not():
    import_taichi()
    long, short = (pose(load_scene(gas(run={"duration": span}))) for span in (40, 4))
    assert 8.0 < meaning_ends(long, Budget(1e9)) < 40.0
    assert meaning_ends(short, Budget(1e9)) is None


@pytest.fixture(scope="module")
def gas_study(tmp_path_factory):
    return study_of(gas(), tmp_path_factory.mktemp("gas"), "pressure", ("swept",), aim=0.1, seconds=12.0)


@pytest.mark.sampled(3)
def test_a_setting_of_a_gas_is_compared_by_means_with_a_bar(gas_study):
    known = gas_study.value_reference
    assert known.runs == 6 and known.integrator == "event_driven"
    assert known.bars[0] == pytest.approx(STUDENT * known.scatters[0] / math.sqrt(6.0), rel=1e-9)
    rows = [row for row in gas_study.rows() if row.sample.configuration.integrator == "swept" and row.sample.values]
    assert rows
    for row in rows:  # exact at any step, so that the only error is the scatter of the runs
        assert len(row.sample.values) == 6 and len({value for (value,) in row.sample.values}) == 6
        assert row.wanted.value is None and row.wanted.at_most < 3.0 * math.hypot(1.0, 1.0) * known.bar + 2.0 * known.scatter


@pytest.mark.sampled(3)
def test_a_bad_solver_differs_by_more_than_the_scatter(gas_study):
    """Disks of 0.6 that move by 0.6 in a step are found when they overlap by their radius, and walls are met late."""
    import_taichi()
    machine = Machine(gas_study.problem, "pairwise", backend="cpu", precision="f64")
    sample, _ = machine.run(machine.configuration(100), Budget(1e9))
    machine.close()
    assert gas_study.value_reference.error(sample).value > 0.05


@pytest.mark.sampled(3)
def test_a_target_of_positions_in_a_gas_is_refused_with_a_target_that_it_can_have(tmp_path):
    spec = load_scene(gas(accuracy=1e-3))
    with pytest.raises(mpp.StabilityError, match="keeps its meaning: accuracy: {of: pressure, below: …}"):
        choose(spec, tmp_path, integrators=("swept",), precisions=("f64",), seconds=30.0)


# --- the verb ---------------------------------------------------------------------------------------------------------


def run_verb(folder, scene, *words):
    path = folder / "scene.yaml"
    path.write_text(yaml.safe_dump(scene), encoding="utf-8")
    return main(["accuracy", str(path), "--out", str(folder / "out"), "--precisions", "f64", "--backends", "cpu", *words])


@pytest.mark.sampled(3)
def test_the_table_has_a_column_of_the_quantity(tmp_path, capfd):
    code = run_verb(tmp_path, ellipse(), "--of", "orbital_period", "--integrators", "leapfrog", "--budget", "8s")
    told = capfd.readouterr().out
    found = json.loads((tmp_path / "out" / "accuracy.json").read_text(encoding="utf-8"))
    assert code == 0 and "orbital_period   energy" in told and "position" not in told
    assert "Reference: orbital_period(of=planet, around=sun) = 6.2831853" in told
    assert found["quantity"] == found["wanted"] == "orbital_period" and found["values"]["runs"] == 1
    assert "error of orbital_period" in (tmp_path / "out" / "accuracy.html").read_text(encoding="utf-8")


@pytest.mark.sampled(3)
def test_a_gas_is_compared_by_what_it_expects_first(tmp_path, capfd):
    code = run_verb(tmp_path, gas(), "--integrators", "swept", "--budget", "10s")
    told = capfd.readouterr()
    assert code == 0 and "pressure is compared, the first entry of expect:; --of names another" in told.err
    assert (
        "every setting is the mean of 6 runs, and a number with ≤ says that it differs by less than their scatter" in told.out
    )


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ("orbital_periof", "did you mean 'orbital_period'?"),
        ("end_position", "needs of and axis"),
        ("time", "the same for every"),
    ],
)
def test_a_quantity_that_cannot_be_compared_is_refused_in_one_line(of, said, tmp_path, capfd):
    code = run_verb(tmp_path, ellipse(), "--of", of)
    told = capfd.readouterr().err.strip().splitlines()[-1]
    assert code == 2 and f"--of {of}: " in told and said in told
