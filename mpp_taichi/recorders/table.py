"""Table: conserved quantities sampled along a run, their errors, and the files they are written to."""

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.energy.energy_error import EnergyError, ratio, scale_of
from mpp_taichi.errors import OutputError, SceneError
from mpp_taichi.quantities._base import Setting
from mpp_taichi.recorders._measured_columns import MeasuredColumns
from mpp_taichi.recorders._simulation_sample import SimulationSample

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

SAMPLES_PER_RUN = 200
SPARSE_STEPS = 20  # the potential of 3073 bodies took six of their steps; so far apart, samples are a quarter of a run
FORMATS = (".csv", ".npz")
_SCALARS = ("time", "step", "kinetic_energy", "potential_energy", "total_energy")
_BALANCE = ("dissipated_energy", "work", "heat", "energy_balance_residual")  # only with an energy balance; heat with a bath
_VECTORS = ("momentum", "angular_momentum", "center_of_mass")
ERRORS = ("relative_energy_error", "momentum_error", "angular_momentum_error", "center_of_mass_error")


def asked_columns(simulation: "Simulation") -> MeasuredColumns | None:
    """The columns that `record: {table: {columns: […]}}` of a scene names; None where it names none.

    Raises:
        SceneError: a quantity is not defined for this scene, or its header is to have units and the scene has none.
    """
    table = simulation.spec.record.table
    if table is None:
        return None
    if table.units and simulation.spec.units is None:
        raise SceneError(f"{table.location}: record.table.units: the scene names no units; write units: as well")
    found = MeasuredColumns(Setting(simulation.spec, simulation.start))
    for number, entry in enumerate(table.columns):
        found.add(entry, f"record.table.columns[{number}]")
    return found


