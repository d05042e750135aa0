"""Show the equipment of this machine: backends that really start, OpenCL and Vulkan devices, encoder, display, versions."""

import argparse
import contextlib
import json
import os
import platform
import subprocess
import sys
from typing import Any

from mpp_taichi import __version__
from mpp_taichi.cli._terminal import output_reserved, put, put_json
from mpp_taichi.device.fast_taichi import switch
from mpp_taichi.errors import BackendError, MppError, OutputError

PACKAGES = ("taichi", "numpy", "pydantic", "PyYAML", "pillow", "rich", "imageio-ffmpeg", "pyopencl")
CHILD_SECONDS = 60
# Run in a child process, which a broken OpenCL driver may crash.
OPENCL_CHILD = """
import json
import pyopencl
print(json.dumps([
    {
        "platform": platform.name.strip(),
        "version": platform.version.strip(),
        "device": device.name.strip(),
        "float64": "cl_khr_fp64" in device.extensions,
        "compute_units": device.max_compute_units,
    }
    for platform in pyopencl.get_platforms()
    for device in platform.get_devices()
]))
"""
VULKAN_CHILD = """
import json
from mpp_taichi.device.vulkan import devices
kinds = ("other", "integrated", "discrete", "virtual", "software")
print(json.dumps([{"name": name, "kind": kinds[kind] if kind < 5 else "other"} for name, kind in devices()]))
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the option."""
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")


def execute(arguments: argparse.Namespace) -> int:
    """Examine the machine, and print the findings."""
    with output_reserved(arguments.json):
        off = _parts_off()
        found = {
            "mpp_taichi": __version__,
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.release()} {platform.machine()}",
            "cpu_threads": os.cpu_count(),
            "packages": {name: _version(name) for name in PACKAGES},
            **off,
            "backends": _backends(),
            "vulkan_devices": _ask_child(VULKAN_CHILD),
            "opencl_devices": _ask_child(OPENCL_CHILD),
            "encoder": _encoder(),
            "display": _display(),
        }
    if arguments.json:
        put_json(found)
    else:
        put("\n".join(_lines(found)))
    return 0


def _version(package: str) -> str | None:
    import importlib.metadata  # takes 10 ms

    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _parts_off() -> dict[str, Any]:
    """The parts of fast_taichi that are off; Taichi itself may be broken, which the backends then say."""
    from mpp_taichi.device.backends import import_taichi

    with contextlib.suppress(BackendError):
        import_taichi()
    return switch.facts()


def _backends() -> dict[str, Any]:
    """Every backend, started in a process of its own, with the capabilities found there."""
    from mpp_taichi.device import backends
    from mpp_taichi.device.availability import BACKENDS, availability

    found: dict[str, Any] = {}
    for name in BACKENDS:
        report = dict(availability(name))
        if report["available"]:
            try:
                report["probes"] = vars(backends.all_probes(backends.start(name, "f32")))
            except MppError as error:
                report["problem"] = str(error)
            finally:
                backends.stop()
        found[name] = report
    return found


def _ask_child(program: str) -> dict[str, Any]:
    """Run a small program that prints JSON; a failure of the program is returned as a text, not raised."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", program], stdin=subprocess.DEVNULL, capture_output=True, timeout=CHILD_SECONDS, check=False
        )
    except OSError as error:
        return {"devices": [], "problem": f"no process for it: {error.strerror or error}"}
    except subprocess.TimeoutExpired:
        return {"devices": [], "problem": f"no answer within {CHILD_SECONDS} s"}
    try:
        return {"devices": json.loads(done.stdout.decode("utf-8", "replace").strip().splitlines()[-1]), "problem": ""}
    except (IndexError, ValueError):
        last = (done.stderr.decode("utf-8", "replace").strip().splitlines() or [f"it ended with status {done.returncode}"])[-1]
        return {"devices": [], "problem": last}


def _encoder() -> dict[str, Any]:
    from mpp_taichi.recorders.video import check_encoder

    try:
        return {"path": check_encoder(), "problem": ""}
    except OutputError as error:
        return {"path": None, "problem": str(error)}


def _display() -> dict[str, Any]:
    from mpp_taichi.cli.run import no_window

    problem = no_window()
    return {"window": not problem, "problem": problem}


def _lines(found: dict[str, Any]) -> list[str]:
    python = f"Python {found['python']}, {found['system']}, {found['cpu_threads']} CPU threads"
    rows = [f"mpp_taichi {found['mpp_taichi']}, {python}"]
    rows.append("  " + ", ".join(f"{name} {version or 'not installed'}" for name, version in found["packages"].items()))
    if off := switch.line(found):
        rows.append(f"off     {off}")
    rows.append("backends")
    for name, report in found["backends"].items():
        rows.append(f"  {name:8s}{_backend_line(report)}")
    for title, key in (("Vulkan", "vulkan_devices"), ("OpenCL", "opencl_devices")):
        rows.append(title)
        rows += [f"  {', '.join(_words(device))}" for device in found[key]["devices"]]
        if found[key]["problem"] or not found[key]["devices"]:
            rows.append(f"  none: {found[key]['problem'] or 'no device'}")
    rows.append(f"encoder {found['encoder']['path'] or found['encoder']['problem']}")
    rows.append(f"window  {'opens here' if found['display']['window'] else found['display']['problem']}")
    return rows


def _backend_line(report: dict[str, Any]) -> str:
    if not report["available"]:
        return f"does not start: {report['reason']}"
    if "problem" in report:
        return f"{report['device']}, but {report['problem']}"
    probes = report["probes"]
    limit = probes["loop_limit"]
    facts = [
        "f64" if probes["float64"] else "no f64",
        "compensated sums hold" if probes["compensation"] else "compensated sums are optimised away",
        "f32c and ds hold" if probes["low_parts"] else "no f32c, no ds",
        "df64 holds" if probes["low_parts"] and probes["double_single"] else "no df64",
        f"loops stop after {limit:,} iterations" if limit else "",
    ]
    return f"{report['device']} ({', '.join(fact for fact in facts if fact)})"


def _words(device: dict[str, Any]) -> list[str]:
    """The values in words; a truth value becomes yes or no with its name."""
    return [f"{name} {'yes' if value else 'no'}" if isinstance(value, bool) else str(value) for name, value in device.items()]
