"""H5MD 1.1: particles in HDF5, every frame of a trajectory.

Source: P. de Buyl, P. H. Colberg, F. Höfling, Comput. Phys. Commun. 185 (2014) 1546; nongnu.org/h5md, version 1.1.0.
"""

import importlib.util
import itertools
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.errors import BackendError
from mpp_taichi.exporters._source import Source
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.version import __version__
from mpp_taichi.walls._base import Enclosure

SUFFIXES = (".h5md", ".h5")
HOLDS_FRAMES = True
AUTHOR = "not stated"  # the format wants a name, and no scene has one
GROUP = "trajectory"  # any name is allowed; without a topology MDAnalysis counts the particles of the group of this name
NO_PARTICLE = -1  # the `id` of a particle that has merged into another particle


def write(source: Source, path: Path) -> None:
    """Position, velocity, mass, radius, charge, name, the box that repeats, springs as connectivity, and the scene's units.

    Elements that may differ from frame to frame are time-dependent, all with the same `step` and `time`. Where spheres merge,
    `id` is −1 for a sphere that is gone. No `unit` attributes: readers know only the units of molecules; a scene's units stand
    in `parameters`.
    SceneError where steps of frames do not increase, or another axis repeats than before. BackendError without h5py.
    """
    if importlib.util.find_spec("h5py") is None:
        raise BackendError("H5MD needs h5py: pip install 'mpp-taichi[formats]'; .xyz needs nothing")
    import h5py

    _check_steps(source)
    # In memory: a file of HDF5 that cannot be finished, as on a full disk, stays open and breaks the next file of the process.
    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        _fill(file, source)
        file.flush()
        image = file.id.get_file_image()
    path.write_bytes(image)


def _fill(file: Any, source: Source) -> None:
    frames = source.frames()
    first = next(frames)
    _describe(file, source)
    group = file.create_group(f"particles/{GROUP}")
    elements = _elements(group, source.frame_count, *first)
    _write_fixed(group, first[0], set(elements))
    _write_springs(file, group, first[0])
    for frame, (snapshot, enclosure) in enumerate(itertools.chain([first], frames)):
        if enclosure.repeats != first[1].repeats:
            raise source.refuse(f"H5MD has one kind of boundary for all frames, but frame {frame} has another kind")
        values = {key: getattr(snapshot, key) for key in elements if hasattr(snapshot, key)}
        values |= {"edges": enclosure.period, "id": np.where(snapshot.present, np.arange(len(snapshot.mass)), NO_PARTICLE)}
        for key, element in elements.items():
            element["value"][frame] = values[key]
        elements["position"]["step"][frame] = snapshot.step
        elements["position"]["time"][frame] = snapshot.time


def _check_steps(source: Source) -> None:
    if source.trajectory is None:
        return
    step = source.trajectory.step
    if back := (np.flatnonzero(step[1:] <= step[:-1]) + 1).tolist():
        raise source.refuse(
            f"H5MD has steps that increase, and frame {back[0]} goes from {step[back[0] - 1]} to {step[back[0]]}"
        )


def _describe(file: Any, source: Source) -> None:
    file.create_group("h5md").attrs["version"] = np.array([1, 1], np.int32)
    creator = {"name": "mpp_taichi", "version": __version__}
    for group, attributes in (("author", {"name": AUTHOR}), ("creator", creator)):
        made = file["h5md"].create_group(group)
        for key, text in attributes.items():
            made.attrs[key] = _fixed_length(text)
    if source.spec is not None:
        parameters = file.create_group("parameters")
        parameters.attrs["title"] = source.spec.title
        for key, unit in (source.spec.units or {}).items():
            parameters.attrs[f"{key}_unit"] = unit


def _elements(group: Any, frame_count: int, snapshot: Snapshot, enclosure: Enclosure) -> dict[str, Any]:
    """Time-dependent elements by their key, still to be filled."""
    count = snapshot.particle_count
    box = group.create_group("box")
    box.attrs["dimension"] = 3
    box.attrs["boundary"] = np.array([b"periodic" if repeats else b"none" for repeats in enclosure.repeats])
    shapes: dict[str, tuple[int, ...]] = {"position": (count, 3), "velocity": (count, 3)}
    if any(enclosure.repeats):
        shapes["edges"] = (3,)
    if snapshot.numbers_change:
        shapes |= {"mass": (count,), "radius": (count,), "charge": (count,), "id": (count,)}
    elements: dict[str, Any] = {}
    for key, shape in shapes.items():
        element = (box if key == "edges" else group).create_group(key)
        kind = {"dtype": "i8", "fillvalue": NO_PARTICLE} if key == "id" else {"dtype": "f8"}
        element.create_dataset("value", (frame_count, *shape), **kind)
        if elements:  # hard links, as the format asks for
            element["step"], element["time"] = elements["position"]["step"], elements["position"]["time"]
        else:
            element.create_dataset("step", (frame_count,), dtype="i8")
            element.create_dataset("time", (frame_count,), dtype="f8")
        elements[key] = element
    return elements


def _write_fixed(group: Any, snapshot: Snapshot, moving: set[str]) -> None:
    import h5py

    for key in ("mass", "radius", "charge"):
        if key not in moving:
            group.create_dataset(key, data=getattr(snapshot, key), dtype="f8")
    if any(snapshot.name):
        group.create_dataset("name", data=snapshot.name, dtype=h5py.string_dtype())


def _write_springs(file: Any, group: Any, snapshot: Snapshot) -> None:
    between = snapshot.springs.between[snapshot.springs.whole]
    if len(between):
        springs = file.create_dataset("connectivity/springs", data=between, dtype="i4")
        springs.attrs["particles_group"] = group.ref
    if len(snapshot.rods):
        rods = file.create_dataset("connectivity/rods", data=snapshot.rods.between, dtype="i4")
        rods.attrs["particles_group"] = group.ref


def _fixed_length(text: str) -> np.bytes_:
    return np.bytes_(text.encode("ascii"))
