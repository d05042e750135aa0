"""Advice: the largest step of the integrator of a scene, the limit that it obeys, and the warning or refusal beyond."""

import copy
import logging
import math
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import StabilityError
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.stability.network import Rates, SpringNetwork
from mpp_taichi.stability.step_limit import growth_per_step, largest_stable_step
from mpp_taichi.wording.told_apart import told_apart

log = logging.getLogger(__name__)

WARNING_SHARE = 0.9  # of the limit: a longer step gives a warning
SAME = 1e-3  # two limits with a smaller relative difference count as equal; the safe limit is then reported
ABSURD_GROWTH = 1e6  # of an amplitude over a run: a method that is stable for no step is then refused
HARMLESS_GROWTH = 1.01
STEPS_OF_ENDLESS_RUN = 10_000


class Method(Protocol):
    """The part of an integrator that its stability follows from."""

    stable_for_any_stiffness: bool

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Matrix of one step on an oscillator."""


class StepAdvice:
    """The effects of a step `dt` of an integrator on a network; each quantity is computed when it is first read."""

    def __init__(self, network: SpringNetwork, method: Method, integrator: str, dt: float, begins: float = 0.0) -> None:
        """Keep the parts; `begins` is the time from which on the network is as given [time]."""
        self.network, self.method, self.integrator, self.dt, self.begins = network, method, integrator, dt, begins

    @cached_property
    def safe_limit(self) -> float:
        """Largest step that is stable for every arrangement of these springs, from the bound of their frequency [time].

        Infinite where every step is stable, 0 for a method with which an undamped oscillation grows whatever the step is.
        """
        return _limit(self.method, self.network.anywhere)

    @cached_property
    def placed_limit(self) -> float:
        """Largest step that is stable for the springs as they are placed; at least the safe limit [time]."""
        if math.isinf(self.safe_limit):
            return self.safe_limit
        return max(self.safe_limit, _limit(self.method, self.network.placed))

    @property
    def limit(self) -> float:
        """The limit that decides: of the springs as placed, or the safe limit where the two differ by less than `SAME`."""
        return self.safe_limit if self.safe_limit >= (1.0 - SAME) * self.placed_limit else self.placed_limit

    @property
    def decided_by(self) -> str:
        """The origin of the limit, in words."""
        if self.is_unlimited:
            return "the method, which takes every step"
        if not self.network.swings:
            return "only the damping"
        if not self.network.converged:
            return "a bound of the frequency: its iteration did not converge"
        if self.limit == self.safe_limit:
            return "the springs in any arrangement"
        return "the springs as placed"

    @property
    def is_unlimited(self) -> bool:
        """Whether every step is stable."""
        return math.isinf(self.limit)

    @property
    def never_stable(self) -> bool:
        """Whether undamped oscillations grow however small the step is."""
        return self.safe_limit == 0.0

    @property
    def holding_step(self) -> float:
        """A step that holds in every arrangement of the springs, rounded down to two digits [time].

        Half of `dt` where the springs allow `dt`, or where no step is stable and a smaller one only does less harm.
        """
        reach = WARNING_SHARE * (self.safe_limit or self.placed_limit)
        return _rounded_down(reach if 0.0 < reach < self.dt else 0.5 * self.dt)

    @cached_property
    def culprit(self) -> str:
        """The spring or the damping that sets the limit, in words."""
        index = self.network.stiffest_spring()
        if index is None or self.hardest.frequency < self.hardest.damping * 1e-3:
            return f"the damping rate {self.hardest.damping:.4g}"
        return self.network.describe_spring(index)

    @cached_property
    def hardest(self) -> Rates:
        """The oscillation of the network as placed that limits the step."""
        return min(self.network.placed, key=lambda rates: _limit(self.method, [rates]))

    def growth(self, steps: int) -> float:
        """Factor by which the fastest growing oscillation grows in so many steps of dt."""
        worst = max(growth_per_step(self.method.amplification, r.frequency, r.damping, self.dt) for r in self.network.placed)
        return math.exp(min(700.0, steps * math.log(worst)))

    def growth_per_oscillation(self) -> float:
        """Factor by which the fastest growing oscillation grows in one period of the fastest oscillation."""
        frequency = self.network.frequency
        return self.growth(max(1, round(2.0 * math.pi / (frequency * self.dt)))) if frequency else 1.0

    def at(self, dt: float) -> "StepAdvice":
        """The same network and method with another step."""
        other = copy.copy(self)  # with the limits that were computed already
        other.dt = dt
        return other

    def enforce(self, *, steps: int | None = None, force: bool = False) -> None:
        """Warn from `WARNING_SHARE` of the limit; beyond it refuse, or only warn where `force` says so.

        A method that is stable for no step is refused where an oscillation would grow by more than `ABSURD_GROWTH` in `steps`
        steps.

        Raises:
            StabilityError: the step is longer than the integrator can take.
        """
        if self.dt <= WARNING_SHARE * self.safe_limit:
            return
        if self.never_stable:
            self._enforce_growth(STEPS_OF_ENDLESS_RUN if steps is None else steps, force)
        elif self.dt > self.limit:
            self._refuse(f"{self._beyond()}; {self.dt_key} = {self.holding_step:.6g} holds", force)
        elif self.dt > WARNING_SHARE * self.limit:
            log.warning(
                "%s: %s is %.3g of the largest stable step %.6g, set by %s; it holds while the springs stay as they are",
                self.place,
                f"{self.dt_key} = {self.dt:.6g}",
                self.dt / self.limit,
                self.limit,
                self.culprit,
            )

    def _enforce_growth(self, steps: int, force: bool) -> None:
        growth = self.growth(steps)
        if growth <= HARMLESS_GROWTH:
            return
        per_oscillation = 100.0 * (self.growth_per_oscillation() - 1.0)
        text = (
            f"{self.place}: {self.dt_key} = {self.dt:.6g}: {self.integrator} makes the oscillation "
            f"of {self.culprit} grow by {per_oscillation:.3g} % each time, and no step keeps an undamped one"
        )
        if growth > ABSURD_GROWTH:
            instead = " or ".join(component.proposed("integrators", "oscillation"))
            self._refuse(f"{text}, and {growth:.1e}-fold in {steps:,} steps; {instead} would hold it", force)
        else:
            log.warning("%s, %.3g-fold in %s steps", text, growth, f"{steps:,}")

    def _beyond(self) -> str:
        safe = "" if self.limit == self.safe_limit else f", {self.safe_limit:.6g} is safe in any arrangement"
        dt, limit = told_apart(self.dt, self.limit)
        return (
            f"{self.place}: {self.dt_key} = {dt} is beyond the largest stable step "
            f"{limit} ({self.decided_by}{safe}), which is set by {self.culprit}"
        )

    def _refuse(self, text: str, force: bool) -> None:
        if not force:
            raise StabilityError(f"{text}; --force, or Simulation(…, force=True), runs it all the same")
        log.warning("%s; it is run because that was asked for", text)

    @property
    def place(self) -> str:
        """`scene.yaml:9:3`, with the time from which on the advice holds."""
        begins = f": from t = {self.begins:.6g} on" if self.begins > 0.0 else ""
        return f"{self.network.spec.integrator.location}{begins}"

    @property
    def dt_key(self) -> str:
        """`integrator.leapfrog.dt`."""
        return f"integrator.{self.integrator}.dt"

    def facts(self) -> dict[str, Any]:
        """The entries that `explain` and a dry run report; None stands for "no limit"."""
        return {
            "dt_limit": _finite(self.limit),
            "dt_limit_placed": _finite(self.placed_limit),
            "dt_limit_any_arrangement": _finite(self.safe_limit),
            "dt_limit_decided_by": self.decided_by,
            "dt_limit_set_by": None if self.is_unlimited else self.culprit,
            "largest_frequency": self.network.frequency,
            "largest_frequency_bound": self.network.frequency_bound,
            "largest_damping_rate_bound": self.network.damping_bound,
        }

    def line(self) -> str:
        """One line for a person."""
        frequency = f"largest frequency {self.network.frequency:.6g}, at most {self.network.frequency_bound:.6g}"
        if self.is_unlimited:
            return f"{self.integrator} is stable for every step; {frequency}"
        if self.never_stable:
            growth = 100.0 * (self.growth_per_oscillation() - 1.0)
            return f"{self.integrator} makes oscillations grow, {growth:.3g} % each time at this step; {frequency}"
        return (
            f"{self.integrator} is stable up to {self.limit:.6g} ({self.decided_by}; {self.safe_limit:.6g} in any arrangement)"
            f", set by {self.culprit}; {frequency}"
        )


def advise(spec: SceneSpec, snapshot: Snapshot, method: Method, dt: float, *, begins: float = 0.0) -> StepAdvice | None:
    """The advice on the step `dt` of this integrator, for a scene in a state; None where nothing limits the step.

    `snapshot` has the springs and the masses as they are now, `spec` the dimensions, the kind of damping and the drag.
    """
    network = SpringNetwork(spec, snapshot)
    if network.is_still:
        return None
    return StepAdvice(network, method, spec.integrator.name, dt, begins)


def check_step(
    spec: SceneSpec,
    snapshot: Snapshot,
    method: Method,
    dt: float,
    *,
    steps: int | None = None,
    force: bool = False,
    begins: float = 0.0,
) -> StepAdvice | None:
    """`advise`, then warn or refuse; to be called again whenever masses, springs, drag, damping or the step have changed.

    Raises:
        StabilityError: the step is longer than the integrator can take, and `force` is not set.
    """
    advice = advise(spec, snapshot, method, dt, begins=begins)
    if advice is not None:
        advice.enforce(steps=steps, force=force)
    return advice


def _limit(method: Method, rates: list[Rates]) -> float:
    if method.stable_for_any_stiffness:
        return math.inf
    return min((largest_stable_step(method.amplification, each.frequency, each.damping) for each in rates), default=math.inf)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _rounded_down(value: float) -> float:
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / digit * (1.0 + 1e-12)) * digit:.2g}")
