"""Choice: the integrator, step and precision that reach a scene's `accuracy:` in the least time, found by pilot runs and kept.

The pilot is a study of the scene. For every method in every precision, the step that just reaches the target is interpolated
between two of its runs, in the logarithms of error, steps and time. Up to three of the fastest methods are then run with this
step, to confirm the error and to compare their times. The choice is written to a file: the next run uses it unchanged, on any
machine, and so repeats every bit.
"""

import json
import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.methods import LOOKS
from mpp_taichi.accuracy.problem import pose, with_integrator
from mpp_taichi.accuracy.sample import Configuration, MeasuredError
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.verdict import duration
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.atomic_file import whole_file
from mpp_taichi.errors import MppError, OutputError, StabilityError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.scene.tree_checks import tree_of

PILOT_SECONDS = 30.0
SAFETY = 0.7  # of the target: the error for which the step is interpolated
TOO_GOOD = 3.0  # an error smaller than the target by this factor: a coarser step is tried as well
TRIALS = 3  # runs with the chosen step, each corrected by the result of the last
MOST_TRIED, ALIKE = 3, 1.5  # offers that are run, unless they seem slower than the first by more than this factor
REPEATS = 3
Tried = tuple[Configuration, float, MeasuredError, float]  # with its step, its error and its seconds
LOOKS_OF_ADAPTIVE = 1000  # samples in a run of a method that needs no step


@dataclass(frozen=True)
class Choice:
    """The chosen method, and the reason for the choice.

    error      measured with exactly this step over `span` [time], the part of the run that the pilot covered
    seconds    of the steps over this span, in the pilot
    """

    scene: str  # identity of its physics
    whole_span: float
    target: float
    asked: str | None
    quantity: str
    integrator: str
    precision: str
    dt: float
    error: float
    span: float
    seconds: float
    why: str
    control: str = ""
    tolerance: float | None = None

    def line(self) -> str:
        """The choice as a line for a person."""
        setting = f"dt = {self.dt:.6g}" if self.tolerance is None else f"{self.control} = {self.tolerance:.3g}"
        method = f"{self.integrator} in {self.precision}, {setting}"
        return f"accuracy {self.target:g} of {self.quantity}: {method}; {self.why}"

    def settle(self, spec: SceneSpec) -> SceneSpec:
        """The scene with the chosen method in place of its target."""
        asked = {} if self.tolerance is None else {self.control: self.tolerance}
        made = with_integrator(spec, self.integrator, self.dt, **asked)
        parameters = {key: value for key, value in made.integrator.parameters.items() if value is not None}
        resolved = {key: value for key, value in spec.resolved.items() if key != "accuracy"}
        chosen: dict[str, Any] = {"integrator": {made.integrator.name: parameters}}
        if tree_of(made) is not None or tree_of(spec) is not None:
            chosen["forces"] = [_resolved(*pair) for pair in zip(resolved["forces"], made.forces)]
        return replace(made, resolved={**resolved, **chosen})


def _resolved(entry: Any, force: ComponentSpec) -> Any:
    """The entry of a force in the scene, with the solver that was chosen for gravity."""
    if not force.flag("forces", "can_use_tree"):
        return entry
    said = (entry.get(force.name) or {}) if isinstance(entry, Mapping) else {}
    given = {key: value for key, value in said.items() if key not in ("solver", "accuracy")}
    chosen = {key: force.parameters[key] for key in ("solver", "accuracy") if force.parameters.get(key) is not None}
    return {force.name: {**given, **chosen}}


