"""Shared by all tests: the tests' own modules on the path, a clean Taichi runtime for each test, and which tests run.

Most of the time goes into compiling kernels. A test marked `sampled(n)`, with n up to 6, runs one of n of its cases, and the
others in the n − 1 next runs (see support/rotation.py). `--thorough` runs all. Where a run takes longer than `--budget`
minutes, the sampled tests that have not begun by then are skipped, so that a run on a slow machine ends too. A test marked
`fast_taichi(*names)` needs those parts of device/fast_taichi, and is skipped where one is off.
"""

import gc
import os
import sys
import time
from datetime import date
from pathlib import Path

import pytest

from mpp_taichi.device.fast_taichi import switch

HERE = Path(__file__).parent
# Tests find the modules of tests/support, and each other, from every folder.
sys.path[:0] = [str(HERE), *(str(folder) for folder in sorted(HERE.iterdir()) if folder.is_dir())]

import rotation  # noqa: E402

ROOT = Path(__file__).parents[1]
BEGAN = time.monotonic()
os.environ["MPP_TAICHI_WINDOW"] = "fresh"  # no test reads or writes the settings of the user's own windows


@pytest.fixture(autouse=True)
def fresh_runtime():
    """Whatever a test started is stopped after it."""
    yield
    if "taichi" in sys.modules:
        from mpp_taichi.device import backends

        backends.stop()


@pytest.fixture
def compilations(monkeypatch):
    """Every kernel that Taichi compiles, by its name."""
    from taichi.lang.kernel_impl import Kernel

    found, plain = [], Kernel.materialize

    def materialize(self, key=None, args=None, arg_features=None):
        if key not in self.compiled_kernels:
            found.append(self.func.__name__)
        return plain(self, key, args, arg_features)

    monkeypatch.setattr(Kernel, "materialize", materialize)
    return found


@pytest.fixture(scope="session")
def software_vulkan():
    """Skip where no Vulkan device starts, and say why."""
    from mpp_taichi.device.availability import availability

    report = availability("vulkan")
    if not report["available"]:
        pytest.skip(f"no Vulkan here: {report['reason']}")
    return report["device"]


@pytest.fixture(scope="session")
def opencl():
    """The module that runs scenes in OpenCL; skip where no device starts, and say why."""
    from mpp_taichi.compare.opencl_package import load_opencl

    runner = load_opencl()
    _, reason = runner.devices()
    if reason:
        pytest.skip(f"no OpenCL here: {reason}")
    return runner


@pytest.fixture(scope="module")
def browser():
    """A browser without a window; skip where none is installed."""
    sys.path.insert(0, str(ROOT / "tools" / "benchmarks"))
    from headless_browser import HeadlessBrowser, find_browser

    if find_browser() is None:
        pytest.skip("no browser here: chromium is not installed")
    with HeadlessBrowser((800, 500)) as opened:
        yield opened


def pytest_collection_finish(session):
    """What was imported and collected stays to the end: the garbage collector need not look through it again and again."""
    gc.collect()
    gc.freeze()


def pytest_addoption(parser):
    """Run all, or what is enough for a change; what is drawn at random is drawn by the seed."""
    parser.addoption("--thorough", action="store_true", help="every case of every test")
    parser.addoption(
        "--budget", type=float, default=23.0, help="minutes after which no sampled test begins, without --thorough"
    )
    today = int(os.environ.setdefault("MPP_TAICHI_TEST_SEED", str(date.today().toordinal())))  # the same in all processes
    parser.addoption("--seed", type=int, default=today, help="of cases that are drawn at random; absent: the number of the day")
    number = int(os.environ.setdefault("MPP_TAICHI_TEST_ROTATION", str(rotation.number(ROOT, today))))
    parser.addoption("--rotation", type=int, default=number, help="of the sample; absent: of the commit, or of the day")


def pytest_report_header(config):
    """The numbers by which the tests of this run were chosen."""
    return f"of this run: --rotation {config.getoption('--rotation')} --seed {config.getoption('--seed')}"


def pytest_collection_modifyitems(config, items):
    """Skip tests of parts around Taichi that are off; leave out what a plain run need not do, the same in every process."""
    off, reason = switch.parts_off(switch.variable(), switch.KNOWN_TAICHI)
    for item in items:
        mark = item.get_closest_marker("fast_taichi")
        needed = sorted(set(mark.args).intersection(off)) if mark else ()
        if needed:
            item.add_marker(pytest.mark.skip(reason=f"{reason}: {', '.join(needed)} off"))
    if config.getoption("--thorough"):
        return
    kept, left = rotation.chosen(items, config.getoption("--rotation"))
    config.hook.pytest_deselected(items=left)
    items[:] = rotation.turned(kept, config.getoption("--rotation"))


def pytest_runtest_setup(item):
    """Skip what a sample took where the time is over; the reason counts them in the list of skipped tests."""
    budget = item.config.getoption("--budget")
    may_skip = item.get_closest_marker("sampled") and not item.config.getoption("--thorough")
    if may_skip and time.monotonic() - BEGAN > 60.0 * budget:
        pytest.skip(f"a sampled test, and the {budget:g} minutes of --budget are over")


def pytest_configure(config):
    """Bundled scenes and tools are found from anywhere."""
    config.root_folder = ROOT
