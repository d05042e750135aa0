"""A lock file beside each output, which names the process that writes it, so that an output has one writer."""

import os
from contextlib import suppress
from pathlib import Path

from mpp_taichi.errors import OutputError
from mpp_taichi.recorders._process_stat import stat_words

_held: set[Path] = set()
"""Locks of this process. Another lock that names it is left over from an earlier process with the same number."""


class OutputLock:
    """Holds `.name.lock` while an output is being written; a lock whose process is gone is taken over."""

    def __init__(self, output: Path) -> None:
        """Take the lock.

        Raises:
            OutputError: another process that is alive holds it, or the folder cannot be written.
        """
        self.path = output.absolute().with_name(f".{output.name}.lock")
        try:
            output.parent.mkdir(parents=True, exist_ok=True)
            try:
                self._create()
            except FileExistsError:
                owner = self._owner()
                if owner is not None and (self.path in _held or _is_alive(owner)):
                    raise OutputError(f"{output}: process {owner} is writing it; if it is gone, remove {self.path}") from None
                self.path.unlink(missing_ok=True)
                self._create()
        except OSError as error:
            raise OutputError(f"{output}: cannot be written: {error.strerror or error}") from error
        _held.add(self.path)

    def release(self) -> None:
        """Give the lock back; harmless when called twice."""
        if self.path in _held:
            _held.remove(self.path)
            self.path.unlink(missing_ok=True)

    def _create(self) -> None:
        descriptor = os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
        try:
            with os.fdopen(descriptor, "w", encoding="ascii") as stream:
                stream.write(str(os.getpid()))
        except OSError:  # the disk is full
            self.path.unlink(missing_ok=True)
            raise

    def _owner(self) -> int | None:
        try:
            return int(self.path.read_text(encoding="ascii"))
        except (OSError, ValueError):
            return None


def release_all() -> None:
    """Remove every lock of this process, which ends now."""
    while _held:
        with suppress(OSError):
            _held.pop().unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    if process == os.getpid():
        return False
    if os.name == "nt":
        return True  # there, signal 0 would be a Ctrl-C
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return not _has_ended(process)


def _has_ended(process: int) -> bool:
    """Whether a process has ended and only waits for its parent to ask how, as after a kill in a container without an init."""
    return stat_words(process)[:1] in (["Z"], ["X"])
