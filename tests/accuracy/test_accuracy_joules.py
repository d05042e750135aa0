"""Joules of the runs of a study, on a machine that counts its energy."""

import time

import pytest

from mpp_taichi.accuracy import joules, sweep
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.findings import findings
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.table import lines
from mpp_taichi.device.energy_counters import EnergyCounter
from mpp_taichi.scene.load import load_scene
from scenes import kepler

WATTS, SPAN = 20.0, 20.0
METHODS = ("pefrl",)


def studied(folder):
    problem = pose(load_scene({**kepler(0.3), "run": {"duration": SPAN}}))
    wishes = StudyWishes(METHODS, (("cpu", "f64"),), reference="pefrl")
    study = Study(problem, Store(folder, identity(problem, SPAN, "test")), Budget(60.0), wishes)
    study.run()
    return study


@pytest.mark.sampled(3)
def test_a_run_has_the_joules_of_the_counter(tmp_path, monkeypatch):
    """The counter of this machine counts WATTS while the process works."""
    counter = [EnergyCounter("package-0", lambda: WATTS * time.process_time())]
    for module in (joules, sweep):
        monkeypatch.setattr(module, "energy_counters", lambda: counter)
    study = studied(tmp_path)
    rows = [row for row in study.rows() if row.sample.status == "ok"]
    assert rows
    for row in rows:  # a measured run also begins anew, which takes a few tenths of a millisecond
        assert 0.9 * WATTS * row.seconds <= row.sample.joules <= WATTS * (3.0 * row.seconds + 2e-3)
    found = findings(study, 1e-6)
    assert found["verdict"]["choice"]["joules"] > 0.0 and f"{found['verdict']['choice']['joules']:.2g} J" in found["sentence"]
    assert "  J  " in lines(study.rows(), {"time": (), "evaluations": ()})[0]
    kept = Store(tmp_path, identity(study.problem, SPAN, "test"))
    assert {sample.joules for sample in kept} == {row.sample.joules for row in study.rows()}


def test_a_machine_without_counters_tells_no_joules(tmp_path, monkeypatch):
    for module in (joules, sweep):
        monkeypatch.setattr(module, "energy_counters", list)
    study = studied(tmp_path)
    assert all(row.sample.joules is None for row in study.rows())
    head = lines(study.rows(), {"time": (), "evaluations": ()})[0]
    assert "J" not in head.split() and " J" not in findings(study, 1e-6)["sentence"]
