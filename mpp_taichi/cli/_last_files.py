"""Last files of a run of the command line: the state at its end, and the files that are written when everything is over."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpp_taichi.cli._options import OUTPUT_FOLDER, output_stem
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._terminal import put_last_failure, say
from mpp_taichi.errors import MppError, OutputError, StabilityError
from mpp_taichi.recorders._lock import release_all

Job = tuple[Path, Callable[[], Any]]


def state_file(source: str, request: Request, error: MppError | None, *, broken_off: bool) -> Path | None:
    """The file of the last state: the file of `--snapshot`, or, when the run broke off, a file beside the other output."""
    if broken_off:
        return OUTPUT_FOLDER / f"{output_stem(source)}.interrupted.npz"
    if isinstance(error, StabilityError):
        return OUTPUT_FOLDER / f"{output_stem(source)}.crash.npz"
    return request.snapshot


def write_all(jobs: Sequence[Job], error: MppError | None) -> tuple[list[str], MppError | None]:
    """Do every job, also after a failure, which is told; the files that were written, and the first error of the run."""
    files: list[str] = []
    for path, job in jobs:
        try:
            job()
            files.append(str(path))
        except OutputError as failure:
            if str(failure) != str(error):
                say(f"error: {failure}")
            error = error or failure
    return files, error


def farewell(error: MppError, files: Sequence[str], state: Path | None) -> int:
    """Tell why the process ends here and now, and where the state is; the exit code."""
    release_all()
    saved = f"; the state is in {state}" if state is not None and str(state) in files else ""
    say(f"error: {error}{saved}")
    return put_last_failure(f"{error}{saved}", list(files), error.exit_code)
