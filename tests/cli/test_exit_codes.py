"""Exit codes: for each code of the help and each verb that can end with it a command, or the reason why there is none.

Code 0 of each verb is in the tests of its `--json` keys; the codes of signals are in test_exit_codes_of_signals.py.
"""

import json
import re
import sys
from pathlib import Path

import pytest
import yaml

from mpp_taichi.cli import main as entry
from mpp_taichi.cli._costs import StepTime
from mpp_taichi.cli.main import VERBS, main
from mpp_taichi.compare.comparison import Comparison
from mpp_taichi.errors import CapacityError, StabilityError
from mpp_taichi.verify.case_result import FAILED, CaseResult
from mpp_taichi.verify.examination import Examination

BODIES = [
    {"body": {"name": "sun", "mass": 1.0, "position": [0, 0, 0]}},
    {"body": {"name": "earth", "mass": 0.5, "position": [1, 0, 0], "velocity": [0, 1.2, 0]}},
]
SCENE = {
    "particles": BODIES,
    "springs": [{"link": {"between": ["sun", "earth"], "stiffness": 0.5, "rest_length": 1.0}}],
    "forces": [{"newtonian_gravity": {"strength": 1.0}}],
    "integrator": {"leapfrog": {"dt": 0.125}},
    "run": {"duration": 2.0},
    "expect": {"steps": {"below": 1}},
}
MANY = {"lattice": {"shape": [3000, 3000, 1000], "lower": [0, 0, 0], "upper": [1, 1, 1], "mass": 1.0}}
MISSING = "metal" if sys.platform != "darwin" else "cuda"
SWEPT = ("--vary", "run.duration=1:2:2", "--measure", "end_time")
ONE_CASE = ("verify", "--only", "massless", "--backend", "cpu", "--precision", "f64")
NO_JSON = ("new", "schema")

