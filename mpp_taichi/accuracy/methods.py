"""Methods: what the integrators of the catalogue say of themselves, before any of them is compiled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.accuracy import force_solvers
from mpp_taichi.accuracy.contact_methods import EXACT, ORDERS, solvers
from mpp_taichi.accuracy.problem import Problem, defaults, with_integrator
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.scene.integrator_checks import suits
from mpp_taichi.scene.layout import layout_of
from mpp_taichi.scene.physics_checks import refused_friction
from mpp_taichi.stability import advise

LIMIT_SHARE = 0.95  # of the step that springs and drag allow
ITERATIONS = 6.0  # forces of an implicit step, until they were counted
FEWEST_STEPS = 2.0
LOOKS = 64  # at energies and positions in a run; a reference takes a multiple of so many steps


@dataclass(frozen=True)
class Method:
    """One integrator, for one scene; its name may have a tree in it, see force_solvers.

    evaluations    forces per step; a guess for implicit methods, 1 for adaptive ones
    fewest_steps   that springs and drag allow over the span
    controlled_by  of a method that chooses its steps itself the parameter that says how accurate it is to be; else nothing
    tolerance      its default
    """

    name: str
    order: int
    symplectic: bool
    implicit: bool
    evaluations: float
    fewest_steps: int
    controlled_by: str = ""
    tolerance: float | None = None

    @property
    def adaptive(self) -> bool:
        """Whether it chooses its steps itself; all runs of it have as many looks as those of others."""
        return self.tolerance is not None


def methods(problem: Problem, asked: Sequence[str] = ()) -> dict[str, Method]:
    """Integrators that advance by steps, take the scene's forces and need nothing else to be said; its own among them.

    Gravity is summed directly; by a tree as well in methods that are `asked` for, and with the scene's own where it may pay.
    """
    import_taichi()
    if problem.spec.contacts is not None:
        orders = {**ORDERS, EXACT: 0}
        return {name: Method(name, orders[name], True, False, 1.0, 1) for name in solvers(problem.spec)}
    found = {}
    own, layout = problem.spec.integrator.name, layout_of(problem.spec)
    for name in dict.fromkeys((own, *component.names("integrators"))):
        declared = component.declaration("integrators", name)
        takes_steps = name != "event_driven" and any(parameter.name == "dt" for parameter in declared.parameters)
        if refused_friction(name, problem.spec, problem.start):
            continue
        if not takes_steps or (name != own and defaults(name) is None):
            continue
        if suits(with_integrator(problem.spec, name, problem.own_dt), problem.start, layout):
            found[name] = _method(problem, name)
    for name in force_solvers.variants(problem.spec, problem.start, asked):
        integrator = force_solvers.split(name)[0]
        if integrator in found and force_solvers.allows_tree(with_integrator(problem.spec, name, problem.own_dt)):
            found[name] = replace(found[integrator], name=name)
    return found


def _method(problem: Problem, name: str) -> Method:
    spec = with_integrator(problem.spec, name, problem.own_dt)
    made: Any = component.build("integrators", name, spec.integrator.parameters)
    advice = advise(spec, problem.start, made, problem.own_dt)
    fewest = 1
    if advice is not None and not advice.never_stable and math.isfinite(advice.limit):
        fewest = math.ceil(problem.span / (LIMIT_SHARE * advice.limit))
    control = (made.controlled_by, float(getattr(made, made.controlled_by))) if made.controlled_by else ()
    is_implicit = made.evaluations_per_step is None and not control
    evaluations = ITERATIONS if is_implicit else 1.0 if control else max(1.0, float(made.evaluations_per_step))
    return Method(name, made.order, bool(made.symplectic), is_implicit, evaluations, fewest, *control)


def for_reference(found: dict[str, Method]) -> list[Method]:
    """Explicit methods with direct sums whose step can be halved, the most promising first.

    By order, symplectic, and more forces a step.
    """
    direct = [method for method in found.values() if not force_solvers.by_tree(method.name)]
    halved = [method for method in direct if not method.implicit and not method.adaptive]
    return sorted(halved, key=_promise, reverse=True)


def rank(found: dict[str, Method], method: Method) -> int:
    """How many methods of the same order promise more; so that the best of every order come first."""
    return sum(other.order == method.order and _promise(other) > _promise(method) for other in found.values())


def _promise(method: Method) -> tuple[int, bool, float]:
    return method.order, method.symplectic, method.evaluations


def equal_cost(problem: Problem, method: Method, own: Method) -> float:
    """Steps with which a method spends as many forces as the scene's own setting; the looks of an adaptive one."""
    if method.adaptive:
        return float(LOOKS)
    return problem.own_steps * own.evaluations / method.evaluations


def first_steps(problem: Problem, method: Method, own: Method) -> int:
    """Steps for the first run of a reference: a quarter as dear as the scene's own setting; coarse runs show convergence too.

    A multiple of the looks, or a power of two below, so that runs of twice the steps are looked at at the same times.
    """
    steps = max(equal_cost(problem, method, own) / 4.0, float(method.fewest_steps), FEWEST_STEPS)
    return math.ceil(steps / LOOKS) * LOOKS if steps > LOOKS else 2 ** math.ceil(math.log2(steps))
