"""Trajectory as NumPy arrays: raw frames in one part for each array, packed into one `.npz` at the end."""

import os
import shutil
import zipfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import fresh
from mpp_taichi.errors import StateError
from mpp_taichi.passport.carried import stamp
from mpp_taichi.recorders._trajectory_parts import TrajectoryPart
from mpp_taichi.recorders.trajectory_file import opened_array
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.walls._base import Enclosure


class ArrayWriter:
    """Writes the frames of a `.npz` file. Every method may raise OSError."""

    ARRAYS = ("position", "velocity")
    CHANGING = ("mass", "radius", "charge")  # where spheres merge, or masses and charges are functions of the time

    def __init__(self, path: Path) -> None:
        """Nothing is opened yet."""
        self.path = path
        self._parts: dict[str, TrajectoryPart] = {}
        self._times: list[float] = []
        self._steps: list[int] = []
        self._boxes: list[tuple[Any, Any]] = []  # period and origin
        self._particles: Snapshot | None = None
        self._recorded = False

    def begin(self) -> None:
        """Open the parts."""
        for name in self.ARRAYS:
            self._parts[name] = TrajectoryPart.begin(self._part(name))

    def write(self, snapshot: Snapshot, enclosure: Enclosure) -> None:
        """Append a frame."""
        if self._particles is None and snapshot.numbers_change:
            for name in self.CHANGING:
                self._parts[name] = TrajectoryPart.begin(self._part(name))
        for name, part in self._parts.items():
            part.write(np.ascontiguousarray(getattr(snapshot, name), dtype="<f8").tobytes())
        self._times.append(snapshot.time)
        self._steps.append(snapshot.step)
        self._boxes.append((enclosure.period, enclosure.origin))
        self._particles = snapshot

    def at_record(self) -> dict[str, Any]:
        """The frames so far, which are on the disk now."""
        lengths = {name: part.at_record() for name, part in self._parts.items()}
        self._recorded = True
        boxes = np.array(self._boxes, dtype=float).reshape(-1, 2, 3)
        return {"time": np.array(self._times), "step": np.array(self._steps), "boxes": boxes, "parts": lengths}

    def go_on(self, saved: Mapping[str, Any], snapshot: Snapshot) -> None:
        """Take the frames of a record from the parts that a killed run has left, or from the file of an interrupted run.

        Raises:
            StateError: they are not there, or have changed.
        """
        found = {name: TrajectoryPart.of_leftover(self._part(name), *entry) for name, entry in saved["parts"].items()}
        whole = {name: part for name, part in found.items() if part is not None}
        if len(whole) < len(found):
            for part in whole.values():
                part.close()
            whole = self._of_finished(saved["parts"])
        self._parts, self._particles, self._recorded = whole, snapshot, True
        self._times, self._steps = saved["time"].tolist(), saved["step"].tolist()
        self._boxes = [(tuple(period), tuple(origin)) for period, origin in saved["boxes"].tolist()]

    def _of_finished(self, lengths: Mapping[str, Any]) -> dict[str, TrajectoryPart]:
        found: dict[str, TrajectoryPart] = {}
        try:
            for name, entry in lengths.items():
                with opened_array(self.path, name) as stream:
                    found[name] = TrajectoryPart.of_finished(self._part(name), stream, *entry)
        except BaseException as error:
            for part in found.values():
                part.remove()
            if isinstance(error, StateError):
                raise StateError(f"{self.path}: {error}") from None
            raise
        return found

    def close(self, *, keep: bool) -> None:
        """Pack the frames and remove the parts; where packing fails, a run that has a record leaves them to go on from."""
        whole = self.path.with_name(self.path.name + ".part")
        packed = not keep
        try:
            if keep:
                with zipfile.ZipFile(fresh(whole), "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
                    self._pack(archive)
                stamp(whole, self.path.suffix)
                os.replace(whole, self.path)
                packed = True
        finally:
            if self._parts:
                whole.unlink(missing_ok=True)
            with ExitStack() as stack:
                for part in self._parts.values():
                    stack.callback(part.remove if packed or not self._recorded else part.close)

    def _part(self, name: str) -> Path:
        return self.path.with_name(f"{self.path.name}.{name}.part")

    def _pack(self, archive: zipfile.ZipFile) -> None:
        assert self._particles is not None
        small: dict[str, Any] = {"time": np.array(self._times), "step": np.array(self._steps)}
        fixed = (name for name in ("mass", "radius", "charge") if name not in self._parts)
        small |= {name: getattr(self._particles, name) for name in fixed}
        if self._particles.merged_into is not None:
            small["merged_into"] = self._particles.merged_into
        if any(any(period) for period, _ in self._boxes):
            small["period"], small["origin"] = (np.array(each, dtype=float) for each in zip(*self._boxes, strict=True))
        small["name"] = np.array(self._particles.name, dtype=np.str_)
        for name, values in small.items():
            with archive.open(_member(name), "w") as member:
                np.lib.format.write_array(member, values, allow_pickle=False)
        frames = (len(self._times), self._particles.particle_count)
        for name, part in self._parts.items():
            shape = frames if name in self.CHANGING else (*frames, 3)
            header = {"descr": "<f8", "fortran_order": False, "shape": shape}
            part.stream.seek(0)
            with archive.open(_member(name), "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                shutil.copyfileobj(part.stream, member, 1 << 20)


def _member(name: str) -> zipfile.ZipInfo:
    """An entry without the time of day, so that the same run writes the same bytes."""
    return zipfile.ZipInfo(f"{name}.npy")
