"""The paper report: marks follow from numbers, runs agree with the paper, and the page needs no other file."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from xml.etree import ElementTree

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import paper_report  # noqa: E402
from paper.page import APART, CURED, EMPTY, HOLDS, SAME, WRONG, Figure, Row, Section, half_digit, number, page  # noqa: E402

from mpp_taichi.accuracy import svg  # noqa: E402
from mpp_taichi.accuracy.svg import Plot, PlotMark, Series  # noqa: E402

SECTIONS = "choreographies,two_bodies,ring"


@pytest.mark.parametrize(
    "row, mark",
    [
        (Row("", "", "365.3", 365.349), SAME),  # to the digits printed
        (Row("", "", "365.3", 365.351), APART),
        (Row("", "", "0.318e-3", 0.31795e-3), SAME),
        (Row("", "", "0.318e-3", 0.3174e-3), APART),
        (Row("", "", "3072", 3073), APART),  # whole numbers are meant
        (Row("", "", "5e3", 5001), APART),
        (Row("", "", "0", 1e-6), APART),
        (Row("", "", "1", 1.004, within=0.005), HOLDS),
        (Row("", "", "7.933369", 7.9333586, correct="7.933359"), WRONG),
        (Row("", "", "7.933369", 7.9334, correct="7.933359"), APART),  # wrong there is not right here
        (Row("", "", "7.933359", 7.9333586, correct="7.933359"), SAME),  # not wrong where it agrees
        (Row("", "", "small", "0.1", holds=True), HOLDS),
        (Row("", "", "small", "10", holds=False), APART),
        (Row("", "", "cannot be done", "done", holds=True, cured=True), CURED),
        (Row("", "", "cannot be done", "not done", holds=False, cured=True), APART),
        (Row("", "", "an open question", "answered"), EMPTY),
        (Row("", "", "0.1", float("nan")), APART),
    ],
)
def test_a_mark_follows_from_the_numbers(row, mark):
    assert row.mark == mark


def test_numbers_are_told_with_two_digits_more_than_printed():
    assert [half_digit(text) for text in ("365.3", "2.9584e-4")] == pytest.approx([0.05, 0.5e-8])
    assert [number(365.29931, "365.3"), number(7.93335862, "7.933369"), number(3072.0, "3072"), number("words")] == [
        *("365.299", "7.93335862", "3,072", "words")
    ]


def fake(name, short):
    """A section, or the end of the process."""
    if name == "dies":
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGKILL)
    return f"{name} made"


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
def test_sections_are_kept_when_a_process_dies(monkeypatch):
    monkeypatch.setattr(paper_report, "make", fake)
    names = ["one", "dies", "two", "three"]
    assert paper_report.make_in_processes(names, True) == ["one made", None, "two made", "three made"]


def test_a_linear_axis_takes_every_sign_and_equal_steps():
    marks = [PlotMark(x, y) for x, y in ((-2.0, -1.0), (0.0, 0.0), (2.0, 1.0))]
    drawn = svg.draw(Plot("line", "x", "y", [Series("a", 0, marks, marked=False)], linear_x=True, linear_y=True))
    line = ElementTree.fromstring(drawn).find(f".//{{{svg.NAMESPACE}}}polyline").get("points")
    (x0, y0), (x1, y1), (x2, y2) = ((float(x), float(y)) for x, y in (pair.split(",") for pair in line.split()))
    assert x2 - x1 == pytest.approx(x1 - x0, abs=0.11) and y2 - y1 == pytest.approx(y1 - y0, abs=0.11)  # tenths of a pixel
    assert x1 > x0 and y1 < y0
    assert ">−0.5</text>" in drawn and ">−1</text>" in drawn and ">0</text>" in drawn


def test_what_a_row_says_is_text_and_not_markup():
    rows = [Row("<§1>", "a & b", "<1", "2 < 3 & e-5", "5e-05 & -3", holds=False)]
    section = Section("A < B", "x & y", rows, [Figure("F <", "<p/>", "-1 < 0", "a & b")])
    root = ElementTree.fromstring(page({"one": section}, "m & n", []).removeprefix("<!DOCTYPE html>"))
    text = " ".join(root.itertext())
    assert "2 < 3 & e-5" in text and "5e−05 & −3" in text and "−1 < 0" in text


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A short report of some sections: the page's text, and its rows."""
    folder = tmp_path_factory.mktemp("report")
    words = ["--short", "--only", SECTIONS, "--page", str(folder / "page.html"), "--json", str(folder / "rows.json")]
    ran = subprocess.run(
        [sys.executable, "tools/paper_report.py", *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    rows = json.loads((folder / "rows.json").read_text(encoding="utf-8"))
    return (folder / "page.html").read_text(encoding="utf-8"), rows


@pytest.mark.sampled(3)
def test_the_runs_agree_with_the_paper_except_where_it_is_wrong(made):
    rows = [row for section in made[1].values() for row in section]
    assert not [row for row in rows if row["mark"] == APART]
    table = {row["place"]: row for row in rows if row["place"].startswith("Table 1")}
    assert [row["mark"] for row in table.values()] == [SAME] * 6 + [WRONG, SAME]
    assert table["Table 1, N = 8"]["ours"] == pytest.approx(7.933359, abs=0.5e-6)
    assert sum(row["mark"] == WRONG for row in rows) == 3
    year = next(row for row in rows if "measured in a run" in row["what"])
    assert year["ours"] == pytest.approx(365.2998, rel=1e-4 / 24)  # Kepler's third law with both masses; the step adds 1e-8


@pytest.mark.sampled(3)
def test_the_page_is_one_file_that_asks_for_nothing(made):
    text, rows = made
    root = ElementTree.fromstring(text.removeprefix("<!DOCTYPE html>"))
    names = [element.tag.rpartition("}")[2] for element in root.iter()]
    assert not {"script", "link", "iframe", "object"} & set(names)
    sources = [element.get("src") for element in root.iter() if element.get("src")]
    assert len(sources) >= 6 and all(source.startswith("data:image/png;base64,") for source in sources)
    links = [element.get("href") for element in root.iter() if element.get("href")]
    assert links == [f"#{name}" for name in SECTIONS.split(",")]
    assert "url(" not in text and "@import" not in text and "prefers-color-scheme: dark" in text
    for title in ("Figure 7, right", "Figure 8", "Figure B.14"):
        assert f"<b>{title}.</b>" in text
    assert names.count("tr") == sum(map(len, rows.values())) + 3 + 4  # with those that are wrong once more, and four heads


def test_every_figure_and_table_of_the_paper_has_its_place():
    texts = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tools" / "paper").glob("*.py"))
    wanted = [f"Figure {k}" for k in (5, 6, "7, left", "7, right", 8, 9, 10, 11, 12, 13, "B.14")]
    assert not [title for title in wanted if not re.search(rf'"{title}"', texts)]
