"""Extended XYZ, as ASE and OVITO read it: all particles with all digits, and every frame of a trajectory."""

from pathlib import Path

from mpp_taichi.exporters._source import Source
from mpp_taichi.recorders._extended_xyz import frame_lines

SUFFIXES = (".xyz", ".extxyz")
HOLDS_FRAMES = True


def write(source: Source, path: Path) -> None:
    """One frame after the other. Units are the units of the scene, whatever units a reader assumes."""
    with open(path, "w", encoding="utf-8") as stream:
        for snapshot, enclosure in source.frames():
            stream.writelines(f"{line}\n" for line in frame_lines(snapshot, enclosure))
