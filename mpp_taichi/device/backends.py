"""Backends: the only module that starts Taichi. The backend that a user asks for runs, or an error says why it does not."""

import contextlib
import io
import logging
import os
import sys
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mpp_taichi.device import fast_taichi, forked, kernel_cache, one_thread, own_runtime
from mpp_taichi.device.availability import BACKENDS, availability, cpu_name, present, remembered
from mpp_taichi.device.fast_taichi import short_compilation
from mpp_taichi.device.held_signals import signals_held
from mpp_taichi.device.memory_limit import ADVICE, LOADING_BYTES, POOL_BYTES, require_memory, tells_no_memory
from mpp_taichi.device.taichi_environment import user_variables_hidden
from mpp_taichi.device.thread_count import bounded, check_threads, processors, require_threads
from mpp_taichi.errors import BackendError, CapacityError
from mpp_taichi.missing_package import missing_packages_named
from mpp_taichi.precision import PRECISIONS, carries_low_parts, forces_have_low_parts, number_type

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Probes:
    """The operations that a backend computes correctly, by the probes (probes.py) and not by its documentation.

    loop_limit     iterations that one kernel thread may make, or None when a count to 70,000 was right
    float64        f64 holds 1 + 2⁻⁵²; its square root, division and sum of many terms are right to their rounding
    compensation   the compiler does not optimise away the correction of a compensated sum
    low_parts      the update of f32c, ds and df64 keeps its rounding errors; where `compensation` is False, with guards
    finds_nan      the tests for NaN and infinity are True for them, and False for a number
    double_single  products, quotients, roots and sums of two parts, of which df64 makes its forces, are right; None where the
                   device was not started for df64, since this probe takes longer to compile than all others
    """

    loop_limit: int | None
    float64: bool
    compensation: bool
    low_parts: bool
    finds_nan: bool
    double_single: bool | None = None


@dataclass(frozen=True)
class Device:
    """A started backend. `generation` counts the starts: the fields of an earlier generation no longer exist."""

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
    taichi: Any = None  # the module, once it is imported and its parts are in place
    device: Device | None = None
    generation: int = 0
    users: int = 0


_runtime = _Runtime()  # Taichi has one runtime in a process; this mirrors it.


def import_taichi() -> Any:
    """Import Taichi without its banner, and put the parts of `fast_taichi` in place; a second call only returns the module.

    Raises:
        ArgumentError: MPP_TAICHI_FAST has a name that no part has.
        BackendError: Taichi cannot be imported.
        CapacityError: there is too little memory for it.
    """
    if _runtime.taichi is not None:  # some callers ask before each launch of a kernel
        return _runtime.taichi
    if os.name != "nt" and "HOME" not in os.environ and "XDG_CACHE_HOME" not in os.environ:
        home = os.path.expanduser("~")
        os.environ["HOME"] = home if os.path.isabs(home) else os.devnull  # without it Taichi ends the process
    if "taichi" not in sys.modules:
        require_memory(LOADING_BYTES + POOL_BYTES)
    faster = fast_taichi.being_imported()
    try:
        with signals_held(), missing_packages_named(), user_variables_hidden(), faster:
            import taichi
    except Exception as error:
        if tells_no_memory(error):
            raise CapacityError(f"there is too little memory to load Taichi ({error}): {ADVICE}") from error
        if not isinstance(error, ImportError):
            raise
        raise BackendError(
            f"taichi cannot be imported ({error}); it has wheels for Python 3.10–3.13 on Linux x86-64, Windows, macOS arm64"
        ) from error
    fast_taichi.install(taichi)
    own_runtime.install()
    forked.install()
    _runtime.taichi = taichi
    return taichi


def start(backend: str = "auto", precision: str | None = None, *, large: bool = False, threads: int | None = None) -> Device:
    """Start a backend, or keep the backend that runs if it is the same.

    `auto` takes a GPU for a large scene where a GPU starts, else the CPU. Without a `precision` it is f64 on the CPU and f32
    on other backends.

    Raises:
        BackendError: the backend does not start here, or computes wrongly in this precision; or this process was forked from
            one in which Taichi ran.
        MppError: another thread has an open simulation.
        ArgumentError: too many threads, or an unknown name in MPP_TAICHI_FAST.
    """
    _check_names(backend, precision)
    forked.refuse_child()
    one_thread.refuse_second(_open_here())  # without the lock, which the other thread may hold for long
    with one_thread.lock:
        return _start(backend, precision, large=large, threads=check_threads(threads))


