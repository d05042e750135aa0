"""Dropped simulations: the memory of simulations that were deleted without `close`.

Python may delete an object at any moment, also while Taichi compiles a kernel, when no field can be freed. So their memory is
given back when the next simulation is made or closed.
"""

import weakref
from typing import Any

from mpp_taichi.device import backends, one_thread
from mpp_taichi.device.backends import Device
from mpp_taichi.simulation.compiled_phases import CompiledPhases

_dropped: list[tuple[CompiledPhases, Device]] = []


def watch(simulation: Any, compiled: CompiledPhases, device: Device) -> Any:
    """Note these phases for `free_dropped` when the simulation is deleted, or when the result is called before."""
    watcher = weakref.finalize(simulation, _dropped.append, (compiled, device))
    watcher.atexit = False
    return watcher


def free_dropped() -> None:
    """Give back the memory of the simulations that were deleted or closed; the lock of device/one_thread.py is held."""
    while _dropped:
        compiled, device = _dropped.pop()
        if backends.is_alive(device):
            if one_thread.is_owner():  # else the memory is given back with the runtime
                compiled.destroy()
            backends.release(device)
