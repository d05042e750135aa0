"""Killed runs: does the same command go on to the same results, and is nothing left behind?

    python tools/checks/kill_runs.py [--count 200] [--seed 1] [--verbs run,record,…] [--keep]

Each trial starts a command, sends it SIGKILL (three of five times), SIGTERM or SIGINT at a random moment, looks for processes
that are left over after two seconds, and gives the same command again. The second end must have the results of a command that
was never killed, and no temporary file and no lock may be left. Prints one line for each trial that fails, and a table:

    lost    the time by which both starts together took longer than a whole run and one more start [s], after SIGKILL

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
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
MARK = "MPP_TAICHI_KILLED"
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
GRACE = 2.0  # seconds after which no process of a killed command may be left
BUSY = 100  # seconds that an end may take at most

ORBITS = """
title: Orbits
particles:
  - body: {name: sun, mass: 1, position: [0, 0, 0]}
  - body: {name: a, mass: 1e-3, position: [1, 0, 0], velocity: [0, 1, 0]}
  - body: {name: b, mass: 1e-4, position: [-1.7, 0, 0.1], velocity: [0, -0.75, 0]}
forces: [{newtonian_gravity: {strength: 1}}]
inspect: [{x: time, y: {kinetic_energy: {}}}]
"""
NETWORK = """
title: Network
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0], free: false}
  - body: {name: b, mass: 1, position: [1, 0, 0.3]}
  - body: {name: c, mass: 0.7, position: [1.7, 0, 0.9]}
springs: [{link: {between: [a, b], stiffness: 200}}, {link: {between: [b, c], stiffness: 80, damping: 0.01}}]
forces: [{uniform_gravity: {acceleration: [0, 0, -9.81]}}]
inspect: [{x: time, y: {kinetic_energy: {}}}]
timeline: [{at: 1.00000012, set: {"springs[0].link.stiffness": 150}}]
"""
GAS = """
title: Gas
dimensions: 2
particles: [{gas: {name: gas, count: 150, lower: [-7, -7], upper: [7, 7], radius: 0.35, speed: 1}}]
walls: [{box: {lower: [-7, -7], upper: [7, 7]}}]
contacts: {hard_spheres: {solver: event_driven}}
inspect: [{x: time, y: {kinetic_energy: {}}}]
"""
SHORT = ORBITS + "integrator: {leapfrog: {dt: 1e-3}}\nrun: {duration: 2}\n"
OUTPUTS = ("--diagnostics", "t.csv", "--snapshot", "e.npz", "--inspect", "p.csv", "--json")


@dataclass
class Case:
    """A command, the file that it reads, and how its results are taken from a folder and its standard output."""

    verb: str
    scenes: dict[str, str]
    words: list[str]
    results: Callable[[Path, str], object]
    goes_on: bool = True  # by an archive


def state_and_tables(folder: Path, told: str) -> object:
    """The end of a run: its arrays, its tables and its verdict."""
    found = json.loads(told)
    with np.load(folder / "e.npz") as end:
        arrays = {name: end[name].tobytes() for name in end}
    facts = {name: found[name] for name in ("status", "steps", "time", "relative_energy_error_max", "findings", "phases")}
    return facts, arrays, *((folder / name).read_bytes() for name in ("t.csv", "p.csv"))


def film(folder: Path, told: str) -> object:
    """The bytes of a film, and the number of steps."""
    return (folder / "f.mp4").read_bytes(), json.loads(told)["steps"]


def statuses(folder: Path, told: str) -> object:
    """The status and the energy error of every scene."""
    return [(each["scene"], each["status"], each["relative_energy_error_max"]) for each in json.loads(told)["scenes"]]


def verdicts(folder: Path, told: str) -> object:
    """The contenders of a comparison, with their status."""
    found = json.loads(told)
    names = ("label", "variant", "precision", "status", "verdict")
    return found["status"], sorted(str([row.get(name) for name in names]) for row in found["rows"])


def choice(folder: Path, told: str) -> object:
    """Whether a study was written whole, with its reference."""
    found = json.loads(told)
    return found["reference"] is not None, len(found["rows"]) > 0, sorted(each.name for each in folder.rglob("*.html"))


def cases() -> list[Case]:
    """The commands."""

    def run(text: str, integrator: str, duration: float) -> Case:
        text += f"integrator: {integrator}\nrun: {{duration: {duration!r}}}\n"
        return Case("run", {"s.yaml": text}, ["run", "s.yaml", "--headless", *OUTPUTS], state_and_tables)

    short = {f"{name}.yaml": SHORT for name in "abcd"}
    recorded = ORBITS + "integrator: {leapfrog: {dt: 1e-3}}\nrun: {duration: 40}\nrecord: {size: [640, 360], seconds: 20}\n"
    return [
        run(ORBITS, "{leapfrog: {dt: 1e-6}}", 200),
        run(ORBITS, "{ias15: {dt: 1}}", 600_000),
        run(NETWORK, "{leapfrog: {dt: 1e-6}}", 80.00000012),
        run(NETWORK, "{bdf2: {dt: 1e-4}}", 80.00000012),
        run(GAS, "{event_driven: {dt: 0.05}}", 30_000),
        Case("record", {"s.yaml": recorded}, ["record", "s.yaml", "--video", "f.mp4", "--json"], film),
        Case("check", short, ["check", *short, "--jobs", "2", "--json"], statuses, goes_on=False),
        Case(
            "compare",
            {"s.yaml": SHORT},
            ["compare", "s.yaml", "--backends", "cpu", "--steps", "200", "--json"],
            verdicts,
            goes_on=False,
        ),
        Case("accuracy", {"s.yaml": SHORT}, ["accuracy", "s.yaml", "--budget", "8", "--json"], choice, goes_on=False),
    ]


def begin(case: Case, folder: Path, mark: str) -> subprocess.Popen:
    """Start the command of a case in a folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "mpp_taichi", *case.words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), MARK: mark},
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


