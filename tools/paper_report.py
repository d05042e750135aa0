"""The MPPhys paper recomputed: every table, figure and stated number as one HTML page, ours beside the paper's.

    python tools/paper_report.py [--page out/paper_report.html] [--json FILE] [--only NAME,NAME] [--short]

Numbers of ours come from runs and computations of the program; the paper's are typed in, with their place. Where the paper is
wrong, the row says what is right. Sections share two processes; a section that ends its process is left out, and told.
`--short` takes shorter runs and leaves out what takes longest; it checks that the report can be made.
"""

import argparse
import contextlib
import importlib
import json
import logging
import os
import platform
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.metadata import version
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent)]  # so that it also runs from a checkout

from mpp_taichi.atomic_file import whole_text  # noqa: E402
from mpp_taichi.device.with_parent import end_with_parent  # noqa: E402

NAMES = (
    "two_bodies",
    "circumbinary",
    "choreographies",
    "ring",
    "springs",
    "membrane",
    "cantilever",
    "spheres",
    "gas",
    "equations",
)


def make(name, short):
    """One section and what it took."""
    began = time.perf_counter()
    logging.getLogger("mpp_taichi").setLevel(logging.ERROR)  # steps beyond their limit are taken on purpose
    section = importlib.import_module(f"paper.{name}").section(short=short)
    section.seconds = time.perf_counter() - began
    return section


def make_in_processes(names, short):
    """Every section, two at a time in processes of their own; None for a section whose process ended.

    A pool is lost with one of its processes. The sections that it had not finished are then made again, one at a time, so that
    only the section is left out that ends its process.
    """
    made = dict.fromkeys(names)
    for count in (2, 1):
        for part in [names] if count == 2 else [[name] for name in names if made[name] is None]:
            with ProcessPoolExecutor(count, initializer=end_with_parent, initargs=[os.getpid()]) as pool:
                waiting = {}
                with contextlib.suppress(BrokenProcessPool):
                    waiting |= {name: pool.submit(make, name, short) for name in part}
                for name, future in waiting.items():
                    with contextlib.suppress(BrokenProcessPool):
                        made[name] = future.result()
    return list(made.values())


def machine(seconds):
    """Where, with what, how long."""
    from mpp_taichi import __version__
    from mpp_taichi.device.availability import cpu_name

    others = ", ".join(f"{name} {version(name)}" for name in ("taichi", "numpy"))
    return f"{cpu_name()}; mpp_taichi {__version__}, {others}, python {platform.python_version()}; {seconds:.0f} s"


def as_json(sections):
    """Every row as plain data."""
    keys = ("place", "what", "paper", "ours", "difference", "mark", "correct", "note")
    return {name: [{key: getattr(row, key) for key in keys} for row in section.rows] for name, section in sections.items()}


def main(words=None):
    """Make the page; 0 if every row is as the paper says or is known to be wrong there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--page", type=Path, default=Path("out/paper_report.html"))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--only", default=",".join(NAMES), help="sections, with commas between")
    parser.add_argument("--short", action="store_true")
    arguments = parser.parse_args(words)
    chosen = arguments.only.split(",")
    unknown = [name for name in chosen if name not in NAMES]
    if unknown:
        parser.error(f"unknown section {unknown[0]!r}, allowed: {', '.join(NAMES)}")
    began = time.perf_counter()
    if len(chosen) < 2:
        made = [make(chosen[0], arguments.short)]
    else:
        made = make_in_processes(chosen, arguments.short)
    sections = {name: section for name, section in zip(chosen, made, strict=True) if section is not None}
    broken = [name for name in chosen if name not in sections]
    from paper.page import APART, page

    kind = ["Short: fewer runs and shorter ones than the whole report has."] if arguments.short else []
    whole_text(arguments.page, page(sections, machine(time.perf_counter() - began), kind), "the page")
    if arguments.json:
        whole_text(arguments.json, json.dumps(as_json(sections), indent=1), "the numbers")
    apart = [row for section in sections.values() for row in section.rows if row.mark == APART]
    for row in apart:
        sys.stderr.write(f"differs: {row.place}, {row.what}: {row.paper} in the paper, {row.ours} here\n")
    for name in broken:
        sys.stderr.write(f"{name}: its process ended without a result; the page lacks this section\n")
    rows = sum(len(section.rows) for section in sections.values())
    sys.stdout.write(f"{arguments.page}: {rows} rows, {time.perf_counter() - began:.0f} s\n")
    return 1 if apart or broken else 0


if __name__ == "__main__":
    sys.exit(main())
