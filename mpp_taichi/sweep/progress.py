"""Progress: lines with the time that is left, and a picture of the part that is done."""

import time as clock
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from mpp_taichi.errors import MppError
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.sweep.member import STATUSES
from mpp_taichi.sweep.picture import draw
from mpp_taichi.sweep.results import SweepResults
from mpp_taichi.sweep.store import SweepStore

TOLD_SECONDS = 2.0
PICTURE_SHARE = 0.01  # of the time, which pictures of a part may take
FIRST_PICTURE = 0.01  # of the chunks


class Progress:
    """Counts the chunks that are done; `members` is the number of members run so far."""

    def __init__(self, store: SweepStore, numbers: Sequence[int], tell: Callable[[str], None], *, goes_on: bool) -> None:
        """`numbers` are the chunks of this call, or of a round of it where it `goes_on` with another round."""
        self.store, self.tell = store, tell
        self._count, self._done, self.members = len(numbers), 0, 0
        self._others = 0
        self._began = self._told = self._drawn = clock.monotonic()
        self._drawing = 0.0
        if goes_on:
            members = sum(len(store.members(number)) for number in numbers)
            tell(f"the next round has {members:,} members, at places where neighbours differ")
        elif (before := store.chunk_count - len(numbers)) > 0:
            tell(f"{before:,} of {store.chunk_count:,} chunks are done already, in {store.folder}; --fresh begins anew")

    def done(self, answer: dict[str, Any]) -> None:
        """A chunk is done."""
        self._done += len(answer["numbers"])
        self.members += sum(answer["statuses"])
        self._others += sum(number for word, number in zip(STATUSES, answer["statuses"]) if word not in ("ok", "stopped"))
        now = clock.monotonic()
        if now - self._told >= TOLD_SECONDS and self._done < self._count:
            self._told = now
            left = (now - self._began) / self._done * (self._count - self._done)
            failed = f", {self._others:,} broke down or were refused" if self._others else ""
            self.tell(f"{self._done:,}/{self._count:,} chunks, {self.members:,} members{failed}; some {_time(left)} left")
        is_first = self._drawn == self._began and self._done >= FIRST_PICTURE * self._count
        if is_first or now - self._drawn > self._drawing / PICTURE_SHARE:
            self.picture()

    def picture(self) -> None:
        """Draw what is done; a picture of a part is no reason to end the sweep."""
        began = clock.monotonic()
        with suppress(MppError, OSError), held(OutputLock(self.store.folder / "picture.png")):
            draw(SweepResults(self.store), self.store.folder)
        self._drawn = clock.monotonic()
        self._drawing = self._drawn - began


@contextmanager
def held(lock: OutputLock) -> Iterator[None]:
    """A block that holds a lock, and gives it back."""
    try:
        yield
    finally:
        lock.release()


def _time(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
