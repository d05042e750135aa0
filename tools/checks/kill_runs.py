"""Killed runs: does the same command go on to the same results, and is nothing left behind?

    python tools/checks/kill_runs.py [--count 200] [--seed 1] [--verbs run,record,…] [--share 1/4] [--json F] [--patience 100]
    python tools/checks/kill_runs.py --table killed-1.json killed-2.json …

Each trial starts a command, sends it SIGKILL (three of five times), SIGTERM or SIGINT at a random moment, looks for processes
that are left over after two seconds, and gives the same command again. The second end must have the results of a command that
was never killed, and no temporary file, no journal and no lock may be left. After SIGKILL at most MOST_LOST seconds of work may
be lost: the time from the last record of the archive or journal (of a command that had none yet, from the end of its start) to
the signal. Every verb has the same number of trials, and of every signal.

`--share k/n` does every n-th trial from the k-th on, with the same moments as all of them. Prints one line for each trial that
fails, and a table; `--table` makes it of the files that shares have written:

    lost    seconds of work that were lost by SIGKILL, the median and the largest
    longer  the time by which both starts together took longer than a whole run [s], the median after SIGKILL

The exit code is 1 where a trial failed.
"""

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import uuid
from pathlib import Path
from typing import Any

from kill_cases import Case, cases

ROOT = Path(__file__).parents[2]
MARK = "MPP_TAICHI_KILLED"
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
MOST_LOST = 5.0  # seconds of work
GRACE = 2.0  # seconds after which no process of a killed command may be left
BUSY = 100.0  # seconds that an end may take at most, unless --patience says otherwise

REST = ("*.part*", ".*.lock", "*journal", "work")  # of what must not be left after a study has ended


def environment(mark: str) -> dict[str, str]:
    """The environment of a command; `mark` is inherited by all of its processes."""
    return {**os.environ, "PYTHONPATH": str(ROOT), MARK: mark}


def begin(case: Case, folder: Path, mark: str) -> subprocess.Popen:
    """Start the command of a case in a folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "mpp_taichi", *case.words],
        cwd=folder,
        env=environment(mark),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def folder_of(case: Case, parent: Path) -> Path:
    """A new folder with the scenes of a case."""
    folder = Path(tempfile.mkdtemp(dir=parent))
    for name, text in case.scenes.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def left_over(mark: str) -> list[int]:
    """Numbers of the processes that have the mark in their environment."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            with contextlib.suppress(OSError):
                if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
    return found


def trial(
    case: Case, parent: Path, whole: tuple[object, float, float], moment: float, number: int, patience: float
) -> dict[str, Any]:
    """The facts of one killed run; `whole`: the results, the seconds of a whole run, and those of a start alone."""
    folder, mark = folder_of(case, parent), uuid.uuid4().hex
    wanted, seconds, start = whole
    found: dict[str, Any] = {"verb": case.verb, "signal": signal.Signals(number).name, "after": round(moment, 2), "faults": []}
    faults = found["faults"]
    process, began, at = begin(case, folder, mark), time.monotonic(), time.time()
    try:
        process.wait(timeout=moment)
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    sent = time.time()
    try:
        _, told = process.communicate(timeout=patience)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        faults.append(f"did not end within {patience:g} s")
        return found
    first = time.monotonic() - began
    found["was_running"] = process.returncode not in (0, None)
    if "Traceback" in told:
        faults.append("a traceback")
    until = time.monotonic() + GRACE
    while left_over(mark) and time.monotonic() < until:
        time.sleep(0.1)
    if rest := left_over(mark):
        faults.append(f"processes left: {rest}")
        for each in rest:
            with contextlib.suppress(OSError):
                os.kill(each, signal.SIGKILL)
    records = [each.stat().st_mtime for pattern in case.memory for each in folder.glob(pattern)]
    again, began = begin(case, folder, uuid.uuid4().hex), time.monotonic()
    try:
        out, told = again.communicate(timeout=patience)
    except subprocess.TimeoutExpired:
        os.killpg(again.pid, signal.SIGKILL)
        faults.append(f"the second start did not end within {patience:g} s")
        return found
    second = time.monotonic() - began
    try:
        if case.results(folder, out) != wanted:
            faults.append("other results")
    except (OSError, ValueError, KeyError, TypeError) as error:
        faults.append(f"no results, {error!r}: {told[-200:]!r}")
    if rest := [str(each.relative_to(folder)) for pattern in REST for each in folder.rglob(pattern)]:
        faults.append(f"files left: {rest}")
    if number == signal.SIGKILL and found["was_running"]:
        found["lost"] = round(max(0.0, sent - max([at + start, *records])), 2)
        found["longer"] = round(first + second - seconds, 2)
        if found["lost"] > MOST_LOST:
            faults.append(f"{found['lost']:.1f} s of work lost")
    if not faults:
        shutil.rmtree(folder)
    return found


