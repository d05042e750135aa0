"""OpenCL devices: which there are, and how one is chosen by name and version."""

import os
from dataclasses import dataclass, field
from typing import Any

HINTS = {"POCL_VECTORIZER_PREFER_VECTOR_WIDTH": "512"}  # bits; LLVM alone takes 256 on processors that have both
LANGUAGE = "OpenCL "  # what every version begins with: OpenCL, the version of the language, then the driver's own


class Refused(Exception):
    """What OpenCL is asked for and cannot do here, in one line."""


class Failed(Exception):
    """A run that came to no good end, in one line."""


@dataclass(frozen=True)
class Device:
    """A device of a platform.

    version   of the driver, as "PoCL 3.1+debian": it tells platforms of one name apart
    type      "gpu", "cpu" or "accelerator"
    id        "version / name", with " #2" where the same comes again; `choose` takes it, or any words of it
    """

    name: str
    platform: str
    version: str
    type: str
    id: str
    handle: Any = field(repr=False, compare=False)


def devices() -> tuple[list[Device], str]:
    """All devices here and "", or an empty list and the reason in one line."""
    for name, value in HINTS.items():
        os.environ.setdefault(name, value)  # read when the driver is loaded
    try:
        import pyopencl
    except Exception as error:  # noqa: BLE001 - a broken driver may raise anything while it is loaded
        return [], f"pyopencl cannot be imported: {_line(error)}"
    try:
        handles = [(platform, device) for platform in pyopencl.get_platforms() for device in platform.get_devices()]
    except pyopencl.Error as error:
        return [], f"no OpenCL platform: {_line(error)}"
    found: list[Device] = []
    for platform, handle in handles:
        version = driver_version(platform.version)
        name = " ".join(handle.name.split())
        label = f"{version} / {name}"
        same = sum(one.id == label or one.id.startswith(f"{label} #") for one in found)
        unique = f"{label} #{same + 1}" if same else label
        found.append(Device(name, " ".join(platform.name.split()), version, _type(pyopencl, handle), unique, handle))
    return found, "" if found else "no OpenCL device"


def choose(text: str | None = None) -> Device:
    """The device whose id is `text`, or the only one with every word of it in id, platform or type; None: a GPU, or the first.

    Raises:
        Refused: there is no device, none like that, or several.
    """
    found, reason = devices()
    if not found:
        raise Refused(reason)
    if text is None:
        return next((device for device in found if device.type == "gpu"), found[0])
    exact = [device for device in found if device.id == text]
    words = text.lower().split()
    matching = exact or [
        device for device in found if all(word in f"{device.id} {device.platform} {device.type}".lower() for word in words)
    ]
    if not matching:
        raise Refused(f"no OpenCL device matches {text!r}, there are: {_listed(found)}")
    if len(matching) > 1:
        raise Refused(f"{len(matching)} OpenCL devices match {text!r}, say which: {_listed(matching)}")
    return matching[0]


def _listed(devices: list[Device]) -> str:
    return "; ".join(device.id for device in devices)


def driver_version(text: str) -> str:
    """Of a platform's version, what the driver says of itself: "PoCL 3.1+debian" of "OpenCL 3.0 PoCL 3.1+debian  Linux, …"."""
    _, _, rest = text.removeprefix(LANGUAGE).partition(" ")
    known = rest.strip() if text.startswith(LANGUAGE) else text
    return known.split("  ")[0].split(",")[0].strip() or text.strip()


def _type(pyopencl: Any, handle: Any) -> str:
    kinds = pyopencl.device_type
    return "gpu" if handle.type & kinds.GPU else "cpu" if handle.type & kinds.CPU else "accelerator"


def _line(error: Exception) -> str:
    """The first line of a message."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
