"""Variables of the user that Taichi reads have no effect on runs, and are restored afterwards."""

import os
import subprocess
import sys
from pathlib import Path

from mpp_taichi.device import taichi_environment
from mpp_taichi.device.taichi_environment import user_variables_hidden, without_user_variables

ROOT = Path(__file__).parents[2]
PROGRAM = """
import os
before = dict(os.environ)
from mpp_taichi.device import backends
device = backends.start("cpu", "f64")
import taichi as ti
assert ti.lang.impl.current_cfg().default_fp == ti.f64 and device.threads == os.cpu_count()
assert {name: value for name, value in os.environ.items() if name.startswith(("TI_", "ENABLE_TAICHI"))} == {
    name: value for name, value in before.items() if name.startswith(("TI_", "ENABLE_TAICHI"))
}
backends.stop()
ti.init(arch=ti.cpu, log_level=ti.ERROR)
print(ti.lang.impl.current_cfg().default_fp)
"""


def test_a_users_variables_hold_for_the_users_own_start_alone():
    environment = dict(
        os.environ, PYTHONPATH=str(ROOT), TI_DEFAULT_FP="64", TI_SKIP_VERSION_CHECK="ON", TI_CPU_MAX_NUM_THREADS="1"
    )
    environment |= {"TI_ARCH": "x64"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=200, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.splitlines()[-1] == "f64"
    for name in ("TI_DEFAULT_FP", "TI_CPU_MAX_NUM_THREADS", "TI_ARCH"):
        assert done.stderr.count(f"ignoring {name}=") == 1


def test_variables_come_back_after_an_error(monkeypatch):
    monkeypatch.setenv("TI_ARCH", "vulkan")
    monkeypatch.delenv("TI_SKIP_VERSION_CHECK", raising=False)
    before = dict(os.environ)
    try:
        with user_variables_hidden():
            assert "TI_ARCH" not in os.environ and os.environ["TI_SKIP_VERSION_CHECK"] == "ON"
            raise KeyError
    except KeyError:
        pass
    assert dict(os.environ) == before


def test_a_child_process_gets_none_of_them():
    found = without_user_variables({"TI_ARCH": "vulkan", "HOME": "/home", "TI_SKIP_VERSION_CHECK": "OFF"})
    assert found == {"HOME": "/home", **taichi_environment.OURS}
