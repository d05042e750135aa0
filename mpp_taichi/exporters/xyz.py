"""Extended XYZ, as ASE and OVITO read it: all particles with all digits, and every frame of a trajectory."""

from pathlib import Path

from mpp_taichi.exporters._source import Source
from mpp_taichi.recorders._extended_xyz import frame_lines

SUFFIXES = (".xyz", ".extxyz")
HOLDS_FRAMES = True


def write(source: Source, path: Path) -> None:
    """A frame after the other. Units are those of the scene, whatever a reader takes them for."""
    with open(path, "w", encoding="utf-8") as stream:
        for snapshot, enclosure in source.frames():
            stream.writelines(f"{line}\n" for line in frame_lines(snapshot, enclosure))
