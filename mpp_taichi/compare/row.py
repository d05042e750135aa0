"""Row: one backend in one precision: its facts, its certificate and its times."""

import statistics
from dataclasses import dataclass, field
from typing import Any

from mpp_taichi.compare.kept_worker import KeptWorker
from mpp_taichi.compare.process import WorkerProcess
from mpp_taichi.compare.work import Work


@dataclass(eq=False)
class BackendRow:
    """One backend in one precision. `precision` is empty where the backend as a whole is missing.

    variant    the rung of the ladder that the backend was told to run; empty where it chooses by itself
    status     "ok"; "missing": it does not run here or not this scene; "failed": it ran and then broke off
    """

    backend: str
    precision: str
    status: str = "ok"
    reason: str = ""
    variant: str = ""
    facts: dict[str, Any] = field(default_factory=dict)
    certificate: dict[str, Any] = field(default_factory=dict)
    seconds_per_step: float = 0.0  # a first timing, from which the time of others is planned; 0 without one
    step_samples: list[float] = field(default_factory=list)  # seconds of a step
    joule_samples: list[float] = field(default_factory=list)  # energy of a step [J], where the machine counts it
    copy_samples: list[float] = field(default_factory=list)
    warm_compile_seconds: float | None = None
    peaks: dict[str, float] = field(default_factory=dict)
    scaling: list[tuple[int, float]] = field(default_factory=list)  # (particles, seconds of a step)
    process: WorkerProcess | KeptWorker | None = None
    filled_cache: bool = False  # whether a worker of this process has compiled its kernels

    @property
    def name(self) -> str:
        """`vulkan f32`, `opencl tiled f64`."""
        return f"{self.label} {self.precision}".strip()

    @property
    def label(self) -> str:
        """`vulkan`, `opencl tiled`."""
        return f"{self.backend} {self.variant}".strip()

    @property
    def device_kind(self) -> str:
        """Backends of one kind share a device: "processor" (software drivers too) or "gpu"."""
        return "processor" if self.facts.get("on_processor") else "gpu"

    @property
    def step_seconds(self) -> float | None:
        """Median time of a step."""
        return statistics.median(self.step_samples) if self.step_samples else None

    @property
    def step_spread(self) -> float | None:
        """Interquartile range over median."""
        if len(self.step_samples) < 3:
            return None
        low, middle, high = statistics.quantiles(self.step_samples, n=4, method="inclusive")
        return (high - low) / middle

    def give_up(self, reason: str, status: str = "failed") -> None:
        """Note the reason, and end the process."""
        self.status, self.reason = status, reason
        if self.process is not None:
            self.process.kill()
        self.process = None


def described(row: BackendRow, work: Work, peak: dict[str, float]) -> dict[str, Any]:
    """A row as plain data; `peak` has the `flops` and `bytes` per second that its device reaches in its precision."""
    seconds, found = row.step_seconds, {}
    if seconds:
        rates = {
            "interactions_per_second": work.interactions / seconds,
            "springs_per_second": work.springs * work.evaluations / seconds,
            "particle_steps_per_second": work.particles / seconds,
            "flops": work.flops(row.precision) / seconds,
            "bytes_per_second": work.bytes(row.precision) / seconds,
        }
        found = {name: rate for name, rate in rates.items() if rate}
        for name, most in (("flops", peak.get("flops")), ("bytes_per_second", peak.get("bytes"))):
            if name in found and most:
                found[f"share_of_peak_{name.partition('_')[0]}"] = found[name] / most
    return {
        "label": row.label,
        "backend": row.backend,
        "variant": row.variant or None,
        "precision": row.precision or None,
        "status": row.status,
        "reason": row.reason,
        **row.facts,
        **row.certificate,
        "cold_compile_seconds": row.facts.get("compile_seconds"),
        "warm_compile_seconds": row.warm_compile_seconds,
        "step_seconds": seconds,
        "step_spread": row.step_spread,
        "step_samples": row.step_samples,
        "step_joules": statistics.median(row.joule_samples) if row.joule_samples else None,
        "copy_seconds": statistics.median(row.copy_samples) if row.copy_samples else None,
        "peaks": row.peaks,
        "rates": found,
        "scaling": [{"particle_count": count, "step_seconds": taken} for count, taken in row.scaling],
    }


def peak_of(rows: list[BackendRow], row: BackendRow) -> dict[str, float]:
    """The highest rates of all backends on the same device: flops in the row's precision, bytes in any precision."""
    mates = [mate for mate in rows if mate.status == "ok" and mate.device_kind == row.device_kind and mate.peaks]
    flops = [mate.peaks["flops"] for mate in mates if mate.precision == row.precision]
    copies = [mate.peaks["bytes"] for mate in mates]
    return ({"flops": max(flops)} if flops else {}) | ({"bytes": max(copies)} if copies else {})
