"""Run output: a file of a run that grows while the run goes on, as the archive of the run sees it."""

from collections.abc import Iterator, Mapping
from typing import Any, Protocol


class RunOutput(Protocol):
    """A film or a trajectory, which is begun anew or goes on from a record; `simulation` is `Any` as in `Recorder`.

    pending   bytes that wait in memory for the next record
    """

    pending: int

    def begin_anew(self) -> None:
        """Begin a new file, in place of what an earlier run has left."""

    def at_record(self) -> Mapping[str, Any]:
        """How far the file is, as a value of an archive; called behind `news`."""

    def news(self) -> list[Any]:
        """What has to be kept of the output since the last record; the archive keeps all news, and forgets none."""

    def stop(self) -> None:
        """There will be no more records: gather no more news."""

    def go_on(self, simulation: Any, saved: Mapping[str, Any], news: Iterator[list[Any]]) -> None:
        """Go on from a record; `news` are those of all records up to this one."""
