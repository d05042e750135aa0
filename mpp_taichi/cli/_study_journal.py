"""The journal of a study on the command line: what all its results depend on, and the line that says what it goes on with."""

import argparse
import hashlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi import __version__
from mpp_taichi.archive.journal import Journal
from mpp_taichi.cli._terminal import say
from mpp_taichi.device.availability import TAICHI_VERSION, cpu_name

FORMAT = 1
PACKAGE = Path(__file__).parents[1]


def study_journal(path: Path, verb: str, arguments: argparse.Namespace, known: Mapping[str, Any]) -> Journal:
    """The journal of a study with these options; `known` is what its results depend on, beside versions and machine.

    Raises:
        OutputError: another process writes the journal, or it cannot be read.
    """
    everything = {
        "format": FORMAT,
        "verb": verb,
        "version": __version__,
        "program": program_digest(),
        "taichi": TAICHI_VERSION,
        "numpy": np.__version__,
        "cpu": cpu_name(),
        **known,
    }
    return Journal(None if arguments.no_archive else path, everything, fresh=arguments.fresh, tell=say)


@cache
def program_digest() -> str:
    """A digest of the names, sizes and times of the program's files: a changed program measures anew."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        facts = path.stat()
        digest.update(f"{path.relative_to(PACKAGE)} {facts.st_size} {facts.st_mtime_ns}\n".encode())
    return digest.hexdigest()[:12]


def went_on(journal: Journal) -> dict[str, Any] | None:
    """What a study went on with, for --json; None where it began anew."""
    if not journal.taken:
        return None
    return {"file": str(journal.path), "results": len(journal.taken), "torn_bytes": journal.torn}


def torn(journal: Journal) -> str:
    """What was lost of a record, for a line; empty where nothing was."""
    return f"; a record that was being written, {journal.torn:,} bytes, is lost" if journal.torn else ""
