"""Agreement: why rows are not judged."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.compare.agreement import Agreement
from mpp_taichi.compare.evidence import Evidence
from mpp_taichi.compare.row import BackendRow
from mpp_taichi.scene.load import load_scene
from scenes import kepler


class Course:
    """A course from which nothing is found, as where rounding has grown too large; `limits` are there for spheres that meet."""

    def __init__(self, limits):
        self.limits = limits

    def findings(self, evidence, precision):
        return []

    def looks(self, evidence, precision):
        return {}


def reasons_of(limits, turns, tmp_path, monkeypatch):
    """The reasons why rows of cpu and vulkan in f64 are not judged, where the first serves as the reference."""
    start = SimpleNamespace(position=np.zeros((2, 3)), particle_count=2)
    spec = load_scene(kepler())
    judge = SimpleNamespace(
        spec=spec,
        start=start,
        step_refusal="NumPy has no such step",
        conservation=lambda *_: {},
        force_refusal="no force",
        turns=turns,
    )
    agreement = Agreement(judge, tmp_path, lambda *_, **__: None, Budget(60.0), lambda _: None, lambda _, find: find())
    rows = [BackendRow(backend, "f64", seconds_per_step=1e-6) for backend in ("cpu", "vulkan")]
    none = np.zeros((0, 0, 3))
    evidence = Evidence(none, none, none, np.array([1]), none, none)
    findings = {row: [] for row in rows}
    monkeypatch.setattr(agreement, "_course_of", lambda *_: Course(limits))
    monkeypatch.setattr(agreement, "_gather", lambda *_: evidence)
    agreement._follow_neighbors(dict.fromkeys(rows, evidence), findings, ["f64"], 1000, 60.0)
    return {row.backend: reason for row, reason in agreement._reasons.items()}


@pytest.mark.parametrize("limits", [None, np.ones(3)], ids=["without spheres", "with spheres"])
def test_only_where_spheres_meet_they_are_the_reason_for_no_verdict(limits, tmp_path, monkeypatch):
    expected = {} if limits is None else {"vulkan": "rounding of f64 may decide which spheres meet, and when"}
    found = reasons_of(limits, lambda *_: False, tmp_path, monkeypatch)
    assert found == expected, "the row whose course is followed is its own reference"


def test_turned_kicks_are_not_compared_with_kicks_that_are_solved_to_an_order(tmp_path, monkeypatch):
    found = reasons_of(None, lambda backend, _: backend == "cpu", tmp_path, monkeypatch)
    assert found == {"vulkan": "Vulkan has no sines in f64: its kicks are not those of cpu f64"}
