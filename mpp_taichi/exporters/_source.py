"""Source: the data to write: a state or a trajectory, and the scene that it comes from, if there is one."""

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

    file        the file that was read, for messages
    state       the state, or the first frame of a trajectory
    spec        the scene, or None
    trajectory  the trajectory, or None
    """

    file: str
    state: Snapshot
    spec: "SceneSpec | None" = None
    trajectory: TrajectoryFile | None = None

    @property
    def frame_count(self) -> int:
        """The number of frames of a trajectory; 1 for a state."""
        return 1 if self.trajectory is None else self.trajectory.frame_count

    def frames(self) -> Iterator[tuple[Snapshot, Enclosure]]:
        """Each frame, or the single state, with the periodic box, which only a scene and a trajectory have."""
        if self.trajectory is not None:
            yield from self.trajectory.frames()
        else:
            yield self.state, Enclosure() if self.spec is None else enclosure_of(self.spec)

    def rest(self) -> np.ndarray:
        """Positions without displacements [length], (particle_count, 3); only a scene has displacements."""
        return self.state.position if self.spec is None else rest_positions(self.spec)

    def refuse(self, reason: str) -> SceneError:
        """An error with the reason why the format cannot hold this source."""
        return SceneError(f"{self.file}: {reason}")