def _start(backend: str, precision: str | None, *, large: bool, threads: int | None) -> Device:
    chosen = _choose(large) if backend == "auto" else backend
    if chosen != "cpu":
        report = availability(chosen)
        if not report["available"]:
            here = ", ".join(present())
            raise BackendError(f"backend {chosen} does not start here: {report['reason']}; here are: {here}")
    precision = precision or ("f64" if chosen == "cpu" else "f32")
    _forget_what_others_ended()
    one_thread.refuse_second(_open_here())
    running = _runtime.device if one_thread.is_owner() else None
    threads = bounded(threads) if threads and chosen == "cpu" else None
    if running and (running.backend, running.precision) == (chosen, precision) and threads in (None, running.threads):
        return running
    ti = import_taichi()
    if own_runtime.has_foreign_fields():
        log.warning("the fields of Taichi that this program made have ended: %s", own_runtime.ONE_RUNTIME)
    initialise(ti, chosen, precision, threads)
    _forget()  # the start has ended the earlier runtime
    own_trees = ti.lang.impl.get_runtime().prog.get_snode_tree_size()
    probes = _probe_here(ti, chosen)
    if precision == "f64" and not probes.float64:
        stop()
        raise BackendError(f"backend {chosen} on this device has no true f64; use --precision f32")
    if carries_low_parts(precision) and not probes.low_parts:
        stop()
        raise BackendError(f"backend {chosen} on this device loses what {precision} carries along; use --precision f32")
    if forces_have_low_parts(precision):
        probes = _with_double_single(ti, chosen, probes)
        if not probes.double_single:
            stop()
            raise BackendError(
                f"backend {chosen} on this device rounds the double-single forces of {precision}; use --precision ds"
            )
    if not probes.finds_nan:
        stop()
        raise BackendError(f"backend {chosen} on this device does not detect NaN, so no result of it can be trusted")
    if ti.lang.impl.get_runtime().prog.get_snode_tree_size() > own_trees:
        # Taichi numbers fields, and a kernel that it kept fits only fields of the same numbers. The probes of a first start
        # made fields; after a new start the scene's fields have the numbers that they will have in every later run.
        initialise(ti, chosen, precision, threads)
    name = cpu_name() if chosen == "cpu" else availability(chosen)["device"]
    used = threads or processors()
    _runtime.device = Device(chosen, name, precision, used if chosen == "cpu" else 0, probes, _runtime.generation)
    return _runtime.device


def initialise(ti: Any, backend: str, precision: str, threads: int | None = None) -> None:
    """The only call of `ti.init`. Taichi would fall back to the CPU without a message; this raises BackendError instead."""
    threads = threads or processors()  # Taichi itself would take all of the machine, also where this process may not use them
    options: dict[str, Any] = {"cpu_max_num_threads": threads} if backend == "cpu" else {}
    require_threads(threads)
    if ti.lang.impl.get_runtime().prog is None:
        require_memory(POOL_BYTES)
    folder = kernel_cache.folder_of(ti)
    kernel_cache.remove_old_lock(folder)
    if not kernel_cache.is_writable(folder):
        # Even without a cache Taichi makes the folder when the process ends, and aborts where it cannot. So it is given a
        # folder that exists, and writes nothing into it.
        here = str(Path(__file__).parent)
        options |= {"offline_cache": False, "offline_cache_file_path": here, "offline_cache_cleaning_policy": "never"}
    try:
        with contextlib.redirect_stdout(io.StringIO()), user_variables_hidden(), own_runtime.being_started():
            ti.init(
                arch=getattr(ti, backend),
                default_fp=getattr(ti, number_type(precision)),
                fast_math=False,  # one meaning of a float: NaN, division by zero and compensation survive
                enable_fallback=False,
                # This pass of Taichi 1.7.4 keeps a field's entry in a register across a branch that changes the entry: a
                # Runge–Kutta step with its stages in a loop then loses the stages without a message.
                cache_loop_invariant_global_vars=False,
                cfg_optimization=short_compilation.analyses(),
                log_level=ti.ERROR,
                **options,
            )
    except Exception as error:  # Taichi raises bare RuntimeErrors and pybind errors of its own
        if tells_no_memory(error):
            raise CapacityError(f"there is too little memory to start backend {backend}: {ADVICE}") from error
        raise BackendError(f"backend {backend} does not start here: {str(error).strip().splitlines()[0]}") from error
    running = ti.lang.impl.current_cfg().arch
    if backend != "cpu" and running != getattr(ti, backend):
        raise BackendError(f"asked for backend {backend}, but Taichi started {running}")
    if backend == "cpu":
        fast_taichi.start_threads()


