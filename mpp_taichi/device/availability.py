"""The backends that start on this machine: each is tried in a child process, which may crash, and the result is kept."""

import contextlib
import ctypes
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

BACKENDS = ("cpu", "cuda", "vulkan", "metal")
PROBE_SECONDS = 60
PROBE_REVISION = 2  # raise when a probe changes
TAICHI_VERSION = "1.7.4"
DRIVER_FOLDERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
DRIVER_VARIABLES = ("VK_ICD_FILENAMES", "VK_DRIVER_FILES", "CUDA_VISIBLE_DEVICES")


def availability(backend: str) -> dict[str, Any]:
    """Whether a backend really starts here: {available, reason, device, software}."""
    if backend == "cpu":
        return {"available": True, "reason": "", "device": cpu_name(), "software": False}
    reason = _missing_library(backend)
    if reason:
        return {"available": False, "reason": reason, "device": "", "software": False}
    return remembered(f"start-{backend}", lambda: _try_in_child(backend), keep=lambda report: report["available"])


def present() -> list[str]:
    """Backends that start here, with their devices, for messages."""
    reports = {backend: availability(backend) for backend in BACKENDS}
    return [f"{backend} ({report['device']})" for backend, report in reports.items() if report["available"]]


def _try_in_child(backend: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "mpp_taichi.device.trial_start", backend]
    search_path = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    environment = dict(os.environ, PYTHONPATH=search_path)
    try:
        done = subprocess.run(command, capture_output=True, timeout=PROBE_SECONDS, env=environment, check=False)
    except OSError as error:
        reason = f"no process for a trial start: {error.strerror or error}"
        return {"available": False, "reason": reason, "device": "", "software": False}
    except subprocess.TimeoutExpired:
        return {"available": False, "reason": f"it did not answer within {PROBE_SECONDS} s", "device": "", "software": False}
    said, told = (stream.decode("utf-8", "replace").strip().splitlines() for stream in (done.stdout, done.stderr))
    try:
        return json.loads(said[-1])
    except (IndexError, ValueError):
        last = (told or ["no message"])[-1]
        reason = f"a trial start ended with status {done.returncode}: {last}"
        return {"available": False, "reason": reason, "device": "", "software": False}


def remembered(name: str, find: Callable[[], dict[str, Any]], *, keep: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """The result of `find`, kept between runs until a driver changes; where it cannot be kept, it is found anew in each run."""
    key = "".join(letter if letter.isalnum() else "-" for letter in f"{name}-{TAICHI_VERSION}-{platform.machine()}")
    stamp = [PROBE_REVISION, _driver_stamp(), [os.environ.get(variable, "") for variable in DRIVER_VARIABLES]]
    path = cache_folder() / f"{key[:120]}.json"
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["stamp"] == stamp:
            return stored["found"]
    found = find()
    if keep(found):
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps({"stamp": stamp, "found": found}), encoding="utf-8")
    return found


def _driver_stamp() -> list[str]:
    """Names and times of the installed Vulkan drivers, so that a new driver is tried; a link to nothing has its own time."""
    entries: list[Path] = []
    for folder in DRIVER_FOLDERS:
        with contextlib.suppress(OSError):  # it does not exist, or may not be read
            entries += sorted(folder.iterdir())
    return [f"{entry.name}:{(entry.stat() if entry.exists() else entry.lstat()).st_mtime_ns}" for entry in entries]


def cache_folder() -> Path:
    """The folder in which results about this machine are kept."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path(os.path.expanduser("~")) / ".cache") / "mpp_taichi"


def _missing_library(backend: str) -> str:
    if backend == "metal":
        return "" if sys.platform == "darwin" else "Metal exists on macOS only"
    wanted = {"cuda": ("nvcuda" if os.name == "nt" else "cuda"), "vulkan": ("vulkan-1" if os.name == "nt" else "vulkan")}[
        backend
    ]
    candidates = [f"lib{wanted}.so.1", f"lib{wanted}.so", f"{wanted}.dll", f"lib{wanted}.dylib", f"lib{wanted}.1.dylib"]
    for candidate in candidates:
        with contextlib.suppress(OSError):
            ctypes.CDLL(candidate)
            return ""
    return {"cuda": "no NVIDIA driver (libcuda) is installed", "vulkan": "no Vulkan loader (libvulkan) is installed"}[backend]


def cpu_name() -> str:
    """Model name of the CPU."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