class TableRecorder:
    """Samples energies, momentum, angular momentum and centre of mass every `every` steps, all in f64.

    With `asked` it samples these quantities besides, and its file has their columns in place of its own.

    Errors are against the first sample; the error of the energy is against the energy at the start of the present phase:

    relative_energy_error   |E − E₀| / |E₀|; where E₀ is zero, over the largest kinetic + |potential| seen so far instead
    momentum_error          |P − P₀| over the largest Σ m |v| seen so far
    angular_momentum_error  |L − L₀| over the largest Σ m |x| |v| seen so far
    center_of_mass_error    distance of the centre of mass from uniform motion, over the radius of the system at the start,
                            or over its own largest way where the system is a point

    Where an external force acts or a particle is held (`conserves_momentum` is False), the last three are changes, not errors.

    `validity`, if given, is a function of the time: 1 where positions are valid, 0 where not, NaN where unknown, for a last
    column `valid`.

    With an energy balance also energy_balance_error, |E + D − W − Q − E₀| over the largest kinetic energy, dissipated energy D,
    |work| W or |heat| Q of a bath in the whole run, or over its largest kinetic + |potential| where these four are no more than
    rounding.
    """

    def __init__(self, every: int, asked: MeasuredColumns | None = None) -> None:
        """Sample every `every` steps; `finish` takes the last sample."""
        self.every, self.asked = max(1, every), asked
        self.rows: list[dict[str, Any]] = []
        self.validity: Callable[[float], float] | None = None
        self.restart()

    def restart(self) -> None:
        """Forget every sample."""
        self.rows.clear()
        if self.asked is not None:
            self.asked.restart()
        self._drift = np.zeros(3)
        self._radius = 0.0
        self._phase_number = 0
        self._energy_error = EnergyError()
        self._largest = dict.fromkeys(("momentum", "angular_momentum", "way"), 0.0)

    def go_back(self, simulation: "Simulation") -> None:
        """Forget the samples from the step on to which a simulation has gone back; a new sample is taken there."""
        self.rows[:] = [row for row in self.rows if row["step"] < simulation.step_count]
        self._phase_number = -1  # the phase that comes may have the number of a phase that is forgotten
        if not self.rows:
            self.restart()

    @staticmethod
    def every_for(steps: int | None, *, sparse: bool = False) -> int:
        """Steps between samples that make about `SAMPLES_PER_RUN` of them; of an endless run, every 100th step.

        `sparse` keeps `SPARSE_STEPS` between two samples at least, where summing the energy costs as much as several steps.
        """
        return max(SPARSE_STEPS if sparse else 1, 100 if steps is None else steps // SAMPLES_PER_RUN)

    @staticmethod
    def every_of(simulation: "Simulation", steps: int | None) -> int:
        """Steps between samples of a run of so many steps: as the scene says by `run.every`, else `every_for`."""
        sparse = simulation.total_force.has_pairs and simulation.plan == "parallel"
        return simulation.scene.run.every or TableRecorder.every_for(steps, sparse=sparse)

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the next sample; a new phase has a sample at its beginning."""
        if self.rows and simulation.phase_number != self._phase_number:
            return 0
        return self.rows[-1]["step"] + self.every - simulation.step_count if self.rows else 0

    def record(self, simulation: "Simulation") -> None:
        """Take a sample."""
        with np.errstate(over="ignore", invalid="ignore"):  # the watchdog finds numbers that overflow
            sample = SimulationSample(simulation)
            row = dict(sample.mechanics)
            if not self.rows:
                self._remember_start(simulation)
            self._phase_number = simulation.phase_number
            kept = {
                "conserves_energy": simulation.phase.conserves_energy,
                "conserves_momentum": simulation.phase.conserves_momentum,
            }
            self.rows.append({**row, **self._errors(row, simulation), **kept})
            if self.asked is not None:
                self.rows[-1]["asked"] = self.asked.measure(sample)

    def finish(self, simulation: "Simulation") -> None:
        """Take the last sample, unless there is one of this step."""
        if not self.rows or self.rows[-1]["step"] != simulation.step_count:
            self.record(simulation)

    def _remember_start(self, simulation: "Simulation") -> None:
        snapshot = simulation.snapshot()
        weight = (
            snapshot.mass / snapshot.mass.sum()
            if snapshot.mass.sum()
            else np.full(len(snapshot.mass), 1.0 / len(snapshot.mass))
        )
        self._drift = weight @ snapshot.velocity
        self._radius = float(np.linalg.norm(snapshot.position - weight @ snapshot.position, axis=1).max())

    def _errors(self, row: dict[str, Any], simulation: "Simulation") -> dict[str, float]:
        first = self.rows[0] if self.rows else row
        way = row["center_of_mass"] - first["center_of_mass"]
        self._raise("momentum", row["momentum_scale"])
        self._raise("angular_momentum", row["angular_momentum_scale"])
        self._raise("way", math.hypot(*way))
        largest = self._largest
        uniform = self._drift * (row["time"] - first["time"])
        return {
            "relative_energy_error": self._energy_error.see(
                row["kinetic_energy"],
                row["potential_energy"],
                phase_number=simulation.phase_number,
                phase_energy=simulation.phase_energy,
            ),
            "momentum_error": _ratio(row["momentum"] - first["momentum"], largest["momentum"]),
            "angular_momentum_error": _ratio(row["angular_momentum"] - first["angular_momentum"], largest["angular_momentum"]),
            "center_of_mass_error": _ratio(way - uniform, self._radius or largest["way"]),
        }

    def _raise(self, name: str, value: float) -> None:
        self._largest[name] = max(self._largest[name], value)

    def summary(self) -> dict[str, float]:
        """First and last energy, and the largest of every error (`relative_energy_error_max`, …).

        `conserved_energy_error_max` is the largest error of the energy while every force present had a potential; it is absent
        where some force never had one.
        """
        found = {
            "total_energy_initial": self.rows[0]["total_energy"],
            "total_energy_final": self.rows[-1]["total_energy"],
            "kinetic_energy_final": self.rows[-1]["kinetic_energy"],
            "potential_energy_final": self.rows[-1]["potential_energy"],
        }
        if kept := [row["relative_energy_error"] for row in self.rows if row["conserves_energy"]]:
            found["conserved_energy_error_max"] = max(kept)
        found |= {f"{name}_max": max(row[name] for row in self.rows) for name in ERRORS}
        if self.is_balanced:
            found |= {name: self.rows[-1][name] for name in _BALANCE[:3] if name in self.rows[-1]}
            found["energy_balance_error_max"] = max(self._balance_errors())
        return found

    @property
    def is_balanced(self) -> bool:
        """Whether the samples hold an energy balance."""
        return bool(self.rows) and _BALANCE[0] in self.rows[0]

    def _balance_errors(self) -> list[float]:
        turnover, largest = max(row["energy_turnover"] for row in self.rows), self._energy_error.largest
        return [_ratio(row["energy_balance_residual"], scale_of(turnover, largest)) for row in self.rows]

    def _of_balance(self) -> list[str]:
        """The columns of the energy balance that every sample has; a bath may come with a later phase."""
        return [name for name in _BALANCE if all(name in row for row in self.rows)]

    def _derived(self) -> dict[str, list[float]]:
        """The columns that are computed from others: the errors, and the energy balance where it is kept."""
        found = {name: [row[name] for row in self.rows] for name in (*ERRORS, *self._of_balance())}
        found |= {"energy_balance_error": self._balance_errors()} if self.is_balanced else {}
        return found | self._valid()

    def _valid(self) -> dict[str, list[float]]:
        """The column `valid`, where it is asked for."""
        return {} if self.validity is None else {"valid": [self.validity(row["time"]) for row in self.rows]}

    def columns(self) -> dict[str, Any]:
        """Every column: scalars (sample_count,), vectors (sample_count, 3); or the columns asked for, (sample_count,) each."""
        if self.asked is not None:
            found = {name: np.array([row["asked"][k] for row in self.rows]) for k, name in enumerate(self.asked.names)}
            return found | {name: np.array(values) for name, values in self._valid().items()}
        measured = {name: [row[name] for row in self.rows] for name in (*_SCALARS, *_VECTORS)}
        return {name: np.array(values) for name, values in (measured | self._derived()).items()}

    def save(self, path: Path) -> None:
        """Write the table as its suffix says, by way of a temporary file.

        Raises:
            OutputError: the suffix is none of `FORMATS`, or the file cannot be written.
        """
        if path.suffix.lower() not in FORMATS:
            raise OutputError(f"{path}: the table format {path.suffix!r} is none of {', '.join(FORMATS)}")
        with whole_file(path, "the table") as temporary:
            if path.suffix.lower() == ".csv":
                with open(temporary, "w", encoding="utf-8", newline="") as stream:
                    csv.writer(stream).writerows(self._lines())
            else:
                with open(temporary, "wb") as raw:
                    np.savez(raw, **self.columns())

    def _lines(self) -> list[Sequence[str]]:
        """Header and rows; numbers in their shortest exact spelling."""
        valid = self._valid()
        if self.asked is not None:
            table = [(*row["asked"], *more) for row, *more in zip(self.rows, *valid.values(), strict=True)]
            spec = self.asked.setting.spec.record.table
            names = self.asked.header if spec is not None and spec.units else self.asked.names
            return [[*names, *valid], *([repr(float(value)) for value in row] for row in table)]
        derived = self._derived()
        header = [*_SCALARS, *(f"{name}_{axis}" for name in _VECTORS for axis in "xyz"), *derived]
        lines: list[Sequence[str]] = [header]
        for row, *rest in zip(self.rows, *derived.values(), strict=True):
            numbers = [row[name] for name in _SCALARS]
            numbers += [value for name in _VECTORS for value in row[name]]
            numbers += rest
            lines.append([repr(value) if isinstance(value, int) else repr(float(value)) for value in numbers])
        return lines


def _ratio(change: Any, scale: float) -> float:
    """The length of a change, of a number or a vector, over a scale; 0 where both are 0."""
    return ratio(math.hypot(*np.atleast_1d(change)), scale)
