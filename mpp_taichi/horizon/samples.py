"""Samples: the times at which a run is compared with its reruns, and the walk of a rerun through them."""

from collections.abc import Callable, Generator
from contextlib import closing
from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.horizon.rerun import HAIR, Rerun
from mpp_taichi.simulation.course import phase_at

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


def sample_times(simulation: "Simulation", end: float, count: int) -> np.ndarray:
    """About `count` times from the start to `end`, after even numbers of steps in each phase, and some times before the first.

    So the coarse rerun reaches them with whole steps. Of a flight, and of a method that chooses its steps, there are
    `count` even times.
    """
    begin = simulation.time
    if simulation.integrator.controlled_by or not simulation.launcher.takes_steps:
        return np.linspace(begin, end, count + 1)[1:]
    begins = [begin, *(phase.at for phase in simulation.phases if begin < phase.at < end)]
    found: list[float] = []
    for number, (began, ended) in enumerate(zip(begins, [*begins[1:], end])):
        dt = simulation.phases[phase_at(simulation.phases, began)].dt if number else simulation.dt
        pairs = int((ended - began) / (2.0 * dt) + HAIR)
        here = min(pairs, max(2, round(count * (ended - began) / (end - begin))))
        found += [began + 2.0 * dt * k for k in even_and_early(pairs, here)]
    return np.array(found)


def even_and_early(last: int, count: int) -> list[int]:
    """Whole numbers from 1 to `last`: `count` at equal distances, and before the first of them powers of two."""
    even = {round(last * k / count) for k in range(1, count + 1)} if count else set()
    return sorted(even | {2**k for k in range(last.bit_length()) if 2**k * count < last})


class Walk:
    """The positions of a run or a rerun at given times; afterwards the number of its evaluations, and how far it came."""

    def __init__(
        self, simulation: "Simulation", coarseness: float, times: np.ndarray, look: Callable[[], None], shift: float = 0.0
    ) -> None:
        """Bind the parts; nothing is followed yet. `look` is called at every time, and may raise."""
        self._rerun, self._times, self._look = Rerun(simulation, coarseness, shift), times, look
        self.reached = simulation.time
        self.path: list[np.ndarray] = []  # the places of which `differences` were taken

    @property
    def evaluations(self) -> int:
        """Evaluations of the force, of a method that chooses its steps."""
        return self._rerun.evaluations

    @property
    def meetings(self) -> int:
        """Contacts of a sphere with another or with a wall, summed over the spheres."""
        return self._rerun.meetings

    def positions(self) -> np.ndarray:
        """Positions at all times that the run reaches, (samples, followed, 3) [length]."""
        return np.array(list(self._places()))

    def differences(self, own: np.ndarray, far: float) -> np.ndarray:
        """Largest distance of a particle from its place in the run at each time [length], until it is at least `far`."""
        found: list[float] = []
        with closing(self._places()) as places:
            for k, place in enumerate(places):
                self.path.append(place)
                found.append(float(np.linalg.norm(place - own[k], axis=1).max()))
                if not found[-1] < far:
                    break
        return np.array(found)

    def _places(self) -> Generator[np.ndarray]:
        with closing(self._rerun.positions([float(time) for time in self._times])) as places:
            for place, time in zip(places, self._times):
                self._look()
                self.reached = float(time)
                yield place
