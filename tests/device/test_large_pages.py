"""Large pages: Taichi's fields are in large pages where Linux provides them on request."""

import platform
import re
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi import large_pages
from mpp_taichi.simulation import compiled_phase

SWITCH = Path("/sys/kernel/mm/transparent_hugepage/enabled")
COUNT = 1 << 23


def linux_can_move_pages():
    version = tuple(int(number) for number in re.findall(r"\d+", platform.release())[:2])
    return platform.system() == "Linux" and version >= (6, 1) and SWITCH.exists() and "[never]" not in SWITCH.read_text()


def in_large_pages():
    found = re.findall(r"^AnonHugePages:\s+(\d+) kB", Path("/proc/self/smaps").read_text(), re.MULTILINE)
    return 1024 * sum(int(kilobytes) for kilobytes in found)


@pytest.mark.fast_taichi("large_pages")
@pytest.mark.skipif(not linux_can_move_pages(), reason="this system does not move memory into large pages when asked")
@pytest.mark.sampled(3)
def test_fields_are_moved_into_large_pages_with_what_is_in_them():
    backends.start("cpu", "f64")
    import taichi as ti

    field = ti.field(ti.f64, COUNT)
    numbers = np.random.default_rng(0).random(COUNT)
    field.from_numpy(numbers)
    before = in_large_pages()
    large_pages.use_large_pages()
    assert in_large_pages() - before > COUNT * 8 / 2  # memory may be too scattered to give all that is asked for
    np.testing.assert_array_equal(field.to_numpy(), numbers)


@pytest.mark.parametrize("side", [25, 26])
def test_a_simulation_of_many_particles_asks_for_them(side, monkeypatch):
    asked = []
    monkeypatch.setattr(compiled_phase, "use_large_pages", lambda: asked.append(True))
    lattice = {"shape": [side] * 3, "lower": [0, 0, 0], "upper": [1, 1, 1], "mass": 1.0}
    with Simulation({"particles": [{"lattice": lattice}], "integrator": {"leapfrog": {"dt": 0.01}}}, backend="cpu"):
        assert bool(asked) == (side**3 >= large_pages.MANY_PARTICLES)


@pytest.mark.parametrize("missing", ["platform", "library"])
def test_runs_work_without_large_pages(missing, monkeypatch):
    def refuse(*_):
        raise OSError

    monkeypatch.setattr(large_pages.sys, "platform", "win32" if missing == "platform" else "linux")
    monkeypatch.setattr(large_pages.ctypes, "CDLL", refuse)
    assert large_pages.use_large_pages() == 0
