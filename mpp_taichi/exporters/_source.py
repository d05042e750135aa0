"""Source: what is to be written, a state and, where it comes from a scene, what the scene says beyond it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.snapshot import Snapshot

if TYPE_CHECKING:
    from mpp_taichi.scene.spec import SceneSpec


@dataclass(frozen=True)
class Source:
    """A state to write.

    file  where it comes from, for messages
    rest  positions without displacements [length], (particle_count, 3)
    spec  the scene, where there is one
    """

    file: str
    state: Snapshot
    rest: np.ndarray
    spec: "SceneSpec | None" = None

    def refuse(self, reason: str) -> SceneError:
        """An error that says why it cannot be written so."""
        return SceneError(f"{self.file}: {reason}")
