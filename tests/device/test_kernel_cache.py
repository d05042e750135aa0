"""The folder of compiled kernels: locks that others left, and one start of Taichi where no probe has to be made."""

import os
import time

import pytest

from mpp_taichi.device import backends, kernel_cache


@pytest.mark.parametrize(("age", "stays"), [(2 * kernel_cache.LONGEST, False), (1.0, True)])
def test_only_a_lock_that_no_process_can_hold_any_more_is_removed(tmp_path, age, stays):
    lock = tmp_path / kernel_cache.LOCK
    lock.touch()
    os.utime(lock, (time.time() - age,) * 2)
    kernel_cache.remove_old_lock(str(tmp_path))
    assert lock.exists() == stays
    kernel_cache.remove_old_lock(str(tmp_path / "absent"))


def test_taichi_starts_once_where_its_probes_are_remembered(monkeypatch):
    """A second start takes as long as the first."""
    backends.start("cpu", "f64")  # which remembers the probes
    backends.stop()
    starts = []
    plain = backends.initialise
    monkeypatch.setattr(backends, "initialise", lambda *given: starts.append(given) or plain(*given))
    backends.start("cpu", "f64")
    assert len(starts) == 1
