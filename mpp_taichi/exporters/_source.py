"""Source: what is to be written, a state and, where it comes from a scene, what the scene says beyond it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.assemble import rest_positions
from mpp_taichi.errors import SceneError
from mpp_taichi.snapshot import Snapshot

if TYPE_CHECKING:
    from mpp_taichi.scene.spec import SceneSpec


@dataclass(frozen=True)
class Source:
    """A state to write.

    file  where it comes from, for messages
    spec  the scene, where there is one
    """

    file: str
    state: Snapshot
    spec: "SceneSpec | None" = None

    def rest(self) -> np.ndarray:
        """Positions without displacements [length], (particle_count, 3); only a scene knows of any."""
        return self.state.position if self.spec is None else rest_positions(self.spec)

    def refuse(self, reason: str) -> SceneError:
        """An error that says why it cannot be written so."""
        return SceneError(f"{self.file}: {reason}")
