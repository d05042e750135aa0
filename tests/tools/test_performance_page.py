"""docs/performance.md holds the results of the benchmarks: correct ratios, also slower runs, no column for missing programs."""

import re
import subprocess
import sys

import pytest
from conftest import ROOT

sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "tools" / "benchmarks")]

import measure_performance  # noqa: E402
from performance_page import BARS, LIMITS, duration, page, ratio, size, with_new_limits, with_new_results  # noqa: E402

MACHINE = {"processor": "Abacus", "threads": 2, "system": "Beads", "taichi": "1.7.4", "numpy": "2.4", "python": "3.11"}


def pair_row(speed, error=1e-7):
    return {"per_second": speed, "error": error}


FOUND = {
    "pairs": {
        "machine": MACHINE,
        "results": {
            "f32": {
                "1024": {"composed": pair_row(1e9), "gather": pair_row(2e9, 3e-7), "c": pair_row(4e9), "numpy": pair_row(1e8)},
                "2048": {"composed": pair_row(3e9), "gather": pair_row(2e9), "c": pair_row(3e9)},
            }
        },
        "bars": [
            {"bar": "f32: speed ÷ c, at least", "limit": 0.7, "value": 0.5, "held": False},
            {"bar": "f32: speed ÷ numpy, at least", "limit": 10.0, "value": 20.0, "held": True},
        ],
    },
    "compare scenes/ring.yaml": {
        "scene": "scenes/ring.yaml",
        "title": "Ring",
        "particle_count": 3073,
        "warnings": ["the machine was busy"],
        "rows": [
            {"label": "cpu", "precision": "f64", "verdict": "rounding", "status": "ok", "on_processor": True,
             "step_seconds": 4e-3, "cold_compile_seconds": 2.0, "warm_compile_seconds": None,
             "rates": {"interactions_per_second": 2.5e9, "share_of_peak_flops": 0.4}},
            {"label": "cuda", "precision": None, "status": "missing", "reason": "no driver"},
            {"label": "vulkan", "precision": "f64", "verdict": "rounding", "status": "ok", "on_processor": True,
             "step_seconds": 0.1, "cold_compile_seconds": 0.2, "warm_compile_seconds": 0.1, "rates": {}},
        ],
    },
}  # fmt: skip
COMMANDS = {"pairs": "python tools/benchmarks/benchmark_pairs.py", "compare scenes/ring.yaml": "python -m mpp_taichi compare …"}


@pytest.fixture(scope="module")
def lines():
    return page(FOUND, COMMANDS).splitlines()


def test_a_ratio_compares_the_faster_of_the_programs_two_sums_with_the_other_program(lines):
    assert "| f32: N | pairs/s | speed ÷ C, AVX-512 | speed ÷ NumPy | largest error ÷ mean acceleration |" in lines
    assert "| 1,024 | 2 G | 0.5 | 20 | 3.0e-07 |" in lines  # by the sum for few bodies
    assert "| 2,048 | 3 G | 1 | – | 1.0e-07 |" in lines


def test_missed_bars_the_machine_and_the_commands_are_on_the_page(lines):
    text = "\n".join(lines)
    assert (
        "1 of 2 results keep their limit." in text and "| pairs | f32: speed ÷ c, at least | 0.7 | 0.5 | **missed** |" in lines
    )
    assert "Abacus, 2 threads, Beads; taichi 1.7.4, numpy 2.4, python 3.11." in lines
    assert "    python tools/benchmarks/benchmark_pairs.py" in lines


def test_a_backend_that_is_missing_is_a_row_with_the_reason(lines):
    assert "| cpu | f64 | rounding | 2 s | – | 4 ms | 2.5 G pairs/s | 40 % |" in lines
    assert "| cuda |  | missing |  |  |  | no driver |  |" in lines
    assert "**Not run on a GPU.**" in lines  # a software driver is none
    assert "The machine was busy." in lines


def test_the_page_says_what_was_tried_for_each_goal_and_what_limits_it():
    assert LIMITS in (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    summary, *attempts = re.split(r"^### ", LIMITS, flags=re.M)
    tried = {text.splitlines()[0].lower().replace(" ", "-"): text.count("\n| ") - text.count("\n|---") for text in attempts}
    goals = [row.strip("| ").split(" | ") for row in summary.splitlines() if row.startswith("| ")][1:]
    assert len(goals) > 10
    for goal in goals:
        anchor = re.search(r"\(#([\w-]+)\)", goal[0])
        assert goal[1] and (anchor is None or tried[anchor[1]] >= 2), goal[0]


def test_limits_are_renewed_without_a_change_of_the_measured_tables():
    whole = page(FOUND, COMMANDS)
    assert with_new_limits(whole) == whole
    assert with_new_limits(whole.replace(LIMITS.strip(), LIMITS.splitlines()[0] + "\n\nOld text.")) == whole
    without = whole.replace(LIMITS.strip() + "\n\n", "")
    assert LIMITS.splitlines()[0] not in without and BARS in without
    assert with_new_limits(without) == whole


def test_new_results_of_one_benchmark_leave_all_other_tables_as_they_are():
    steps = {"machine": MACHINE, "bars": [{"bar": "2 bodies", "limit": 0.5, "value": 0.4, "held": True}]}
    steps["results"] = {"steps": [], "start": {}}
    found = {**FOUND, "steps": steps}
    commands = {**COMMANDS, "steps": "python tools/benchmarks/benchmark_steps.py"}
    pairs = {**FOUND["pairs"], "machine": {**MACHINE, "processor": "Loom"}}
    pairs["bars"] = [{"bar": "f32: speed ÷ c, at least", "limit": 0.7, "value": 0.8, "held": True}]
    before, after = page(found, commands), page({**found, "pairs": pairs}, commands)
    renewed = with_new_results(before, "pairs", pairs, COMMANDS["pairs"])
    assert "Measured by itself: Loom, 2 threads, Beads; taichi" in renewed
    assert "2 of 2 results keep their limit." in renewed and "**missed**" not in renewed
    without = re.sub(r"Measured by itself: .*\n\n", "", renewed)
    assert without == after.replace("Loom, 2 threads", "Abacus, 2 threads")


def test_numbers_are_printed_with_few_digits():
    assert [size(870_000.0), size(12.0), ratio(0.0567), ratio(123.4), ratio(None)] == ["870 k", "12", "0.057", "123", "–"]
    assert [duration(None), duration(0.0123), duration(4.5e-7)] == ["–", "12.3 ms", "450 ns"]


def test_every_listed_benchmark_exists_and_accepts_its_arguments(tmp_path):
    for name, arguments in measure_performance.RUNS.items():
        call, told = measure_performance.call_of(name, arguments[0], measure_performance.file_of(tmp_path, name))
        assert told.startswith("python ")
        if name.startswith("compare"):
            assert (ROOT / call[4]).is_file()
        else:
            assert (ROOT / call[1]).is_file() and "--json" in call


@pytest.mark.sampled(6)
def test_a_short_run_writes_the_page(tmp_path):
    """Runs the command once, with the fastest of the benchmarks."""
    words = ["--short", "--only", "event_driven", "--folder", str(tmp_path), "--page", str(tmp_path / "page.md")]
    ran = subprocess.run(
        [sys.executable, "tools/measure_performance.py", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "## Contacts, event-driven" in text and "| 3D, 1,000 |" in text and "| event_driven | 3D, 1000 spheres" in text
