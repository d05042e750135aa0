"""The decades of the work–precision benchmark: which runs are compared, and where we are behind."""

import sys

import pytest
from conftest import ROOT

sys.path[:0] = [str(ROOT / "tools" / "benchmarks")]

from work_precision_decades import compare, markdown  # noqa: E402
from work_precision_page import front  # noqa: E402

RUNS = {
    "taylor": [("taylor 1e-3", 5e-4, 0.2), ("taylor 1e-9", 1e-9, 0.4)],
    "leapfrog": [("leapfrog 0.1", 8e-3, 0.1)],
    "rebound whfast°": [("whfast 0.1", 1e-6, 0.1)],
    "heyoka": [("taylor 1e-9", 1e-10, 0.5)],
}


def test_a_decade_compares_the_fastest_runs_that_reach_it():
    rows = {row.error: row for row in compare({"runs": RUNS})}
    assert rows[1e-2].ours[0] == "leapfrog 0.1" and rows[1e-2].ratio == pytest.approx(1.0) and rows[1e-2].ahead
    assert rows[1e-3].ours[0] == "taylor 1e-3" and rows[1e-3].program == "rebound whfast" and not rows[1e-3].ahead
    assert rows[1e-9].other[0] == "taylor 1e-9" and rows[1e-9].ratio == pytest.approx(0.8)
    assert rows[1e-10].ours is None and not rows[1e-10].ahead  # only heyoka reaches it
    assert rows[1e-12].ours is None and rows[1e-12].other is None


def test_the_table_marks_where_we_are_behind():
    lines = markdown({"one": {"title": "Kepler", "runs": RUNS}}).splitlines()
    assert lines[0] == "| error | Kepler |" and len(lines) == 2 + 11
    assert lines[2] == "| 10⁻² | 100 : 100 REBOUND WHFast |"
    assert lines[3] == "| 10⁻³ | **200 : 100 REBOUND WHFast** |"
    assert lines[10] == "| 10⁻¹⁰ | **– : 500 heyoka** |" and lines[12] == "| 10⁻¹² | – : – |"


def test_the_front_has_no_run_that_is_both_slower_and_worse():
    found = front([("a", 1e-3, 1.0), ("b", 1e-2, 2.0), ("c", 1e-6, 3.0), ("d", 1e-3, 0.5)])
    assert [row[0] for row in found] == ["d", "c"]
