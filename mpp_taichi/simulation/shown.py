"""Shown: how a simulation is seen from Python, as a line, as a picture, and by itself in a notebook."""

from typing import TYPE_CHECKING, cast

import numpy as np

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


class Shown:
    """The part of a Simulation that shows it; what draws is imported when it is asked for."""

    def picture(self, size: tuple[int, int] = (960, 540)) -> np.ndarray:
        """What a window would show now: red, green, blue as uint8, shape (height, width, 3).

        Raises:
            MppError: the simulation has ended.
        """
        from mpp_taichi.simulation import notebook

        return notebook.picture(self._simulation, size)

    def __repr__(self) -> str:
        """Scene, time, size and method in one line."""
        from mpp_taichi.simulation import notebook

        return notebook.line(self._simulation)

    def _repr_png_(self) -> bytes | None:
        from mpp_taichi.simulation import notebook

        return notebook.png(self._simulation)

    def _repr_html_(self) -> str:
        from mpp_taichi.simulation import notebook

        return notebook.html(self._simulation)

    @property
    def _simulation(self) -> "Simulation":
        return cast("Simulation", self)
