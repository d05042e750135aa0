"""Sample: one way to run a scene, and its result."""

import math
import statistics
from dataclasses import dataclass, field
from typing import Any

import numpy as np

CLEAR = 2.0  # times the bar of a reference: larger errors are stated as numbers


@dataclass(frozen=True)
class Configuration:
    """One way to run the scene: `steps` equal steps over the span of the study.

    An adaptive method chooses its steps by `tolerance`, the value of its parameter `control`, and `steps` is the number of
    its samples.
    """

    integrator: str
    steps: int
    precision: str
    backend: str
    control: str = ""
    tolerance: float | None = None

    @property
    def key(self) -> str:
        """`leapfrog-f64-cpu-12400`, `ias15-f64-cpu-64-epsilon-1e-09`: the name of the sample, also of its file."""
        asked = "" if self.tolerance is None else f"-{self.control}-{self.tolerance:.6g}"
        return f"{self.integrator}-{self.precision}-{self.backend}-{self.steps}{asked}"

    @property
    def fineness(self) -> float:
        """The number that grows as the error falls: the steps, or 1 / tolerance of an adaptive method."""
        return float(self.steps) if self.tolerance is None else 1.0 / self.tolerance


@dataclass(eq=False)
class Sample:
    """The result of a run. Errors are relative, see `machine`; None where a quantity is not conserved.

    evaluations   force evaluations of the whole run; for an implicit method the iterations of its solver
    status        "ok"; "diverged", "refused", or "undefined" where the run lacks the wanted quantity; `reason` says why
    seconds       of the steps without samples on a quiet machine, see StepClock; one number for each repeat
    joules        energy of the whole machine during a run; None where the machine does not count it
    energy_errors over the run, one for each of `times`
    values        of the wanted quantity, one list for each run, with one number for each entry of `expect:`
    along         the largest error of the positions over the run, where it was measured, see film_checks
    end           positions at the end, (particle_count, 3) [length]; None for a run that did not reach the end. A sphere that
                  has become a part of sphere k has nan, k, nan
    """

    configuration: Configuration
    dt: float
    evaluations: int = 0
    status: str = "ok"
    reason: str = ""
    compile_seconds: float = 0.0
    seconds: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    energy_errors: list[float] = field(default_factory=list)
    energy: float | None = None
    joules: float | None = None
    momentum: float | None = None
    angular_momentum: float | None = None
    values: list[list[float]] = field(default_factory=list)
    along: float | None = None
    end: np.ndarray | None = None

    @property
    def setting(self) -> str:
        """`dt = 0.01`, or `epsilon = 1e-09` of a method that chooses its steps."""
        asked = self.configuration.tolerance
        return f"dt = {self.dt:.3g}" if asked is None else f"{self.configuration.control} = {asked:.3g}"

    @property
    def median_seconds(self) -> float | None:
        """The median time of the repeats."""
        return statistics.median(self.seconds) if self.seconds else None

    def facts(self) -> dict[str, Any]:
        """The sample as plain data, without `end`."""
        found = {key: value for key, value in vars(self).items() if key not in ("configuration", "end")}
        return {**vars(self.configuration), **found}

    @staticmethod
    def of(facts: dict[str, Any], end: np.ndarray | None) -> "Sample":
        """The sample with the given `facts`."""
        names = ("integrator", "steps", "precision", "backend", "control", "tolerance")
        rest = {key: value for key, value in facts.items() if key not in names}
        return Sample(configuration=Configuration(**{name: facts[name] for name in names}), end=end, **rest)


@dataclass(frozen=True)
class MeasuredError:
    """An error: its `value`, or, where the error of the reference may be half of it, only a bound of it, `at_most`."""

    value: float | None
    at_most: float | None = None

    @staticmethod
    def against(value: float | None, bar: float) -> "MeasuredError":
        """The error of a run that differs by `value` from a reference whose own error is at most `bar`.

        The error is between value − bar and value + bar. From twice the bar on, `value` is at least half and at most twice the
        error; below, only the upper bound is stated.
        """
        if value is None or not math.isfinite(value):
            return MeasuredError(None)
        return MeasuredError(value) if value > CLEAR * bar else MeasuredError(None, value + bar)

    @property
    def bound(self) -> float:
        """The value, or else the bound, or else infinity."""
        return self.value if self.value is not None else self.at_most if self.at_most is not None else math.inf

    def __str__(self) -> str:
        """`2.1e-07`, `≤ 2e-13`, the bound rounded up, or a dash."""
        if self.value is not None:
            return f"{self.value:.1e}"
        return "–" if self.at_most is None else f"≤ {rounded_up(self.at_most):.0e}"


def rounded_up(value: float) -> float:
    """The smallest number of one digit that is at least `value` > 0, apart from rounding of the number itself."""
    power = math.floor(math.log10(value))
    return math.ceil(value / 10.0**power * (1.0 - 1e-12)) * 10.0**power
