"""mpp_taichi: scenes of particles, compiled to just the physics they name.

    import mpp_taichi as mpp
    with mpp.Simulation("scenes/ring.yaml", backend="cpu") as simulation:
        simulation.run(duration=100.0)
        print(simulation.diagnostics()["total_energy"])

Importing the package starts no device and imports no Taichi.
"""

import importlib
from typing import TYPE_CHECKING, Any

from mpp_taichi.errors import (
    AccuracyWarning,
    ArgumentError,
    BackendError,
    CapacityError,
    ComponentError,
    MppError,
    OutputError,
    SceneError,
    StabilityError,
)
from mpp_taichi.version import __version__

if TYPE_CHECKING:
    from mpp_taichi.accuracy.choice import settle
    from mpp_taichi.report.result import Result, run
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.scene.own_components import add_components, force
    from mpp_taichi.scene.spec import SceneSpec
    from mpp_taichi.simulation.resume import resume
    from mpp_taichi.simulation.simulation import Simulation
    from mpp_taichi.snapshot import Snapshot
    from mpp_taichi.sweep.results import SweepResults, open_sweep

__all__ = [
    "AccuracyWarning",
    "ArgumentError",
    "BackendError",
    "CapacityError",
    "ComponentError",
    "MppError",
    "OutputError",
    "Result",
    "SceneError",
    "SceneSpec",
    "Simulation",
    "Snapshot",
    "StabilityError",
    "SweepResults",
    "__version__",
    "add_components",
    "force",
    "load_scene",
    "open_sweep",
    "resume",
    "run",
    "settle",
]

_LAZY = {
    "add_components": "mpp_taichi.scene.own_components",
    "force": "mpp_taichi.scene.own_components",
    "Result": "mpp_taichi.report.result",
    "SceneSpec": "mpp_taichi.scene.spec",
    "Simulation": "mpp_taichi.simulation.simulation",
    "Snapshot": "mpp_taichi.snapshot",
    "SweepResults": "mpp_taichi.sweep.results",
    "load_scene": "mpp_taichi.scene.load",
    "open_sweep": "mpp_taichi.sweep.results",
    "resume": "mpp_taichi.simulation.resume",
    "run": "mpp_taichi.report.result",
    "settle": "mpp_taichi.accuracy.choice",
}


def __getattr__(name: str) -> Any:
    """Import the other names on first use, so that `import mpp_taichi` costs next to nothing."""
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'mpp_taichi' has no attribute {name!r}")
