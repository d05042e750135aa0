"""Commands that are killed by kill_runs.py, and what their results are."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

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
STUDIED = ORBITS + "integrator: {leapfrog: {dt: 1e-2}}\nrun: {duration: 60}\n"
MEMORY_OF_CHECK = ("out/check-*.journal", "out/check-*.runs/*.run")  # of whole scenes, and within a scene
FIRST_STEP = ("run", "s.yaml", "--headless", "--steps", "1", "--no-archive")
FIRST_PICTURE = ("record", "s.yaml", "--steps", "1", "--duration", "1", "--fps", "1", "--video", "first.mp4", "--no-archive")
OUTPUTS = ("--diagnostics", "t.csv", "--snapshot", "e.npz", "--inspect", "p.csv", "--json")


@dataclass
class Case:
    """A command, the file that it reads, and how its results are taken from a folder and its standard output."""

    verb: str
    scenes: dict[str, str]
    words: list[str]
    results: Callable[[Path, str], object]
    start: tuple[str, ...]  # the words of a command that only starts
    memory: tuple[str, ...] = ("out/*.run",)  # the archives or journals from which it goes on


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
    """The contenders of a comparison, with their verdicts and what decided them."""
    found = json.loads(told)
    names = ("label", "variant", "precision", "status", "verdict", "decided_by")
    return found["status"], found["steps_compared"], sorted(str([row.get(name) for name in names]) for row in found["rows"])


def errors(folder: Path, told: str) -> object:
    """The reference of a study, and all of its runs with their errors."""
    found = json.loads(told)
    reference = {name: found["reference"][name] for name in ("integrator", "steps", "bar", "differences")}
    rows = sorted(str((row["key"], row["status"], row["errors"])) for row in found["rows"])
    return found["status"], reference, rows, sorted(each.name for each in folder.rglob("*.html"))


def cases() -> list[Case]:
    """The commands."""

    def run(text: str, integrator: str, duration: float) -> Case:
        text += f"integrator: {integrator}\nrun: {{duration: {duration!r}}}\n"
        return Case("run", {"s.yaml": text}, ["run", "s.yaml", "--headless", *OUTPUTS], state_and_tables, FIRST_STEP)

    checked = {f"{name}.yaml": ORBITS + "integrator: {leapfrog: {dt: 1e-6}}\nrun: {duration: 4}\n" for name in "abcdef"}
    starts = {
        f"{name}.yaml": ORBITS + "integrator: {leapfrog: {dt: 1e-6}}\nrun: {duration: 1e-6}\n" for name in ("first", "last")
    }
    recorded = ORBITS + "integrator: {leapfrog: {dt: 1e-3}}\nrun: {duration: 40}\nrecord: {size: [320, 180], seconds: 16}\n"
    few = ["--integrators", "leapfrog,pefrl,rk4,yoshida4", "--precisions", "f64", "--backends", "cpu", "--budget", "120"]
    return [
        run(ORBITS, "{leapfrog: {dt: 1e-6}}", 25),
        run(ORBITS, "{ias15: {dt: 1}}", 25_000),
        run(NETWORK, "{leapfrog: {dt: 1e-6}}", 8.00000012),
        run(NETWORK, "{bdf2: {dt: 1e-4}}", 7.00000012),
        run(GAS, "{event_driven: {dt: 0.05}}", 2_500),
        Case("record", {"s.yaml": recorded}, ["record", "s.yaml", "--video", "f.mp4", "--json"], film, FIRST_PICTURE),
        Case(
            "check",
            checked | starts,
            ["check", *checked, "--jobs", "2", "--json"],
            statuses,
            ("check", "first.yaml", "last.yaml", "--jobs", "2", "--no-archive"),
            MEMORY_OF_CHECK,
        ),
        Case(
            "compare",
            {"s.yaml": SHORT},
            ["compare", "s.yaml", "--backends", "cpu,numpy", "--steps", "200", "--json"],
            verdicts,
            ("compare", "--help"),
            ("out/s.compare/journal",),
        ),
        Case(
            "accuracy",
            {"s.yaml": STUDIED},
            ["accuracy", "s.yaml", *few, "--json"],
            errors,
            ("accuracy", "--help"),
            ("out/s.accuracy/samples-*.json",),
        ),
    ]
