"""The number of threads or processes is checked before any of them starts."""

import os

import numpy as np
import pytest
import yaml

from mpp_taichi import MppError, Simulation
from mpp_taichi.cli import _check_in_parallel, check
from mpp_taichi.cli.main import main
from mpp_taichi.device import backends
from mpp_taichi.device.thread_count import most_threads, processors
from scenes import kepler

ti = backends.import_taichi()
REFUSED = ["1000000", "1e6", "0", "-3", "2.5", "nan", "inf", "two", "", "9" * 5000]


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = {**kepler(dt=0.02), "run": {"duration": 0.1}}
    (tmp_path / "kepler.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return "kepler.yaml"


@pytest.fixture
def no_start(monkeypatch):
    """Fail where a backend is started."""

    def start(*_, **__):
        raise AssertionError("a backend was started")

    monkeypatch.setattr(backends, "initialise", start)
    backends.stop()


@pytest.mark.parametrize("count", REFUSED)
@pytest.mark.parametrize(
    "words",
    [
        ["run", "kepler.yaml", "--headless", "--threads"],
        ["record", "kepler.yaml", "--still", "a.png", "--threads"],
        ["explain", "kepler.yaml", "--threads"],
        ["check", "kepler.yaml", "--threads"],
        ["check", "kepler.yaml", "--jobs"],
        ["compare", "kepler.yaml", "--threads"],
    ],
    ids=lambda words: f"{words[0]} {words[-1]}",
)
def test_a_count_on_the_command_line_is_refused_before_anything_starts(scene, no_start, capsys, words, count):
    assert main([*words[:-1], f"{words[-1]}={count}"]) == 2
    said = capsys.readouterr().err.splitlines()[0]
    assert words[-1] in said and f"must be a whole number from 1 on, at most {most_threads()}" in said


@pytest.mark.parametrize("count", ["1000000", "0", "-3", "2.5", "two", "9" * 5000])
def test_a_count_of_the_right_half_is_refused_before_anything_starts(scene, no_start, capsys, count):
    assert main(["record", scene, "--still", "a.png", "--beside", f"threads={count}"]) == 2
    assert f"must be a whole number from 1 on, at most {most_threads()}" in capsys.readouterr().err


@pytest.mark.parametrize("count", [10**6, 0, -3, 2.5, 2.0, float("nan"), "2", True, np.float64(2.0)])
def test_a_count_in_python_is_refused_before_anything_starts(no_start, count):
    for start in (lambda: Simulation(kepler(), backend="cpu", threads=count), lambda: backends.start("cpu", threads=count)):
        with pytest.raises(MppError, match="threads=.* must be a whole number from 1 on") as caught:
            start()
        assert caught.value.exit_code == 2


def test_more_threads_than_processors_are_bounded_with_a_note(caplog):
    for count in (most_threads(), processors()):
        caplog.clear()
        with Simulation({**kepler(dt=0.02), "run": {"steps": 3}}, backend="cpu", threads=np.int64(count)) as simulation:
            simulation.run()
            assert simulation.device.threads == processors()
        note = f"threads: {processors()} instead of {count}, as this process has {processors()} processors"
        assert [each.getMessage() for each in caplog.records] == [note] * (count > processors())


def test_a_process_that_may_use_one_processor_runs_one_thread_and_one_check(monkeypatch, tmp_path):
    """A container or the command taskset gives a process some of the processors; more threads would only take turns."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    with Simulation({**kepler(dt=0.02), "run": {"steps": 3}}, backend="cpu") as simulation:
        assert simulation.device.threads == ti.lang.impl.current_cfg().cpu_max_num_threads == 1
    asked = []
    monkeypatch.setattr(_check_in_parallel, "check_at_once", lambda *_: asked.append("many") or [])
    monkeypatch.setattr(check, "_check", lambda scene, *_: {"scene": str(scene), "status": "ok", "exit_code": 0, "expect": []})
    monkeypatch.chdir(tmp_path)
    names = [f"{letter}.yaml" for letter in "abcdefg"]
    assert main(["check", *names, "--quiet"]) == 0 and not asked
