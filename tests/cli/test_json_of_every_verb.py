"""Each verb with `--json` has a test of all its keys, and the grades of a worksheet are those of the run."""

import argparse
import math
import re
from pathlib import Path

import pytest
from json_facts import Matching, asked

from mpp_taichi.cli import main as entry
from mpp_taichi.cli.main import VERBS, main

TESTED = {
    "test_json_of_runs.py": ("run", "record", "check"),
    "test_json_of_tools.py": ("run", "explain", "scenes", "convert", "passport", "replay", "info"),
    "test_json_of_studies.py": ("compare", "verify", "sweep"),
    "test_json_of_accuracy.py": ("accuracy",),
}


def test_each_verb_with_json_has_a_test_of_its_keys():
    verbs = next(each for each in entry._parser()._actions if isinstance(each, argparse._SubParsersAction)).choices
    with_json = {verb for verb in VERBS if "--json" in verbs[verb]._option_string_actions}
    assert with_json == {verb for tested in TESTED.values() for verb in tested}
    for file, tested in TESTED.items():
        text = (Path(__file__).parent / file).read_text(encoding="utf-8")
        assert set(re.findall(r'asked\(capsys, "(\w+)"', text)) >= set(tested), file


@pytest.fixture
def sheet(tmp_path, monkeypatch):
    """The worksheet of the two bodies with the answer to its second question alone."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "answers.yaml", "--sheet", "two_bodies"]) == 0
    text = Path("answers.yaml").read_text(encoding="utf-8")
    Path("answers.yaml").write_text(re.sub(r"^( *year_with_four_suns:).*$", r"\1 182", text, flags=re.MULTILINE))


def test_every_key_of_the_grades_is_the_answer_s_or_the_law_of_kepler(sheet, capsys):
    """A circular year at a distance of 1 lasts 2π/√(G M) = 365.25 days; with four suns it lasts half as long.

    The comparison is as fine as the worksheet's own allowance.
    """
    found = asked(capsys, "check", "answers.yaml", "--quiet", code=4)
    rows = found.pop("questions")
    assert found == {"worksheet": "two_bodies", "name": "", "right": 1, "status": "failed"}
    keys = {"question", "answer", "measured", "unit", "within", "verdict", "because"}
    assert len(rows) == 3 and all(row.keys() == keys for row in rows)
    (graded,) = (row for row in rows if row["answer"] is not None)
    assert graded == {
        "question": "year_with_four_suns",
        "answer": 182,
        "measured": pytest.approx(0.5 * 365.25, rel=graded["within"]),
        "unit": Matching("days?"),
        "within": graded["within"],
        "verdict": "right",
        "because": Matching(".+"),
    }
    assert math.isclose(182, graded["measured"], rel_tol=graded["within"])
    for row in rows:
        if row is not graded:
            assert (row["verdict"], row["measured"]) == ("not answered", None) and row["within"] > 0.0
