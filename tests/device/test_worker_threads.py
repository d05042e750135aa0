"""The worker threads compute each block of a loop once, for any number of threads, and end with Taichi."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi import worker_threads

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux" or os.uname().machine != "x86_64", reason="Taichi's own threads are used"),
    pytest.mark.fast_taichi("worker_threads"),
]
LOOPS = 200
SIZES = (1, 513, 5_000, 100_000)  # Taichi gives a thread at least 512 iterations: one block, two, several, many


@pytest.fixture(params=(1, 2, 3, 7))
def threads(request):
    """As many threads started; more than there are processors too, which do not look for work but sleep."""
    backends.stop()
    yield backends.start("cpu", "f64", threads=request.param).threads
    backends.stop()


def workers():
    """Those of this process; they have a name."""
    tasks = Path("/proc/self/task").iterdir()
    return [int(task.name) for task in tasks if (task / "comm").read_text().strip() == "mpp_taichi"]


def become(wanted):
    """Whether there are soon so many workers; the list of threads lags a little behind."""
    until = time.monotonic() + 10.0
    while len(workers()) != wanted and time.monotonic() < until:
        time.sleep(0.01)
    return len(workers()) == wanted


def settled():
    """The number of workers, once it has been the same for a second."""
    since, count = time.monotonic(), len(workers())
    while time.monotonic() < since + 1.0:
        if len(workers()) != count:
            since, count = time.monotonic(), len(workers())
        time.sleep(0.01)
    return count


def seconds_of(thread):
    """Processor time of a thread."""
    return int(Path(f"/proc/self/task/{thread}/schedstat").read_text().split()[0]) / 1e9


def shares(kernel):
    """Processor time of the workers, largest first, over that of the calling thread, in loops that find them asleep."""
    threads = workers()
    caller, began = -seconds_of(os.getpid()), [seconds_of(thread) for thread in threads]
    for _ in range(40):
        time.sleep(0.002)
        for _ in range(50):
            kernel(max(SIZES))
    caller += seconds_of(os.getpid())
    return sorted(((seconds_of(thread) - start) / caller for thread, start in zip(threads, began)), reverse=True)


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


@pytest.mark.sampled(3)
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


@pytest.mark.sampled(3)
def test_the_requested_number_of_threads_starts_and_ends_with_taichi(threads):
    import taichi as ti

    assert become(threads - 1)
    worker_threads.stop()
    assert become(0)
    counted, count = counting()
    count(max(SIZES))  # on the calling thread
    assert not counted.to_numpy().any()
    backends.stop()
    device = backends.start("cpu", "f64", threads=threads)
    assert become(threads - 1)
    ti.reset()  # by someone else
    assert become(0)
    backends.stop()
    assert not backends.is_alive(device)


def test_more_threads_than_processors_all_take_part():
    """Taichi compiles a kernel for no more threads than there are processors, whatever was wanted."""
    backends.stop()
    backends.start("cpu", "f64", threads=(os.cpu_count() or 1) + 1)
    counted, kernel = counting()
    kernel(1)
    found = shares(kernel)
    assert found[-1] > found[0] / 3
    backends.stop()


@pytest.mark.parametrize("threads", [2], indirect=True)
def test_a_worker_that_slept_takes_its_share(threads):
    counted, kernel = counting()
    kernel(1)
    assert shares(kernel)[0] > 1 / 50


@pytest.mark.sampled(3)
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


@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
@pytest.mark.parametrize("threads", [2], indirect=True)
def test_a_forked_process_does_no_loops(threads):
    counted, count = counting()
    counted.fill(1)
    count(max(SIZES))
    child = os.fork()
    if child == 0:  # whatever happens, the child must not go on with the tests
        try:
            count(max(SIZES))
        except Exception:  # the child has no runtime of Taichi
            os._exit(0)
        except BaseException:
            os._exit(2)
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert counted[0] == 3


BEGIN_AGAIN = "import taichi; taichi.init(offline_cache=False)"


@pytest.mark.parametrize("ending", ["", "import taichi; taichi.reset()", "import sys; sys.exit(0)", BEGIN_AGAIN])
@pytest.mark.sampled(3)
def test_a_process_ends_in_good_order_right_after_a_loop(ending, tmp_path):
    """The process has its own cache of kernels, for Taichi warns where another process holds the lock of the cache."""
    code = (
        "from mpp_taichi.device import backends\nbackends.start('cpu', 'f64', threads=2)\n"
        "import sys\nsys.path[:0] = ['tests/device']\n"
        f"from test_worker_threads import SIZES, counting\ncounted, count = counting()\ncount(max(SIZES))\n{ending}\n"
    )
    own = os.environ | {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, env=own, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    assert not done.stderr
    assert any(tmp_path.rglob("ticache*"))
