"""Backends: the only place that starts Taichi. What is asked for is what runs, or an error says why not."""

import contextlib
import importlib.util
import io
import json
import logging
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mpp_taichi.errors import BackendError

log = logging.getLogger(__name__)

TAICHI_VERSION = "1.7.4"
BACKENDS = ("cpu", "cuda", "vulkan", "metal")
PRECISIONS = ("f32", "f64")
PROBE_SECONDS = 60


@dataclass(frozen=True)
class Probes:
    """What a backend was seen to do, before anything is promised on it.

    loop_limit     iterations one kernel thread may make, or None when a count to 70,000 was right
    float64        f64 keeps 1 + 2⁻⁵² and its square root is right to an ulp
    compensation   a Kahan sum is not optimised away
    finds_nan      the checks used for NaN and infinity fire
    """

    loop_limit: int | None
    float64: bool
    compensation: bool
    finds_nan: bool


@dataclass(frozen=True)
class Device:
    """A started backend. `generation` counts starts: fields die when it moves on."""

    backend: str
    name: str
    precision: str
    threads: int
    probes: Probes
    generation: int

    @property
    def on_cpu(self) -> bool:
        """Whether kernels run on the CPU's own threads."""
        return self.backend == "cpu"


@dataclass
class _Runtime:
    device: Device | None = None
    generation: int = 0
    users: int = 0
    removed_variables: list[str] = field(default_factory=list)


_runtime = _Runtime()  # Taichi has one runtime in a process; this mirrors it.


def import_taichi() -> Any:
    """Import Taichi quietly, after removing the TI_* variables that would override the program."""
    for key in [key for key in os.environ if key.startswith("TI_") and key != "TI_SKIP_VERSION_CHECK"]:
        _runtime.removed_variables.append(key)
        log.warning("ignoring %s=%s: settings come from the scene and the command line", key, os.environ.pop(key))
    os.environ["TI_SKIP_VERSION_CHECK"] = "ON"  # the check calls a server
    os.environ["ENABLE_TAICHI_HEADER_PRINT"] = "False"
    try:
        import taichi
    except ImportError as error:
        raise BackendError(
            f"taichi cannot be imported ({error}); its wheels exist for Python 3.10–3.13 on Linux x86-64, Windows and macOS arm64"
        ) from error
    return taichi


def start(backend: str = "auto", precision: str | None = None, *, large: bool = False, threads: int | None = None) -> Device:
    """Start a backend, or keep the one that runs if it is the same.

    `auto` takes the GPU for a large scene where there is one that starts, else the CPU. Precision is f64 on the CPU and f32
    elsewhere unless said. Raises BackendError when what was asked for does not start here.
    """
    _check_names(backend, precision)
    chosen = _choose(large) if backend == "auto" else backend
    if chosen != "cpu":
        report = availability(chosen)
        if not report["available"]:
            raise BackendError(f"backend {chosen} does not start here: {report['reason']}; here are: {', '.join(_present())}")
    precision = precision or ("f64" if chosen == "cpu" else "f32")
    running = _runtime.device
    if running and (running.backend, running.precision) == (chosen, precision) and threads in (None, running.threads):
        return running
    ti = import_taichi()
    initialise(ti, chosen, precision, threads)
    _runtime.generation += 1
    _runtime.users = 0
    probes = _probe_here(ti, chosen)
    if precision == "f64" and not probes.float64:
        stop()
        raise BackendError(f"backend {chosen} on this device has no true f64; use --precision f32")
    if not probes.finds_nan:
        stop()
        raise BackendError(f"backend {chosen} on this device does not detect NaN, so no result of it can be trusted")
    name = _cpu_name() if chosen == "cpu" else availability(chosen)["device"]
    used = threads or os.cpu_count() or 1
    _runtime.device = Device(chosen, name, precision, used if chosen == "cpu" else 0, probes, _runtime.generation)
    return _runtime.device


def initialise(ti: Any, backend: str, precision: str, threads: int | None = None) -> None:
    """The one call of `ti.init`. Taichi would fall back to the CPU in silence; this raises BackendError instead."""
    options: dict[str, Any] = {"cpu_max_num_threads": threads} if threads and backend == "cpu" else {}
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            ti.init(
                arch=getattr(ti, backend),
                default_fp=getattr(ti, precision),
                fast_math=False,  # one meaning of a float: NaN, division by zero and compensation survive
                enable_fallback=False,
                log_level=ti.ERROR,
                **options,
            )
    except Exception as error:  # Taichi raises bare RuntimeErrors and pybind errors of its own
        raise BackendError(f"backend {backend} does not start here: {str(error).strip().splitlines()[0]}") from error
    running = ti.lang.impl.current_cfg().arch
    if backend != "cpu" and running != getattr(ti, backend):
        raise BackendError(f"asked for backend {backend}, but Taichi started {running}")


def widest_float(device: Device) -> Any:
    """The Taichi type that energies are computed in."""
    ti = import_taichi()
    return ti.f64 if device.probes.float64 else ti.f32


