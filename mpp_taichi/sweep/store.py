"""Sweep store: the folder of a sweep. `sweep.json` says which members there are; `chunks/` holds the rows that are done."""

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.device.availability import TAICHI_VERSION
from mpp_taichi.errors import ArgumentError, SceneError, StateError
from mpp_taichi.report.expectations import label_of
from mpp_taichi.scene.load import load_resolved
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.sweep_spec import SweepSpec
from mpp_taichi.sweep.chunk import Columns, name_of, plain_text, read
from mpp_taichi.sweep.member import UNREAD, scene_of, whole_scene
from mpp_taichi.sweep.order import coarse_to_fine
from mpp_taichi.sweep.plan import Plan
from mpp_taichi.sweep.refinement import GridRefinement
from mpp_taichi.sweep.structure import Own, own_of
from mpp_taichi.version import __version__

FORMAT = 1
FILE = "sweep.json"
LOOKED_AT = 33  # members by which it is known which parameters of forces vary
CHUNKS = "chunks"
SUFFIX = ".sweep"


@dataclass(frozen=True, eq=False)
class SweepStore:
    """A sweep with its folder.

    device   backend and precision of all members, as plain values
    chunk    members of a chunk
    """

    folder: Path
    resolved: Mapping[str, Any]
    source: str
    device: Mapping[str, Any]
    chunk: int

    @cached_property
    def scene(self) -> SceneSpec:
        """The scene as it is written, with its block `sweep:`."""
        return load_resolved(self.resolved, self.source)

    @property
    def sweep(self) -> SweepSpec:
        """The checked block `sweep:`."""
        found: SweepSpec = self.scene.sweep
        return found

    @cached_property
    def plan(self) -> Plan:
        """The members."""
        return Plan(self.sweep)

    @cached_property
    def order(self) -> np.ndarray:
        """All members, coarse to fine."""
        return coarse_to_fine(self.plan.shape, spread=self.sweep.sample is None)

    @cached_property
    def measures(self) -> list[str]:
        """A name for each measure: that of its quantity, with its parameters where a quantity is measured twice."""
        names = [each.quantity for each in self.sweep.measure]
        return [
            name if names.count(name) == 1 else label_of(each) for name, each in zip(names, self.sweep.measure, strict=True)
        ]

    @cached_property
    def known(self) -> dict[str, Any]:
        """What all results depend on, beside the values of the members."""
        plain = {key: value for key, value in self.resolved.items() if key not in UNREAD}
        block = {key: value for key, value in plain.pop("sweep").items() if key in ("measure", "stop")}
        expected = None if block.get("measure") else self.resolved.get("expect")
        versions = {"mpp_taichi": __version__, "taichi": TAICHI_VERSION, "numpy": np.__version__}
        return {"scene": plain, "sweep": block, "expect": expected, "device": dict(self.device), "versions": versions}

    @cached_property
    def _known_text(self) -> str:
        return plain_text(self.known)

    @cached_property
    def own(self) -> Own:
        """The parameters of forces that vary, by some members of the whole sweep: the same ones for all chunks."""
        numbers = np.unique(np.linspace(0, self.plan.count - 1, LOOKED_AT).astype(np.int64))
        numbers = np.unique(np.concatenate([numbers, self.order[:LOOKED_AT]]))
        specs = []
        for values in self.plan.values(numbers):
            with suppress(SceneError):
                specs.append(scene_of(self.resolved, self.source, values))
        return own_of(specs) if specs else frozenset()

    def member(self, number: int) -> SceneSpec:
        """The scene of a member with its pictures.

        Raises:
            ArgumentError: there is no such member.
        """
        if not 0 <= number < self.plan.count:
            raise ArgumentError(f"member {number}: the sweep has the members 0 to {self.plan.count - 1:,}")
        return whole_scene(self.resolved, self.source, self.plan.values([number])[0])

    @cached_property
    def _refinement(self) -> GridRefinement | None:
        if self.sweep.refine is None:
            return None
        ordered = [self.plan.is_ordered(k) for k in range(len(self.plan.shape))]
        return GridRefinement(self.plan.shape, ordered, self.sweep.refine)

    @cached_property
    def _rounds(self) -> list[np.ndarray]:
        """The chunks of the rounds of a refinement so far."""
        assert self._refinement is not None
        return self._chunks_of(self._refinement.first())

    def _chunks_of(self, members: np.ndarray) -> list[np.ndarray]:
        return [members[begin : begin + self.chunk] for begin in range(0, len(members), self.chunk)]

    def grow(self) -> None:
        """Add the chunks of the next rounds of a refinement, as far as all chunks before them are done.

        Which members a round has follows from the rows of the rounds before, so that all processes find the same chunks.
        """
        while self._adds_round():
            pass

    def _adds_round(self) -> bool:
        if self._refinement is None or self._refinement.is_over:
            return False
        known, status = np.zeros(self.plan.count, bool), np.zeros(self.plan.count, np.int8)
        values = np.full((self.plan.count, len(self.measures)), np.nan)
        for number in range(len(self._rounds)):
            columns = self.columns(number)
            if columns is None:
                return False
            known[columns.number], status[columns.number] = True, columns.status
            values[columns.number] = columns.values
        found = self._refinement.next(known, status, values)
        self._rounds.extend(self._chunks_of(found))
        return len(found) > 0

    @property
    def chunk_count(self) -> int:
        """Number of chunks; of a refinement those of the rounds so far."""
        return -(-self.plan.count // self.chunk) if self._refinement is None else len(self._rounds)

    def members(self, number: int) -> np.ndarray:
        """The members of a chunk."""
        if self._refinement is None:
            return self.order[number * self.chunk : (number + 1) * self.chunk]
        if number >= len(self._rounds):
            self.grow()
        return self._rounds[number]

    def path(self, number: int) -> Path:
        """The file of a chunk."""
        members = self.members(number)
        return self.folder / CHUNKS / name_of(self._known_text, self.plan.values(members), members.tolist())

    def columns(self, number: int) -> Columns | None:
        """The rows of a chunk; None where it is not done."""
        return read(self.path(number), self.members(number), len(self.measures))

    def missing(self) -> list[int]:
        """Numbers of the chunks that are not done; of a refinement those of the present round."""
        self.grow()
        return [number for number in range(self.chunk_count) if self.columns(number) is None]

    def save(self) -> None:
        """Write `sweep.json`.

        Raises:
            OutputError: it cannot be written.
        """
        facts = {
            "format": FORMAT,
            "scene": dict(self.resolved),
            "source": self.source,
            "device": dict(self.device),
            "chunk": self.chunk,
            "members": self.plan.count,
            "versions": self.known["versions"],
        }
        text, path = json.dumps(facts, indent=1), self.folder / FILE
        with suppress(OSError):
            if path.read_text(encoding="utf-8") == text:
                return
        with whole_file(path, "the description of the sweep", shared=True) as temporary:
            temporary.write_text(text, encoding="utf-8")


def opened(folder: Path) -> SweepStore:
    """The sweep of a folder.

    Raises:
        StateError: there is none, or its description cannot be read.
    """
    path = folder / FILE
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise StateError(f"{folder}: no sweep, it has no {FILE}") from None
    except (OSError, ValueError) as error:
        raise StateError(f"{path}: cannot be read: {error}") from None
    if not isinstance(facts, dict) or facts.get("format") != FORMAT:
        raise StateError(f"{path}: is no description of a sweep of format {FORMAT}")
    return SweepStore(folder, facts["scene"], facts["source"], facts["device"], int(facts["chunk"]))
