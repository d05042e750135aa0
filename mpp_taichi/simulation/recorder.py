"""Recorder: an object that takes samples of a run."""

from typing import Any, Protocol


class Recorder(Protocol):
    """Takes samples of a simulation; the simulation is `Any` here, as its class imports this module."""

    def steps_until_due(self, simulation: Any) -> int:
        """The number of steps that may pass before the next sample; 0 means now."""

    def record(self, simulation: Any) -> None:
        """Take a sample."""