def stop() -> None:
    """Reset Taichi; every field and kernel made since `start` is gone."""
    if "taichi" in sys.modules:
        sys.modules["taichi"].reset()
    _runtime.device = None
    _runtime.users = 0
    _runtime.generation += 1


def retain(device: Device) -> None:
    """Count one more simulation that lives on the device."""
    _runtime.users += 1


def release(device: Device) -> None:
    """Count one less; with the last one gone Taichi is reset, which gives memory and kernels back."""
    if is_alive(device):
        _runtime.users -= 1
        if _runtime.users <= 0:
            stop()


def is_alive(device: Device) -> bool:
    """Whether fields made under this device still exist."""
    return _runtime.device is not None and _runtime.generation == device.generation


def availability(backend: str) -> dict[str, Any]:
    """Whether a backend really starts here: {available, reason, device}. Tried in a child process, which may crash; remembered."""
    _check_names(backend, None)
    if backend == "cpu":
        return {"available": True, "reason": "", "device": _cpu_name()}
    missing = _missing_library(backend)
    if missing:
        return {"available": False, "reason": missing, "device": ""}
    return _remembered(f"start-{backend}", lambda: _try_in_child(backend), keep=lambda report: report["available"])


def _try_in_child(backend: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "mpp_taichi.probes", backend]
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]))
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PROBE_SECONDS, env=environment, check=False)
    except subprocess.TimeoutExpired:
        return {"available": False, "reason": f"it did not answer within {PROBE_SECONDS} s", "device": ""}
    try:
        return json.loads(done.stdout.strip().splitlines()[-1])
    except (IndexError, ValueError):
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return {"available": False, "reason": f"a trial start ended with status {done.returncode}: {last}", "device": ""}


def _probe_here(ti: Any, backend: str) -> Probes:
    from mpp_taichi import probes

    name = f"probes-{backend}-{availability(backend)['device']}"
    return Probes(**_remembered(name, lambda: probes.run(ti, backend), keep=lambda report: True))


def _remembered(name: str, find: Any, *, keep: Any) -> dict[str, Any]:
    """A finding kept between runs; a cache that cannot be read or written is only slower."""
    version = importlib.util.find_spec("mpp_taichi")
    key = "".join(letter if letter.isalnum() else "-" for letter in f"{name}-{TAICHI_VERSION}-{platform.machine()}")
    stamp = [key, _driver_stamp(), os.environ.get("VK_ICD_FILENAMES", ""), os.environ.get("VK_DRIVER_FILES", ""), PROBE_REVISION]
    path = cache_folder() / f"{key[:120]}.json"
    with contextlib.suppress(OSError, ValueError, KeyError):
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["stamp"] == stamp:
            return stored["found"]
    found = find()
    if keep(found) and version is not None:
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps({"stamp": stamp, "found": found}), encoding="utf-8")
    return found


PROBE_REVISION = 1  # raise when a probe changes


def _driver_stamp() -> list[str]:
    """Names and times of the installed Vulkan drivers, so that a new driver is tried afresh."""
    folders = [Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d")]
    return [f"{entry.name}:{entry.stat().st_mtime_ns}" for folder in folders if folder.is_dir() for entry in sorted(folder.iterdir())]


def cache_folder() -> Path:
    """Where findings about this machine are kept."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path(os.path.expanduser("~")) / ".cache") / "mpp_taichi"


def _missing_library(backend: str) -> str:
    import ctypes.util

    if backend == "metal":
        return "" if sys.platform == "darwin" else "Metal exists on macOS only"
    wanted = {"cuda": ("nvcuda" if os.name == "nt" else "cuda"), "vulkan": ("vulkan-1" if os.name == "nt" else "vulkan")}[backend]
    candidates = [f"lib{wanted}.so.1", f"lib{wanted}.so", f"{wanted}.dll", f"lib{wanted}.dylib", f"lib{wanted}.1.dylib"]
    for candidate in candidates:
        with contextlib.suppress(OSError):
            ctypes.CDLL(candidate)
            return ""
    return {"cuda": "no NVIDIA driver (libcuda) is installed", "vulkan": "no Vulkan loader (libvulkan) is installed"}[backend]


def _choose(large: bool) -> str:
    """A hardware GPU for a large scene, else the CPU: one thread of it beats any launch for a small scene."""
    if large:
        for backend in ("cuda", "metal", "vulkan"):
            report = availability(backend)
            if report["available"] and not report.get("software", False):
                return backend
    return "cpu"


def _present() -> Iterator[str]:
    for backend in BACKENDS:
        report = availability(backend)
        if report["available"]:
            yield f"{backend} ({report['device']})"


def _check_names(backend: str, precision: str | None) -> None:
    if backend not in (*BACKENDS, "auto"):
        raise BackendError(f"backend {backend!r} is unknown; there are auto, {', '.join(BACKENDS)}")
    if precision not in (*PRECISIONS, None):
        raise BackendError(f"precision {precision!r} is unknown; there are {', '.join(PRECISIONS)}")


def _cpu_name() -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
