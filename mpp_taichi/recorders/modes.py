"""Modes: amplitudes along a run, their frequencies, and the files they are written to."""

import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.modes.frequency_meter import FrequencyMeter, MeasuredFrequency
from mpp_taichi.modes.mode_set import ModeError, ModeReading, ModeSet, find_modes
from mpp_taichi.scene.spec import ModesSpec

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

PLOT_FORMATS = (".png", ".svg", ".pdf")
FORMATS = (*PLOT_FORMATS, ".csv", ".npz")
SAMPLES_KEPT = 100_000  # with more, every second sample is dropped; frequencies are measured from all
EXCITED = 1e-3  # of the largest amplitude, times √(modal mass); a smaller one is rounding, or is forced by other modes
CAPTION_MODES = 3
SMALL = 1e-9  # of the largest amplitude: captions call it 0


class ModeRecorder:
    """Projects the particles on a few modes, as often as the fastest of them needs; every `every` steps while no mode swings.

    For each mode: its amplitude [length] and rate, its share of the energy of the linear network, and its frequency from the
    times at which it goes through zero. Leakage is the share of the energy outside all of them.
    """

    def __init__(self, simulation: "Simulation", asked: ModesSpec | None, every: int) -> None:
        """Find the modes; where none are asked for, the lowest few.

        Raises:
            ModeError: they do not exist, or cannot be found.
        """
        asked = asked or ModesSpec()
        self.every, self.after = every, asked.after
        spec, start = simulation.spec, simulation.start
        try:
            self.modes: ModeSet = find_modes(spec, start, of=asked.of, show=asked.show, along=asked.along)
        except ModeError as error:
            raise ModeError(f"{spec.source}: {error}") from None
        self.units = simulation.spec.units or {}
        self.title = simulation.spec.title
        self.restart()

    def restart(self) -> None:
        """Forget every sample."""
        self.times: list[float] = []
        self.readings: list[ModeReading] = []
        self._meters = [FrequencyMeter() for _ in self.modes.modes]
        self._shares = np.zeros(len(self._meters))
        self._leakage = 0.0
        self._sample_count, self._moving_samples, self._stride = 0, 0, 1
        self._due_step, self._seen_step = 0, -1

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the next sample."""
        return self._due_step - simulation.step_count

    def record(self, simulation: "Simulation") -> None:
        """Take a sample."""
        self._seen_step = simulation.step_count
        if simulation.time >= self.after:
            self._take(simulation.time, self.modes.read(simulation.snapshot()))
        wanted = min(meter.interval(mode.angular_frequency) for meter, mode in zip(self._meters, self.modes.modes))
        steps = max(1, int(wanted / simulation.dt)) if wanted < math.inf else self.every
        self._due_step = simulation.step_count + steps

    def _take(self, time: float, reading: ModeReading) -> None:
        for meter, amplitude, rate in zip(self._meters, reading.amplitude, reading.rate):
            meter.observe(time, float(amplitude), float(rate))
        if reading.total_energy > 0.0:
            self._moving_samples += 1
            self._shares += (reading.share - self._shares) / self._moving_samples
            self._leakage = max(self._leakage, 1.0 - float(reading.share.sum()))
        if self._sample_count % self._stride == 0:
            self.times.append(time)
            self.readings.append(reading)
            if len(self.times) == SAMPLES_KEPT:
                self.times, self.readings, self._stride = self.times[::2], self.readings[::2], 2 * self._stride
        self._sample_count += 1

    def finish(self, simulation: "Simulation") -> None:
        """Take the last sample, unless there is one of this step."""
        if self._seen_step != simulation.step_count:
            self.record(simulation)

    def measured(self) -> list[MeasuredFrequency | None]:
        """Frequency of each mode; None for a mode that is not excited or has not crossed zero three times."""
        inertia = np.sqrt(self.modes.modal_mass)
        sizes = inertia * [meter.largest for meter in self._meters]
        return [meter.measured() if size >= EXCITED * sizes.max() else None for meter, size in zip(self._meters, sizes)]

    def summary(self) -> dict[str, Any]:
        """`modes`, with an entry for each mode; the source of their theory; and the largest share of the energy outside them.

        Shares are None where springs are slack: the linear network holds no energy in such a mode.
        """
        slack = any(mode.angular_frequency == 0.0 for mode in self.modes.modes)
        rows = []
        for mode, meter, share, found in zip(self.modes.modes, self._meters, self._shares, self.measured()):
            theory = mode.angular_frequency
            error = found.angular_frequency / theory - 1.0 if found and theory > 0.0 else None
            rows.append(
                {
                    "mode": list(mode.numbers),
                    "angular_frequency_theory": theory,
                    "angular_frequency_measured": found.angular_frequency if found else None,
                    "angular_frequency_uncertainty": found.uncertainty if found else None,
                    "relative_frequency_error": error,
                    "amplitude_max": meter.largest,
                    "energy_share": None if slack else float(share),
                }
            )
        return {"modes": rows, "modes_source": self.modes.source, "mode_leakage_max": None if slack else self._leakage}

    def caption(self) -> str:
        """The amplitudes now: `modes (1, 1) +0.0098  (2, 1) -1.2e-06`."""
        if not self.readings:
            return ""
        shown = zip(self.modes.modes[:CAPTION_MODES], self.readings[-1].amplitude)
        rounding = SMALL * max(meter.largest for meter in self._meters)
        return "modes " + "  ".join(f"{mode.label} {a if abs(a) > rounding else 0.0:+.2g}" for mode, a in shown)

    def columns(self) -> dict[str, np.ndarray]:
        """time and total_energy (sample_count,); amplitude, rate and energy_share (sample_count, mode_count)."""
        return {
            "time": np.array(self.times),
            "total_energy": np.array([reading.total_energy for reading in self.readings]),
            "amplitude": np.array([reading.amplitude for reading in self.readings]),
            "rate": np.array([reading.rate for reading in self.readings]),
            "energy_share": np.array([reading.share for reading in self.readings]),
        }

    def save(self, path: Path) -> None:
        """Write the amplitudes as a table, or draw them, as the suffix says; by way of a temporary file.

        Raises:
            OutputError: the file cannot be written.
        """
        with whole_file(path, "the modes") as temporary:
            if path.suffix.lower() in PLOT_FORMATS:
                from mpp_taichi.recorders._mode_plot import draw

                draw(self, temporary)
            elif path.suffix.lower() == ".csv":
                self._write_table(temporary)
            else:
                theory = np.array([mode.angular_frequency for mode in self.modes.modes])
                measured = np.array([found.angular_frequency if found else np.nan for found in self.measured()])
                numbers = np.array([mode.numbers for mode in self.modes.modes])
                found: dict[str, Any] = {**self.columns(), "mode": numbers}
                found |= {"angular_frequency_theory": theory, "angular_frequency_measured": measured}
                with open(temporary, "wb") as raw:
                    np.savez(raw, **found)

    def _write_table(self, path: Path) -> None:
        """One line for each sample; a column `amplitude_2_1` for the amplitude of mode (2, 1), and so on."""
        found = self.columns()
        kinds = ("amplitude", "rate", "energy_share")
        names = ["_".join(map(str, mode.numbers)) for mode in self.modes.modes]
        header = ["time", "total_energy", *(f"{kind}_{name}" for kind in kinds for name in names)]
        table = np.column_stack([found["time"], found["total_energy"], *(found[kind] for kind in kinds)])
        with open(path, "w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerows([header, *([repr(float(value)) for value in row] for row in table)])
