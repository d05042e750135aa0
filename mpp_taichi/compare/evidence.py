"""Evidence: what a contender did, as arrays: the forces it felt, and where its particles were along a run."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

SHAKEN_PLACE = 0.05  # of the system's size
SEED = 20_000


class Contender(Protocol):
    """A backend with a scene on it."""

    facts: dict[str, Any]

    def accelerations_at(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions and velocities as it keeps them, and the accelerations there, (N, 3) each in float64."""

    def restart(self) -> None:
        """Back to the start of the scene."""

    def begin(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Go on from here, (N, 3) each, at the time of the start."""

    def advance(self, steps: int) -> float:
        """Take steps; the seconds of it."""

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities now, (N, 3) each in float64."""

    def copy_seconds(self) -> float:
        """How long positions take from the device to the host."""

    def peaks(self) -> dict[str, float]:
        """Flops and bytes per second that its device reaches at best."""

    def close(self) -> None:
        """Give everything back."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """States with the accelerations felt there, (2, N, 3): the start, and the start shaken. Then the looks along a run.

    steps      counts at which it was looked at, (looks,)
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
    """Ask for the forces at the states, then run from the start and look after so many steps."""
    found = [contender.accelerations_at(position, velocity) for position, velocity in states] if forces else []
    contender.restart()
    places, speeds = _run(contender, looks)
    empty = np.zeros((0, 0, 3))
    position, velocity, acceleration = [np.stack(column) for column in zip(*found)] if found else [empty] * 3
    return Evidence(position, velocity, acceleration, np.asarray(looks, int), places, speeds)


def follow(
    contender: Contender, starts: Sequence[tuple[np.ndarray, np.ndarray]], looks: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities at the looks of runs from each of the starts, (starts, looks, N, 3) each."""
    runs = []
    for position, velocity in starts:
        contender.begin(position, velocity)
        runs.append(_run(contender, looks))
    places, speeds = (np.stack(column) for column in zip(*runs))
    return places, speeds


def _run(contender: Contender, looks: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities after so many steps from now on, (looks, N, 3) each."""
    done, seen = 0, []
    for steps in looks:
        contender.advance(steps - done)
        done = steps
        seen.append(contender.read())
    if not seen:
        return np.zeros((0, 0, 3)), np.zeros((0, 0, 3))
    return np.stack([place for place, _ in seen]), np.stack([speed for _, speed in seen])


def shaken(position: np.ndarray, velocity: np.ndarray, free: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """The state with every free axis moved, so that springs are stretched and brakes have something to brake.

    `free` is 1.0 or 0.0, (N, 3). Velocities are moved by about as much as they are; all at rest, by a size per unit of time.
    """
    random = np.random.default_rng(SEED)
    speed = float(np.sqrt(np.mean(velocity * velocity))) or size
    place = position + SHAKEN_PLACE * size * random.standard_normal(position.shape) * free
    return place, velocity + speed * random.standard_normal(velocity.shape) * free
