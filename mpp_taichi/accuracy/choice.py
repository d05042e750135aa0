"""Choice: the integrator, step and precision that reach a scene's `accuracy:` in the least time, found by pilot runs and kept.

The pilot is a study of the scene. For every method in every precision, the step that just reaches the target is interpolated
between two of its runs, in the logarithms of error, steps and time. Up to three of the fastest methods are then run with this
step, to confirm the error and to compare their times. The choice is written to a file: the next run uses it unchanged, on any
machine, and so repeats every bit.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mpp_taichi.accuracy import chosen
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.chosen import Choice
from mpp_taichi.accuracy.front import QUANTITIES
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.sweep import WORTH
from mpp_taichi.accuracy.trials import SAFETY, Trial, Trials, as_run
from mpp_taichi.accuracy.value_reference import ValueReference
from mpp_taichi.accuracy.verdict import duration
from mpp_taichi.accuracy.wanted import first_expected
from mpp_taichi.errors import MppError, StabilityError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec

PILOT_SECONDS = 20.0  # of processor time, most of it for the compiler
MOST_PILOTS = 3.0  # times as long where a timeline has several phases, each of which is compiled


def settle(
    scene: str | Path | Mapping[str, Any] | SceneSpec,
    *,
    folder: str | Path,
    overrides: Mapping[str, Any] | Sequence[str] = (),
) -> tuple[SceneSpec, str]:
    """The scene with the method that reaches its `accuracy:`, and the precision to run it in; the choice is kept in `folder`.

    Raises:
        StabilityError: no method that was tried reaches the target.
    """
    spec = load_scene(scene, overrides=overrides)
    if spec.accuracy is None:
        raise MppError(f"{spec.source}: the scene has no accuracy: to choose for")
    found = choose(spec, Path(folder))
    return found.settle(spec), found.precision


def choose(
    spec: SceneSpec,
    folder: Path,
    *,
    precisions: Sequence[str] = ("f64", "f32"),
    seconds: float | None = None,
    integrators: Sequence[str] | None = None,
    look: Callable[[], None] = lambda: None,
    tell: Callable[[str], None] = lambda _: None,
) -> Choice:
    """The choice for a scene's target: the choice that is kept in the folder, or a new choice.

    The pilot takes PILOT_SECONDS when `seconds` are not given, and with a timeline up to MOST_PILOTS times as long.

    Raises:
        StabilityError: no method that was tried reaches the target.
    """
    from mpp_taichi import __version__

    target = spec.accuracy
    assert target is not None
    problem = pose(spec, of=target.of)
    path = folder / "choice.json"
    known = chosen.read(path)
    wanted = (problem.identity(), problem.span, target.error, target.asked)
    if known is not None and (known.scene, known.whole_span, known.target, known.asked) == wanted:
        if known.precision in precisions:
            return known
    if seconds is None:
        compiled = len({id(phase.kernels) for phase in problem.phases})
        seconds = PILOT_SECONDS * min(MOST_PILOTS, (1.0 + compiled) / 2.0)
    tell(f"accuracy {target.error:g}: choosing integrator, step and precision by pilot runs, {seconds:.0f} s of processor time")
    devices = [("cpu", precision) for precision in precisions]
    wishes = StudyWishes(integrators, devices, quantity=target.quantity, aim=SAFETY * target.error)
    store = Store(folder, identity(problem, problem.span, __version__))
    if store.resumed:
        tell(f"{store.resumed} runs are known from before")
    trials = Trials(target.error)
    study = Study(problem, store, Budget(seconds, look), wishes, tell, trials.run)
    study.run()
    found = _decide(study, trials, target.error, target.asked)
    chosen.write(path, found)
    return found


def _decide(study: Study, trials: Trials, target: float, asked: str | None) -> Choice:
    quantity = study.quantity
    place = f"{study.problem.spec.source}: accuracy"
    if quantity is None:
        advice = ""
        if study.problem.has_contacts and study.search.horizon is not None:
            name = first_expected(study.problem.spec) or "…"
            other = f"accuracy: {{of: {name}, below: …}}"
            advice = f"; shorten run.duration, or give a target for a quantity that keeps its meaning: {other}"
        raise StabilityError(
            f"{place}: nothing can be chosen for {target:g} of {asked or QUANTITIES[0]}: {study.reason}{advice}"
        )
    best = min(trials.reached, key=lambda trial: trial.seconds, default=None) or as_run(study, target)
    if best is not None:
        configuration = best.configuration
        return Choice(
            scene=study.problem.identity(),
            whole_span=study.whole,
            target=target,
            asked=asked,
            quantity=quantity,
            quantity_because=study.reason,
            budget=study.budget.seconds,
            spent=study.budget.spent,
            integrator=configuration.integrator,
            precision=configuration.precision,
            dt=best.dt,
            error=best.error.bound,
            span=study.problem.span,
            seconds=best.seconds,
            why=_why(trials, best, study),
            control=configuration.control,
            tolerance=configuration.tolerance,
        )
    if (values := study.value_reference) is not None and trials.allowed(study) <= 0.0:
        raise StabilityError(f"{place}: {target:g} of {quantity} is beyond its reference: {values.told}")
    if study.reference is not None and trials.allowed(study) <= 0.0:
        beyond = f"is beyond the reference itself, which is {study.reference.told}"
        raise StabilityError(f"{place}: {target:g} of {quantity} {beyond}")
    names = study.wishes.integrators or study.methods
    rows = [row for row in study.rows() if row.sample.status == "ok" and row.sample.configuration.integrator in names]
    errors = [row.error(quantity).bound for row in rows]
    raise StabilityError(f"{place}: nothing that was tried reaches {target:g} of {quantity}; {_best(study, errors)}")


def _best(study: Study, errors: Sequence[float]) -> str:
    if not errors:
        return "the budget ended before a run was done"
    ended = "" if study.status == "complete" else "; the budget ended before all methods were tried"
    known = study.reference
    bar = "" if known is None or study.quantity != QUANTITIES[0] else f", where the reference is {known.told}"
    return f"the best was {min(errors):.1e}{bar}{ended}"


def _why(trials: Trials, chosen: Trial, study: Study) -> str:
    measured = {trial.offer: trial.seconds for trial in trials.reached}
    if (values := study.value_reference) is not None and values.runs > 1:
        return _why_among_runs(chosen, values)
    part = "" if study.problem.span == study.whole else f" over the first t = {study.problem.span:.4g}"
    said = f"its error was {chosen.error}{part}, in {duration(chosen.seconds)}"
    known = [offer for offer in trials.offers if offer.is_known or offer in measured]
    others = [offer for offer in known if offer.integrator != chosen.configuration.integrator]
    if others:
        other = min(others, key=lambda offer: measured.get(offer, offer.seconds))
        ratio = measured.get(other, other.seconds) / chosen.seconds
        said += f"; {other.integrator} in {other.precision} would take {ratio:.2g} times as long"
    elif len({row.sample.configuration.integrator for row in study.rows()}) > 1:
        said += f"; no other method that was tried reaches the target in {WORTH:g} times that"
    return said


def _why_among_runs(chosen: Trial, values: ValueReference) -> str:
    """The reason where mean values of several runs are compared."""
    differs = f"by {chosen.error}" if chosen.error.value is not None else "by less than the scatter"
    mean = (
        f"its mean of {values.runs} runs differs {differs} from the reference ({chosen.error}), in {duration(chosen.seconds)}"
    )
    return f"{mean}; a single run scatters by {values.scatter:.1e}"
