"""Source: what is to be written, a state and, where it comes from a scene, what the scene says beyond it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.recorders.trajectory_file import TrajectoryFile
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import rest_positions
from mpp_taichi.start.contact_setup import enclosure_of
from mpp_taichi.walls._base import Enclosure

if TYPE_CHECKING:
    from mpp_taichi.scene.spec import SceneSpec


@dataclass(frozen=True)
class Source:
    """A state to write, or the frames of a trajectory.

    file        where it comes from, for messages
    state       of a trajectory, the first frame
    spec        the scene, where there is one
    trajectory  where there is one
    """

    file: str
    state: Snapshot
    spec: "SceneSpec | None" = None
    trajectory: TrajectoryFile | None = None

    @property
    def frame_count(self) -> int:
        """Of a trajectory; 1 for a state."""
        return 1 if self.trajectory is None else self.trajectory.frame_count

    def frames(self) -> Iterator[tuple[Snapshot, Enclosure]]:
        """Each frame, or the state alone, and the box that repeats; only a scene and a trajectory know of one."""
        if self.trajectory is not None:
            yield from self.trajectory.frames()
        else:
            yield self.state, Enclosure() if self.spec is None else enclosure_of(self.spec)

    def rest(self) -> np.ndarray:
        """Positions without displacements [length], (particle_count, 3); only a scene knows of any."""
        return self.state.position if self.spec is None else rest_positions(self.spec)

    def refuse(self, reason: str) -> SceneError:
        """An error that says why it cannot be written so."""
        return SceneError(f"{self.file}: {reason}")