def trial(case: Case, parent: Path, whole: tuple[object, float], moment: float, number: int) -> tuple[list[str], float | None]:
    """The faults of one killed run, and the seconds that were lost."""
    folder, mark = folder_of(case, parent), uuid.uuid4().hex
    wanted, seconds = whole
    process = begin(case, folder, mark)
    began = time.monotonic()
    try:
        process.wait(timeout=moment)
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    try:
        _, told = process.communicate(timeout=BUSY)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return [f"did not end within {BUSY} s"], None
    first = time.monotonic() - began
    faults = ["a traceback"] if "Traceback" in told else []
    until = time.monotonic() + GRACE
    while left_over(mark) and time.monotonic() < until:
        time.sleep(0.1)
    if rest := left_over(mark):
        faults.append(f"processes left: {rest}")
        for each in rest:
            with contextlib.suppress(OSError):
                os.kill(each, signal.SIGKILL)
    again = begin(case, folder, uuid.uuid4().hex)
    began = time.monotonic()
    out, told = again.communicate(timeout=BUSY)
    second = time.monotonic() - began
    try:
        if case.results(folder, out) != wanted:
            faults.append("other results")
    except (OSError, ValueError, KeyError) as error:
        faults.append(f"no results, {error!r}: {told[-200:]!r}")
    if rest := [str(each.relative_to(folder)) for pattern in ("*.part*", ".*.lock") for each in folder.rglob(pattern)]:
        faults.append(f"files left: {rest}")
    if not faults:
        shutil.rmtree(folder)
    killed = number == signal.SIGKILL and case.goes_on and process.returncode != 0
    return faults, first + second - seconds if killed else None


def main() -> int:
    """Kill so many runs; 1 where one of them did not go on as it should."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbs", default="run,record,check,compare,accuracy")
    options = parser.parse_args()
    chance, wrong = random.Random(options.seed), 0
    lost: dict[str, list[float]] = defaultdict(list)
    tries: dict[str, int] = defaultdict(int)
    chosen = [case for case in cases() if case.verb in options.verbs.split(",")]
    parent = Path(tempfile.mkdtemp(prefix="killed-"))
    whole = []
    for case in chosen:
        folder, began = folder_of(case, parent), time.monotonic()
        process = begin(case, folder, uuid.uuid4().hex)
        out, told = process.communicate(timeout=BUSY)
        try:
            whole.append((case.results(folder, out), time.monotonic() - began))
        except (OSError, ValueError, KeyError) as error:
            raise SystemExit(f"{case.words}: no results without a kill: {error!r}\n{told[-2000:]}") from None
        print(f"{' '.join(case.words[:2])}: a whole run takes {whole[-1][1]:.1f} s", flush=True)
    for k in range(options.count):
        which = k % len(chosen)
        case = chosen[which]
        moment, number = chance.uniform(0.05, 0.95) * whole[which][1], chance.choice(SIGNALS)
        faults, seconds = trial(case, parent, whole[which], moment, number)
        tries[case.verb] += 1
        if seconds is not None:
            lost[case.verb].append(seconds)
        if faults:
            wrong += 1
            told = "; ".join(faults)
            print(f"{case.verb} (case {which}), {signal.Signals(number).name} after {moment:.2f} s: {told}", flush=True)
    print("verb      trials  lost, median [s]  lost, largest [s]")
    for verb, count in tries.items():
        figures = f"{statistics.median(lost[verb]):16.1f}  {max(lost[verb]):17.1f}" if lost[verb] else ""
        print(f"{verb:9} {count:6}  {figures}")
    print(f"{options.count} killed, {wrong} of them did not go on to the same results or left something behind")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