def widest_float(device: Device) -> Any:
    """The Taichi type in which energies are computed."""
    ti = import_taichi()
    return ti.f64 if device.probes.float64 else ti.f32


def stop() -> None:
    """Reset Taichi; every field and kernel made since `start` is gone."""
    if "taichi" in sys.modules:
        sys.modules["taichi"].reset()
    _forget()


def _forget() -> None:
    """Note that our runtime no longer exists."""
    _runtime.device = None
    _runtime.users = 0
    _runtime.generation += 1


def _forget_what_others_ended() -> None:
    """Notice a ti.init or ti.reset by the program: a process has one Taichi runtime, so either has ended ours."""
    if _runtime.device is not None and not own_runtime.is_own():
        _forget()


def retain(device: Device) -> None:
    """Count one more simulation on the device."""
    _runtime.users += 1


def _open_here() -> int:
    """Number of the open simulations, of every thread."""
    return _runtime.users if own_runtime.is_own() else 0


def release(device: Device) -> None:
    """Count one simulation less; after the last simulation Taichi is reset, which frees memory and kernels."""
    with one_thread.lock:
        if is_alive(device):
            _runtime.users -= 1
            if _runtime.users <= 0:
                stop()


def is_alive(device: Device) -> bool:
    """Whether fields made under this device still exist."""
    return _runtime.device is not None and _runtime.generation == device.generation and own_runtime.is_own()


def all_probes(device: Device) -> Probes:
    """The probes of the device that runs, with the probe of double-single numbers."""
    return _with_double_single(import_taichi(), device.backend, device.probes)


def _probe_here(ti: Any, backend: str) -> Probes:
    from mpp_taichi.device import probes

    sources = ("device/probes", "device/update_probe", "arithmetic/low_parts", "arithmetic/particle_update")
    return Probes(**_remembered_probe("probes", sources, backend, lambda: probes.run(ti, backend)))


def _with_double_single(ti: Any, backend: str, known: Probes) -> Probes:
    if known.double_single is not None:
        return known

    def probe() -> dict[str, Any]:
        from mpp_taichi.device.double_single_probe import is_double_single_right  # it imports Taichi

        return {"double_single": is_double_single_right(ti, guards_rounding=not known.compensation)}

    numbers = ("low_parts", "particle_update", "double_single", "force_numbers", "inverse_distance")
    sources = ("device/double_single_probe", *(f"arithmetic/{name}" for name in numbers))
    return replace(known, **_remembered_probe("double-single", sources, backend, probe))


def _remembered_probe(name: str, sources: Sequence[str], backend: str, probe: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The results of a probe. Its name has a digest of the sources, so that results of older probes are not used."""
    texts = [(Path(__file__).parents[1] / f"{source}.py").read_bytes() for source in sources]
    full_name = f"{name}-{zlib.crc32(b''.join(texts)):08x}-{backend}-{availability(backend)['device']}"
    return remembered(full_name, probe, keep=lambda report: True)


def _choose(large: bool) -> str:
    """A hardware GPU for a large scene, else the CPU: for a small scene one CPU thread is faster than a GPU's launches."""
    if large:
        for backend in ("cuda", "metal", "vulkan"):
            report = availability(backend)
            if report["available"] and not report["software"]:
                return backend
    return "cpu"


def _check_names(backend: str, precision: str | None) -> None:
    if backend not in (*BACKENDS, "auto"):
        raise BackendError(f"backend {backend!r} is unknown; there are auto, {', '.join(BACKENDS)}")
    if precision not in (*PRECISIONS, None):
        raise BackendError(f"precision {precision!r} is unknown; there are {', '.join(PRECISIONS)}")
