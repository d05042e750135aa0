"""A trial start of a backend, in a child process because a broken driver may crash it.

Run as `python -m mpp_taichi.device.trial_start vulkan`: it starts the backend and prints one JSON object, the report of
`availability`.
"""

import ctypes
import json
import sys
from typing import Any

from mpp_taichi.device import backends
from mpp_taichi.device.vulkan import chosen_device
from mpp_taichi.errors import MppError


def try_start(backend: str) -> dict[str, Any]:
    """Start a backend in this process, run a kernel on it, and name its device."""
    ti = backends.import_taichi()
    backends.initialise(ti, backend, "f32")
    field = ti.field(ti.i32, shape=8)

    @ti.kernel
    def fill():
        for i in field:
            field[i] = i * i

    fill()
    if int(field.to_numpy().sum()) != 140:
        return {"available": False, "reason": "a trial kernel gave a wrong result", "device": "", "software": False}
    name, software = chosen_device() if backend == "vulkan" else (f"{backend} device", False)
    if backend == "cuda":
        name = _cuda_name()
    return {"available": True, "reason": "", "device": name, "software": software}


def _cuda_name() -> str:
    driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    name = ctypes.create_string_buffer(256)
    driver.cuInit(0)
    return name.value.decode() if driver.cuDeviceGetName(name, 256, 0) == 0 else "CUDA device"


if __name__ == "__main__":
    try:
        print(json.dumps(try_start(sys.argv[1])))
    except MppError as error:
        print(json.dumps({"available": False, "reason": str(error), "device": "", "software": False}))
