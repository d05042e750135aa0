"""Elsewhere: the setting that a study recommends, run and timed on every other backend that starts on this machine.

A backend takes the fastest setting of the CPU that reaches the target and whose method runs there, with the same step and in
the same precision. Where the backend does not have this precision, or the run misses the target, more exact precisions follow
from f32 on. A backend is left out where the rest of the budget is too short, and the study says so.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

from mpp_taichi.accuracy.budget import OutOfTime
from mpp_taichi.accuracy.chaos import ROUND_OFF
from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.reference_machines import DEVICE as REFERENCE
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.study import Study
from mpp_taichi.accuracy.sweep import StepSweep
from mpp_taichi.accuracy.verdict import choice, duration
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.device import backends
from mpp_taichi.device.availability import BACKENDS, availability
from mpp_taichi.errors import BackendError, MppError, PrecisionError
from mpp_taichi.precision import PRECISIONS

START_SECONDS = 0.5  # to start a backend, at least
EVALUATIONS = 2.0  # a step with more forces compiles longer than on the CPU, in proportion: 1 to 13 times as long on Vulkan
REPEATS_SHARE = 0.05  # of the budget
METHOD, PRECISION = "method", "precision"  # parts of a setting that a backend does not have


class _TooShort(Exception):
    """The rest of the budget is too short for a setting."""


class Elsewhere:
    """The recommended setting of a study, for a target of its quantity, on other backends."""

    def __init__(self, study: Study, target: float, precisions: Sequence[str] = PRECISIONS) -> None:
        """Begin without a run; only these `precisions` are tried."""
        self._study, self._target, self._precisions = study, target, precisions

    def run(self) -> None:
        """Run the setting on each backend for which the study has no run of it; the store keeps the runs.

        A backend that does not start is left out without a word.
        """
        try:
            if self._choice(set()) is not None:
                for backend in BACKENDS:
                    if backend != REFERENCE[0]:
                        self._on(backend)
        finally:
            self._study.store.save()

    # Internals

    def _choice(self, refused: set[str]) -> StudyRow | None:
        """The recommended setting on the CPU, by another method than the refused methods."""
        made = [(row, row.sample.configuration) for row in self._study.rows()]
        rows = [row for row, here in made if here.backend == REFERENCE[0] and here.integrator not in refused]
        return choice(rows, self._study.quantity or "", self._target)

    def _on(self, backend: str) -> None:
        study, began = self._study, time.perf_counter()
        report = availability(backend)
        study.budget.wait(time.perf_counter() - began)
        if not report["available"]:
            return
        notes = study.store.notes.setdefault("elsewhere", {})
        if notes.get(backend, {}).get("device") != report["device"]:  # what is known of another device does not count
            notes[backend] = {"device": report["device"], "lacks": {}, "runs": []}
        try:
            self._try_methods(backend, notes[backend]["lacks"], notes[backend]["runs"])
        except _TooShort as told:
            study.leave_out(f"{backend}: {told}")
        except OutOfTime:
            study.leave_out(f"{backend}: the budget ended during the run of the setting for {self._target:g}")

    def _try_methods(self, backend: str, lacks: dict[str, str], runs: list[str]) -> None:
        """Try the settings in turn until a run reaches the target; `lacks` and `runs` are what is known of the backend."""
        refused: set[str] = set()
        while (row := self._choice(refused)) is not None:
            for setting in self._settings(row, backend):
                if setting.key not in lacks and setting.key not in runs:
                    lacking = self._measure(setting, row.sample)
                    if lacking:
                        lacks[setting.key] = lacking
                    else:
                        runs.append(setting.key)
                if lacks.get(setting.key) == METHOD:
                    refused.add(setting.integrator)
                    break
                if setting.key in runs and self._reaches(setting):
                    return
            else:
                return
        self._study.leave_out(f"{backend}: no method that reaches {self._target:g} on the CPU runs there")

    def _settings(self, row: StudyRow, backend: str) -> Iterator[Configuration]:
        """The setting of a row on another backend, in its own precision and then in others, the least exact first."""
        here = row.sample.configuration
        others = [each for each in PRECISIONS if each != here.precision and ROUND_OFF.get(each, 0.0) < self._target]
        for precision in (here.precision, *others):
            if precision in self._precisions:
                yield replace(here, backend=backend, precision=precision)

    def _reaches(self, setting: Configuration) -> bool:
        """Whether the run of a setting reached the target."""
        sample, quantity = self._study.store.get(setting), self._study.quantity
        return sample is not None and quantity is not None and self._study.error(sample, quantity).bound <= self._target

    def _measure(self, setting: Configuration, on_cpu: Sample) -> str:
        """Run a setting and keep its sample; the part of the setting that the backend does not have, or an empty text.

        Raises:
            _TooShort: the rest of the budget is too short.
            OutOfTime: the budget ended during the run.
        """
        study, budget = self._study, self._study.budget
        evaluations = study.methods[setting.integrator].evaluations if setting.integrator in study.methods else 1.0
        compiling = START_SECONDS + max(1.0, evaluations / EVALUATIONS) * on_cpu.compile_seconds
        if compiling > budget.left():
            raise _TooShort("the budget left no time for a run there")
        try:
            backends.start(setting.backend, setting.precision)
        except BackendError:
            return PRECISION
        study.tell(f"{setting.backend} {setting.precision}: {setting.integrator}, {on_cpu.setting}")
        with Workbench(study.problem, backend=setting.backend, precision=setting.precision) as bench:
            try:
                machine = bench.machine(setting.integrator)
            except MppError as error:
                return PRECISION if isinstance(error, PrecisionError) else METHOD
            wanted = study.problem.wanted
            seconds = setting.steps * machine.budget_per_step * (1.0 if wanted is None else 1.0 + wanted.runs)
            if seconds > budget.left():
                told = f"{setting.integrator} in {setting.precision}, {on_cpu.setting}"
                raise _TooShort(f"{told}, would take about {duration(seconds)} there, for which the budget left no time")
            sweep = StepSweep(
                bench, study.store, budget, study.methods, lambda sample: study.error(sample, study.quantity or "").bound
            )
            sweep.measure(setting)
            sweep.repeat(share=min(1.0, budget.used + REPEATS_SHARE))
            sweep.weigh(share=1.0)
        return ""
