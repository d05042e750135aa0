"""A study that is killed: its runs were written while it went on, and nothing of a half-written file is left."""

import json
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from mpp_taichi.accuracy import store as store_of
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.sweep import StepSweep

KNOWN = {"scene": "s"}


def sample(steps):
    configuration = Configuration("leapfrog", steps, "f64", "cpu")
    return Sample(configuration, 1.0 / steps, seconds=[0.25], end=np.full((2, 3), 1.0 / steps))


KILLED = """
import os, signal, sys
from pathlib import Path
from test_accuracy_killed import KNOWN, sample
from mpp_taichi.accuracy import store as store_of
store_of.EVERY = 0.0
store_of.SHARE = 1e9
store = store_of.Store(Path(sys.argv[1]), KNOWN)
for steps in range(1, 6):
    store.add(sample(steps))
(store.folder / "leapfrog-f64-cpu-6.part.npy").write_bytes(b"half")
store.path.with_name(f"{store.path.stem}.part.json").write_bytes(b"{")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX are used")
def test_the_runs_of_a_killed_study_are_known_and_half_written_files_are_gone(tmp_path):
    paths = os.pathsep.join(sys.path)
    process = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], env={**os.environ, "PYTHONPATH": paths})
    assert process.returncode == -9
    assert len([*tmp_path.rglob("*.part.*")]) == 2
    again = Store(tmp_path, KNOWN)
    assert again.resumed == 5
    for known in again:
        assert known.facts() == sample(known.configuration.steps).facts()
        np.testing.assert_array_equal(known.end, sample(known.configuration.steps).end)
    assert [*tmp_path.rglob("*.part.*")] == []


def test_samples_are_written_now_and_then(tmp_path, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(store_of.clock, "monotonic", lambda: now[0])
    monkeypatch.setattr(store_of.clock, "thread_time", lambda: 0.0)
    store, written = Store(tmp_path, KNOWN), []
    for steps, second in enumerate((100.2, 100.9, 101.1, 101.5, 102.2), start=1):
        now[0] = second
        store.add(sample(steps))
        written.append(len(json.loads(store.path.read_text())["samples"]) if store.path.exists() else 0)
    assert written == [0, 0, 3, 3, 5]


def test_repeats_of_runs_are_written_while_they_go_on(tmp_path, monkeypatch):
    monkeypatch.setattr(store_of, "EVERY", 0.0)
    monkeypatch.setattr(store_of, "SHARE", 1e9)
    store, written = Store(tmp_path, KNOWN), []

    class Timer:
        name, compile_seconds = "leapfrog", 0.0

        def time(self, *_):
            written.append([len(each["seconds"]) for each in json.loads(store.path.read_text())["samples"]])
            return 0.25

    for steps in (1, 2):
        store.add(sample(steps))
    bench = SimpleNamespace(backend="cpu", precision="f64", machines={"leapfrog": Timer()}, machine=lambda _: Timer())
    StepSweep(bench, store, Budget(1e9), {}, lambda _: 0.0).repeat(share=1.0)
    assert written == [[1, 1], [2, 1], [2, 2], [3, 2], [3, 3], [4, 3], [4, 4], [5, 4]]
