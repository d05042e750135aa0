"""Methods: the properties of the integrators of the catalogue, found before any of them is compiled."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.accuracy import force_solvers
from mpp_taichi.accuracy.contact_methods import exact_solvers, flies_exactly, orders, solvers
from mpp_taichi.accuracy.method_variants import split_variant, variants_of
from mpp_taichi.accuracy.problem import AS_WRITTEN, Problem, defaults, with_integrator
from mpp_taichi.accuracy.stretches import LOOKS as LOOKS
from mpp_taichi.accuracy.stretches import Stretch, own_step
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
    """One integrator, for one scene; its name may include a tree, see force_solvers, or a variant, see method_variants.

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
    """The integrators that take steps, support the forces of all phases and have defaults; the scene's own comes first.

    Gravity is summed directly. Methods with a tree are added where they are `asked` for, and for the scene's own integrator
    where the scene has many particles.
    """
    import_taichi()
    own = problem.own_method
    if problem.compares_solvers:
        return _contact_methods(problem, own)
    found = {own: _as_written(problem)} if own == AS_WRITTEN else {}
    own = problem.spec.integrator.name
    layouts = [layout_of(stretch.spec) for stretch in problem.different]
    for name in dict.fromkeys((own, *component.names("integrators"))):
        declared = component.declaration("integrators", name)
        takes_steps = not declared.flags.get("flies") and any(parameter.name == "dt" for parameter in declared.parameters)
        if any(refused_friction(name, stretch.spec, stretch.particles) for stretch in problem.different):
            continue
        if not takes_steps or (name != own and defaults(name) is None) or not _goes_with_contacts(name, problem):
            continue
        made = [(with_integrator(each.spec, name, own_step(each.spec)), each.particles) for each in problem.different]
        if all(suits(spec, particles, layout) for (spec, particles), layout in zip(made, layouts)):
            found[name] = _method(problem, name)
            found |= {variant: _method(problem, variant) for variant in variants_of(name) if not _is_own(problem, variant)}
    if leads(problem) and all(flies_exactly(stretch.spec) for stretch in problem.stretches):
        found |= {name: StudyMethod(name, 0, True, False, 1.0, 1, name) for name in exact_solvers()}
    for name in force_solvers.variants(problem.spec, problem.start, asked):
        integrator = force_solvers.split(name)[0]
        scenes = [with_integrator(each.spec, name, own_step(each.spec)) for each in problem.different]
        if integrator in found and all(map(force_solvers.allows_tree, scenes)):
            found[name] = replace(found[integrator], name=name)
    return found


def _is_own(problem: Problem, variant: str) -> bool:
    """Whether the scene's own integrator is this variant."""
    own, (name, parameters) = problem.spec.integrator, split_variant(variant)
    return own.name == name and all(own.parameters.get(key) == value for key, value in parameters.items())


def leads(problem: Problem) -> bool:
    """Whether contacts lead an adaptive method."""
    contacts = [phase.spec.contacts for phase in problem.phases]
    return any(each is not None and bool(each.solver.flag("contacts", "leads")) for each in contacts)


def _goes_with_contacts(name: str, problem: Problem) -> bool:
    """Whether an integrator goes with the contacts of the scene, where these are kept."""
    if not problem.has_contacts:
        return True
    return bool(component.flag("integrators", name, "begins_anew" if leads(problem) else "moves_forward_alone"))


def _contact_methods(problem: Problem, own: str) -> dict[str, StudyMethod]:
    """The contact solvers."""
    order, scenes = orders(), [stretch.spec for stretch in problem.different]
    named = [spec.contacts.solver.name for spec in scenes if spec.contacts is not None]
    order[AS_WRITTEN] = min((order[name] for name in named), default=2)
    return {name: StudyMethod(name, order[name], True, False, 1.0, 1, name) for name in solvers(scenes, own)}


def _method(problem: Problem, name: str) -> StudyMethod:
    fewest, made = 1, _built(problem.stretches[0], name)
    for stretch in problem.stretches if len(problem.start.springs) else problem.different:
        fewest = max(fewest, _fewest_steps(stretch, name))
    control = (made.controlled_by, float(getattr(made, made.controlled_by))) if made.controlled_by else ()
    is_implicit = made.evaluations_per_step is None and not control
    evaluations = ITERATIONS if is_implicit else 1.0 if control else max(1.0, float(made.evaluations_per_step))
    integrator = split_variant(name)[0]
    base = component.declaration("integrators", integrator).base
    family = integrator if base in GENERAL_BASES else base
    flags = (bool(made.slow_to_compile), tuple(made.promising_for))
    return StudyMethod(name, made.order, bool(made.symplectic), is_implicit, evaluations, fewest, family, *flags, *control)


def _as_written(problem: Problem) -> StudyMethod:
    """The scene's own methods, of which each phase keeps its own."""
    parts = [(stretch.share, _method(problem, stretch.spec.integrator.name)) for stretch in problem.different]
    each = [method for _, method in parts]
    return StudyMethod(
        AS_WRITTEN,
        min(method.order for method in each),
        all(method.symplectic for method in each),
        any(method.implicit for method in each),
        sum(share * method.evaluations for share, method in parts) / sum(share for share, _ in parts),
        max(_fewest_steps(stretch, AS_WRITTEN) for stretch in problem.stretches),
        AS_WRITTEN,
        any(method.slow_to_compile for method in each),
    )


def _built(stretch: Stretch, name: str) -> Any:
    spec = with_integrator(stretch.spec, name, own_step(stretch.spec)).integrator
    return component.build("integrators", spec.name, spec.parameters)


def _fewest_steps(stretch: Stretch, name: str) -> int:
    """Steps in all with which springs and drag allow the steps of a stretch."""
    spec = with_integrator(stretch.spec, name, own_step(stretch.spec))
    advice = advise(spec, stretch.particles, _built(stretch, name), own_step(spec))
    if advice is None or advice.never_stable or not math.isfinite(advice.limit):
        return 1
    return math.ceil(stretch.span / stretch.share / (LIMIT_SHARE * advice.limit))


def for_reference(found: dict[str, StudyMethod]) -> list[StudyMethod]:
    """Explicit methods with direct sums whose step can be halved, the most promising first.

    Methods are sorted by order, then symplectic methods first, then methods with more forces per step.
    """
    direct = [method for method in found.values() if method.name != AS_WRITTEN and not force_solvers.by_tree(method.name)]
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
    fewest = FEWEST_STEPS if len(problem.stretches) == 1 else LOOKS  # from LOOKS on the steps of every stretch are doubled
    steps = max(equal_cost(problem, method, own) / 4.0, float(method.fewest_steps), fewest)
    return math.ceil(steps / LOOKS) * LOOKS if steps > LOOKS else 2 ** math.ceil(math.log2(steps))
