"""Evidence: the results of a contender as arrays: its forces, and the positions of its particles along a run."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

SHAKEN_PLACE = 0.05  # of the system's size
SEED = 20_000


class Contender(Protocol):
    """A backend that runs a scene."""

    facts: dict[str, Any]

    def accelerations_at(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions and velocities as the backend stores them, and the accelerations there, (N, 3) each in float64."""

    def restart(self) -> None:
        """Return to the start of the scene."""

    def begin(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Continue from these positions and velocities, (N, 3) each, at the time of the start."""

    def advance(self, steps: int) -> float:
        """Take steps; returns the seconds they took."""

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """The present positions and velocities, (N, 3) each in float64."""

    def copy_seconds(self) -> float:
        """The seconds for copying positions from the device to the host."""

    def peaks(self) -> dict[str, float]:
        """The highest flops and bytes per second that the device reaches."""

    def close(self) -> None:
        """Free the device."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Two states with their accelerations, (2, N, 3): the start, and the start shaken; and samples along a run.

    steps      counts of steps at which samples were taken, (looks,)
    places     positions there, (looks, N, 3), and `speeds`, velocities
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    steps: np.ndarray
    places: np.ndarray
    speeds: np.ndarray


def gather(
    contender: Contender, states: Sequence[tuple[np.ndarray, np.ndarray]], looks: Sequence[int], *, forces: bool = True
) -> Evidence:
    """Compute the forces at the states, then run from the start and take a sample after each count of steps."""
    found = [contender.accelerations_at(position, velocity) for position, velocity in states] if forces else []
    contender.restart()
    places, speeds = _run(contender, looks)
    empty = np.zeros((0, 0, 3))
    position, velocity, acceleration = [np.stack(column) for column in zip(*found)] if found else [empty] * 3
    return Evidence(position, velocity, acceleration, np.asarray(looks, int), places, speeds)


def follow(
    contender: Contender, starts: Sequence[tuple[np.ndarray, np.ndarray]], looks: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities in the samples of runs from each start, (starts, looks, N, 3) each."""
    runs = []
    for position, velocity in starts:
        contender.begin(position, velocity)
        runs.append(_run(contender, looks))
    places, speeds = (np.stack(column) for column in zip(*runs))
    return places, speeds


def _run(contender: Contender, looks: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities after each count of steps from the present state, (looks, N, 3) each."""
    done, seen = 0, []
    for steps in looks:
        contender.advance(steps - done)
        done = steps
        seen.append(contender.read())
    if not seen:
        return np.zeros((0, 0, 3)), np.zeros((0, 0, 3))
    return np.stack([place for place, _ in seen]), np.stack([speed for _, speed in seen])


def shaken(position: np.ndarray, velocity: np.ndarray, free: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """The state displaced along every free axis, so that springs are stretched and drag acts.

    `free` is 1.0 or 0.0, (N, 3). Velocities change by about their own size; if all are zero, by one size per unit of time.
    """
    random = np.random.default_rng(SEED)
    speed = float(np.sqrt(np.mean(velocity * velocity))) or size
    place = position + SHAKEN_PLACE * size * random.standard_normal(position.shape) * free
    return place, velocity + speed * random.standard_normal(velocity.shape) * free