@dataclass(frozen=True)
class Offer:
    """A method in a precision, with the fineness at which it is expected to reach an aim.

    fineness   steps over the span, or 1 / tolerance of an adaptive method
    power      of the fineness with which the error falls; None where only one run is known
    """

    integrator: str
    precision: str
    backend: str
    fineness: float
    seconds: float
    power: float | None = None


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
    seconds: float = PILOT_SECONDS,
    integrators: Sequence[str] | None = None,
    look: Callable[[], None] = lambda: None,
    tell: Callable[[str], None] = lambda _: None,
) -> Choice:
    """The choice for a scene's target: the choice that is kept in the folder, or a new choice.

    Raises:
        StabilityError: no method that was tried reaches the target.
    """
    from mpp_taichi import __version__

    problem, target = pose(spec), spec.accuracy
    assert target is not None
    path = folder / "choice.json"
    known = _known(path)
    wanted = (problem.identity(), problem.span, target.error, target.quantity)
    if known is not None and (known.scene, known.whole_span, known.target, known.asked) == wanted:
        if known.precision in precisions:
            return known
    tell(f"accuracy {target.error:g}: choosing integrator, step and precision by pilot runs, about {seconds:.0f} s")
    devices = [("cpu", precision) for precision in precisions]
    wishes = StudyWishes(integrators, devices, quantity=target.quantity, aim=SAFETY * target.error)
    store = Store(folder, identity(problem, problem.span, __version__))
    study = Study(problem, store, Budget(seconds, look), wishes)
    study.run()
    found = _decide(study, target.error, target.quantity, precisions)
    with whole_file(path, "the choice") as temporary:
        temporary.write_text(json.dumps(asdict(found), indent=1), encoding="utf-8")
    return found


