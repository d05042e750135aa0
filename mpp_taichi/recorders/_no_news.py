"""An output that keeps its contents in files of its own, or as numbers: the archive of a run gathers nothing for it."""

from typing import Any


class NoNews:
    """The part of `RunOutput` of outputs without news."""

    pending = 0

    def news(self) -> list[Any]:
        """Nothing."""
        return []

    def stop(self) -> None:
        """Do nothing."""
