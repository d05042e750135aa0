"""Memory of a process that makes many simulations: closed, dropped without close, and dropped when the next one exists.

    python tools/checks/measure_memory.py [--closed 1000] [--dropped 200] [--overlapping 50]

Prints after each tenth of the simulations the resident memory in MiB, the threads and the objects of Python. Linux only. Closed
and dropped simulations must leave the memory flat: at most 10 MiB more at the end than after the first tenth. Taichi frees
compiled kernels only with its runtime, which ends when no simulation is open. So where the next simulation is made before the
last one is dropped, the memory grows by the kernels of each, which is printed and not judged.
"""

import argparse
import gc
import os
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]  # so that it also runs from a checkout that is not installed

from mpp_taichi import Simulation  # noqa: E402
from scenes import kepler  # noqa: E402

BAR = 10.0  # MiB


def make():
    """A simulation that has run."""
    return Simulation(kepler(), backend="cpu").run(steps=3)


def resident():
    """Resident memory [MiB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def follow(title, count, act):
    """Act so many times, and print a row after each tenth; the growth of the memory from the first row on, in MiB."""
    found = []
    for number in range(1, count + 1):
        act()
        if number % max(1, count // 10) == 0:
            gc.collect()
            found.append(resident())
            row = f"{title:12}{number:8}{found[-1]:10.1f}{len(os.listdir('/proc/self/task')):9}{len(gc.get_objects()):11}"
            print(row, flush=True)
    return found[-1] - found[0] if found else 0.0


def main():
    """Print the table; 1 where closed or dropped simulations leave memory behind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--closed", type=int, default=1000)
    parser.add_argument("--dropped", type=int, default=200)
    parser.add_argument("--overlapping", type=int, default=50)
    options = parser.parse_args()
    print(f"{'':12}{'made':>8}{'MiB':>10}{'threads':>9}{'objects':>11}")
    closed = follow("closed", options.closed, lambda: make().close())
    dropped = follow("dropped", options.dropped, make)
    kept = []

    def overlap():
        kept[:] = [make()]

    grown = follow("overlapping", options.overlapping, overlap)
    print(f"closed {closed:+.1f} MiB, dropped {dropped:+.1f} MiB, overlapping {grown:+.1f} MiB")
    return 1 if max(closed, dropped) > BAR else 0


if __name__ == "__main__":
    raise SystemExit(main())