def _known(path: Path) -> Choice | None:
    if not path.is_file():
        return None
    try:
        return Choice(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise OutputError(f"{path}: not a choice of this program: {error}; remove it") from error


def _decide(study: Study, target: float, asked: str | None, precisions: Sequence[str]) -> Choice:
    quantity = study.quantity
    place = f"{study.problem.spec.source}: accuracy"
    if quantity is None and asked == "energy":
        raise StabilityError(f"{place}: the scene does not keep its energy; ask of position")
    if quantity is None:
        known = "there is no reference" if study.reference is None else study.reference.told
        raise StabilityError(f"{place}: positions at the end are not known well enough ({known}); ask of energy")
    # The error allowed for a part of the run: errors of positions grow up to quadratically, errors of energies linearly.
    part = study.problem.span / study.whole
    allowed = target * part ** (2 if quantity == "position" else 1)
    allowed_methods = study.wishes.integrators or study.methods  # the runs of the reference are among them
    rows = [
        row
        for row in study.rows()
        if row.sample.configuration.precision in precisions and row.sample.configuration.integrator in allowed_methods
    ]
    offers = sorted(offers_for(rows, quantity, SAFETY * allowed), key=lambda offer: offer.seconds)
    tried: list[tuple[Offer, Tried]] = []
    for offer in offers:
        if tried and (len(tried) == MOST_TRIED or offer.seconds > ALIKE * tried[0][0].seconds):
            break
        if (found := _tried(study, offer, quantity, allowed)) is not None:
            tried.append((offer, found))
    if tried:
        offer, (configuration, dt, error, seconds) = min(tried, key=lambda each: each[1][3])
        return Choice(
            *(study.problem.identity(), study.whole, target, asked, quantity),
            *(configuration.integrator, configuration.precision, dt),
            *(error.bound, study.problem.span, seconds),
            why=_why(offers, tried, offer, error, study),
            control=configuration.control,
            tolerance=configuration.tolerance,
        )
    if quantity == "position" and study.reference is not None and study.reference.bar > allowed:
        raise StabilityError(f"{place}: {target:g} of position is beyond the reference itself, which is {study.reference.told}")
    best = min((row.error(quantity).bound for row in rows if row.sample.status == "ok"), default=math.inf)
    raise StabilityError(f"{place}: nothing that was tried reaches {target:g} of {quantity}; the best was {best:.1e}")


def offers_for(rows: Sequence[StudyRow], quantity: str, aim: float) -> list[Offer]:
    """The offer of each method and precision whose runs lie on both sides of the aim, or all reach it."""
    groups: dict[tuple[str, str, str], list[StudyRow]] = {}
    for row in rows:
        configuration = row.sample.configuration
        if row.sample.status == "ok" and row.seconds is not None and math.isfinite(row.error(quantity).bound):
            groups.setdefault((configuration.integrator, configuration.precision, configuration.backend), []).append(row)
    offers = []
    for names, group in groups.items():
        group.sort(key=lambda row: row.sample.configuration.fineness)
        reaching = next((k for k, row in enumerate(group) if row.error(quantity).bound <= aim), None)
        if reaching is not None:
            offers.append(Offer(*names, *_between(group[reaching - 1] if reaching else None, group[reaching], quantity, aim)))
    return offers


def _between(coarse: StudyRow | None, fine: StudyRow, quantity: str, aim: float) -> tuple[float, float, float | None]:
    """Fineness and seconds at which the error equals the aim, by power laws between two runs, and the power of the error."""
    assert fine.seconds is not None
    finest = fine.sample.configuration.fineness
    if coarse is None or coarse.seconds is None or fine.error(quantity).value is None:
        return finest, fine.seconds, None
    fall = math.log(coarse.error(quantity).bound / fine.error(quantity).bound)
    part = math.log(aim / fine.error(quantity).bound) / fall
    coarsest = coarse.sample.configuration.fineness

    def mixed(of_fine: float, of_coarse: float) -> float:
        return of_fine ** (1.0 - part) * of_coarse**part

    return mixed(finest, coarsest), mixed(fine.seconds, coarse.seconds), fall / math.log(finest / coarsest)


def _tried(study: Study, offer: Offer, quantity: str, allowed: float) -> Tried | None:
    """Run an offer, again with a finer or coarser step if its error is too large or far too small; None if it fails."""
    method, fineness = study.methods[offer.integrator], offer.fineness
    power = offer.power if method.adaptive else method.order
    budget = Budget(study.budget.seconds)
    reached = None
    with Workbench(study.problem, backend=offer.backend, precision=offer.precision) as bench:
        machine = bench.machine(offer.integrator)
        for _ in range(TRIALS):
            steps, tolerance = (LOOKS, 1.0 / fineness) if method.adaptive else (math.ceil(fineness), None)
            configuration = machine.configuration(steps, tolerance)
            sample, _ = machine.run(configuration, budget)
            error = study.error(sample, quantity)
            if sample.status == "ok" and error.bound <= allowed:
                dt = study.whole / LOOKS_OF_ADAPTIVE if method.adaptive else study.problem.span / steps
                if reached is None or fineness < reached[0]:
                    seconds = statistics.median(machine.time(configuration, budget) for _ in range(REPEATS))
                    reached = fineness, (configuration, dt, error, seconds)
            is_close = error.bound <= allowed and (error.value is None or error.value > allowed / TOO_GOOD)
            if power is None or not math.isfinite(error.bound) or is_close or (reached and error.bound > allowed):
                break
            wanted = fineness * (error.bound / (SAFETY * allowed)) ** (1.0 / power)
            if not method.adaptive:
                wanted = max(wanted, float(method.fewest_steps))  # a coarser step would be unstable
            if wanted == fineness:
                break
            fineness = wanted
    return reached and reached[1]


def _why(
    offers: Sequence[Offer], tried: Sequence[tuple[Offer, Tried]], chosen: Offer, error: MeasuredError, study: Study
) -> str:
    measured = {offer: found[3] for offer, found in tried}
    part = "" if study.problem.span == study.whole else f" over the first t = {study.problem.span:.4g}"
    said = f"its error was {error}{part}, in {duration(measured[chosen])}"
    others = [measured.get(offer, offer.seconds) for offer in offers if offer.integrator != chosen.integrator]
    if others:
        other = next(offer for offer in offers if measured.get(offer, offer.seconds) == min(others))
        said += f"; {other.integrator} in {other.precision} would take {min(others) / measured[chosen]:.2g} times as long"
    return said
