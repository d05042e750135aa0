"""Answering: the loop of a worker, which reads requests from standard input and writes an answer to each, in lines of JSON."""

import contextlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from typing import Any, TextIO

from mpp_taichi.device.with_parent import end_with_parent
from mpp_taichi.errors import MppError


def answer_lines(answer: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Answer until standard input ends: `{"ok": true, …}`, or `{"ok": false, "reason": …}` where `answer` raises."""
    end_with_parent()
    with _own_output() as output:
        for text in sys.stdin:
            try:
                found = {"ok": True, **answer(json.loads(text))}
            except MppError as error:
                found = {"ok": False, "reason": " ".join(str(error).split())}
            except Exception as error:  # drivers may raise any exception, which the row then reports
                found = {"ok": False, "reason": f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"}
            output.write(json.dumps(found) + "\n")
            output.flush()


@contextlib.contextmanager
def _own_output() -> Iterator[TextIO]:
    """A stream to standard output only for the answers; the output of libraries goes to standard error."""
    kept: TextIO = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    with kept:
        yield kept
