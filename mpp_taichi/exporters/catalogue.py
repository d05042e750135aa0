"""The exporter of a file, found by the file's suffix."""

import importlib
from pathlib import Path
from typing import Any

from mpp_taichi.atomic_file import whole_file, whole_text
from mpp_taichi.exporters._source import Source


def exporters() -> dict[str, Any]:
    """Every exporter, by the suffixes that it writes."""
    names = sorted(path.stem for path in Path(__file__).parent.glob("[!_]*.py") if path.stem != "catalogue")
    found = [importlib.import_module(f"mpp_taichi.exporters.{name}") for name in names]
    return {suffix: exporter for exporter in found for suffix in exporter.SUFFIXES}


def export(source: Source, target: Path) -> None:
    """Write a file whole or not at all.

    Raises:
        SceneError: the format cannot hold the data, or holds a single state and the source is a trajectory.
        OutputError: the file cannot be written.
    """
    known = exporters()
    exporter = known[target.suffix.lower()]
    if source.trajectory is not None and not getattr(exporter, "HOLDS_FRAMES", False):
        able = ", ".join(suffix for suffix, each in known.items() if getattr(each, "HOLDS_FRAMES", False))
        raise source.refuse(
            f"is a trajectory of {source.frame_count} frames, {target.suffix} holds one; all are held by {able}"
        )
    what = "the particles"
    if hasattr(exporter, "write"):
        with whole_file(target, what) as temporary:
            exporter.write(source, temporary)
    else:
        whole_text(target, exporter.text(source), what)
