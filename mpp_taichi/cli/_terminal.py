"""Output: results go to standard output, messages for a person to standard error."""

import contextlib
import json
import logging
import math
import os
import re
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from mpp_taichi.errors import AccuracyWarning, MppError, OutputError, SceneError


class UsageError(MppError):
    """Wrong usage of the command line; like a fault of the scene, it ends with code 2."""

    exit_code = 2


class ClosedOutputError(Exception):
    """Standard output was closed by its reader."""


CLOSED_OUTPUT_CODE = 141  # the exit code of a program that SIGPIPE ended


def prepare_streams() -> None:
    """Replace characters that the terminal cannot show, so that they raise no error."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


class _LineHandler(logging.Handler):
    """Prints warnings as lines on the present standard error, which a progress bar replaces while it is shown."""

    def emit(self, record: logging.LogRecord) -> None:
        say(f"{record.levelname.lower()}: {record.getMessage()}")


@contextlib.contextmanager
def warnings_shown() -> Iterator[None]:
    """Show the program's own warnings; findings of a verdict, which are Python warnings in a script, come by this way."""
    logger = logging.getLogger("mpp_taichi")
    handler = _LineHandler(logging.WARNING)
    logger.addHandler(handler)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AccuracyWarning)
            yield
    finally:
        logger.removeHandler(handler)


# Controls of a terminal but for the ends of lines and tabs, and those that turn the direction of writing.
_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def without_controls(text: str) -> str:
    """Text whose control characters, from a title or a name say, are replaced, so that a terminal only shows them."""
    return _CONTROLS.sub("�", text)


# A verdict at the beginning of a line, or after the name of its row in a summary.
_VERDICTS = re.compile(r"^((?:  (?:status|expect) *)| *)(pass|ok|FAIL|failed|inaccurate|interrupted)(?= |$)", re.MULTILINE)
_GOOD, _BAD, _PLAIN = "\x1b[32m", "\x1b[1;31m", "\x1b[0m"


def painted(text: str, stream: Any) -> str:
    """Text whose verdicts are green and red, where the stream is a terminal that shows colours and NO_COLOR is not set."""
    if stream is None or not stream.isatty():
        return text
    from rich.console import Console

    console = Console(file=stream)
    if console.no_color or console.color_system in (None, "windows"):  # the second: an old console without escape sequences
        return text
    return _VERDICTS.sub(lambda found: f"{found[1]}{_GOOD if found[2] in ('pass', 'ok') else _BAD}{found[2]}{_PLAIN}", text)


def say(text: str, *, verdicts: bool = False) -> None:
    """Print a line for a person on standard error; it is lost without an error when standard error is closed.

    Control characters are replaced; `verdicts` are coloured on a terminal.
    """
    text = without_controls(text)
    text = painted(text, sys.stderr) if verdicts else text
    if sys.stderr is not None:  # closed: print would take standard output instead
        with contextlib.suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


def put(text: str, *, verdicts: bool = False) -> None:
    """Print a result on standard output, with control characters replaced; `verdicts` are coloured on a terminal.

    Raises:
        ClosedOutputError: the reader of standard output has closed it.
    """
    try:
        text = without_controls(text)
        print(painted(text, sys.stdout) if verdicts else text, flush=True)
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
    """Print the JSON object of a failure; returns the exit code, which differs when the output cannot be written."""
    return _put_end({"status": "failed", "error": text} | ({} if faults is None else {"faults": faults}), code)


def put_interruption(code: int) -> int:
    """Print the JSON object of a program that a signal ended before a result; returns as `put_failure`."""
    return _put_end({"status": "interrupted"}, code)


def put_last_failure(text: str, files: list[str], code: int) -> int:
    """As `put_failure`, within `output_reserved` and just before the process ends; nothing where no JSON is wanted."""
    if not _reserved:
        return code
    os.dup2(_reserved[-1], 1)
    return _put_end({"status": "failed", "error": text, "files": files}, code)


def put_last_interruption(code: int) -> int:
    """As `put_interruption`, within `output_reserved` and just before the process ends; nothing where no JSON is wanted."""
    if not _reserved:
        return code
    os.dup2(_reserved[-1], 1)
    return put_interruption(code)


def _put_end(found: dict[str, Any], code: int) -> int:
    try:
        put_json(found | {"exit_code": code})
    except ClosedOutputError:
        return CLOSED_OUTPUT_CODE
    except OSError:
        return OutputError.exit_code
    return code


def plain(value: Any) -> Any:
    """A value with NumPy's types as Python's types, and None for a number that JSON cannot express."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)


_reserved: list[int] = []
"""Standard output, while its descriptor stands for standard error."""


def _drop_output() -> None:
    """Discard buffered output that cannot be written; otherwise Python would report an error at exit."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


@contextlib.contextmanager
def output_reserved(wanted: bool) -> Iterator[None]:
    """Send the output of libraries, in Python or in C, to standard error, so that standard output holds only a JSON object."""
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
    except OSError:  # standard error is closed: the libraries' messages are discarded
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)
    _reserved.append(kept)
    try:
        yield
    finally:
        _reserved.pop()
        # Not by another sys.stdout: Taichi would take that for a notebook and copy its output after every kernel.
        with contextlib.suppress(OSError, ValueError, AttributeError):
            sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def explain_error(error: MppError) -> None:
    """One line for each fault; on a terminal with the source line and a caret below it."""
    on_terminal = sys.stderr is not None and sys.stderr.isatty()
    say(error.render() if isinstance(error, SceneError) and on_terminal else str(error))
