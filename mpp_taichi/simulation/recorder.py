"""Recorder: an object that looks at a run from time to time."""

from typing import Any, Protocol


class Recorder(Protocol):
    """Looks at a simulation; the simulation is `Any` here, as its class imports this module."""

    def steps_until_due(self, simulation: Any) -> int:
        """How many steps may pass before the next look; 0 means now."""

    def record(self, simulation: Any) -> None:
        """Look."""
