"""Every key of `--json` of `compare`, `verify` and `sweep` against NumPy, the documented formulas and the written files.

Whole objects are compared, see test_json_of_runs.py. No independent number is there for measured times, the load of the machine
and the rates that a device reaches: these are bounded, and all rates follow from the median time of a step.
"""

import csv
import importlib.metadata
import json
import math
import os
import platform
import statistics
from pathlib import Path

import numpy as np
import pytest
import yaml
from json_facts import SECONDS, SYSTEM, Between, Matching, asked, processor
from sprung_bodies import DT, ROUNDING, SCENE, STEPS, energies, flight

import mpp_taichi

VERSIONS = {
    "mpp_taichi": mpp_taichi.__version__,
    "taichi": importlib.metadata.version("taichi"),
    "numpy": np.__version__,
    "python": platform.python_version(),
}
PAIRS, SPRINGS, BODIES = 2, 1, 2  # of a step: ordered pairs, springs and bodies


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(SCENE, sort_keys=False), encoding="utf-8")


# --- compare ------------------------------------------------------------------------------------------------------------------

FLOPS = 30.0 * PAIRS  # by convention in f64, docs/compare.md
# A spring's two halves have an index and two numbers; an evaluation reads position, velocity and mass and writes the velocity;
# each of two drifts reads and writes positions and reads velocities.
BYTES = 2 * SPRINGS * (4 + 2 * 8) + BODIES * 10 * 8 + 2 * BODIES * 9 * 8


def finding(found):
    """A check: its ratio is the difference over the allowance, and agreement is a ratio of at most 1."""
    ratio = pytest.approx(found["difference"] / found["allowance"], rel=1e-12)
    assert 0.0 <= found["ratio"] <= 1.0
    return {
        "check": Matching(r"(force|position|velocity) (at|after) .+"),
        "ratio": ratio,
        "difference": SECONDS,
        "allowance": Between(1e-17),
        "of": Matching("the (largest acceleration|system’s size|typical velocity)"),
        "particle": Between(0, BODIES - 1),
        "looked_at": Matching(r"all 2 particles|7 looks to 16 steps(, the reference)?"),
    }


def row_of(found, best, *, is_numpy):
    """A row whose samples are as they were measured, and all other numbers as they follow from samples and scene."""
    seconds = statistics.median(found["step_samples"])
    low, middle, high = np.percentile(found["step_samples"], [25, 50, 75])
    (start, _), end = energies(*flight()[0]), energies(*flight()[-1])
    change = (sum(end) - sum(energies(*flight()[0]))) / (end[0] + abs(end[1]))
    assert start > 0.0 and [each["steps"] for each in found["looks"]] == [1, 2, 3, 5, 7, 11, STEPS]
    assert all(0.0 <= each["distance"] <= each["allowed"] < 1e-11 for each in found["looks"])
    decisive = max(found["findings"], key=lambda each: each["ratio"])
    more = {} if is_numpy else {"evaluations": 1, "threads": 1}
    return more | {
        "label": "numpy" if is_numpy else "cpu",
        "backend": "numpy" if is_numpy else "cpu",
        "variant": None,
        "precision": "f64",
        "status": "ok",
        "reason": "",
        "device": f"NumPy {np.__version__}" if is_numpy else processor(),
        "on_cpu": True,
        "plan": "arrays" if is_numpy else "serial",
        "launches_per_step": None if is_numpy else 0,
        "setup_seconds": SECONDS,
        "compile_seconds": SECONDS,
        "on_processor": True,
        "looks": [{"steps": each["steps"], "distance": SECONDS, "allowed": SECONDS} for each in found["looks"]],
        "verdict": "rounding",
        "verdict_reason": "",
        "decided_by": decisive,
        "findings": [finding(each) for each in found["findings"]],
        "energy_change": pytest.approx(change, abs=ROUNDING),
        "momentum_change": pytest.approx(0.0, abs=ROUNDING),
        "cold_compile_seconds": found["compile_seconds"],
        "warm_compile_seconds": found["warm_compile_seconds"] and SECONDS,
        "step_seconds": seconds,
        "step_spread": pytest.approx((high - low) / middle, rel=1e-9),
        "step_samples": [Between(1e-12)] * len(found["step_samples"]),
        "step_joules": found["step_joules"] and SECONDS,
        "copy_seconds": SECONDS,
        "peaks": {"flops": Between(1e6), "bytes": Between(1e6)},
        "rates": {
            "interactions_per_second": pytest.approx(PAIRS / seconds, rel=1e-12),
            "springs_per_second": pytest.approx(SPRINGS / seconds, rel=1e-12),
            "particle_steps_per_second": pytest.approx(BODIES / seconds, rel=1e-12),
            "flops": pytest.approx(FLOPS / seconds, rel=1e-12),
            "bytes_per_second": pytest.approx(BYTES / seconds, rel=1e-12),
            "share_of_peak_flops": pytest.approx(FLOPS / seconds / best["flops"], rel=1e-12),
            "share_of_peak_bytes": pytest.approx(BYTES / seconds / best["bytes"], rel=1e-12),
        },
        "scaling": [],
    }


