"""The threads that share a kernel's loops: every block once, whatever the number of threads, and nobody left behind."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi import backends, worker_threads

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or os.uname().machine != "x86_64", reason="Taichi's own threads are used"
)
LOOPS = 200
SIZES = (1, 513, 5_000, 100_000)  # Taichi gives a thread at least 512 iterations: one block, two, several, many


@pytest.fixture(params=(1, 2, 3, 7))
def threads(request):
    """As many threads started; more than there are processors too, which do not look for work but sleep."""
    backends.stop()
    yield backends.start("cpu", "f64", threads=request.param).threads
    backends.stop()


def alive():
    """Threads of this process."""
    return len(os.listdir("/proc/self/task"))


def ticks(thread):
    """Processor time of a thread in user mode, in hundredths of a second."""
    return int(Path(f"/proc/self/task/{thread}/stat").read_text().rpartition(")")[2].split()[11])


def counting():
    """Counters, and a kernel that triples each of the first n in two loops, the second of which needs the first."""
    import taichi as ti

    counted = ti.field(ti.i64, shape=max(SIZES))

    @ti.kernel
    def count(n: ti.i32):
        for k in range(n):
            counted[k] = counted[k] * 3 + 1
        for k in range(n):
            counted[n - 1 - k] = counted[n - 1 - k] - 1

    return counted, count


def test_every_block_is_done_once_and_in_its_loop(threads):
    counted, count = counting()
    for n in SIZES:
        counted.fill(1)
        for _ in range(LOOPS):
            count(n)
        value = np.ones(max(SIZES), np.int64)
        with np.errstate(over="ignore"):
            for _ in range(LOOPS):
                value[:n] = value[:n] * 3
        np.testing.assert_array_equal(counted.to_numpy(), value)


def test_they_are_as_many_as_wanted_and_leave_with_taichi(threads):
    import taichi as ti

    with_them = alive()
    worker_threads.dismiss()
    assert with_them - alive() == threads - 1
    counted, count = counting()
    count(max(SIZES))  # on the calling thread
    assert not counted.to_numpy().any()
    backends.stop()
    device = backends.start("cpu", "f64", threads=threads)
    before = alive()
    ti.reset()  # by someone else
    assert before - alive() >= threads - 1
    backends.stop()
    assert not backends.is_alive(device)


@pytest.mark.parametrize("threads", [2], indirect=True)
def test_a_worker_that_slept_takes_its_share(threads):
    counted, count = counting()
    count(1)
    (newest,) = sorted(int(name) for name in os.listdir("/proc/self/task"))[-1:]
    for _ in range(20):
        time.sleep(0.005)
        for _ in range(50):
            count(max(SIZES))
    assert ticks(newest) >= ticks(os.getpid()) / 50


def test_two_threads_of_python_may_launch_at_once(threads):
    counted, count = counting()
    other, count_other = counting()
    counted.fill(1)
    other.fill(1)
    count(max(SIZES))
    count_other(max(SIZES))

    def launch(kernel):
        for _ in range(LOOPS):
            kernel(max(SIZES))

    at_once = [threading.Thread(target=launch, args=(kernel,)) for kernel in (count, count_other)]
    for each in at_once:
        each.start()
    for each in at_once:
        each.join()
    np.testing.assert_array_equal(counted.to_numpy(), other.to_numpy())
    assert counted[0] == pow(3, LOOPS + 1, 1 << 64) or counted[0] == pow(3, LOOPS + 1, 1 << 64) - (1 << 64)


@pytest.mark.parametrize("threads", [2], indirect=True)
def test_a_forked_process_does_its_loops_alone(threads):
    counted, count = counting()
    counted.fill(1)
    count(max(SIZES))
    child = os.fork()
    if child == 0:
        count(max(SIZES))
        worker_threads.dismiss()  # does not wait for those of the parent
        os._exit(0 if (counted.to_numpy() == 9).all() else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert counted[0] == 3


def test_another_version_of_taichi_keeps_its_own(monkeypatch):
    backends.stop()
    monkeypatch.setattr(worker_threads, "KNOWN", (1, 8, 0))
    backends.start("cpu", "f64", threads=3)
    before = alive()
    worker_threads.dismiss()
    assert alive() == before
    counted, count = counting()
    counted.fill(1)
    count(max(SIZES))
    assert (counted.to_numpy() == 3).all()
    backends.stop()


@pytest.mark.parametrize(
    "ending", ["", "import taichi; taichi.reset()", "import sys; sys.exit(0)", "import taichi; taichi.init()"]
)
def test_a_process_ends_in_good_order_right_after_a_loop(ending):
    code = (
        "from mpp_taichi import backends\nbackends.start('cpu', 'f64', threads=2)\nimport sys\nsys.path.insert(0, 'tests')\n"
        f"from test_worker_threads import SIZES, counting\ncounted, count = counting()\ncount(max(SIZES))\n{ending}\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[1], capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    assert not done.stderr