ENDINGS = {
    2: {
        "run": (["run", "faulty.yaml", "--headless"], "did you mean"),
        "record": (["record", "faulty.yaml", "--still", "a.png"], "did you mean"),
        "scenes": (["scenes", "empty"], "holds no *.yaml"),
        "new": (["new", "s.yaml"], "exists already"),
        "accuracy": (["accuracy", "faulty.yaml"], "did you mean"),
        "compare": (["compare", "faulty.yaml"], "did you mean"),
        "sweep": (["sweep", "faulty.yaml", *SWEPT], "did you mean"),
        "explain": (["explain", "faulty.yaml"], "did you mean"),
        "check": (["check", "faulty.yaml"], "did you mean"),
        "convert": (["convert", "faulty.yaml", "a.csv"], "did you mean"),
        "replay": (["replay", "s.yaml"], "is no archive"),
        "verify": (["verify", "--only", "mass"], "no case and no group"),
        "passport": (["passport", "s.yaml"], "files of this kind have none"),
        "info": (["info", "--backend", "cpu"], "unknown argument"),
        "schema": (["schema", "s.yaml"], "unknown argument"),
    },
    3: {
        "run": (["run", "s.yaml", "--headless", "--backend", MISSING], f"{MISSING} does not start here"),
        "record": (["record", "s.yaml", "--still", "a.png", "--backend", MISSING], f"{MISSING} does not start here"),
        "accuracy": (["accuracy", "s.yaml", "--backends", MISSING], f"{MISSING} does not start here"),
        "compare": (["compare", "s.yaml", "--backends", MISSING], f"{MISSING} does not start here"),
        "sweep": (["sweep", "s.yaml", *SWEPT, "--backend", MISSING], f"{MISSING} does not start here"),
        "explain": (["explain", "s.yaml", "--backend", MISSING], f"{MISSING} does not start here"),
        "check": (["check", "s.yaml", "--backend", MISSING], f"{MISSING} does not start here"),
        "verify": (["verify", "--backend", MISSING], f"{MISSING} does not start here"),
    },
    4: {
        "run": (["run", "s.yaml", "--headless"], "1 of 1 expectations not met"),
        "record": (["record", "s.yaml", "--still", "a.png", "--size", "64x48"], "1 of 1 expectations not met"),
        "check": (["check", "s.yaml"], "checking s.yaml"),
    },
    5: {
        "run": (["run", "s.yaml", "--headless", "--snapshot", "file/a.npz"], "cannot be written"),
        "record": (["record", "s.yaml", "--frames", "file/a"], "cannot be written"),
        "new": (["new", "file/a.yaml"], "cannot write the scene"),
        "accuracy": (["accuracy", "s.yaml", "--out", "file/a"], "cannot be written"),
        "compare": (["compare", "s.yaml", "--out", "file/a"], "cannot be written"),
        "sweep": (["sweep", "s.yaml", *SWEPT, "--out", "file/a"], "cannot write the description"),
        "convert": (["convert", "s.yaml", "file/a.csv"], "cannot write the particles"),
        "replay": (["replay", "none.run"], "cannot be read"),
        "verify": ([*ONE_CASE, "--out", "file/a"], "cannot be written"),
        "passport": (["passport", "none.png"], "cannot be read"),
    },
    6: {
        "run": (["run", "many.yaml", "--headless"], "the scene has 9000000002 particles"),
        "record": (["record", "many.yaml", "--still", "a.png"], "the scene has 9000000002 particles"),
        "accuracy": (["accuracy", "many.yaml"], "the scene has 9000000002 particles"),
        "compare": (["compare", "many.yaml"], "the scene has 9000000002 particles"),
        "sweep": (["sweep", "many.yaml", *SWEPT], "the scene has 9000000002 particles"),
        "explain": (["explain", "many.yaml"], "the scene has 9000000002 particles"),
        "check": (["check", "many.yaml"], "the scene has 9000000002 particles"),
        "convert": (["convert", "many.yaml", "a.csv"], "the scene has 9000000002 particles"),
    },
}
PLANTED = {
    4: {"compare": "a bug", "verify": "a failed row", "replay": "a number that is not finite"},
    5: dict.fromkeys(("scenes", "info", "schema", "explain", "check"), "a full disk"),
    6: {"replay": "no memory", "verify": "no thread"},
}
NEVER = {
    3: {
        "scenes": "starts no backend",
        "new": "starts no backend",
        "convert": "starts no backend",
        "replay": "takes the backend of its archive, which ran here or is refused as any other",
        "passport": "starts no backend",
        "info": "says which backends do not start, and this is what was asked",
        "schema": "starts no backend",
    },
    4: {
        "scenes": "runs nothing",
        "new": "runs nothing",
        "accuracy": "a method that breaks down is a row of the table",
        "sweep": "a member that breaks down is a row of the table",
        "explain": "times steps, and judges none",
        "convert": "runs nothing",
        "passport": "runs nothing",
        "info": "runs nothing",
        "schema": "runs nothing",
    },
    6: {name: "needs little memory" for name in ("scenes", "new", "passport", "info", "schema")},
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with a scene that fails its expectation, a faulty scene, a scene that is too large, and a plain file."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MPP_TAICHI_DEBUG"):
        monkeypatch.delenv(name, raising=False)
    faulty = {**SCENE, "integrator": {"leapfrgo": {"dt": 0.125}}}
    many = {**SCENE, "particles": [*BODIES, MANY]}
    for name, scene in (("s.yaml", SCENE), ("faulty.yaml", faulty), ("many.yaml", many)):
        Path(name).write_text(yaml.safe_dump(scene, sort_keys=False), encoding="utf-8")
    Path("file").write_text("", encoding="utf-8")
    Path("empty").mkdir()


def ended(words, capsys, *, said=""):
    """The exit code of a command, whose JSON object has the same code; its message is on standard error."""
    asked = [*words, *(() if words[0] in NO_JSON else ("--json",))]
    code = main(asked)
    told = capsys.readouterr()
    assert said in told.err and "Traceback" not in told.err
    if words[0] not in NO_JSON and told.out:
        assert json.loads(told.out).get("exit_code", code) == code
    return code


