"""Store: samples kept in a file, so that a second study goes on where the first one ended.

A file belongs to one scene (its physics, not its name), one machine and one set of versions; others have files of their own.
It is written while the study goes on, so that a study that is killed loses a second of its work and the run that was going on.
"""

import hashlib
import json
import platform
import time as clock
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.atomic_file import whole_file, whole_text
from mpp_taichi.device.availability import TAICHI_VERSION, availability
from mpp_taichi.errors import OutputError

FORMAT = 3
EVERY = 1.0  # seconds of the wall clock between two writings
SHARE = 0.01  # of the time of a processor, that writing may take


def identity(problem: Problem, asked_span: float, version: str) -> dict[str, Any]:
    """The common properties of all samples of a store: scene, machine and versions."""
    return {
        "format": FORMAT,
        "scene": problem.identity(),
        "asked_span": asked_span,
        "cpu": availability("cpu")["device"],
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "taichi": TAICHI_VERSION,
        "mpp_taichi": version,
    }


class Store:
    """Samples by configuration, each written as soon as it is measured; final positions are in a file of their own."""

    def __init__(self, folder: Path, known: dict[str, Any], *, fresh: bool = False) -> None:
        """Read the samples of the same scene, machine and versions, unless a `fresh` start is asked for.

        Raises:
            OutputError: the file exists but cannot be read.
        """
        name = hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()[:12]
        self.known, self.path, self.folder = known, folder / f"samples-{name}.json", folder / f"samples-{name}"
        self.span: float | None = None
        self.notes: dict[str, Any] = {}
        self._samples: dict[str, Sample] = {}
        self.resumed = 0
        self._due = clock.monotonic() + EVERY
        for left in (*self.folder.glob("*.part.npy"), self.path.with_name(f"{self.path.stem}.part.json")):
            left.unlink(missing_ok=True)  # of a study that was killed while it wrote
        if not fresh and self.path.is_file():
            self._read()

    def __iter__(self) -> Iterator[Sample]:
        """All samples, in the order in which they were measured."""
        return iter(self._samples.values())

    def get(self, configuration: Configuration) -> Sample | None:
        """The sample of a configuration, or None."""
        return self._samples.get(configuration.key)

    def add(self, sample: Sample) -> None:
        """Keep a new or changed sample, and write all samples where it is time for it."""
        key = sample.configuration.key
        self._samples[key] = sample
        if sample.end is not None:
            with whole_file(self.folder / f"{key}.npy", "the positions of a sample") as temporary:
                np.save(temporary, sample.end)
        self.save_when_due()

    def save_when_due(self) -> None:
        """Write all samples where it is time for it."""
        if clock.monotonic() >= self._due:
            self.save()

    def forget(self) -> None:
        """Forget all samples, which were measured in another way than those that follow."""
        self._samples.clear()

    def save(self) -> None:
        """Write the samples."""
        began = clock.thread_time()
        text = json.dumps(
            {
                "known": self.known,
                "span": self.span,
                "notes": self.notes,
                "samples": [sample.facts() for sample in self._samples.values()],
            }
        )
        whole_text(self.path, text, "the samples")
        self._due = clock.monotonic() + max(EVERY, (clock.thread_time() - began) / SHARE)

    def _read(self) -> None:
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
            self.span, self.notes = found["span"], found["notes"]
            for facts in found["samples"]:
                sample = Sample.of(facts, None)
                path = self.folder / f"{sample.configuration.key}.npy"
                if sample.status == "ok":
                    sample.end = np.load(path, allow_pickle=False)
                self._samples[sample.configuration.key] = sample
        except (OSError, ValueError, KeyError, TypeError, EOFError) as error:
            raise OutputError(f"{self.path}: not the samples of a study: {error}; --fresh starts anew") from error
        self.resumed = len(self._samples)
