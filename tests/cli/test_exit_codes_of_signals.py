"""Exit codes of signals: 128 and the number of the signal, from each verb, wherever in its work the signal comes."""

import json
import os
import signal
from pathlib import Path

import pytest
import yaml

from mpp_taichi.accuracy.study import Study
from mpp_taichi.cli.main import VERBS, main
from mpp_taichi.compare.comparison import Comparison
from mpp_taichi.simulation import run_loop
from mpp_taichi.sweep.carrier import Processes
from mpp_taichi.verify.examination import Examination
from scenes import kepler

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
SWEPT = ("--vary", "run.duration=1:2:2", "--measure", "end_time")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A scene in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    Path("s.yaml").write_text(yaml.safe_dump({**kepler(dt=0.02), "run": {"duration": 1.0}}), encoding="utf-8")


def signalled(number):
    """A function in whose place a signal comes; what it was given that looks for signals is called."""

    def leave(*given, **more):
        signal.raise_signal(number)
        for each in (*given, *more.values()):
            if callable(each) and getattr(each, "__name__", "") == "raise_if_any":
                each()
        if isinstance(given[0], Comparison):
            given[0].budget.check()

    return leave


WORDS = {
    "run": ["run", "s.yaml"],
    "record": ["record", "s.yaml", "--still", "a.png"],
    "scenes": ["scenes"],
    "new": ["new", "a.yaml"],
    "accuracy": ["accuracy", "s.yaml"],
    "compare": ["compare", "s.yaml"],
    "sweep": ["sweep", "s.yaml", *SWEPT],
    "explain": ["explain", "s.yaml"],
    "check": ["check", "s.yaml"],
    "convert": ["convert", "s.yaml", "a.csv"],
    "replay": ["replay", "a.run"],
    "verify": ["verify"],
    "passport": ["passport", "a.png"],
    "info": ["info"],
    "schema": ["schema"],
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("verb", VERBS)
def test_a_signal_at_the_beginning_of_a_verb_is_its_code(verb, number, capsys, monkeypatch):
    monkeypatch.setattr(VERBS[verb], "execute", signalled(number))
    assert main(WORDS[verb]) == 128 + number
    told = capsys.readouterr()
    assert told.out == "" and told.err == f"interrupted by {number.name}\n"


WORKING = {
    "accuracy": (Study, "run"),
    "compare": (Comparison, "run"),
    "sweep": (Processes, "carry"),
    "verify": (Examination, "run"),
    "check": (run_loop.RunLoop, "run"),
    "run": (run_loop.RunLoop, "run"),
    "record": (run_loop.RunLoop, "run"),
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("verb", WORKING)
@pytest.mark.sampled(3)
def test_a_signal_within_the_work_of_a_verb_is_its_code(verb, number, capsys, monkeypatch):
    monkeypatch.setattr(*WORKING[verb], signalled(number))
    more = ["--headless"] if verb == "run" else []
    assert main([*WORDS[verb], *more, "--json"]) == 128 + number
    found = json.loads(capsys.readouterr().out)
    assert found["status"] == "interrupted" and found.get("exit_code", 128 + number) == 128 + number


def test_a_signal_while_an_archive_is_opened_is_its_code(capsys, monkeypatch):
    monkeypatch.setattr("mpp_taichi.simulation.resume.resume", signalled(signal.SIGTERM))
    assert main([*WORDS["replay"], "--json"]) == 143
    assert json.loads(capsys.readouterr().out) == {"status": "interrupted", "exit_code": 143}
