"""`verify`: rows that are right, wrong, refused or crash; going on after a kill; the report; what cases see."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from xml.etree import ElementTree

import pytest

from mpp_taichi.archive.journal import Journal
from mpp_taichi.cli.main import main
from mpp_taichi.errors import BackendError, PrecisionError, StabilityError
from mpp_taichi.verify import examination
from mpp_taichi.verify.case import GROUPS, Case, Found
from mpp_taichi.verify.case_result import examine
from mpp_taichi.verify.cases import forces, gravity
from mpp_taichi.verify.catalogue import cases
from mpp_taichi.verify.examination import Examination
from mpp_taichi.verify.place import Place

HERE = Place("cpu", "f64")
# A worker whose cases do what their names say.
PLANTED = """
import os, sys, time
from mpp_taichi.compare.answering import answer_lines
def answer(line):
    name = line["case"]
    open("asked", "a").write(name + "\\n")
    if name == "dies":
        print("the driver fell over", file=sys.stderr, flush=True)
        os._exit(9)
    if name == "sleeps":
        time.sleep(60)
    place = {"backend": line["backend"], "precision": line["precision"]}
    return {"case": name, **place, "status": "solved", "reached": 1.0, "bound": 2.0}
answer_lines(answer)
"""


def made(name, ask=lambda place: Found(0.0, 1.0, ""), **more):
    return Case(name, "numerics", name, "none", ask, True, ("f64",), **more)


def raising(error):
    def ask(place):
        raise error

    return ask


@pytest.mark.parametrize(
    ("ask", "place", "status"),
    [
        (lambda place: Found(1.0, 1.0, ""), HERE, "solved"),
        (lambda place: Found(1.1, 1.0, ""), HERE, "failed"),
        (lambda place: Found(math.nan, 1.0, ""), HERE, "failed"),
        (lambda place: 1 / 0, HERE, "failed"),
        (raising(StabilityError("the step is too long")), HERE, "failed"),
        (raising(StabilityError("the step is too long")), Place("cpu", "f32"), "refused"),
        (raising(PrecisionError("not in f64")), Place("vulkan", "f64"), "refused"),
        (raising(BackendError("no driver")), Place("cuda", "f64"), "not here"),
    ],
)
def test_a_number_within_its_bound_is_solved_and_words_are_a_refusal_where_they_may_be(ask, place, status):
    result = examine(made("planted", ask), place)
    assert result.status == status
    assert (result.reason == "") == (status == "solved")


def test_names_are_unique_and_every_case_has_a_source_and_a_group():
    known = cases()
    assert len({case.name for case in known}) == len(known) > 200
    assert all(case.group in GROUPS and case.source and case.title for case in known)
    assert {case.group for case in known if case.quick} == set(GROUPS)


@pytest.fixture
def planted(tmp_path, monkeypatch):
    (tmp_path / "planted_worker.py").write_text(PLANTED)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(examination, "MODULE", "planted_worker")
    return tmp_path


def test_a_crash_fails_its_own_row_and_the_next_case_has_a_new_process(planted):
    questions = [(made(name), HERE) for name in ("first", "dies", "last")]
    results = Examination(questions, Journal(None, {}), planted, lambda _: None).run(1, lambda: None)
    assert [each.status for each in results] == ["solved", "failed", "solved"]
    assert "status 9" in results[1].reason and "the driver fell over" in results[1].reason


@pytest.mark.sampled(3)
def test_a_case_without_an_answer_is_ended(planted, monkeypatch):
    monkeypatch.setattr(examination, "LONGEST_SECONDS", 3.0)
    questions = [(made(name), HERE) for name in ("sleeps", "last")]
    results = Examination(questions, Journal(None, {}), planted, lambda _: None).run(1, lambda: None)
    assert [each.status for each in results] == ["failed", "solved"] and "did not answer within 3 s" in results[0].reason


def test_an_examination_that_was_cut_off_asks_only_the_rest(planted):
    questions = [(made(name), HERE) for name in ("first", "second", "third")]

    def stopped_after(count):
        def look():
            if (planted / "asked").exists() and (planted / "asked").read_text().count("\n") > count:
                raise KeyboardInterrupt

        return look

    with pytest.raises(KeyboardInterrupt), Journal(planted / "journal", {}, after=0.0) as journal:
        asked = [*questions, (made("sleeps"), HERE)]
        Examination(asked, journal, planted, lambda _: None).run(1, stopped_after(3))
    (planted / "asked").unlink()
    with Journal(planted / "journal", {}, after=0.0) as journal:
        results = Examination([*questions, (made("last"), HERE)], journal, planted, lambda _: None).run(1, lambda: None)
        journal.end()
    assert [each.case for each in results] == ["first", "second", "third", "last"]
    assert (planted / "asked").read_text().split() == ["last"]


@pytest.mark.sampled(3)
def test_the_verb_writes_a_table_a_page_and_json(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = main(["verify", "--backend", "cpu", "--precision", "f64,ds", "--only", "gravity_of_2,head_on", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert code == 0 and told["status"] == "ok" and told["counts"] == {"solved": 3, "refused": 1, "failed": 0, "not here": 0}
    assert told == json.loads((tmp_path / "out/verify/verify.json").read_text()) | {
        "files": told["files"],
        "went_on": None,
    }
    rows = {(row["case"], row["precision"]): row for row in told["rows"]}
    assert 0.0 <= rows["gravity_of_2", "f64"]["reached"] <= rows["gravity_of_2", "f64"]["bound"] < 1e-14
    assert rows["head_on", "ds"]["status"] == "refused" and "low parts" in rows["head_on", "ds"]["reason"]
    page = ElementTree.fromstring((tmp_path / "out/verify/verify.html").read_text().split("\n", 1)[1])
    words = "".join(page.itertext())
    assert "Of 4 questions on cpu" in words and "Hard cases of gravity" in words and "refused" in words
    assert not (tmp_path / "out/verify/journal").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--only", "gravity_of_3"], "no case and no group"),
        (["--backend", "opencl"], "allowed are cpu, cuda"),
        (["--precision", "f16"], "allowed are f32"),
        (["--quick", "--full"], "not allowed with"),
        (["--only", "drift_of_leapfrog", "--precision", "f32"], "none of these cases"),
    ],
)
def test_what_cannot_be_asked_is_told_in_a_line(words, said, capsys):
    assert main(["verify", *words]) == 2
    assert said in capsys.readouterr().err


def test_the_list_names_every_case(capsys):
    assert main(["verify", "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [case.name for case in cases()]


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.sampled(3)
def test_a_signal_ends_the_workers_too(tmp_path):
    command = [sys.executable, "-m", "mpp_taichi", "verify", "--backend", "cpu", "--only", "orders"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while "/" not in process.stderr.readline():
        time.sleep(0.01)
    looked = subprocess.run(["pgrep", "-P", str(process.pid), "-f", "verify.worker"], capture_output=True, text=True)
    workers = looked.stdout.split()
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM and workers
    assert not any(os.path.exists(f"/proc/{each}") for each in workers)


@pytest.mark.sampled(3)
def test_a_wrong_force_and_a_wrong_orbit_are_seen(monkeypatch):
    """The answers are shifted a little in place of the program's; each bound must be smaller than the shift."""
    (two,) = [case for case in forces.GRAVITY if case.name == "gravity_of_2"]
    assert examine(two, HERE).status == "solved"
    plain = forces._pair_sum
    monkeypatch.setattr(forces, "_pair_sum", lambda *given: (plain(*given)[0] * (1.0 + 1e-13), plain(*given)[1]))
    assert examine(two, HERE).status == "failed"
    monkeypatch.setattr(gravity, "separation", lambda e, phase: _separation(e, phase + 1e-9))
    assert examine(gravity.fixed_steps, HERE).status == "failed"


_separation = gravity.separation
