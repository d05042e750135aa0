"""Expectations: a scene's own statements of physics, watched while it runs and judged at the end."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.diagnostics._reductions import reduced
from mpp_taichi.quantities._base import NoResultError, Setting
from mpp_taichi.recorders._simulation_sample import SimulationSample
from mpp_taichi.scene.expectations import SUMMARY_QUANTITIES, kind_of, reduction_keys
from mpp_taichi.scene.spec import Expectation
from mpp_taichi.wording.told_apart import told_apart

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


@dataclass(frozen=True)
class Verdict:
    """One expectation and its outcome; `value` is None where the quantity was not defined, and `reason` says why."""

    quantity: str
    parameters: dict[str, Any]
    value: float | None
    bound: str
    passed: bool
    reason: str = ""
    named: str = ""
    """The label with the names of particles in place of their indices, `orbital_period(of=earth, around=sun)`."""
    told: str = ""
    """The value for a reader, with so many digits that it is seen on which side of a bound it lies."""

    @property
    def label(self) -> str:
        """`orbital_period(of=1, around=0)`."""
        return _label(self.quantity, self.parameters)


class Watcher:
    """The recorder that measures the quantities of a scene's `expect:`; no other diagnostics and quantities are imported.

    It takes samples at the start, every `every` steps, as often as a diagnostic asks for, and at the end (`finish`).

    shortest   time between two samples that a diagnostic has asked for so far [time]; infinite where none has asked
    """

    def __init__(self, expectations: Sequence[Expectation], every: int, *, finer: float = 1.0) -> None:
        """Import and build the diagnostics and quantities; samples are taken `finer` times as often as they ask for."""
        self.expectations = tuple(expectations)
        self.every, self.finer = every, finer
        self.restart()

    def restart(self) -> None:
        """Forget every sample."""
        self._diagnostics: dict[int, Diagnostic] = {}
        self._failures: dict[int, str] = {}
        for number, expectation in enumerate(self.expectations):
            if expectation.quantity not in SUMMARY_QUANTITIES:
                self._diagnostics[number] = diagnostic_of(expectation)
        self._due_step: int | None = None
        self._seen_step = -1
        self.shortest = math.inf

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the earliest sample that any diagnostic asks for."""
        if not self._diagnostics:
            return 2**31
        return 0 if self._due_step is None else self._due_step - simulation.step_count

    def record(self, simulation: "Simulation") -> None:
        """Let every diagnostic take a sample."""
        sample = SimulationSample(simulation)
        if self._seen_step < 0:
            self._begin(simulation)
        self._seen_step = simulation.step_count
        self._each(lambda diagnostic: diagnostic.observe(sample))
        watching = [diagnostic for number, diagnostic in self._diagnostics.items() if number not in self._failures]
        shortest = min((diagnostic.interval for diagnostic in watching), default=math.inf)
        self.shortest = min(self.shortest, shortest) if shortest > 0.0 else self.shortest
        asked = shortest / self.finer
        steps = self.every if shortest == math.inf else min(self.every, max(1, int(asked / simulation.dt)))
        self._due_step = simulation.step_count + steps

    def _begin(self, simulation: "Simulation") -> None:
        setting = Setting(simulation.spec, simulation.start)
        self._each(lambda diagnostic: diagnostic.begin(setting))

    def _each(self, do: Callable[[Diagnostic], None]) -> None:
        for number, diagnostic in self._diagnostics.items():
            try:
                if number not in self._failures:
                    do(diagnostic)
            except NoResultError as error:
                self._failures[number] = str(error)

    def finish(self, simulation: "Simulation") -> None:
        """Take a sample at the end, unless that was the last sample; measure the data that only the end has."""
        if self._diagnostics and self._seen_step != simulation.step_count:
            self.record(simulation)
        self._each(lambda diagnostic: diagnostic.finish())

    def verdicts(self, summary: Mapping[str, Any], precision: str, simulation: "Simulation | None" = None) -> list[Verdict]:
        """Judge every expectation; `summary` holds the quantities that every run measures anyway.

        The particles have their names where a simulation is given.
        """
        setting = None if simulation is None else Setting(simulation.spec, simulation.start)
        rows = []
        for expectation, (value, reason) in zip(self.expectations, self.values(summary)):
            passed = value is not None and holds(expectation, value, precision)
            bound, told = bound_text(expectation, precision, value), value_text(expectation, precision, value)
            shown, named = _shown(expectation), label_of(expectation, setting)
            rows.append(Verdict(expectation.quantity, shown, value, bound, passed, reason, named, told))
        return rows

    def values(self, summary: Mapping[str, Any]) -> list[tuple[float | None, str]]:
        """The value of every expectation, or None and the reason; `summary` as for `verdicts`."""
        return [self._value(number, expectation, summary) for number, expectation in enumerate(self.expectations)]

    def _value(self, number: int, expectation: Expectation, summary: Mapping[str, Any]) -> tuple[float | None, str]:
        if number not in self._diagnostics:
            value = summary.get(expectation.quantity)
            return (None, "it was not measured") if value is None else (float(value), "")
        if number in self._failures:
            return None, self._failures[number]
        try:
            return self._diagnostics[number].result(), ""
        except NoResultError as error:
            return None, str(error)


