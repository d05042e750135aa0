"""Workbench: a problem compiled for several methods on one device.

A device has one precision at a time: a workbench of another precision ends the present workbench. The compiler takes most
of the time of a study, so a workbench compiles its methods by `short_compilation`: a step computes the same bits as a step of a
run, and takes up to a tenth longer.
"""

from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.device.fast_taichi.short_compilation import short_compilation


class Workbench:
    """The compiled methods of one device and precision, each compiled when it is first needed."""

    def __init__(self, problem: Problem, *, backend: str, precision: str) -> None:
        """Begin without a compiled method."""
        self._whole = problem  # for which methods are compiled, whatever part of it is studied
        self.problem, self.backend, self.precision = problem, backend, precision
        self.machines: dict[str, Machine] = {}

    def machine(self, integrator: str) -> Machine:
        """A compiled method; MppError where the scene does not allow it."""
        if integrator not in self.machines:
            with short_compilation():
                made = Machine(self._whole, integrator, backend=self.backend, precision=self.precision)
            made.problem = self.problem
            self.machines[integrator] = made
        return self.machines[integrator]

    def shorten(self, problem: Problem) -> None:
        """Continue with a part of the same scene, with all of it again, or with another number of samples."""
        self.problem = problem
        for machine in self.machines.values():
            machine.change(problem)

    def __enter__(self) -> "Workbench":
        """Use as a context manager."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close every machine."""
        for machine in self.machines.values():
            machine.close()
        self.machines.clear()
