"""Process: the parent's side of a worker; requests and answers are lines, and a worker without an answer is killed."""

import contextlib
import json
import math
import os
import queue
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpp_taichi.device.availability import cache_folder
from mpp_taichi.device.thread_count import start_thread
from mpp_taichi.device.with_parent import child_environment
from mpp_taichi.errors import CapacityError, MppError

LOOK_SECONDS = 0.1  # between two checks for an interruption while an answer is awaited
END_SECONDS = 20.0  # for a worker to end by itself and write its cache of kernels


class WorkerError(MppError):
    """A worker reports a failure, or has died, or does not answer."""


class WorkerProcess:
    """A child process; `look` is called while an answer is awaited and may raise."""

    def __init__(
        self, folder: Path, cache: Path | None, look: Callable[[], None], *, module: str = "mpp_taichi.compare.worker"
    ) -> None:
        """Start the worker, a module that answers lines.

        `folder` is for its standard error, `cache` for the compilers' caches; absent: those that every run uses.

        Raises:
            WorkerError: the system starts no process.
        """
        self._look = look
        self._log = folder / f"worker-{id(self):x}.log"
        root = str(Path(__file__).parents[2])
        environment = child_environment() | {"PYTHONPATH": os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])}
        environment |= caches(cache) if cache is not None else {}
        try:
            with open(self._log, "wb") as log:
                self._process = subprocess.Popen(
                    [sys.executable, "-m", module],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    env=environment,
                    text=True,
                    encoding="utf-8",
                )
        except OSError as error:
            raise WorkerError(f"its process cannot be started: {error.strerror or error}") from error
        self._answers: queue.Queue[str] = queue.Queue()
        try:
            start_thread(threading.Thread(target=self._listen, daemon=True))
        except CapacityError as error:
            self.kill()
            raise WorkerError(f"its answers cannot be read: {error}") from error

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._answers.put(line)
        self._answers.put("")

    def ask(self, command: str, within: float, **fields: Any) -> dict[str, Any]:
        """The answer to a line.

        Raises:
            WorkerError: the worker reports a failure, has died, or gave no answer `within` these seconds.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"do": command, **fields}) + "\n")
            self._process.stdin.flush()
        except OSError:
            raise WorkerError(self._death()) from None
        text = self._await(within)
        if text is None:
            self.kill()
            raise WorkerError(f"it did not answer within {within:.0f} s")
        if not text:
            raise WorkerError(self._death())
        answer: dict[str, Any] = json.loads(text)
        if not answer.pop("ok"):
            raise WorkerError(answer["reason"])
        return answer

    def _await(self, within: float) -> str | None:
        """An answer, or None where none came; the time is counted in looks, as the program may have been stopped in between."""
        for _ in range(math.ceil(within / LOOK_SECONDS)):
            self._look()
            with contextlib.suppress(queue.Empty):
                return self._answers.get(timeout=LOOK_SECONDS)
        return None

    def _death(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        lines = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        last = f": {lines[-1][:300]}" if lines else ""
        return f"its process ended with status {self._process.returncode}{last}"

    def ask_to_end(self) -> None:
        """Close the input of the worker, so that it ends."""
        with contextlib.suppress(OSError, ValueError):
            assert self._process.stdin is not None
            self._process.stdin.close()

    def end(self) -> None:
        """Let the worker end by itself, so that it saves its compiled kernels; then kill it."""
        self.ask_to_end()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(END_SECONDS)
        self.kill()

    def leave(self, *, at_once: bool) -> None:
        """End the worker; `at_once`: by a signal, where its answer is not waited for any more."""
        if at_once:
            self.kill()
        else:
            self.end()

    def kill(self) -> None:
        """Kill the worker now."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()


def caches(folder: Path) -> dict[str, str]:
    """Environment variables by which Taichi, PoCL, pyopencl and the drivers of GPUs cache compiled kernels in a folder."""
    return {
        "XDG_CACHE_HOME": str(folder),
        "POCL_CACHE_DIR": str(folder / "pocl"),
        "CUDA_CACHE_PATH": str(folder / "cuda"),
        "__GL_SHADER_DISK_CACHE_PATH": str(folder / "gl"),
    }


def empty_cache(folder: Path) -> Path:
    """An empty cache of kernels that includes the known facts about the backends."""
    for name in ("", "pocl", "cuda", "gl"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    if cache_folder().is_dir():
        shutil.copytree(cache_folder(), folder / cache_folder().name, dirs_exist_ok=True)
    return folder