@pytest.mark.sampled(3)
def test_every_key_of_a_comparison_follows_from_the_scene_and_the_samples(capsys):
    words = ("--backends", "cpu,numpy", "--precisions", "f64", "--budget", "4s", "--threads", "1", "--quiet", "--out", "o")
    found = asked(capsys, "compare", "s.yaml", *words)
    rows = found["rows"]
    best = {name: max(row["peaks"][name] for row in rows) for name in ("flops", "bytes")}
    assert all(isinstance(line, str) and line for line in (*found["warnings"], *found["remarks"]))
    fastest = min(rows, key=lambda row: row["step_seconds"])["backend"]
    assert found == {
        "scene": "s.yaml",
        "title": SCENE["title"],
        "particle_count": BODIES,
        "spring_count": SPRINGS,
        "effects": ["newtonian_gravity", "spring"],
        "integrator": "leapfrog",
        "dt": DT,
        "evaluations_per_step": 1,
        "interactions_per_step": PAIRS,
        "chance_of_false_alarm": Between(1e-12, 1e-3),
        "steps_compared": STEPS,
        "rows": [row_of(row, best, is_numpy=row["backend"] == "numpy") for row in rows],
        "crossovers": [],
        "warnings": found["warnings"],
        "remarks": found["remarks"],
        "load_average": SECONDS,
        "budget_seconds": 4.0,
        "spent_seconds": SECONDS,
        "known": {
            "cpu": processor(),
            "processors": os.cpu_count(),
            "system": f"{platform.system()} {platform.release()} {platform.machine()}",
            "pyopencl": found["known"]["pyopencl"],
            **VERSIONS,
        },
        "status": "ok",
        "sentence": Matching(
            rf"all 2 that could be judged agree to rounding; in f64 {fastest} is the fastest, .+ µs a step, .+"
        ),
        "went_on": None,
        "files": [str(Path("o", name)) for name in ("compare.json", "compare.html")],
    }
    written = json.loads(Path("o/compare.json").read_text(encoding="utf-8"))
    assert written | {"files": found["files"]} == found and Path("o/compare.html").stat().st_size > 0


