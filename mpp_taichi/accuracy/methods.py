"""Methods: the properties of the integrators of the catalogue, found before any of them is compiled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.accuracy import force_solvers
from mpp_taichi.accuracy.contact_methods import orders, solvers
from mpp_taichi.accuracy.problem import LOOKS as LOOKS
from mpp_taichi.accuracy.problem import Problem, defaults, with_integrator
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.scene.integrator_checks import suits
from mpp_taichi.scene.layout import layout_of
from mpp_taichi.scene.physics_checks import refused_friction
from mpp_taichi.stability import advise

LIMIT_SHARE = 0.95  # of the largest step that springs and drag allow
ITERATIONS = 6.0  # forces of an implicit step, until they have been counted
FEWEST_STEPS = 2.0
GENERAL_BASES = ("Integrator", "Adaptive")  # classes from which methods of many families are derived


@dataclass(frozen=True)
class StudyMethod:
    """One integrator, for one scene; its name may include a tree, see force_solvers.

    evaluations    forces per step; a guess for implicit methods, 1 for adaptive methods
    fewest_steps   over the span that springs and drag allow
    family         of methods that share their code; a method without relatives is a family of its own
    slow_to_compile  takes many times as long to compile as other methods
    promising_for  kinds of scenes for which the method is made, see families
    controlled_by  the parameter that controls the accuracy of an adaptive method; empty for other methods
    tolerance      the default of this parameter
    """

    name: str
    order: int
    symplectic: bool
    implicit: bool
    evaluations: float
    fewest_steps: int
    family: str = ""
    slow_to_compile: bool = False
    promising_for: tuple[str, ...] = ()
    controlled_by: str = ""
    tolerance: float | None = None

    @property
    def adaptive(self) -> bool:
        """Whether the method chooses its steps itself; its runs are sampled as often as the runs of other methods."""
        return self.tolerance is not None


def methods(problem: Problem, asked: Sequence[str] = ()) -> dict[str, StudyMethod]:
    """The integrators that take steps, support the scene's forces and have defaults for all parameters; its own comes first.

    Gravity is summed directly. Methods with a tree are added where they are `asked` for, and for the scene's own integrator
    where the scene has many particles.
    """
    import_taichi()
    if problem.spec.contacts is not None:
        order = orders()
        return {name: StudyMethod(name, order[name], True, False, 1.0, 1, name) for name in solvers(problem.spec)}
    found = {}
    own, layout = problem.spec.integrator.name, layout_of(problem.spec)
    for name in dict.fromkeys((own, *component.names("integrators"))):
        declared = component.declaration("integrators", name)
        takes_steps = not declared.flags.get("flies") and any(parameter.name == "dt" for parameter in declared.parameters)
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


def _method(problem: Problem, name: str) -> StudyMethod:
    spec = with_integrator(problem.spec, name, problem.own_dt)
    made: Any = component.build("integrators", name, spec.integrator.parameters)
    advice = advise(spec, problem.start, made, problem.own_dt)
    fewest = 1
    if advice is not None and not advice.never_stable and math.isfinite(advice.limit):
        fewest = math.ceil(problem.span / (LIMIT_SHARE * advice.limit))
    control = (made.controlled_by, float(getattr(made, made.controlled_by))) if made.controlled_by else ()
    is_implicit = made.evaluations_per_step is None and not control
    evaluations = ITERATIONS if is_implicit else 1.0 if control else max(1.0, float(made.evaluations_per_step))
    base = component.declaration("integrators", name).base
    family = name if base in GENERAL_BASES else base
    flags = (bool(made.slow_to_compile), tuple(made.promising_for))
    return StudyMethod(name, made.order, bool(made.symplectic), is_implicit, evaluations, fewest, family, *flags, *control)


def for_reference(found: dict[str, StudyMethod]) -> list[StudyMethod]:
    """Explicit methods with direct sums whose step can be halved, the most promising first.

    Methods are sorted by order, then symplectic methods first, then methods with more forces per step.
    """
    direct = [method for method in found.values() if not force_solvers.by_tree(method.name)]
    halved = [method for method in direct if not method.implicit and not method.adaptive]
    return sorted(halved, key=promise, reverse=True)


def rank(found: dict[str, StudyMethod], method: StudyMethod) -> int:
    """The number of more promising methods of the same order; sorted by it, the best method of every order comes first."""
    return sum(other.order == method.order and promise(other) > promise(method) for other in found.values())


def promise(method: StudyMethod) -> tuple[int, bool, float]:
    """A key that grows with the promise of a method: the order, then symplectic methods, then the forces per step."""
    return method.order, method.symplectic, method.evaluations


def equal_cost(problem: Problem, method: StudyMethod, own: StudyMethod) -> float:
    """The steps for which a method evaluates as many forces as the scene's own setting; the samples of an adaptive method."""
    if method.adaptive:
        return float(problem.samples)
    return problem.own_steps * own.evaluations / method.evaluations


def first_steps(problem: Problem, method: StudyMethod, own: StudyMethod) -> int:
    """Steps for the first run of a reference, at a quarter of the cost of the scene's own setting.

    A multiple of LOOKS, or a power of two below it, so that runs with twice the steps are sampled at the same times.
    """
    steps = max(equal_cost(problem, method, own) / 4.0, float(method.fewest_steps), FEWEST_STEPS)
    return math.ceil(steps / LOOKS) * LOOKS if steps > LOOKS else 2 ** math.ceil(math.log2(steps))
