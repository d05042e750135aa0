"""Accounts: the counts and energies that a run gathers, kept together so that a bookmark restores all of them at once."""

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpp_taichi.contacts._base import ContactReport
from mpp_taichi.solvers.report import SolverReport

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_balance import EnergyBalance
    from mpp_taichi.simulation.compiled_phase import CompiledPhase


@dataclass(frozen=True, eq=False)
class SavedAccounts:
    """The accounts at one moment."""

    solver_report: SolverReport
    contact_report: ContactReport
    phase_work: tuple[float, ...]
    phase_energy: float | None
    energy_balance: dict[str, Any]


class Accounts:
    """Counts of the solvers, the energy that changes of the scene put in, and the energy balance if one is kept.

    solver_report    of the equations of implicit steps
    contact_report   of the contacts
    phase_work       energy that each change of the scene has put in, one number for each phase after the first [energy]
    phase_energy     total energy that the last change has left; None in the first phase
    energy_balance   dissipated energy and work along the run; None where it is not kept
    """

    def __init__(self) -> None:
        """All counts are 0, and no energy balance is kept."""
        self.energy_balance: EnergyBalance | None = None
        self.phase_work: list[float] = []
        self.restart()

    def restart(self) -> None:
        """Count from the start of the run again."""
        self.solver_report, self.contact_report = SolverReport(), ContactReport()
        self.phase_work.clear()
        self.phase_energy: float | None = None
        if self.energy_balance is not None:
            self.energy_balance.restart()

    def keep_energy_balance(self, phase: "CompiledPhase") -> "EnergyBalance":
        """Keep an energy balance from now on."""
        from mpp_taichi.energy.energy_balance import EnergyBalance

        self.energy_balance = EnergyBalance(phase.power_meter())
        return self.energy_balance

    def measure(self, phase: "CompiledPhase") -> None:
        """Let the energy balance measure the powers in this phase from now on."""
        balance = self.energy_balance
        if balance is not None and not balance.meter.looks_at(phase.state, phase.total_force):
            balance.meter = phase.power_meter()

    def save(self) -> SavedAccounts:
        """A copy of all accounts, for `restore`."""
        balance = {} if self.energy_balance is None else self.energy_balance.copied()
        reports = copy.copy(self.solver_report), copy.copy(self.contact_report)
        return SavedAccounts(*reports, tuple(self.phase_work), self.phase_energy, balance)

    def restore(self, saved: SavedAccounts) -> None:
        """Go back to saved accounts."""
        self.solver_report, self.contact_report = copy.copy(saved.solver_report), copy.copy(saved.contact_report)
        self.phase_work[:], self.phase_energy = saved.phase_work, saved.phase_energy
        if self.energy_balance is not None:
            self.energy_balance.go_back(saved.energy_balance)