def diagnostic_of(expectation: Expectation) -> Diagnostic:
    """The diagnostic that an expectation names, or the reduction of the quantity that it names."""
    kind, given = kind_of(expectation.quantity), dict(expectation.parameters)
    if kind != "quantities":
        found: Diagnostic = component.build("diagnostics", expectation.quantity, given)
        return found
    keys = {key: given.pop(key, default) for key, default in reduction_keys(expectation.quantity).items()}
    return reduced(component.build("quantities", expectation.quantity, given), **keys)


def label_of(expectation: Expectation, setting: Setting | None = None) -> str:
    """`orbital_period(of=1, around=0)`, and with a setting `orbital_period(of=earth, around=sun)`."""
    return _label(expectation.quantity, _shown(expectation) | _names(expectation, setting))


def _label(quantity: str, parameters: Mapping[str, Any]) -> str:
    inside = ", ".join(f"{key}={value}" for key, value in parameters.items() if value is not None)
    return f"{quantity}({inside})" if inside else quantity


def _shown(expectation: Expectation) -> dict[str, Any]:
    """The parameters for a reader: a group of one particle as the index of the particle, no reduction that is the usual one."""
    kind = kind_of(expectation.quantity)
    if kind is None:
        return dict(expectation.parameters)
    groups = {each.name for each in component.declaration(kind, expectation.quantity).parameters if each.type == "Particles"}
    usual = reduction_keys(expectation.quantity) if kind == "quantities" else {}
    return {
        key: value[0] if key in groups and value is not None and value[1] == 1 else value
        for key, value in expectation.parameters.items()
        if key not in usual or value != usual[key]
    }


def _names(expectation: Expectation, setting: Setting | None) -> dict[str, str]:
    """The names of the particles that parameters refer to, by parameter."""
    kind = kind_of(expectation.quantity)
    if kind is None or setting is None:
        return {}
    found = {}
    for parameter in component.declaration(kind, expectation.quantity).parameters:
        value = expectation.parameters.get(parameter.name)
        if value is not None and parameter.type in ("Particle", "Particles"):
            found[parameter.name] = setting.name_of(value)
        elif value is not None and parameter.type in ("Pair", "FourInRow"):
            found[parameter.name] = f"({', '.join(map(setting.name_of, value))})"
    return found


def holds(expectation: Expectation, value: float, precision: str) -> bool:
    """Whether the value is finite and within every bound of the expectation."""
    return bool(hold(expectation, np.array([value]), precision)[0])


def hold(expectation: Expectation, values: np.ndarray, precision: str) -> np.ndarray:
    """For each value whether it is finite and within every bound of the expectation."""
    below, above, near, within = expectation.below, expectation.above, expectation.near, expectation.within
    found = np.isfinite(values)
    if below is not None:
        found &= np.abs(values) < below[precision]
    if above is not None:
        found &= values > above[precision]
    if near is not None:
        found &= np.abs(values - near) <= tolerance(near, within[precision] if within else 0.0)
    return found


def tolerance(near: float, within: float) -> float:
    """`within` is relative to `near`; around zero it is absolute."""
    return within * abs(near) if near != 0.0 else within


def bound_text(expectation: Expectation, precision: str, value: float | None = None) -> str:
    """`< 1e-06`, `> 3`, `6.28 ± 1e-05 (relative)`; with more digits where a `value` would read like the bound.

    `below` bounds the absolute value; where a `value` is below 0 the text says so, `|value| < 0.1`.
    """
    parts = []
    if expectation.below is not None:
        bound = expectation.below[precision]
        compared = "|value| < " if value is not None and value < 0.0 else "< "
        parts.append(compared + told_apart(bound, abs(_finite(value, bound)))[0])
    if expectation.above is not None:
        bound = expectation.above[precision]
        parts.append(f"> {told_apart(bound, _finite(value, bound))[0]}")
    if expectation.near is not None:
        allowed = expectation.within[precision] if expectation.within else 0.0
        parts.append(f"{expectation.near:.12g} ± {allowed:.3g}" + (" (relative)" if expectation.near != 0.0 else ""))
    return " and ".join(parts)


def value_text(expectation: Expectation, precision: str, value: float | None) -> str:
    """A value with nine digits, and with more where it would read like a bound; `undefined` where there is none."""
    if value is None:
        return "undefined"
    below, above, near = expectation.below, expectation.above, expectation.near
    bounds = [] if below is None else [below[precision], -below[precision]]
    bounds += [] if above is None else [above[precision]]
    if near is not None:
        allowed = tolerance(near, expectation.within[precision] if expectation.within else 0.0)
        bounds += [near - allowed, near + allowed]
    return told_apart(value, *bounds, digits=9)[0]


def _finite(value: float | None, default: float) -> float:
    return value if value is not None and math.isfinite(value) else default
