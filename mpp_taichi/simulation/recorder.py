"""Recorder: what a run shows itself to now and then."""

from typing import Any, Protocol


class Recorder(Protocol):
    """Looks at a simulation from time to time; the simulation is `Any` here, as its class imports this one."""

    def steps_until_due(self, simulation: Any) -> int:
        """How many steps may pass before the next look; 0 means now."""

    def record(self, simulation: Any) -> None:
        """Look."""