def whole_runs(chosen: list[Case], parent: Path, patience: float) -> list[tuple[object, float, float]]:
    """The results of each command without a kill, its seconds, and the seconds of the start of the program."""
    found = []
    for case in chosen:
        folder, began = folder_of(case, parent), time.monotonic()
        process = begin(case, folder, uuid.uuid4().hex)
        out, told = process.communicate(timeout=patience)
        seconds, began = time.monotonic() - began, time.monotonic()
        subprocess.run([sys.executable, "-m", "mpp_taichi", *case.start], cwd=folder, env=environment(""), capture_output=True)
        try:
            found.append((case.results(folder, out), seconds, time.monotonic() - began))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SystemExit(f"{case.words}: no results without a kill: {error!r}\n{told[-2000:]}") from None
        print(f"{' '.join(case.words[:2])}: a whole run takes {seconds:.1f} s, a start {found[-1][2]:.1f} s", flush=True)
    return found


def table(found: list[dict[str, Any]]) -> list[str]:
    """Trials, passed trials and losses for each verb and signal, as a table of Markdown."""
    lines = [
        "| verb | signal | trials | passed | lost, median | lost, largest | longer, median |",
        "|---|---|---|---|---|---|---|",
    ]
    for verb, name in sorted({(each["verb"], each["signal"]) for each in found}):
        mine = [each for each in found if (each["verb"], each["signal"]) == (verb, name)]
        passed = sum(not each["faults"] for each in mine)
        lost, longer = ([each[key] for each in mine if key in each] for key in ("lost", "longer"))
        figures = (
            f"{statistics.median(lost):.1f} s | {max(lost):.1f} s | {statistics.median(longer):.1f} s" if lost else "– | – | –"
        )
        lines.append(f"| `{verb}` | {name.removeprefix('SIG')} | {len(mine)} | {passed} | {figures} |")
    passed = sum(not each["faults"] for each in found)
    return [*lines, "", f"{passed} of {len(found)} went on to the same results, lost little and left nothing behind"]


def planned(chosen: list[Case], count: int, seed: int) -> list[tuple[int, float, int]]:
    """The trials: number of the case, moment as a part of a whole run, signal; alike many of each verb and signal."""
    chance = random.Random(seed)
    verbs = list(dict.fromkeys(case.verb for case in chosen))
    found = []
    for k in range(count):
        turn = k // len(verbs)
        mine = [number for number, case in enumerate(chosen) if case.verb == verbs[k % len(verbs)]]
        which = mine[(turn // len(SIGNALS)) % len(mine)]
        found.append((which, chance.uniform(0.05, 0.95), SIGNALS[turn % len(SIGNALS)]))
    return found


def main() -> int:
    """Kill so many runs; 1 where one of them did not go on as it should."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbs", default="run,record,check,compare,accuracy")
    parser.add_argument("--share", default="1/1", metavar="k/n")
    parser.add_argument("--patience", type=float, default=BUSY, metavar="S", help="seconds that a command may take to its end")
    parser.add_argument("--json", type=Path, metavar="FILE", help="all trials, written after each of them")
    parser.add_argument("--table", type=Path, nargs="+", metavar="FILE", help="only print the table of such files")
    options = parser.parse_args()
    if options.table:
        found = [each for path in options.table for each in json.loads(path.read_text(encoding="utf-8"))]
        print("\n".join(table(found)))
        return 1 if any(each["faults"] for each in found) else 0
    number, parts = map(int, options.share.split("/"))
    chosen = [case for case in cases() if case.verb in options.verbs.split(",")]
    parent = Path(tempfile.mkdtemp(prefix="killed-"))
    print(f"folders of trials that fail stay in {parent}", flush=True)
    whole, found = whole_runs(chosen, parent, options.patience), []
    for which, part, given in planned(chosen, options.count, options.seed)[number - 1 :: parts]:
        found.append(trial(chosen[which], parent, whole[which], part * whole[which][1], given, options.patience))
        if options.json is not None:
            options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
        if told := "; ".join(found[-1]["faults"]):
            here = f"{found[-1]['verb']} (case {which}), {found[-1]['signal']} after {found[-1]['after']:.2f} s"
            print(f"{here}: {told}", flush=True)
    print("\n".join(table(found)))
    return 1 if any(each["faults"] for each in found) else 0


if __name__ == "__main__":
    raise SystemExit(main())
