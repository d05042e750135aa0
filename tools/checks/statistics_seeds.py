"""How often is a statistical row of `verify` far from its theory by chance? Every row over many seeds, as a table.

    python tools/checks/statistics_seeds.py [--seeds 1000] [--first 1] [--minutes 600] [--jobs 2] [--precision f64]
                                            [--only NAME,NAME] [--json FILE]

A sound program is beyond 1, 2 and 3 standard errors in 31.7 %, 4.55 % and 0.27 % of the seeds, counted by the probability of
Student's t or of Kolmogorov and Smirnov's distance, and beyond the bound of a row in one of 60,000. Rows whose theory has a
systematic error, and distances of speeds of a fixed energy, are beyond more rarely. `mean z` is the mean over the seeds without
the systematic error taken off, in standard errors of one seed: far from 0 by more than 4/√seeds, the theory is off.
A seed takes about 13 s of processor time, a thousand take two hours on two free cores. 1 if a row was beyond its bound.
"""

import argparse
import json
import math
import sys
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from itertools import islice
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that it also runs from a checkout that is not installed

from mpp_taichi.verify.cases import _gas, statistics  # noqa: E402
from mpp_taichi.verify.place import Place  # noqa: E402

LEVELS = {
    "|z| > 1": math.erfc(1 / math.sqrt(2)),
    "|z| > 2": math.erfc(2 / math.sqrt(2)),
    "|z| > 3": math.erfc(3 / math.sqrt(2)),
}
SEEDS_OF_A_PROCESS = 10  # then its memory is given back


def measure(seed, precision, names):
    """By name: z with what is systematic taken off, the raw z, and the chance; of one seed."""
    place, found = Place("cpu", precision), {}
    for name in names:
        one = statistics.MEASURES[name](place, seed)
        raw = (one.mean - one.theory) / one.error if isinstance(one, _gas.Measured) else None
        found[name] = {"seed": seed, "z": one.z, "raw": raw, "chance": one.chance}
    return found


def measured(options, names):
    """Of each seed that was begun in time, what `measure` gave."""
    end = time.monotonic() + 60.0 * options.minutes
    seeds, found = iter(range(options.first, options.first + options.seeds)), []
    with ProcessPoolExecutor(options.jobs, get_context("spawn"), max_tasks_per_child=SEEDS_OF_A_PROCESS) as pool:
        running = {pool.submit(measure, seed, options.precision, names) for seed in islice(seeds, options.jobs)}
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            found += [each.result() for each in done]
            if time.monotonic() < end:
                running |= {pool.submit(measure, seed, options.precision, names) for seed in islice(seeds, len(done))}
    return found


def table(found, names):
    """Rows of numbers by name."""
    rows = {}
    for name in names:
        chances = [each[name]["chance"] for each in found]
        raw = [each[name]["raw"] for each in found if each[name]["raw"] is not None]
        rows[name] = {
            "seeds": len(found),
            "mean z": sum(raw) / len(raw) if raw else None,
            **{level: sum(chance < limit for chance in chances) for level, limit in LEVELS.items()},
            "beyond the bound": sum(chance < _gas.CHANCE for chance in chances),
            "least chance": min(chances),
        }
    return rows


def main(words=None):
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=600.0, help="no seed begins later")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--precision", default="f64")
    parser.add_argument("--only", default=",".join(statistics.MEASURES))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(words)
    names = options.only.split(",")
    unknown = [name for name in names if name not in statistics.MEASURES]
    if unknown:
        parser.error(f"unknown row {unknown[0]!r}, allowed: {', '.join(statistics.MEASURES)}")
    found = measured(options, names)
    rows = table(found, names)
    columns = ("seeds", "mean z", *LEVELS, "beyond the bound", "least chance")
    sys.stdout.write(f"{'row':22}" + "".join(f"{column:>17}" for column in columns) + "\n")
    for name, row in rows.items():
        cells = ("" if row[column] is None else f"{row[column]:.3g}" for column in columns)
        sys.stdout.write(f"{name:22}" + "".join(f"{cell:>17}" for cell in cells) + "\n")
    expected = (f"{len(found) * limit:.3g}" for limit in (*LEVELS.values(), _gas.CHANCE))
    sys.stdout.write(f"{'expected':22}" + " " * 34 + "".join(f"{cell:>17}" for cell in expected) + "\n")
    if options.json:
        options.json.write_text(json.dumps({"rows": rows, "seeds": found}, indent=1), encoding="utf-8")
    return int(any(row["beyond the bound"] for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
