"""Several scenes checked at once, each by a process of its own, so that a crash of one process does not end the others."""

import argparse
import json
import logging
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from mpp_taichi.cli._exhausted import exhausted
from mpp_taichi.cli._signals import Interruption
from mpp_taichi.cli._terminal import say
from mpp_taichi.cli._verdicts import Verdicts
from mpp_taichi.device.with_parent import child_environment
from mpp_taichi.errors import INTERNAL_ERROR_CODE

log = logging.getLogger(__name__)

PROGRAM = (sys.executable, "-m", "mpp_taichi", "check")
POLL_SECONDS = 0.02
FAREWELL_SECONDS = 10.0  # seconds that a process has to close its files after a signal
Failure = Callable[[Path, str, int], dict[str, Any]]  # scene, error, exit code


@dataclass(eq=False)
class _Job:
    scene: Path
    process: subprocess.Popen[bytes]
    answer: IO[bytes]
    words: IO[bytes]


def check_at_once(
    scenes: Sequence[Path], count: int, arguments: argparse.Namespace, failure: Failure, verdicts: Verdicts
) -> list[dict[str, Any]]:
    """The result of the check of each scene, in the order of the scenes; at most `count` of them run at a time.

    `verdicts` has those of an earlier check that was cut off, and keeps new ones. `failure` makes the result of a scene whose
    process ended without a result.

    Raises:
        Interrupted: a signal was received; the processes have been ended.
        OSError: not even one process can be started.
    """
    results = {scene: known for scene in scenes if (known := verdicts.get(scene)) is not None}
    waiting, running = [scene for scene in dict.fromkeys(scenes) if scene not in results], list[_Job]()
    with Interruption() as interruption:
        try:
            while waiting or running:
                while waiting and len(running) < count:
                    try:
                        running.append(_started(waiting[0], arguments, verdicts.run_of(waiting[0])))
                    except OSError as error:
                        if not running or exhausted(error) is None:
                            raise
                        count = len(running)  # the machine has no room for more of them
                        log.warning("%s; %d scenes are checked at a time", exhausted(error), count)
                    else:
                        del waiting[0]
                for job in [job for job in running if job.process.poll() is not None]:
                    running.remove(job)
                    results[job.scene] = _result(job, failure)
                    verdicts.keep(job.scene, results[job.scene])
                interruption.raise_if_any()
                time.sleep(POLL_SECONDS)
        finally:
            _end(running)
    return [results[scene] for scene in scenes]


def _started(scene: Path, arguments: argparse.Namespace, kept: Path | None) -> _Job:
    words = [*PROGRAM, "--jobs", "1", "--json", "--no-archive", "--backend", arguments.backend, "--plan", arguments.plan]
    words += ["--precision", arguments.precision] if arguments.precision else []
    words += ["--threads", str(arguments.threads)] if arguments.threads else []
    words += ["--quiet"] if arguments.quiet else []
    words += ["--kept-run", str(kept)] if kept is not None else []
    command = [*words, "--", str(scene)]
    with ExitStack() as opened:
        answer, told = (opened.enter_context(tempfile.TemporaryFile()) for _ in range(2))  # a full pipe would block
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=answer, stderr=told, env=child_environment())
        opened.pop_all()
    return _Job(scene, process, answer, told)


def _result(job: _Job, failure: Failure) -> dict[str, Any]:
    """The result of a process; its messages are printed again by this process."""
    with job.answer, job.words:
        job.answer.seek(0)
        job.words.seek(0)
        answer, words = job.answer.read(), job.words.read().decode("utf-8", "replace").strip()
    if words:
        say(words)
    try:
        found: dict[str, Any] = json.loads(answer)["scenes"][0]
    except (ValueError, LookupError):
        code = job.process.returncode
        error = f"its process ended with code {code} and without a result"
        found = failure(job.scene, error, code if code > 0 else INTERNAL_ERROR_CODE)
    return found


def _end(jobs: Sequence[_Job]) -> None:
    for job in jobs:
        job.process.terminate()
    for job in jobs:
        try:
            job.process.wait(FAREWELL_SECONDS)
        except subprocess.TimeoutExpired:
            job.process.kill()
            job.process.wait()
        job.answer.close()
        job.words.close()
