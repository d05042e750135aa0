"""What is written where: results on standard output, everything meant for a person on standard error."""

import contextlib
import json
import logging
import math
import os
import sys
from collections.abc import Iterator
from typing import Any

from mpp_taichi.errors import MppError, OutputError, SceneError


class UsageError(MppError):
    """The command line asks for something that makes no sense; like a fault of the scene, it ends with code 2."""

    exit_code = 2


class ClosedOutputError(Exception):
    """Standard output was closed by its reader."""


CLOSED_OUTPUT_CODE = 141  # as a program that SIGPIPE ended


def prepare_streams() -> None:
    """Let no character that a terminal lacks end the program."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


class _LineHandler(logging.Handler):
    """Warnings as lines on whatever standard error is at the time: a progress bar takes its place while it is shown."""

    def emit(self, record: logging.LogRecord) -> None:
        say(f"{record.levelname.lower()}: {record.getMessage()}")


@contextlib.contextmanager
def warnings_shown() -> Iterator[None]:
    """Show the program's own warnings."""
    logger = logging.getLogger("mpp_taichi")
    handler = _LineHandler(logging.WARNING)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


def say(text: str) -> None:
    """A line for a person; lost without complaint when nobody listens."""
    if sys.stderr is not None:  # closed: print would take standard output instead
        with contextlib.suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


def put(text: str) -> None:
    """A result on standard output.

    Raises:
        ClosedOutputError: its reader is gone.
    """
    try:
        print(text, flush=True)
    except (BrokenPipeError, ValueError):
        _drop_output()
        raise ClosedOutputError from None
    except OSError:
        _drop_output()
        raise


def put_json(found: dict[str, Any]) -> None:
    """One JSON object on standard output; a number that is not finite becomes null."""
    put(json.dumps(plain(found), indent=2, allow_nan=False, ensure_ascii=True))


def put_failure(text: str, faults: list[str] | None, code: int) -> int:
    """What `--json` tells of a failure; returns the exit code, which is another one where the output cannot be written."""
    try:
        put_json({"status": "failed", "error": text} | ({} if faults is None else {"faults": faults}) | {"exit_code": code})
    except ClosedOutputError:
        return CLOSED_OUTPUT_CODE
    except OSError:
        return OutputError.exit_code
    return code


def plain(value: Any) -> Any:
    """NumPy's types as Python's, and null for what JSON cannot say."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)


def _drop_output() -> None:
    """What is still buffered has nowhere to go; without this Python would complain about it at exit."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


@contextlib.contextmanager
def output_reserved(wanted: bool) -> Iterator[None]:
    """Send what libraries print, in Python or in C, to standard error, so that a JSON object stands alone."""
    if not wanted:
        yield
        return
    try:
        kept = os.dup(1)
    except OSError:  # standard output is closed
        yield
        return
    try:
        os.dup2(2, 1)
    except OSError:  # standard error is closed: what is not wanted is not shown
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)
    try:
        yield
    finally:
        # Not by another sys.stdout: Taichi would take that for a notebook and copy its output after every kernel.
        with contextlib.suppress(OSError, ValueError, AttributeError):
            sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def explain_error(error: MppError) -> None:
    """One line for each fault; on a terminal with the source line and a caret below it."""
    on_terminal = sys.stderr is not None and sys.stderr.isatty()
    say(error.render() if isinstance(error, SceneError) and on_terminal else str(error))
