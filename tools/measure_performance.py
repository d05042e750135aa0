"""All speed benchmarks in turn, and docs/performance.md from what they found.

    python tools/measure_performance.py [--short] [--only pairs springs …] [--keep] [--folder out/performance] [--page FILE]
    python tools/measure_performance.py --renew springs … [--page FILE]
    python tools/measure_performance.py --limits [--page FILE]

Each runs as a process of its own and writes JSON into the folder; `--keep` takes those that are there already. `--short` sees
that all of it works, with few sizes and repeats, and writes no page unless one is named. `--renew` measures some benchmarks
and puts their tables and bars into the page, whose other tables stay. `--limits` measures nothing: it takes over what is
written by hand of the limits into the page, whose tables stay. The whole takes about half an hour on two cores.
The exit code is 1 where a benchmark failed; a bar that is missed is a line of the page.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tools" / "benchmarks"))

from performance_page import SECTIONS, page, with_new_limits, with_new_results  # noqa: E402

PAGE = ROOT / "docs" / "performance.md"
RUNS = {  # name: arguments, and those of --short
    "pairs": ("--sizes 1024 2048 8192 16384 --repeats 7", "--sizes 1024 --repeats 2"),
    "opencl": ("--sizes 1024 16384 65536 --repeats 5", "--sizes 1024 --repeats 2"),
    "steps": ("", "--counts 2 16 --repeats 2"),
    "tree": ("--sizes 3000 10000 100000 1000000 --repeats 3", "--sizes 3000 --repeats 1"),
    "springs": ("--repeats 9", "--counts 4096 --repeats 2"),
    "contacts": ("--counts 100000 --crossover --precisions f64 f32", "--counts 1000 --crossover 64 --repeats 2"),
    "event_driven": ("--repeats 5", "--counts 1000 2000 --repeats 2"),
    "compare scenes/ring.yaml": ("--ladder --budget 3min", "--budget 5s --steps 5"),
    "compare scenes/cloth.yaml": ("--budget 90s", "--budget 5s --steps 5"),
}
MISSED = 1  # exit code of a benchmark that ran and misses a bar


def call_of(name, arguments, file):
    """What runs a benchmark, and how a person would."""
    if name.startswith("compare"):
        words = [*name.split(), *arguments.split()]
        told, writes = ["-m", "mpp_taichi", *words], ["--out", str(file.with_suffix(""))]
    else:
        told, writes = [f"tools/benchmarks/benchmark_{name}.py", *arguments.split()], ["--json", str(file)]
    return [sys.executable, *told, *writes], f"python {' '.join(told)}"


def file_of(folder, name):
    """Where its findings are."""
    return folder / f"{name.replace('scenes/', '').replace('.yaml', '').replace(' ', '-')}.json"


def measure(name, call, file):
    """Run it; whether there is something to tell."""
    print(f"\n--- {name}", flush=True)
    code = subprocess.run(call, cwd=ROOT, check=False).returncode
    if name.startswith("compare") and code == 0:
        file.write_bytes((file.with_suffix("") / "compare.json").read_bytes())
    good = code in (0, MISSED) and file.is_file()
    if not good:
        print(f"{name} ended with {code}", flush=True)
    return good


def renew(options):
    """Measure the benchmarks of `--renew`, and put their results into the page."""
    target, failed = options.page or PAGE, []
    for name in options.renew:
        file = file_of(options.folder.resolve(), name)
        call, command = call_of(name, RUNS[name][options.short], file)
        file.unlink(missing_ok=True)
        if measure(name, call, file):
            found = json.loads(file.read_text(encoding="utf-8"))
            text = with_new_results(target.read_text(encoding="utf-8"), name, found, command)
            target.write_text(text, encoding="utf-8")
        else:
            failed.append(name)
    return 1 if failed else 0


def main():
    """Measure, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--only", nargs="+", choices=list(RUNS), default=list(RUNS))
    parser.add_argument("--keep", action="store_true", help="do not repeat what is in the folder")
    parser.add_argument("--folder", type=Path, default=ROOT / "out" / "performance")
    parser.add_argument(
        "--renew", nargs="+", choices=list(SECTIONS), default=[], help="measure these, and keep all other tables"
    )
    parser.add_argument("--limits", action="store_true", help="measure nothing, and renew the limits that are written by hand")
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    if options.limits:
        target = options.page or PAGE
        target.write_text(with_new_limits(target.read_text(encoding="utf-8")), encoding="utf-8")
        return 0
    options.folder.mkdir(parents=True, exist_ok=True)
    if options.renew:
        return renew(options)
    found, commands, failed = {}, {}, []
    for name, arguments in RUNS.items():
        file = file_of(options.folder.resolve(), name)
        call, commands[name] = call_of(name, arguments[options.short], file)
        if name in options.only and not (options.keep and file.is_file()):
            file.unlink(missing_ok=True)
            if not measure(name, call, file):
                failed.append(name)
        if file.is_file():
            found[name] = json.loads(file.read_text(encoding="utf-8"))
    target = options.page or (None if options.short else PAGE)
    if target is not None:
        target.write_text(page(found, commands), encoding="utf-8")
        print(f"\nwrote {target}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
