"""A program that was stopped for a while (Ctrl-Z, SIGSTOP, a machine that slept) does not take the other programs for hung."""

import io
import queue
import time
from types import SimpleNamespace

import pytest

from mpp_taichi.compare.process import WorkerProcess
from mpp_taichi.recorders import _stall

STOPPED = 1000.0  # seconds, more than every limit


@pytest.fixture
def stop(monkeypatch):
    """A function that lets the clock jump, as it does over the time in which a process is stopped."""
    plain, passed = time.monotonic, [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: plain() + passed[0])

    def jump():
        passed[0] += STOPPED

    return jump


def test_an_encoder_that_was_stopped_too_has_not_hung(stop, monkeypatch, tmp_path):
    polls = iter([None, None, None, 0])
    encoder = SimpleNamespace(pid=0, poll=lambda: next(polls), kill=lambda: pytest.fail("it was killed"))
    monkeypatch.setattr(_stall.time, "sleep", lambda _: stop())
    assert _stall.ends_in_time(encoder, tmp_path / "film.mp4", 5.0)


def test_an_encoder_that_shows_no_life_for_so_many_looks_is_killed(monkeypatch, tmp_path):
    killed = []
    encoder = SimpleNamespace(pid=0, poll=lambda: None, kill=lambda: killed.append(True), wait=lambda: None)
    monkeypatch.setattr(_stall.time, "sleep", lambda _: None)
    assert not _stall.ends_in_time(encoder, tmp_path / "film.mp4", 5.0) and killed


def test_a_worker_that_was_stopped_too_has_not_hung(stop):
    worker, looks = object.__new__(WorkerProcess), iter(range(9))
    worker._answers = queue.Queue()
    worker._process = SimpleNamespace(stdin=io.StringIO(), poll=lambda: pytest.fail("it was killed"))

    def look():
        stop()
        if next(looks) == 2:
            worker._answers.put('{"ok": true, "steps": 3}\n')

    worker._look = look
    assert worker.ask("run", 5.0) == {"steps": 3}
