"""A file that is written whole or not at all."""

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mpp_taichi.errors import OutputError
from mpp_taichi.passport.carried import stamp


@contextmanager
def whole_file(path: Path, what: str, *, durable: bool = False, shared: bool = False) -> Iterator[Path]:
    """A temporary path beside `path`, of the same suffix, that takes its place when the block ends; folders are made.

    An old file stays as it was until then, and nothing is left of a new file that cannot be completed. A `durable` file is
    on the disk before it replaces an old file, even if the machine stops. Of a `shared` file, which several processes may write
    at the same time, the temporary path is this process's own.

    Raises:
        OutputError: it cannot be written; says which file and `what` was to be in it.
    """
    own = f".{os.getpid()}.{secrets.token_hex(4)}" if shared else ""
    temporary = path.with_name(f"{path.stem}{own}.part{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield fresh(temporary)
        stamp(temporary)
        if durable:
            with open(temporary, "rb+") as stream:
                os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):  # the folder itself may be the cause of the error
            temporary.unlink()
        if not isinstance(error, OSError):
            raise
        raise OutputError(f"{path}: cannot write {what}: {reason(error)}") from error


def whole_text(path: Path, text: str, what: str) -> None:
    """Write a text in UTF-8, whole or not at all; bytes of a file's name that are no letters become question marks.

    Raises:
        OutputError: it cannot be written; says which file and `what` was to be in it.
    """
    with whole_file(path, what) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="replace")


def fresh(path: Path) -> Path:
    """The same path, where an empty file of this process now takes the place of what was there.

    A symbolic link that somebody has put at a temporary name is removed, and the file that it leads to stays as it is. OSError
    where the file cannot be made.
    """
    with suppress(FileNotFoundError):
        path.unlink()
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    return path


def reason(error: Exception) -> str:
    """Why a file cannot be written, on one line: HDF5 says it in several, with the number of the system's error."""
    number = re.search(r"errno = (\d+)", str(error))
    if number is not None:
        return os.strerror(int(number[1]))
    return " ".join(str(getattr(error, "strerror", None) or error).split())
