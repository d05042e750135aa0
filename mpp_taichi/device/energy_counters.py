"""Energy counters: the electrical energy that processors and GPUs of this machine have used, where the machine counts it.

Processors: Linux counts microjoules for each package in /sys/class/powercap (Intel's and AMD's "running average power limit").
Many systems let only root read the counters, and virtual machines have none. NVIDIA GPUs from Volta on: NVML's
nvmlDeviceGetTotalEnergyConsumption, in millijoules. A counter belongs to the whole machine: energy that other programs use in
the same time is part of the difference of two readings.

Sources: docs.kernel.org/power/powercap; NVML API reference, nvmlDeviceGetTotalEnergyConsumption.
"""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

POWERCAP = Path("/sys/class/powercap")
NVML = "libnvidia-ml.so.1"
SUCCESS = 0


@dataclass(frozen=True)
class EnergyCounter:
    """One counter: its name, a function that reads it [J], and the energy at which it begins again at 0 [J]; 0: never."""

    name: str
    read: Callable[[], float]
    range: float = 0.0

    def used(self, before: float, after: float) -> float:
        """The energy between two readings [J]; a counter may have begun again once."""
        return after - before + (self.range if after < before else 0.0)


class EnergyMeasurement:
    """The energy that all counters together count from its creation on."""

    def __init__(self, counters: Sequence[EnergyCounter]) -> None:
        """Read all counters."""
        self.counters = counters
        self._before = [counter.read() for counter in counters]

    def joules(self) -> float | None:
        """The energy since the start [J]; None where the machine has no counter that can be read."""
        if not self.counters:
            return None
        return sum(counter.used(before, counter.read()) for counter, before in zip(self.counters, self._before))


def energy_counters(powercap: Path = POWERCAP) -> list[EnergyCounter]:
    """The counters of all processors and NVIDIA GPUs of this machine that can be read.

    A GPU that waits uses energy as well, and so does a processor that waits for a GPU: every backend is charged with all of it.
    """
    return [*_packages(powercap), *_nvidia()]


def _packages(powercap: Path) -> list[EnergyCounter]:
    found = []
    for folder in sorted(powercap.glob("*:*")):
        try:
            name = (folder / "name").read_text(encoding="ascii").strip()
            counter = EnergyCounter(name, _file_reader(folder / "energy_uj"), _microjoules(folder / "max_energy_range_uj"))
            counter.read()
        except (OSError, ValueError):  # not allowed, or no counter
            continue
        if name.startswith("package"):  # the parts of a package are counted in the package
            found.append(counter)
    return found


def _file_reader(path: Path) -> Callable[[], float]:
    return lambda: _microjoules(path)


def _microjoules(path: Path) -> float:
    return int(path.read_text(encoding="ascii")) * 1e-6


def _nvidia() -> list[EnergyCounter]:
    try:
        library = ctypes.CDLL(NVML)
    except OSError:
        return []
    count = ctypes.c_uint()
    if library.nvmlInit_v2() != SUCCESS or library.nvmlDeviceGetCount_v2(ctypes.byref(count)) != SUCCESS:
        return []
    found = []
    for index in range(count.value):
        device, used = ctypes.c_void_p(), ctypes.c_ulonglong()
        if library.nvmlDeviceGetHandleByIndex_v2(ctypes.c_uint(index), ctypes.byref(device)) != SUCCESS:
            continue
        if library.nvmlDeviceGetTotalEnergyConsumption(device, ctypes.byref(used)) == SUCCESS:
            found.append(EnergyCounter(f"gpu-{index}", _gpu_reader(library, device)))
    return found


def _gpu_reader(library: ctypes.CDLL, device: ctypes.c_void_p) -> Callable[[], float]:
    def read() -> float:
        used = ctypes.c_ulonglong()
        library.nvmlDeviceGetTotalEnergyConsumption(device, ctypes.byref(used))
        return used.value * 1e-3

    return read
