"""Value desk: the state of a search for reference values, and the steps that all ways of searching have in common."""

from collections.abc import Callable

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.measuring import with_runs
from mpp_taichi.accuracy.methods import StudyMethod
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference_machines import machine_of
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.sweep import timed
from mpp_taichi.accuracy.value_reference import MEANING, ValueReference, scales_of
from mpp_taichi.accuracy.wanted import Wanted
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.quantities._base import Setting

WELL_KNOWN = 1e-13  # a bar below which no better reference is tried
WITHIN_AIM = 0.05  # of an aim: no better reference is tried below this bar
PATIENCE = 3  # runs without a value, each with half of the steps, after which the quantity counts as undefined


class ValueDesk:
    """What a search knows so far.

    aim        the only error of interest, or None
    problem    the problem with the number of runs and of samples that the quantity needs
    reference  None until it is found
    reason     why there is no value, where a run said so
    undefined  runs in turn that had no value
    ended      whether more runs would change nothing
    """

    def __init__(
        self, problem: Problem, store: Store, budget: Budget, methods: dict[str, StudyMethod], tell: Callable[[str], None]
    ) -> None:
        """Begin without a reference."""
        assert problem.wanted is not None
        self.problem, self.store, self.budget, self.methods, self.tell = problem, store, budget, methods, tell
        self.own = methods[problem.own_method]
        self.aim: float | None = None
        self.reference: ValueReference | None = None
        self.reason = ""
        self.conserves_energy = False
        self.undefined = 0
        self.ended = False

    @property
    def wanted(self) -> Wanted:
        """The quantity."""
        assert self.problem.wanted is not None
        return self.problem.wanted

    @property
    def is_known(self) -> bool:
        """Whether errors can be told."""
        return self.reference is not None and self.reference.trusted

    @property
    def enough(self) -> float:
        """A bar over the scale below which no better reference is tried."""
        return WELL_KNOWN if self.aim is None else WITHIN_AIM * self.aim

    @property
    def is_enough(self) -> bool:
        """Whether no better reference is tried."""
        return self.reference is not None and self.reference.trusted and self.reference.bar <= self.enough

    @property
    def suffices(self) -> bool:
        """Whether the aim is well above the bar of the reference."""
        return self.reference is not None and self.is_known and (self.aim is None or 2.0 * self.reference.bar <= self.aim)

    def recall(self) -> bool:
        """Take the reference that the store has; whether it is trusted."""
        known = self.store.notes.get("values")
        if known is None:
            return False
        self.reference = ValueReference(**known)
        self.problem = with_runs(
            self.problem, runs=self.reference.runs, samples=self.reference.samples, shift=self.reference.shift
        )
        return self.is_known

    def change(self, bench: Workbench, **changes: float) -> None:
        """Go on with another number of runs or samples, or with another shift of the starts."""
        self.problem = with_runs(self.problem, **changes)
        bench.shorten(self.problem)

    def sampled(self, machine: Machine, configuration: Configuration) -> Sample:
        """The sample of a configuration, which is kept."""
        sample, _ = machine.run(configuration, self.budget)
        timed(machine, sample, self.budget)
        self.store.add(sample)
        self.conserves_energy = self.conserves_energy or sample.energy is not None
        if sample.values:
            self.undefined = 0
        else:
            self.undefined += sample.status == "undefined"
            self.reason = sample.reason
        return sample

    def take(
        self,
        machine: Machine,
        values: np.ndarray,
        bars: np.ndarray,
        samples: int,
        differences: list[float],
        *,
        steps: int = 0,
        tolerance: float | None = None,
        sure: bool | None = None,
        scatters: np.ndarray | None = None,
    ) -> None:
        """Keep a reference; `sure` says whether it is trusted, by default where its bar is below MEANING."""
        scales = scales_of(self.wanted, values, bars)
        trusted = bool(np.max(bars / scales) < MEANING) if sure is None else sure
        self.reference = ValueReference(
            self.wanted.name,
            self.wanted.labels(Setting(self.problem.spec, self.problem.start)),
            values=[float(each) for each in values],
            bars=[float(each) for each in bars],
            scatters=[0.0] * len(values) if scatters is None else [float(each) for each in scatters],
            scales=[float(each) for each in scales],
            runs=self.wanted.runs,
            samples=self.problem.samples,
            trusted=trusted,
            integrator=machine.name,
            steps=steps or samples,
            differences=differences,
            control="" if tolerance is None else machine.integrator.controlled_by,
            tolerance=tolerance,
            shift=self.wanted.shift,
        )
        self.store.notes["values"] = self.reference.facts()

    def machine_of(self, bench: Workbench, name: str) -> Machine | None:
        """See reference_machines.machine_of."""
        return machine_of(bench, name, self.methods, self.budget)
