"""Compiled kernels that Taichi keeps in its folder: the second run of a scene finds all of them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCENE = Path(__file__).parents[2] / "scenes" / "kepler.yaml"


def run_with_cache(folder):
    """Run a scene in a process with its own folder of kernels; returns the names of the kernels in the folder."""
    environment = os.environ | {"XDG_CACHE_HOME": str(folder)}
    command = [sys.executable, "-m", "mpp_taichi", "run", str(SCENE), "--headless", "--steps", "10"]
    subprocess.run(command, env=environment, check=True, capture_output=True, timeout=300, cwd=folder)
    return {path.name for path in (folder / "taichi" / "ticache").glob("*.tic")}


@pytest.mark.sampled(3)
def test_the_second_run_compiles_no_kernel_again(tmp_path):
    """The probes of the first start make fields, which must not change the numbers of the scene's fields."""
    first = run_with_cache(tmp_path)
    assert len(first) > 5
    lock = tmp_path / "taichi" / "ticache" / "ticache.lock"
    lock.touch()  # of a process that was killed long ago
    os.utime(lock, (0, 0))
    assert run_with_cache(tmp_path) == first
    assert not lock.exists()
