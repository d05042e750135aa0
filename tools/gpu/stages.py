"""Stages of a GPU round: commands in the order of their worth, each with a limit of time and the file that it writes."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from families import FAMILIES

CERTIFICATES = ("ring", "cloth", "figure_eight")  # gravity of thousands of bodies, springs, few bodies
TESTS = ("tests/integrators/test_copies_elsewhere.py", "tests/contacts/test_contacts_on_devices.py")
FAILED_ROWS = 4  # exit code where a certificate or a question has failed
SIZES = {"adaptive": 25.0}  # seconds within which a family begins a size, where it takes longer to compile than others
SIZE_SECONDS = 8.0
WITH_FAMILY = 30.0  # seconds of a process beside its sizes: start, compilation, the largest size


@dataclass(frozen=True)
class Stage:
    """One process of a round.

    seconds       its limit of time
    file          what it writes, as JSON
    chosen        the part of the file that the round keeps
    good_codes    exit codes with which all is well
    keeps_parts   whether the file of a process that was cut off is worth keeping
    """

    name: str
    kind: str
    command: tuple[str, ...]
    seconds: float
    file: Path | None = None
    chosen: Callable = lambda data: data
    good_codes: tuple[int, ...] = (0,)
    keeps_parts: bool = False


def stages_of(backends, out, *, short=False):
    """All stages, those of the first backend before those of the others."""
    found = [Stage("info", "info", program("info"), 60.0)]
    found += [certificate(scene, backends, out, short) for scene in CERTIFICATES[: 1 if short else None]] if backends else []
    for k, backend in enumerate(backends):
        found += rates(backend, out, short)
        found += [film(backend, out, short), questions(backend, out, short)]
        found += [tests()] if k == 0 and not short else []
    return found


def program(*words):
    """The command line of the program."""
    return (sys.executable, "-m", "mpp_taichi", *map(str, words))


def certificate(scene, backends, out, short):
    """`compare`: do the backends agree, and how fast are they?"""
    folder = out / f"compare-{scene}"
    words = ["compare", f"scenes/{scene}.yaml", "--backends", ",".join(dict.fromkeys((*backends, "cpu"))), "--quiet"]
    words += ["--budget", "5s" if short else "25s", "--out", folder, "--fresh", *(["--steps", 5] if short else [])]
    return Stage(f"certificate of {scene}", "certificate", program(*words), 90.0, folder / "compare.json", rows_of)


def rows_of(data):
    """The rows of a certificate, without what only its own page needs."""
    kept = ("label", "precision", "status", "reason", "verdict", "device", "step_seconds", "rates", "peaks")
    return [{key: row.get(key) for key in kept} for row in data["rows"]]


def rates(backend, out, short):
    """`rates.py` for each family and precision."""
    script = Path(__file__).with_name("rates.py")
    found = []
    for family in FAMILIES.values():
        seconds = SIZES.get(family.name, SIZE_SECONDS)
        for precision in family.precisions[-1:] if short else family.precisions:
            file = out / f"rates-{family.name}-{backend}-{precision}.json"
            words = [family.name, backend, precision, "--json", file, *(["--sizes", 1] if short else ["--seconds", seconds])]
            command = (sys.executable, str(script), *map(str, words))
            name = f"{family.name} on {backend} in {precision}"
            found.append(Stage(name, "rates", command, seconds + WITH_FAMILY, file, keeps_parts=True))
    return found


def film(backend, out, short):
    """A film of `scenes/ring.yaml`; the time of the stage is the time of the whole command `record`."""
    words = ["record", "scenes/ring.yaml", "--backend", backend, "--video", out / f"ring-{backend}.mp4", "--fresh", "--quiet"]
    words += ["--duration", 0.2 if short else 4, *(["--size", "320x180"] if short else [])]
    return Stage(f"film on {backend}", "film", program(*words), 60.0)


def questions(backend, out, short):
    """`verify`: questions with known answers."""
    folder = out / f"verify-{backend}"
    words = ["verify", "--backend", backend, "--quick", "--out", folder, "--quiet"]  # which goes on where it was cut off
    words += ["--only", "refusals"] if short else []
    codes = (0, FAILED_ROWS)  # what failed is a number of the page
    return Stage(f"verify on {backend}", "verify", program(*words), 170.0, folder / "verify.json", counts_of, codes)


def counts_of(data):
    """How many questions ended in which way, and those that failed."""
    rows = data["rows"]
    return {
        "counts": {status: sum(row["status"] == status for row in rows) for status in sorted({row["status"] for row in rows})},
        "failed": [row for row in rows if row["status"] == "failed"][:20],
    }


def tests():
    """The families of tests that run on a Vulkan device."""
    words = ("-m", "pytest", *TESTS, "-q", "--thorough", "-k", "vulkan or device or copies", "-x")
    return Stage("tests on vulkan", "tests", (sys.executable, *words), 150.0)
