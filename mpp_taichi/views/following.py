"""Following: the camera goes along with a particle, or with the centre of mass."""

import numpy as np

from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera

CENTER = "center of mass"


class Follower:
    """Moves the camera's target together with `what`: a particle's index, `CENTER` for the centre of mass, or None."""

    def __init__(self) -> None:
        """Follow nothing."""
        self.what: int | str | None = None
        self._last: np.ndarray | None = None

    def next(self, picked: int | None) -> str:
        """Change to the next choice: the picked particle, the centre of mass, nothing. Returns a line that names the choice."""
        choices: list[int | str | None] = [CENTER, None] if picked is None else [picked, CENTER, None]
        place = choices.index(self.what) if self.what in choices else len(choices) - 1
        self.what, self._last = choices[(place + 1) % len(choices)], None
        if self.what is None:
            return "follows nothing"
        return f"follows the {CENTER}" if self.what == CENTER else f"follows particle {self.what}"

    def update(self, camera: Camera, frame: Frame) -> None:
        """Move the target: aim at a newly followed particle, then keep its place in the picture."""
        place = self._place(frame)
        if place is None or not np.isfinite(place).all():
            return
        camera.target = place.copy() if self._last is None else camera.target + (place - self._last)
        self._last = place

    def _place(self, frame: Frame) -> np.ndarray | None:
        if self.what is None:
            return None
        if isinstance(self.what, str):
            return None if frame.center is None else np.array(frame.center, dtype=float)
        return np.array(frame.position[self.what], dtype=float) if self.what < len(frame.position) else None