# --- verify -------------------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_every_key_of_an_examination_is_the_question_s_or_its_documented_bound(capsys):
    """The bound of roundings is that of docs/verify.md, for 300 steps of three stages and 3 rad of an orbit with e = 0.3."""
    roundings = math.sqrt(3 * 300 * 3) * 2.0**-53 * (1.0 + 3.0 * 3.0 / (1.0 - 0.3))
    words = ("--only", "coincident,massless", "--backend", "cpu", "--precision", "f64", "--quiet", "--out", "o")
    found = asked(capsys, "verify", *words)
    row = {"backend": "cpu", "precision": "f64", "status": "solved", "reason": "", "seconds": SECONDS}
    assert found == {
        "cases": [
            {"name": "coincident", "group": "gravity", "title": Matching(r"Coincident bodies .+"), "source": "symmetry"},
            {"name": "massless", "group": "gravity", "title": Matching(r"A body without mass .+"), "source": Matching(r".+")},
        ],
        "places": ["cpu f64"],
        "rows": [
            {"case": "coincident", "reached": 0.0, "bound": 0.0, "because": Matching(r"by symmetry .+"), **row},
            {
                "case": "massless",
                "reached": Between(0.0, roundings),
                "bound": pytest.approx(roundings, rel=1e-9, abs=0.0),
                "because": Matching(r".+n = 300 steps of s = 3 stages.+φ = 3 rad, L = 1\.43"),
                **row,
            },
        ],
        "counts": {"solved": 2, "refused": 0, "failed": 0, "not here": 0},
        "missing": {},
        "known": {**VERSIONS, "system": SYSTEM, "devices": {"cpu": processor()}},
        "seconds": Between(max(each["seconds"] for each in found["rows"])),
        "status": "ok",
        "sentence": Matching(r"of 2 questions on cpu \(.+\), 2 were solved within their bounds, none failed"),
        "went_on": None,
        "files": [str(Path("o", name)) for name in ("verify.json", "verify.html")],
    }
    assert json.loads(Path("o/verify.json").read_text(encoding="utf-8"))["rows"] == found["rows"]


# --- sweep --------------------------------------------------------------------------------------------------------------------

VARIED = ("--vary", "particles[1].body.velocity[1]=1.0:1.2:3", "--measure", "end_time", "--measure", "total_energy")


@pytest.mark.sampled(3)
def test_every_key_of_a_sweep_is_that_of_its_table(capsys):
    """The last of three members is the scene itself, whose energy NumPy knows."""
    found = asked(capsys, "sweep", "s.yaml", *VARIED, "--out", "o", "--quiet", "--workers", "1")
    with open("o/members.csv", encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["status"] for row in rows] == ["ok"] * 3 and [float(row["end_time"]) for row in rows] == [DT * STEPS] * 3
    assert float(rows[-1]["total_energy"]) == pytest.approx(sum(energies(*flight()[-1])), abs=ROUNDING)
    files = found["files"]
    assert found == {
        "folder": "o",
        "members": 3,
        "shape": [3],
        "measures": ["end_time", "total_energy"],
        "statuses": {"ok": 3},
        "ran": 3,
        "seconds": SECONDS,
        "files": files,
        "status": "ok",
        "exit_code": 0,
    }
    assert files[0] == str(Path("o/members.csv")) and len(set(files)) == len(files)
    assert all(Path(file).parent == Path("o") and Path(file).stat().st_size > 0 for file in files)
    again = asked(capsys, "sweep", "s.yaml", *VARIED, "--out", "o", "--quiet", "--workers", "1")
    assert again == found | {"ran": 0, "seconds": SECONDS}


def test_every_key_of_a_dry_sweep_is_a_count_of_the_plan(capsys):
    words = ("--vary", "particles[1].body.velocity[1]=1.0:1.2:5", "--measure", "end_time", "--chunk", "2", "--workers", "3")
    assert asked(capsys, "sweep", "s.yaml", *words, "--out", "o", "--dry-run") == {
        "folder": "o",
        "members": 5,
        "shape": [5],
        "chunks": 3,
        "members_per_chunk": 2,
        "measures": ["end_time"],
        "side_by_side": True,
        "reason": "",
        "workers": 3,
        "seconds": SECONDS,
        "bytes": Between(5 * BODIES * 7 * 8),  # mass, position and velocity of each member
        "status": "ok",
        "exit_code": 0,
    }
    assert not Path("o").exists()
