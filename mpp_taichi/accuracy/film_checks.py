"""Film checks: which runs show every frame of a film right, and not only its end.

The error of a run at the end may be far smaller than on the way: an eccentric orbit that ends far from the pericentre, a swing
that ends where it turns. So the fastest runs that a film could use are followed over LOOKS times, and compared with the path of
the most exact run. Between the samples of this path its positions are cubics through positions and velocities.
"""

import math
from dataclasses import replace

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.reference import MEANING as FILM
from mpp_taichi.accuracy.reference_machines import DEVICE as REFERENCE
from mpp_taichi.accuracy.sample import Configuration
from mpp_taichi.accuracy.study import Study
from mpp_taichi.accuracy.trace import Trace
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.arithmetic.hermite import cubic

LOOKS = 1000  # of a run that is checked
PATH_LOOKS = 4000  # of the path, at most MOST_NUMBERS of them
MOST_NUMBERS = 2**22
EXACT = 1e-4  # part of FILM: the error at the end of a run whose path is exact enough
FALL = 16.0  # of the error of a cubic where its span is halved
MOST_CHECKED = 4  # runs on one workbench
SHARE = 0.02  # of the budget that one check may take


class FilmChecks:
    """Notes in samples the largest error over a run, `along`, of the fastest runs that a film could use."""

    def __init__(self) -> None:
        """Begin without a path."""
        self._path: Trace | None = None
        self._bar = math.inf  # error of the cubics, relative to the size of the system

    def run(self, study: Study, bench: Workbench) -> None:
        """Check runs of a workbench, of a study that compares positions of particles without contacts."""
        known = study.reference
        if study.quantity != "position" or known is None or study.problem.has_contacts:
            return
        here = (bench.backend, bench.precision)
        rows = [row for row in study.rows() if _is_of(row, here)]
        compiled = [row for row in rows if row.sample.configuration.integrator in bench.machines]
        right = [row for row in rows if row.sample.along is not None and row.sample.along <= FILM]
        least = min((row.seconds or math.inf for row in right), default=math.inf)
        ratio = 1.0  # of the largest error on the way over the error at the end
        for _ in range(MOST_CHECKED):
            usable = [row for row in compiled if ratio * row.position.bound <= FILM and (row.seconds or math.inf) < least]
            fastest = min(usable, key=lambda row: row.seconds or math.inf, default=None)
            if fastest is None:
                return
            sample = fastest.sample
            if sample.along is None:
                if self._path is None and here == REFERENCE:
                    self._find_path(study, bench, compiled, known.size)
                if self._path is None or self._bar > FILM / 10.0:
                    return
                path = _followed(study, bench, sample.configuration, LOOKS)
                if path is None:
                    return
                sample.along = self._apart(path, known.size) + self._bar
                study.store.add(sample)
            if sample.along <= FILM:
                return
            ratio = max(ratio, sample.along / fastest.position.bound)
            compiled.remove(fastest)

    def _find_path(self, study: Study, bench: Workbench, rows: list[StudyRow], size: float) -> None:
        """The path of the fastest run that is exact enough, or else of the most exact run."""
        exact = [row for row in rows if row.position.bound <= EXACT * FILM]
        chosen = min(exact, key=lambda row: row.seconds or math.inf, default=None)
        chosen = chosen or min(rows, key=lambda row: row.position.bound, default=None)
        if chosen is None:
            return
        numbers = 6 * study.problem.start.particle_count
        looks = max(LOOKS, min(PATH_LOOKS, MOST_NUMBERS // numbers))
        path = _followed(study, bench, chosen.sample.configuration, looks)
        if path is None or len(path.times) < 3:
            return
        coarse = Trace(path.times[::2], path.position[::2], velocity=path.velocity[::2])
        self._path, self._bar = coarse, 0.0
        self._path, self._bar = path, self._apart(path, size) / FALL

    def _apart(self, run: Trace, size: float) -> float:
        """The largest distance of a particle from the path, at any time of a run, relative to the size of the system."""
        path = self._path
        assert path is not None
        after = np.clip(np.searchsorted(path.times, run.times), 1, len(path.times) - 1)
        largest = 0.0
        for time, number, position in zip(run.times, after, run.position):
            before, behind = ((path.position[k], path.velocity[k]) for k in (number - 1, number))
            begin, span = path.times[number - 1], path.times[number] - path.times[number - 1]
            there = cubic((time - begin) / span, span, before, behind)
            largest = max(largest, float(np.linalg.norm(position - there, axis=-1).max()) / size)
        return largest


def _is_of(row: StudyRow, device: tuple[str, str]) -> bool:
    """Whether a row is of a run to the end on a device, with a time."""
    configuration = row.sample.configuration
    return (configuration.backend, configuration.precision) == device and row.sample.status == "ok" and bool(row.seconds)


def _followed(study: Study, bench: Workbench, configuration: Configuration, looks: int) -> Trace | None:
    """The path of a run with so many samples; None where the budget does not allow the run, or the run breaks off."""
    machine: Machine = bench.machine(configuration.integrator)
    if configuration.tolerance is not None:  # its steps are those between two samples
        configuration = replace(configuration, steps=looks)
    seconds = configuration.steps * machine.budget_per_step
    if seconds > SHARE * study.budget.seconds:
        return None
    return machine.run(configuration, Budget(math.inf, study.budget.look), follow=True, looks=looks)[1]
