"""Kills of a sweep at random moments: the table is that of a sweep that nothing disturbed, byte for byte.

    python tools/checks/kill_sweep.py [--kills 100] [--seed 1] [--members 1600] [--longest 8] [--json FILE]

A sweep by two processes is killed with all its processes (SIGKILL) after a time that
is drawn between 0 and `--longest` seconds, and begun again by the same command, until it ends by itself. Then the table is
compared with the table of an undisturbed sweep, and the next sweep begins in a new folder, until there were so many kills. The
exit code is 1 where two tables differ, or where a sweep leaves a file of another name than an undisturbed one.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


def command(folder: Path, side: int) -> list[str]:
    """A sweep of side × side members in many chunks."""
    vary = [f"--vary=constants.distance=0.4:1.0:{side}", f"--vary=constants.phase=0:350:{side}"]
    measures = ["--measure=distance: {of: planet, when: largest}", "--measure=end_time"]
    words = ["sweep", "kepler16", "--set", "run.duration=600", *vary, *measures, "--chunk", "16", "--workers", "2", "--quiet"]
    return [sys.executable, "-m", "mpp_taichi", *words, "--out", str(folder)]


def run(words: list[str], seconds: float | None) -> bool:
    """Whether the sweep ended by itself; after so many seconds it is killed with all its processes."""
    sweep = subprocess.Popen(words, cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        _, said = sweep.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        os.killpg(sweep.pid, signal.SIGKILL)
        sweep.communicate()
        return False
    if sweep.returncode:
        raise SystemExit(f"the sweep ended with code {sweep.returncode}: {said.decode()}")
    return True


def names(folder: Path) -> list[str]:
    """The files of a sweep below its folder."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def main() -> None:
    """Kill, go on, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--members", type=int, default=1600)
    parser.add_argument("--longest", type=float, default=8.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    draw, kills, finished, wrong = random.Random(options.seed), 0, 0, []
    began, side = time.monotonic(), round(options.members**0.5)
    with tempfile.TemporaryDirectory() as where:
        whole = Path(where, "whole")
        run(command(whole, side), None)
        table, files = (whole / "members.csv").read_bytes(), names(whole)
        while kills < options.kills:
            folder = Path(where, "killed")
            while not run(command(folder, side), draw.uniform(0.0, options.longest)):
                kills += 1
            finished += 1
            if (folder / "members.csv").read_bytes() != table or names(folder) != files:
                wrong.append(finished)
            shutil.rmtree(folder)
            print(f"{kills} kills, {finished} sweeps ended, {len(wrong)} of them differ", flush=True)
    found = {"kills": kills, "sweeps": finished, "differ": wrong, "seed": options.seed, "members": side * side}
    if options.json:
        options.json.write_text(json.dumps(found | {"seconds": time.monotonic() - began}, indent=1), encoding="utf-8")
    raise SystemExit(1 if wrong else 0)


if __name__ == "__main__":
    main()
