"""Speed histogram: the distribution of the speeds of a gas beside the curve of theory, and its files."""

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.errors import OutputError
from mpp_taichi.kinetic_theory import kolmogorov_smirnov
from mpp_taichi.kinetic_theory.speeds import kinetic_temperature, speed_cumulative, speed_density, speed_scale

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

PLOT_FORMATS = (".png", ".svg", ".pdf")
FORMATS = (*PLOT_FORMATS, ".csv", ".npz")
BINS = 30
REACH = 3.0  # of the curve at least, in units of b; beyond it are 10⁻⁴ of the particles
SAMPLES_KEPT = 1000  # with more, every second sample is dropped


class SpeedHistogram:
    """Speeds of the particles that are free along every axis: in the last sample, or in all samples from `after` on together.

    The curve belongs to the mean kinetic temperature of these samples; where masses differ it is the mean of the curves of all
    particles.
    """

    def __init__(self, simulation: "Simulation", *, after: float | None = None, every: int = 1) -> None:
        """Take a sample every `every` steps from `after` on; without `after`, at the end only.

        Raises:
            OutputError: no particle is free.
        """
        spec, start = simulation.spec, simulation.start
        self.after, self.every = after, max(1, every)
        self.title, self.dimensions = spec.title, spec.dimensions
        units = spec.units or {}
        self.speed_unit = f"{units['length']}/{units['time']}" if units else ""
        if start.merged_into is not None:
            raise OutputError(f"{spec.source}: there is no histogram of the speeds of spheres that merge: their masses change")
        if start.changing:
            raise OutputError(f"{spec.source}: there is no histogram of the speeds of particles whose masses change")
        self._rows = np.flatnonzero(start.free.all(axis=1))
        self.mass = start.mass[self._rows]
        if len(self._rows) == 0:
            raise OutputError(f"{spec.source}: there are no free particles whose speeds could be drawn")
        self.restart()

    def restart(self) -> None:
        """Forget every sample."""
        self._speeds: list[np.ndarray] = []
        self._temperatures: list[float] = []
        self._seen_step, self._sample_count, self._stride = -1, 0, 1
        self.time = 0.0

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the next sample; without `after` there is none before the end."""
        if self.after is None:
            return 2**31
        return 0 if self._seen_step < 0 else self._seen_step + self.every - simulation.step_count

    def record(self, simulation: "Simulation") -> None:
        """Take a sample."""
        self._seen_step, self.time = simulation.step_count, simulation.time
        if self.after is not None and simulation.time < self.after:
            return
        snapshot = simulation.snapshot()
        if self._sample_count % self._stride == 0:
            self.add(snapshot.velocity[self._rows])
        self._sample_count += 1
        if len(self._speeds) == SAMPLES_KEPT:
            self._speeds, self._temperatures = self._speeds[::2], self._temperatures[::2]
            self._stride *= 2

    def add(self, velocity: np.ndarray) -> None:
        """Keep the velocities of the free particles at one time, (n, 3)."""
        self._speeds.append(np.linalg.norm(velocity, axis=1))
        self._temperatures.append(kinetic_temperature(velocity, self.mass, self.dimensions))

    def finish(self, simulation: "Simulation") -> None:
        """Take the last sample, unless there is one of this step."""
        if self._seen_step != simulation.step_count:
            self.record(simulation)

    @property
    def temperature(self) -> float:
        """k T, mean over the samples."""
        return float(np.mean(self._temperatures)) if self._temperatures else 0.0

    @property
    def label(self) -> str:
        """The number of particles, and the time or the number of samples."""
        samples = len(self._speeds)
        return (
            f"{len(self.mass):,} particles at time {self.time:.6g}"
            if samples == 1
            else f"{len(self.mass):,} particles, {samples} samples"
        )

    @property
    def distance(self) -> float:
        """Kolmogorov–Smirnov distance of the last sample from the curve; 1 where nothing moves."""
        scale = speed_scale(self.mass, self.temperature)
        if not (self._speeds and self.temperature > 0.0):
            return 1.0
        return kolmogorov_smirnov.distance(speed_cumulative(self._speeds[-1], scale, self.dimensions))

    def theory(self, speed: np.ndarray) -> np.ndarray:
        """The curve f(v) [time / length], mean over the particles."""
        masses, counts = np.unique(self.mass, return_counts=True)
        if not self.temperature > 0.0:
            return np.zeros_like(speed)
        curves = [speed_density(speed, speed_scale(mass, self.temperature), self.dimensions) for mass in masses]
        return np.average(curves, axis=0, weights=counts)

    def columns(self) -> dict[str, np.ndarray]:
        """edge (BINS + 1,); density, its standard_error as of independent samples, and theory over the bin (BINS,).

        The number of particles in a bin is binomial, with the variance n p (1 − p) for the share p of all n particles.
        """
        speeds = np.concatenate([np.zeros(0), *self._speeds])
        largest = float(speeds.max()) if len(speeds) else 0.0
        reach = max(1.0001 * largest, REACH * float(np.max(speed_scale(self.mass, self.temperature)))) or 1.0
        edge = np.linspace(0.0, reach, BINS + 1)
        counts, _ = np.histogram(speeds, edge)
        whole, width = max(1, len(speeds)), reach / BINS
        masses, numbers = np.unique(self.mass, return_counts=True)
        below = np.zeros(BINS + 1)
        if self.temperature > 0.0:
            cumulative = [speed_cumulative(edge, speed_scale(mass, self.temperature), self.dimensions) for mass in masses]
            below = np.average(cumulative, axis=0, weights=numbers)
        return {
            "edge": edge,
            "density": counts / (whole * width),
            "standard_error": np.sqrt(counts * (1.0 - counts / whole)) / (whole * width),
            "theory": np.diff(below) / width,
        }

    def save(self, path: Path) -> None:
        """Draw the histogram or write it as a table, as the suffix says; by way of a temporary file.

        Raises:
            OutputError: the suffix is none of `FORMATS`, or the file cannot be written.
        """
        suffix = path.suffix.lower()
        if suffix not in FORMATS:
            raise OutputError(f"{path}: the histogram's format {path.suffix!r} is none of {', '.join(FORMATS)}")
        with whole_file(path, "the histogram") as temporary:
            if suffix in PLOT_FORMATS:
                from mpp_taichi.recorders._speed_plot import draw

                draw(self, temporary)
            elif suffix == ".csv":
                self._write_table(temporary)
            else:
                found: dict[str, Any] = {**self.columns(), "temperature": self.temperature, "distance": self.distance}
                with open(temporary, "wb") as raw:
                    np.savez(raw, **found)

    def _write_table(self, path: Path) -> None:
        """One line for each bin, its two edges first."""
        found = self.columns()
        header = ["from", "to", "density", "standard_error", "theory"]
        table = np.column_stack([found["edge"][:-1], found["edge"][1:], *(found[name] for name in header[2:])])
        with open(path, "w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerows([header, *([repr(float(value)) for value in row] for row in table)])
