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


@pytest.mark.parametrize("limits", [None, np.ones(3)], ids=["without spheres", "with spheres"])
def test_only_where_spheres_meet_they_are_the_reason_for_no_verdict(limits, tmp_path, monkeypatch):
    start = SimpleNamespace(position=np.zeros((2, 3)), particle_count=2)
    spec = load_scene(kepler())
    judge = SimpleNamespace(
        spec=spec, start=start, step_refusal="NumPy has no such step", conservation=lambda *_: {}, force_refusal="no force"
    )
    agreement = Agreement(judge, tmp_path, lambda *_, **__: None, Budget(60.0), lambda _: None, lambda _, find: find())
    rows = [BackendRow(backend, "f64", seconds_per_step=1e-6) for backend in ("cpu", "vulkan")]
    none = np.zeros((0, 0, 3))
    evidence = Evidence(none, none, none, np.array([1]), none, none)
    findings = {row: [] for row in rows}
    monkeypatch.setattr(agreement, "_course_of", lambda *_: Course(limits))
    monkeypatch.setattr(agreement, "_gather", lambda *_: evidence)
    agreement._follow_neighbors(dict.fromkeys(rows, evidence), findings, ["f64"], 1000, 60.0)
    expected = {} if limits is None else {rows[1]: "rounding of f64 may decide which spheres meet, and when"}
    assert agreement._reasons == expected, "the row whose course is followed is its own reference"
