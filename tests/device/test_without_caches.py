"""Without a writable folder for caches, runs take longer, and have the same results."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CASES = ("no home", "no cache", "a file", "read-only", "not set")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/proc and /sys are used")


def environment(case, folder):
    found = {key: value for key, value in os.environ.items() if key not in ("HOME", "XDG_CACHE_HOME")}
    if case == "no home":
        return found | {"HOME": "/proc/none"}
    if case == "no cache":
        return found | {"HOME": str(folder), "XDG_CACHE_HOME": "/proc/none"}
    if case == "a file":
        (folder / ".cache").write_text("")
        return found | {"HOME": str(folder)}
    if case == "read-only":
        (folder / "taichi").mkdir()
        (folder / "taichi" / "ticache").symlink_to("/sys")
        (folder / "mpp_taichi").symlink_to("/sys")
        return found | {"XDG_CACHE_HOME": str(folder)}
    return found


@pytest.mark.parametrize("case", CASES)
@pytest.mark.sampled(3)
def test_a_scene_runs_without_a_cache(case, tmp_path):
    command = [sys.executable, "-m", "mpp_taichi", "run", "scenes/sun_earth.yaml", "--headless", "--steps", "10", "--json"]
    done = subprocess.run(
        command, cwd=ROOT, env=environment(case, tmp_path), capture_output=True, text=True, timeout=200, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout)["status"] == "ok"
    assert sum("not kept" in line for line in done.stderr.splitlines()) == (case != "not set")
