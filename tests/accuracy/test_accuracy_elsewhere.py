"""The recommended setting on other backends: the run, its row, its sentence, and the backends left out."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from mpp_taichi.accuracy import elsewhere, front
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.elsewhere import Elsewhere
from mpp_taichi.accuracy.findings import findings
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.sample import Configuration, MeasuredError, Sample
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.verdict import duration, factor, sentence, verdict
from mpp_taichi.cli.main import main
from mpp_taichi.device import backends
from mpp_taichi.errors import BackendError
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.scene.load import load_scene
from scenes import kepler

SPAN, TARGET = 3.0, 1e-5
SCENE = {**kepler(0.3, dt=0.01), "run": {"duration": SPAN}}


def opened(folder):
    """A study in a folder, which knows what was measured before."""
    problem = pose(load_scene(SCENE))
    wishes = StudyWishes(("pefrl",), (("cpu", "f64"),), reference="pefrl")
    store = Store(folder, identity(problem, SPAN, "test"))
    return Study(problem, store, Budget(120.0), wishes)


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """The folder of a study of one method on the CPU."""
    folder = tmp_path_factory.mktemp("elsewhere")
    opened(folder).run()
    return folder


@pytest.fixture
def study(known, tmp_path):
    """The study of one method on the CPU, whose runs are known."""
    found = opened(shutil.copytree(known, tmp_path / "study"))
    found.run()
    return found


def rows_of(study, backend):
    return [row for row in study.rows() if row.sample.configuration.backend == backend]


def recommended(study, target=TARGET):
    """The row on the CPU that the sentence names."""
    key = verdict(rows_of(study, "cpu"), "position", target)["choice"]["key"]
    return next(row for row in study.rows() if row.sample.configuration.key == key)


@pytest.mark.sampled(3)
def test_the_recommended_setting_runs_on_vulkan_and_is_a_row_and_a_clause(software_vulkan, study, monkeypatch):
    devices, time_of = [], Machine.time
    monkeypatch.setattr(
        Machine, "time", lambda self, *asked: devices.append(self.simulation.device.backend) or time_of(self, *asked)
    )
    Elsewhere(study, TARGET).run()
    assert set(devices) == {"vulkan"}
    here, (there,) = recommended(study), rows_of(study, "vulkan")
    assert there.sample.configuration == replace(here.sample.configuration, backend="vulkan")
    # The same equations with the same steps in f64: ends differ by rounding, of each of pefrl's four stages some ulp.
    rounding = 4 * here.sample.configuration.steps * 4 * 2.0**-52
    assert np.abs(there.sample.end - here.sample.end).max() < rounding
    assert there.position.bound == pytest.approx(here.position.bound, abs=2.0 * rounding)
    found = findings(study, TARGET)
    ratio = there.seconds / here.seconds
    said = f"{factor(ratio)} as long" if ratio >= 1.0 else f"{factor(1.0 / ratio)} faster"
    if found["verdict"]["choice"]["backend"] == "cpu":
        assert f"on vulkan in f64 the same takes {duration(there.seconds)} ({said})" in found["sentence"]
    assert found["other_devices"] == {"vulkan": software_vulkan}
    assert there.sample.configuration.key in [row["key"] for row in found["rows"]]


@pytest.mark.sampled(3)
def test_a_second_study_runs_nothing_on_other_backends_unless_the_device_is_another(software_vulkan, study, monkeypatch):
    Elsewhere(study, TARGET).run()
    made = rows_of(study, "vulkan")[0].sample

    def refuse(*_, **__):
        raise AssertionError("a run was made twice")

    with monkeypatch.context() as patch:
        patch.setattr(Machine, "__init__", refuse)
        patch.setattr(elsewhere.backends, "start", refuse)
        again = opened(study.store.folder.parent)
        again.run()
        Elsewhere(again, TARGET).run()
        assert [row.sample.seconds for row in rows_of(again, "vulkan")] == [made.seconds]
    again.store.notes["elsewhere"]["vulkan"]["device"] = "an earlier card"
    Elsewhere(again, TARGET).run()
    (anew,) = rows_of(again, "vulkan")
    assert anew.sample.configuration == made.configuration and anew.sample.seconds != made.seconds
    assert again.store.notes["elsewhere"]["vulkan"]["device"] == software_vulkan


def test_a_method_of_the_cpu_alone_gives_way_to_the_fastest_that_runs_there(software_vulkan, study):
    fastest = recommended(study).sample
    planted = replace(fastest.configuration, integrator="taylor", control="tolerance", tolerance=1e-12)
    study.store.add(Sample(planted, fastest.dt, evaluations=1, seconds=[1e-9], end=fastest.end))
    assert recommended(study).sample.configuration == planted
    Elsewhere(study, TARGET).run()
    (there,) = rows_of(study, "vulkan")
    assert there.sample.configuration == replace(fastest.configuration, backend="vulkan")
    said = findings(study, TARGET)["sentence"]
    assert f", by pefrl in f64 with {fastest.setting}" in said and "on vulkan it takes" in said


@pytest.mark.parametrize("target", [TARGET, 2e-7])
@pytest.mark.sampled(3)
def test_a_backend_without_f64_takes_the_least_exact_precision_that_reaches_the_target(
    target, software_vulkan, study, monkeypatch
):
    start, asked = backends.start, []

    def without_f64(backend, precision, **more):
        asked.append(precision)
        if precision == "f64":
            raise BackendError("backend vulkan on this device has no true f64; use --precision f32")
        return start(backend, precision, **more)

    monkeypatch.setattr(elsewhere.backends, "start", without_f64)
    Elsewhere(study, target).run()
    found = {row.sample.configuration.precision: row for row in rows_of(study, "vulkan")}
    first, *tried = dict.fromkeys(asked)
    assert first == "f64" and tried == list(PRECISIONS[: len(tried)]) and set(found) == set(tried)
    *misses, reaches = (found[precision] for precision in tried)
    assert reaches.position.bound <= target and all(row.position.bound > target for row in misses)
    asked.clear()
    Elsewhere(study, target).run()
    assert asked == []  # it is known that the device has no f64


def test_only_the_precisions_that_were_asked_for_are_tried(software_vulkan, study, monkeypatch):
    def without_f64(*_, **__):
        raise BackendError("no true f64")

    monkeypatch.setattr(elsewhere.backends, "start", without_f64)
    Elsewhere(study, TARGET, ("f64",)).run()
    assert rows_of(study, "vulkan") == []


def test_what_the_budget_does_not_allow_is_left_out_in_one_line(software_vulkan, study, monkeypatch):
    plenty = study.budget
    study.budget = Budget(0.1)
    Elsewhere(study, TARGET).run()
    assert study.remarks == ["vulkan: the budget left no time for a run there"]
    study.budget = plenty
    monkeypatch.setattr(Machine, "budget_per_step", 1e6)
    Elsewhere(study, TARGET).run()
    setting, steps = recommended(study).sample.setting, recommended(study).sample.configuration.steps
    told = f"pefrl in f64, {setting}, would take about {duration(1e6 * steps)} there, for which the budget left no time"
    assert study.remarks[1:] == [f"vulkan: {told}"]
    assert rows_of(study, "vulkan") == []


def test_a_backend_that_does_not_start_is_left_out_without_a_word(study, monkeypatch):
    def unavailable(backend):
        return {"available": False, "reason": "planted", "device": "", "software": False}

    monkeypatch.setattr(elsewhere, "availability", unavailable)
    Elsewhere(study, TARGET).run()
    assert study.remarks == [] and {row.sample.configuration.backend for row in study.rows()} == {"cpu"}
    assert findings(study, TARGET)["other_devices"] == {}


@pytest.mark.parametrize("words, tried", [((), ["f32", "f32c", "ds", "df64", "f64"]), (("--precisions", "f64"), ["f64"])])
def test_the_verb_goes_to_other_backends_unless_backends_are_named(tmp_path, monkeypatch, words, tried):
    made = []

    def run(self):
        made.append(SimpleNamespace(target=self._target, precisions=list(self._precisions)))

    monkeypatch.setattr(Elsewhere, "run", run)
    monkeypatch.setattr(Study, "run", lambda self: None)
    path = tmp_path / "scene.yaml"
    path.write_text(yaml.safe_dump(SCENE), encoding="utf-8")
    asked = ("accuracy", str(path), "--target", "1e-3", "--out", str(tmp_path / "out"), "-q", *words)
    assert main([*asked, "--backends", "cpu"]) == 0 and made == []
    assert main([*asked]) == 0
    assert made == [SimpleNamespace(target=1e-3, precisions=tried)]
    assert json.loads((tmp_path / "out" / "accuracy.json").read_text(encoding="utf-8"))["other_devices"] == {}


def planted(backend, steps, seconds, *, integrator="leapfrog", precision="f64"):
    sample = Sample(Configuration(integrator, steps, precision, backend), 1.0 / steps, evaluations=steps, seconds=[seconds])
    return front.StudyRow(sample, *[MeasuredError(1.0 / steps**2)] * 5)


def test_the_sentence_tells_a_faster_backend_another_method_and_a_missed_target():
    on_cpu = planted("cpu", 2000, 1.0)
    said = sentence(verdict([on_cpu, planted("cuda", 2000, 0.1)], "position", 1e-6))
    assert "take leapfrog in f64 on cuda with dt = 0.0005, 100 ms" in said
    assert "on cpu in f64 the same takes 1 s (10× as long)" in said
    said = sentence(verdict([on_cpu, planted("metal", 2000, 3.0, precision="f32")], "position", 1e-6))
    assert "on metal in f32 the same takes 3 s (3.0× as long)" in said
    said = sentence(verdict([on_cpu, planted("vulkan", 4000, 30_000.0, integrator="pefrl")], "position", 1e-6))
    assert "on vulkan it takes 30000 s (30,000× as long), by pefrl in f64 with dt = 0.00025" in said
    found = verdict([on_cpu, planted("cuda", 100, 0.1), planted("cuda", 50, 0.1)], "position", 1e-6)
    assert found["elsewhere"] == [] and [row["backend"] for row in found["missed"]] == ["cuda"]
    assert "on cuda nothing that was tried reaches it: leapfrog in f64, dt = 0.01, came to 1.0e-04" in sentence(found)