@pytest.mark.parametrize(
    ("code", "verb"), [pytest.param(code, verb, id=f"{code}-{verb}") for code, rows in ENDINGS.items() for verb in rows]
)
@pytest.mark.sampled(3)
def test_a_verb_ends_with_the_code_of_its_failure(code, verb, capsys):
    words, said = ENDINGS[code][verb]
    assert words[0] == verb and ended(words, capsys, said=said) == code


def test_each_code_and_verb_has_a_command_or_a_reason():
    for code, commands in ENDINGS.items():
        rows = [*commands, *PLANTED.get(code, {}), *NEVER.get(code, {})]
        assert sorted(rows) == sorted(VERBS), f"code {code}"


def test_the_codes_are_those_of_the_help_and_of_the_documents():
    listed = re.findall(r"(\d|128 \+ signal)\s+(?=[a-z])", entry.EPILOG.partition("Exit codes: ")[2].replace("\n", " "))
    assert listed == ["0", "1", *map(str, ENDINGS), "128 + signal"]
    documents = Path(__file__).parents[2] / "docs" / "commands.md"
    table = documents.read_text(encoding="utf-8").partition("## Exit codes")[2].partition("\n## ")[0]
    assert re.findall(r"^\| (\d|128 \+ n) \|", table, re.MULTILINE) == ["0", "1", *map(str, ENDINGS), "128 + n"]


# --- failures that no command brings about on every machine -------------------------------------------------------------------


@pytest.mark.parametrize("verb", VERBS)
def test_an_internal_error_of_any_verb_is_code_1(verb, capsys, monkeypatch):
    """The fault is planted behind the options, so that every verb is given words that it takes."""

    def broken(*_):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(VERBS[verb], "execute", broken)
    words = {name: each for name, (each, _) in ENDINGS[2].items()} | {"info": ["info"], "schema": ["schema"]}
    assert ended(words[verb], capsys, said="internal error: ZeroDivisionError") == 1


def test_a_comparison_with_a_bug_is_code_4(capsys, monkeypatch):
    monkeypatch.setattr(Comparison, "run", lambda self: None)
    monkeypatch.setattr(Comparison, "bugs", ["cpu"])
    assert ended(["compare", "s.yaml"], capsys) == 4


def test_an_examination_with_a_failed_row_is_code_4(capsys, monkeypatch):
    failed = CaseResult("massless", "cpu", "f64", FAILED, reason="a planted failure")
    monkeypatch.setattr(Examination, "run", lambda *_: [failed])
    assert ended([*ONE_CASE], capsys) == 4


@pytest.mark.parametrize(("error", "code"), [(StabilityError("a number is not finite"), 4), (MemoryError(), 6)])
def test_a_moment_that_cannot_be_computed_again_has_the_code_of_its_error(error, code, capsys, monkeypatch):
    def broken(**_):
        raise error

    monkeypatch.setattr("mpp_taichi.simulation.resume.resume", broken)
    assert ended(["replay", "a.run"], capsys) == code


def test_an_examination_without_threads_is_code_6(capsys, monkeypatch):
    def refused(*_):
        raise CapacityError("the system starts no more threads")

    monkeypatch.setattr("mpp_taichi.verify.examination.start_thread", refused)
    assert ended([*ONE_CASE], capsys, said="no more threads") == 6


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full is of Linux")
@pytest.mark.parametrize("verb", PLANTED[5])
@pytest.mark.sampled(3)
def test_results_that_the_disk_cannot_hold_are_code_5(verb, monkeypatch):
    monkeypatch.setattr("mpp_taichi.cli._costs.measure", lambda _: (StepTime(1e-6, 1e-7), [], []))
    words = [verb, *(["s.yaml", "--quiet"] if verb in ("explain", "check") else []), *(["--json"] if verb == "check" else [])]
    with open("/dev/full", "w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        code = main(words)
        monkeypatch.undo()
    assert code == 5
