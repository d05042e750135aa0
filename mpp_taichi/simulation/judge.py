"""RunJudge: looks at a run at its start and at its end, and tells by how much its results are wrong."""

import logging
import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mpp_taichi.energy.energy_error import EnergyError
from mpp_taichi.energy.mechanics import kinetic_energies, total
from mpp_taichi.energy.specific_energy import light_particles
from mpp_taichi.errors import AccuracyWarning, ArgumentError, StabilityError
from mpp_taichi.simulation import lost_motion
from mpp_taichi.simulation.massless_watch import MasslessWatch
from mpp_taichi.simulation.verdict import RunFinding, RunVerdict, contact_findings, energy_finding, wall_finding

log = logging.getLogger(__name__)

MODES = ("warn", "raise", "off")
REST = 8
"""A run in many short calls is looked at again after an eighth of the steps that it had at the last look."""


class RunJudge:
    """Collects the findings of a run, the first of each kind, and tells each of them once: as a warning, or as an error.

    It compares the energy, where all forces conserve it, and the energies of massless particles, with those at the first look
    in the phase. Rounding is judged at the start of a phase and contacts by their counts, which costs no launch. `by_recorders`
    leaves the energies to recorders that look at them more often.
    """

    def __init__(self) -> None:
        """Nothing was seen."""
        self.by_recorders = False
        self._tell: Callable[[str], None] = _warn
        self._mode = MODES[0]
        self.restart()

    def use_log(self) -> None:
        """Tell findings by the log, as commands show them, and leave the energies to recorders."""
        self._tell, self.by_recorders = log.warning, True

    def restart(self) -> None:
        """Forget the run, which begins again."""
        self._found: dict[str, RunFinding] = {}
        self._kinetic = 0.0
        self.renew()

    def renew(self) -> None:
        """Compare with the next state from now on: parameters were changed, or the run goes on from elsewhere."""
        self._seen_step: int | None = None
        self._compared = False

    def go_back(self, time: float) -> None:
        """Forget what was found after a time to which the run goes back."""
        self._found = {kind: each for kind, each in self._found.items() if each.time <= time}
        self.renew()

    def note(self, finding: RunFinding) -> None:
        """Keep a finding that was told elsewhere."""
        self._found.setdefault(finding.kind, finding)

    def see(self, row: Mapping[str, Any]) -> None:
        """RunJudge the energy of a sample of a table."""
        self._add(energy_finding(row))

    # Looks

    def begin(self, simulation: Any, mode: str) -> None:
        """Look at the state from which steps are to be taken, unless this was done.

        Raises:
            ArgumentError: there is no such mode.
            StabilityError: the mode is `raise`, and motion would be lost by rounding.
        """
        if mode not in MODES:
            raise ArgumentError(f"judge must be {', '.join(MODES[:-1])} or {MODES[-1]}, got {mode!r}")
        self._mode = mode
        if mode == "off" or (self._seen_step is not None and self._seen_step <= simulation.step_count):
            return
        self._first_step = self._seen_step = simulation.step_count
        self._check_rounding(simulation)
        self._compared = not self.by_recorders
        if self._compared:
            light = len(light_particles(simulation.spec, simulation.phase.particles))
            self._energy_error, self._massless = EnergyError(), MasslessWatch() if light else None
            self._look(simulation)

    def end(self, simulation: Any, *, of_phase: bool = False) -> None:
        """Look at the state at the end of a call of `run`, or of a phase.

        Raises:
            StabilityError: the mode is `raise`, and something was found.
        """
        if self._mode == "off" or self._seen_step is None:
            return
        self._check_contacts(simulation)
        since = simulation.step_count - self._seen_step
        if since and (of_phase or since * REST >= self._seen_step - self._first_step):
            self._look_again(simulation)

    def close(self, simulation: Any) -> None:
        """Look at the steps after the last look; a finding is a warning now, for an error would hide the end of a block."""
        if self._mode != "off" and self._seen_step is not None:
            self._mode = "warn"
            self.end(simulation, of_phase=True)

    def verdict(self, simulation: Any) -> RunVerdict:
        """The judgement of the present state, which is looked at if it was not."""
        if self._seen_step is not None and simulation.is_alive:
            mode, self._mode = self._mode, "off"  # asked for, so that nothing is told
            try:
                self._check_contacts(simulation)
                if simulation.step_count > self._seen_step:
                    self._look_again(simulation)
            finally:
                self._mode = mode
        return RunVerdict(tuple(self._found.values()))

    def _look_again(self, simulation: Any) -> None:
        self._seen_step = simulation.step_count
        if simulation.contacts is not None and simulation.contacts.setup.enclosure.surfaces:
            self._add(wall_finding(simulation.contacts.setup, simulation.snapshot()))
        if self._compared:
            self._look(simulation)

    def _look(self, simulation: Any) -> None:
        phase = simulation.phase
        if phase.conserves_energy and "energy" not in self._found:
            with np.errstate(over="ignore", invalid="ignore"):
                now = simulation.mechanics()
                error = self._energy_error.see(
                    now["kinetic_energy"], now["potential_energy"], phase_number=0, phase_energy=None
                )
            self._add(energy_finding({"relative_energy_error": error, "time": simulation.time, "conserves_energy": True}))
        self._look_at_massless(simulation)

    def _look_at_massless(self, simulation: Any) -> None:
        if "massless" in self._found or self._massless is None:
            return
        here = simulation.mark()
        try:
            self._massless.record(simulation)
        except StabilityError as error:
            finding = RunFinding("massless", str(error), simulation.time, error.particle)
            if self._mode == "raise":
                self.note(finding)
                raise
            simulation.return_to(here)
            self._add(finding)

    def _check_contacts(self, simulation: Any) -> None:
        if simulation.contacts is None:
            return
        report = simulation.contact_report
        if report.missed_energy > 0.0:
            self._kinetic = max(self._kinetic, total(kinetic_energies(simulation.snapshot())))
        for found in contact_findings(report, self._kinetic, simulation.time):
            self._add(found)

    def _check_rounding(self, simulation: Any) -> None:
        if simulation.integrator.carries_rounding or not simulation.launcher.takes_steps:
            return
        fields = [force.parameters["acceleration"] for force in simulation.spec.forces_with("is_uniform")]
        uniform = np.sum(fields, axis=0) if fields else np.zeros(3)
        precision = simulation.device.precision
        self._add(lost_motion.finding(simulation.snapshot(), dt=simulation.dt, precision=precision, uniform=uniform))

    def _add(self, finding: RunFinding | None) -> None:
        """Keep a finding, and tell it if it is the first of its kind."""
        if finding is None or finding.kind in self._found:
            return
        self._found[finding.kind] = finding
        if self._mode == "raise":
            error = StabilityError(finding.message)
            error.step, error.time, error.particle = None, finding.time, finding.particle
            raise error
        if self._mode == "warn":
            self._tell(finding.message)


def _warn(message: str) -> None:
    """A Python warning at the line of the program that called this package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("mpp_taichi."):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, AccuracyWarning, stacklevel=level)
