"""`expect:` blocks are compared with the results, also with wrong results, and `check` reports the failed scenes."""

import json
import math
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from mpp_taichi.cli import _check_in_parallel
from mpp_taichi.cli.main import main
from mpp_taichi.errors import StabilityError
from mpp_taichi.report.expectations import bound_text, holds
from mpp_taichi.scene.spec import Expectation, Location
from scenes import kepler


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Write scenes into an empty working directory."""
    monkeypatch.chdir(tmp_path)

    def write(name, expect=None, duration=2.0 * math.pi, **changes):
        content = {**kepler(dt=0.01), "run": {"duration": duration}, **changes}
        if expect is not None:
            content["expect"] = expect
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return name

    return write


def check(capsys, *words):
    code = main(["check", *words, "--json", "-q"])
    return code, json.loads(capsys.readouterr().out)["scenes"]


def expectation(**bounds):
    given = {"below": None, "above": None, "near": None, "within": None, **bounds}
    return Expectation("quantity", {}, location=Location("", 0, 0), **given)


def both(number):
    return {"f64": number, "f32": 10 * number}


@pytest.mark.parametrize(
    ("bounds", "inside", "outside"),
    [
        ({"below": both(1.0)}, (0.999, -0.999, 0.0), (1.0, -1.0, 5.0)),
        ({"above": both(1.0)}, (1.001,), (1.0, 0.0, -3.0)),
        ({"below": both(2.0), "above": both(1.0)}, (1.5,), (0.5, 2.5)),
        ({"near": 100.0, "within": both(0.01)}, (99.0, 101.0, 100.0), (98.99, 101.01, -100.0)),
        ({"near": -2.0, "within": both(0.1)}, (-2.19, -1.81), (-2.21, 2.0)),
        ({"near": 0.0, "within": both(0.1)}, (0.1, -0.1), (0.11, -0.11)),
        ({"near": 3.0}, (3.0,), (3.0000001,)),
    ],
)
def test_bounds_hold_inside_and_not_outside(bounds, inside, outside):
    assert all(holds(expectation(**bounds), value, "f64") for value in inside)
    assert not any(holds(expectation(**bounds), value, "f64") for value in outside)
    assert not any(holds(expectation(**bounds), value, "f64") for value in (math.nan, math.inf, -math.inf))


def test_each_precision_has_its_own_bound():
    assert not holds(expectation(below=both(1.0)), 5.0, "f64") and holds(expectation(below=both(1.0)), 5.0, "f32")
    assert bound_text(expectation(below=both(1.0)), "f32") == "< 10"
    assert bound_text(expectation(near=2.0, within=both(0.01)), "f64") == "2 ± 0.01 (relative)"


@pytest.mark.parametrize("value, words", [(-0.14, "|value| < 0.1"), (-0.06, "|value| < 0.1"), (0.14, "< 0.1"), (0.06, "< 0.1")])
def test_the_bound_of_a_number_below_0_says_that_it_bounds_the_absolute_value(value, words):
    bounded = expectation(below=both(0.1))
    assert holds(bounded, value, "f64") == (abs(value) < 0.1)
    assert bound_text(bounded, "f64", value) == words


@pytest.mark.sampled(3)
def test_the_period_of_a_kepler_orbit_is_found_whatever_the_sampling(folder, capsys):
    # Vis viva with G (m₁ + m₂) = 1.001 at pericentre 0.7, v² = 1.3 / 0.7; leapfrog at dt = 0.01 shifts the period by 5e-5.
    axis = 1.0 / (2.0 / 0.7 - 1.3 / 0.7 / 1.001)
    period = 2.0 * math.pi * math.sqrt(axis**3 / 1.001)
    expect = {"orbital_period": {"of": "planet", "around": "sun", "near": period, "within": 1e-3}}
    name = folder("long.yaml", expect, duration=60.0, run={"duration": 60.0, "every": 100000})
    code, (found,) = check(capsys, name)
    assert code == 0 and found["expect"][0]["value"] == pytest.approx(period, rel=1e-4)
    code, (found,) = check(capsys, folder("short.yaml", expect, duration=6.0))
    assert code == 4 and found["expect"][0]["value"] is None and "did not complete a turn" in found["expect"][0]["reason"]


@pytest.mark.sampled(3)
def test_a_wrong_expectation_fails_and_a_right_one_passes(folder, capsys):
    right = folder("a.yaml", {"relative_energy_error_max": {"below": 1e-3}, "steps": {"near": 629, "within": 0}})
    wrong = folder("b.yaml", {"relative_energy_error_max": {"below": 1e-12}, "steps": {"near": 629, "within": 0}})
    assert check(capsys, right)[0] == 0
    code, (first, second) = check(capsys, right, wrong)
    assert code == StabilityError.exit_code
    assert (first["status"], second["status"]) == ("ok", "failed")
    assert [row["passed"] for row in second["expect"]] == [False, True]


@pytest.mark.sampled(3)
def test_a_folder_means_every_scene_in_it_and_a_broken_one_stops_nothing(folder, capsys):
    folder("s/a.yaml", {"steps": {"above": 0}})
    folder("s/b.yaml", integrator={"leapfrg": {"dt": 1}})
    folder("s/c.yaml")
    code, found = check(capsys, "s")
    assert code == 2
    assert [(row["scene"], row["exit_code"]) for row in found] == [
        (str(Path(f"s/{n}.yaml")), c) for n, c in zip("abc", (0, 2, 0))
    ]
    assert "did you mean 'leapfrog'" in found[1]["faults"][0]


def test_the_table_names_every_pass_and_fail(folder, capsys):
    folder("s/a.yaml", {"steps": {"above": 0}, "relative_energy_error_max": {"below": 1e-15}})
    folder("s/b.yaml")
    assert main(["check", "s"]) == 4
    out = capsys.readouterr().out
    assert "pass  steps = 629, expected > 0" in out and "FAIL  relative_energy_error_max" in out
    assert "it expects nothing" in out and out.endswith("1 of 2 scenes pass\n")


@pytest.mark.sampled(3)
def test_a_scene_that_cannot_run_here_neither_passes_nor_fails(folder, capsys):
    """In f32c no solver of contacts carries low parts; other scenes run."""
    folder("s/a.yaml", {"steps": {"above": 0}})
    touching = {"hard_spheres": {"solver": "swept"}}
    bodies = [{"body": {"mass": 1, "radius": 0.1, "position": [float(k), 0, 0]}} for k in range(2)]
    refused = folder("s/b.yaml", {"steps": {"above": 0}}, particles=bodies, contacts=touching, move_to_center_of_mass=False)
    code, (runs, cannot) = check(capsys, "s", "--precision", "f32c")
    assert code == 0 and runs["status"] == "ok"
    assert cannot["status"] == "not possible here" and "swept does not carry low parts" in cannot["error"]
    assert main(["check", "s", "--precision", "f32c"]) == 0
    out = capsys.readouterr().out
    assert "FAIL" not in out and out.endswith("1 of 1 scenes pass, 1 not possible here\n")
    assert check(capsys, refused, "--precision", "f32c")[0] == 3  # where nothing ran, nothing passed


@pytest.mark.sampled(3)
def test_precision_chooses_the_bound(folder, capsys):
    name = folder("a.yaml", {"momentum_error_max": {"below": {"f64": 1e-13, "f32": 1e-4}}})
    for precision in ("f64", "f32"):
        code, (found,) = check(capsys, name, "--precision", precision)
        assert code == 0 and found["precision"] == precision
    assert found["expect"][0]["value"] > 1e-13  # f32 would not have passed as f64


def test_run_judges_only_the_scene_s_own_duration(folder, capsys):
    name = folder("a.yaml", {"return_error": {"below": 1e-12}})
    assert main([name, "--headless", "--json"]) == 4
    assert json.loads(capsys.readouterr().out)["expect"][0]["passed"] is False
    assert main([name, "--headless", "--json", "--until", "1.0"]) == 0
    assert json.loads(capsys.readouterr().out)["expect"] == []


def test_an_empty_folder_is_wrong_usage(tmp_path, capsys):
    assert main(["check", str(tmp_path)]) == 2
    assert "holds no *.yaml" in capsys.readouterr().err


# Many at once


@pytest.mark.sampled(3)
def test_scenes_at_once_are_judged_as_one_after_the_other(folder, capsys):
    folder("s/a.yaml", {"steps": {"above": 0}}, duration=2.0)
    folder("s/b.yaml", integrator={"leapfrg": {"dt": 1}})
    folder("s/c.yaml", {"steps": {"below": 1}})
    found = {}
    for jobs in ("1", "2"):
        code = main(["check", "s", "--json", "--jobs", jobs])
        told = capsys.readouterr()
        assert code == 2 and told.err.count("checking ") == 3 and told.err.count("did you mean 'leapfrog'") == 1
        found[jobs] = [{k: v for k, v in row.items() if k in ("scene", "status", "faults", "expect", "exit_code", "steps")}
                       for row in json.loads(told.out)["scenes"]]  # fmt: skip
    assert found["1"] == found["2"] and [row["exit_code"] for row in found["2"]] == [0, 2, 4]


@pytest.mark.sampled(3)
def test_a_process_that_breaks_off_fails_its_own_scene(folder, capsys, monkeypatch):
    """One that ends without a word, in place of Python itself falling over."""
    lost = "import sys, os; os._exit(7) if sys.argv[-1] == 'a.yaml' else os.execv(sys.executable, sys.argv[1:])"
    monkeypatch.setattr(_check_in_parallel, "PROGRAM", (sys.executable, "-c", lost, *_check_in_parallel.PROGRAM))
    scenes = [folder(name, {"steps": {"above": 0}}, duration=1.0) for name in ("a.yaml", "b.yaml")]
    code, (broken, sound) = check(capsys, *scenes, "--jobs", "2")
    assert code == 7 and "ended with code 7 and without a result" in broken["error"]
    assert sound["exit_code"] == 0 and sound["expect"][0]["passed"]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are looked up in /proc")
@pytest.mark.sampled(3)
def test_an_interrupt_ends_all_of_them(folder):
    scenes = [folder(name, {"steps": {"above": 0}}, duration=1e9) for name in ("a.yaml", "b.yaml", "c.yaml")]
    command = [sys.executable, "-m", "mpp_taichi", "check", *scenes, "--jobs", "2"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    until = time.monotonic() + 60.0

    def checks():  # not the process that watches for signals, nor a fork that still has the parent's command line
        lines = {each: Path(f"/proc/{each}/cmdline").read_bytes() for each in children.read_text().split()}
        return [each for each, line in lines.items() if b"check" in line and line.count(b".yaml") == 1]

    while len(begun := checks()) < 2 and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(1.0)  # for them to have begun
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60.0)
    assert process.returncode == 128 + signal.SIGTERM and len(begun) == 2
    assert not any(Path(f"/proc/{child}").exists() for child in begun)
