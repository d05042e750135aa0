"""Error against time on eight problems: our methods beside REBOUND, SciPy and heyoka.

    python tools/benchmarks/benchmark_work_precision.py [--repeats 5] [--problems figure_eight …] [--json FILE] [--from FILE …]
        [--page HTML] [--picture PNG] [--table MD]

Problems (work_precision_problems.py): Kepler's at e = 0.6 and at e = 0.9 over 100 orbits, the figure eight over 20 periods, the
outer solar system over 50 orbits of Jupiter, Burrau's three bodies to t = 10, the seven stars of Hairer, Nørsett & Wanner to
t = 3, a drum of 112 springs, and a cluster of 256 stars to t = 1/2. The error is the largest distance of a body from its right
place at the end, over the root mean square distance from the centre; the right places are those of heyoka in long double, for
the cluster in double. Times are processor times of the stepping alone, on one thread: medians of repeats; all runs of a problem
take turns. A run of milliseconds is repeated three times in a row, and the third time counts.

REBOUND runs leapfrog (orders 2 and 8), WHFast (with and without corrector, and with the lazy kernel), SABA, IAS15 and
Bulirsch–Stoer, SciPy DOP853, heyoka its Taylor method. REBOUND has no springs between bodies, and a force of the user would
take the time of the user's own code; REBOUND is left out of the drum. WHFast and wisdom_holman solve Kepler's problem exactly;
both need a central body. For each decade the fastest run of every contender that reaches it is compared.
`pip install .[bench]` brings the other programs. With --from the numbers of earlier runs are shown again; a problem that is in
several files is taken from the last one.
"""

import os

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"  # read when NumPy is first imported

import argparse  # noqa: E402
import json  # noqa: E402
import platform  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
import warnings  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]  # so that it also runs from a checkout

from work_precision_decades import compare, markdown, show, summary  # noqa: E402
from work_precision_others import other_runs  # noqa: E402
from work_precision_ours import our_runs  # noqa: E402
from work_precision_page import page, picture  # noqa: E402
from work_precision_problems import PROBLEMS  # noqa: E402

ONCE = 0.5  # seconds: a run that takes longer is not repeated, since it varies little
DEAREST = 20.0  # seconds: a contender has no further runs after a run that takes longer


def measure(problem, repeats, keep):
    """{contender: [(label, error, median of seconds)]}; `keep` is called with it after each turn of all runs."""
    runs, found = {**our_runs(problem), **other_runs(problem)}, {}
    for _ in range(repeats):
        for contender, entries in runs.items():
            for label, run in entries:
                row = found.setdefault((contender, label), {"seconds": []})
                if row["seconds"] and min(row["seconds"]) > ONCE:
                    continue
                positions, seconds = run()
                row["error"] = max(float(problem.error(positions)), problem.bar)
                row["seconds"].append(seconds)
                if seconds > DEAREST:
                    break
        table = {}
        for (contender, label), row in found.items():
            if row["seconds"]:
                table.setdefault(contender, []).append((label, row["error"], float(np.median(row["seconds"]))))
        keep(table)
    return table


def machine():
    """What was measured on."""
    versions = {name: __import__(name).__version__ for name in ("numpy", "scipy", "rebound", "heyoka")}
    known = {"processor": platform.machine(), "cores": os.cpu_count(), "system": platform.platform()}
    for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines() if Path("/proc/cpuinfo").exists() else ():
        name, _, value = line.partition(":")
        if name.strip() in ("model name", "cpu family", "model"):
            known[name.strip()] = value.strip()
    return known | {"load": os.getloadavg()} | versions


def main():
    """Run, print, write; exit code 1 where a decade of a problem is lost."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--problems", nargs="+", default=list(PROBLEMS), choices=list(PROBLEMS))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--from", dest="earlier", type=Path, nargs="+", default=[])
    parser.add_argument("--page", type=Path)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    results = {}
    for path in options.earlier:
        results |= json.loads(path.read_text("utf-8"))["results"]
    if not options.earlier:
        from mpp_taichi.device import backends

        backends.start("cpu", "f64", threads=1)
        warnings.filterwarnings("ignore", module="rebound")  # of coarse runs: their errors are in the table
        for name in options.problems:
            problem, began = PROBLEMS[name](), time.monotonic()

            def keep(table, name=name, problem=problem):
                results[name] = {"title": problem.name, "bar": problem.bar, "runs": table}
                if options.json:
                    text = json.dumps({"machine": machine(), "results": results}, indent=1)
                    options.json.write_text(text, encoding="utf-8")

            measure(problem, options.repeats, keep)
            show(results[name])
            print(f"measured in {time.monotonic() - began:.0f} s", flush=True)
    results = {name: results[name] for name in PROBLEMS if name in results}
    if options.earlier:
        for result in results.values():
            show(result)
    if options.page:
        options.page.write_text(page(results), encoding="utf-8")
    if options.picture:
        options.picture.write_bytes(picture(results))
    if options.table:
        options.table.write_text(markdown(results), encoding="utf-8")
    print("\n" + summary(results))
    return 0 if all(row.ahead for result in results.values() for row in compare(result)) else 1


if __name__ == "__main__":
    sys.exit(main())
