"""Which exporter writes a file: by its suffix."""

import importlib
from pathlib import Path
from typing import Any


def exporters() -> dict[str, Any]:
    """Every exporter, by the suffix that it writes."""
    names = sorted(path.stem for path in Path(__file__).parent.glob("[!_]*.py") if path.stem != "catalogue")
    found = [importlib.import_module(f"mpp_taichi.exporters.{name}") for name in names]
    return {exporter.SUFFIX: exporter for exporter in found}
