"""Agreement: collects the evidence of all backends and judges it, within a time limit."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.compare import neighbors
from mpp_taichi.compare.certificate import Judge, verdict
from mpp_taichi.compare.course import COPIES, Finding, ReferenceCourse
from mpp_taichi.compare.evidence import Evidence
from mpp_taichi.compare.numpy_pairs import ROUNDINGS
from mpp_taichi.compare.numpy_reference import DIRECT
from mpp_taichi.compare.row import BackendRow
from mpp_taichi.scene.estimate import estimate

Ask = Callable[..., dict[str, Any] | None]  # a row, a command and its fields; None where the row has failed
Once = Callable[[str, Callable[[], Any]], Any]  # a key, and what finds the value where it is not known from before
LOOKS = 8
USUAL_STEPS = 1000  # of a scene without an end
NUMPY_SHARE = 0.3  # of the time: for the NumPy reference; the same for all backends, and the rest for neighbors
PAIR_SECONDS = 5e-9  # of the NumPy reference, a rough upper bound: to decide whether a step of it should be begun
LEAST_SHARE = 0.1  # of the budget, for neighbors in any case
FURTHER = 2  # the least factor by which neighbors must extend the number of steps
# Base classes of integrators whose steps depend only on the state, and not on a tolerance.
PLAIN_STEPS = ("Splitting", "RungeKutta", "Hermite", "Integrator")
# Solvers that depend on a tolerance, or that only one backend has, with the reason why their trajectories are not judged.
CONTACTS_NOT_JUDGED = {
    "resting": "resting contacts are solved to a tolerance, and rounding decides the remaining error",
    "located": "a contact is searched to a tolerance, and rounding decides the remaining error",
    "event_driven": "only the CPU has event_driven contacts, and rounding of f32 soon decides which spheres meet",
    "merging": "only the CPU has merging contacts, and rounding of f32 soon decides which spheres meet",
}


class Agreement:
    """The certificates of all rows that run."""

    def __init__(self, judge: Judge, files: Path, ask: Ask, budget: Budget, tell: Callable[[str], None], once: Once) -> None:
        """`files` is a folder for the files of the workers; `once` keeps what depends on the clock."""
        self.judge, self._files, self._ask, self._budget, self._tell = judge, files, ask, budget, tell
        self._once = once
        self.remarks: list[str] = []
        self._reasons: dict[BackendRow, str] = {}  # the reason why a row is not judged, other than the scene
        self.steps = 0  # of the longest trajectory compared

    def certify(self, rows: Sequence[BackendRow], precisions: Sequence[str], most_steps: int | None, end: float) -> None:
        """Judge every row, until the time `end` of the budget."""
        judge = self.judge
        usual = min(self._usual_steps(), most_steps or USUAL_STEPS**3)
        share = self._once("seconds for the reference", lambda: max(0.0, NUMPY_SHARE * (end - self._budget.spent)))
        looks = self._once("looks at the reference", lambda: self._looks_in_numpy(usual, share))
        found = self._gather_all(rows, looks, share)
        courses: dict[bool, ReferenceCourse] = {}
        for turns in {judge.turns(row.backend, row.precision) for row in found} if looks else ():
            self._tell(f"following the reference for {looks[-1]:,} steps")
            courses[turns] = judge.follow(precisions, looks, turns=turns)
        findings: dict[BackendRow, list[Finding]] = {}
        for row, evidence in found.items():
            self._tell(f"judging {row.name}")
            has_forces = len(evidence.position) > 0 and judge.force_refusal is None
            findings[row] = judge.forces(evidence, row.precision) if has_forces else []
            course = courses.get(judge.turns(row.backend, row.precision))
            if course is not None:
                findings[row] += course.findings(evidence, row.precision)
                row.certificate |= course.looks(evidence, row.precision)
            self.steps = max(self.steps, int(evidence.steps.max(initial=0)))
        if usual >= FURTHER * self.steps:
            self._follow_neighbors(found, findings, precisions, usual, end)
        if not (self.steps or self.remarks):
            self.remarks.append("trajectories are not judged: steps take too long for the budget")
        for row, several in findings.items():
            row.certificate |= verdict(several, self._reasons.get(row, judge.step_refusal)) | judge.conservation(
                found[row], row.precision
            )

    # Length of the comparison

    def _usual_steps(self) -> int:
        """The number of steps of the scene's own run, or to the first event of its timeline."""
        spec = self.judge.spec
        usual = estimate(spec).steps or USUAL_STEPS
        return min(usual, max(1, math.floor(spec.timeline[0].at / self.judge.dt))) if spec.timeline else usual

    def _looks_in_numpy(self, usual: int, share: float) -> list[int]:
        if self.judge.step_refusal is not None or self.judge.pairs_per_step * PAIR_SECONDS > share:
            return []
        return spread(1, int(max(1, min(usual, share / self.judge.step_seconds()))))

    def _gather_all(self, rows: Sequence[BackendRow], looks: Sequence[int], share: float) -> dict[BackendRow, Evidence]:
        places, speeds = (np.stack(column) for column in zip(*self.judge.states()))
        np.savez(self._files / "states.npz", position=places, velocity=speeds)
        found = {}
        for row in rows:
            evidence = self._gather(row, "states.npz", affordable(looks, row, share / len(rows)))
            if evidence is not None:
                found[row] = evidence
        return found

    def _gather(self, row: BackendRow, states: str | None, looks: Sequence[int]) -> Evidence | None:
        """The evidence of a row, with the forces at the states where these are given."""
        self._tell(f"measuring {row.name}")
        file = self._files / "evidence.npz"
        forces = bool(self.judge.spec.forces or len(self.judge.start.springs)) and states is not None
        name = str(self._files / (states or "states.npz"))
        if self._ask(row, "gather", states=name, looks=list(looks), forces=forces, to=str(file)) is None:
            return None
        with np.load(file, allow_pickle=False) as arrays:
            return Evidence(**{name: arrays[name] for name in arrays.files})

    # Longer trajectories

    def _follow_neighbors(
        self,
        found: dict[BackendRow, Evidence],
        findings: dict[BackendRow, list[Finding]],
        precisions: Sequence[str],
        usual: int,
        end: float,
    ) -> None:
        """Compare longer trajectories, or trajectories of other methods, with the fastest backend of exact f64 forces."""
        judge, spec = self.judge, self.judge.spec
        refused = judge.step_refusal
        plain = component.declaration("integrators", spec.integrator.name).base in PLAIN_STEPS
        # A tolerance decides which nodes a tree opens, and rounding may change the decision.
        plain = plain and all(force.parameters.get("solver", DIRECT) == DIRECT for force in spec.forces)
        contacts = spec.contacts.solver.name if spec.contacts is not None else ""
        if contacts in CONTACTS_NOT_JUDGED:
            refused = CONTACTS_NOT_JUDGED[contacts]
            self._reasons |= dict.fromkeys(found, refused)
        if not plain or contacts in CONTACTS_NOT_JUDGED:
            self.remarks.append(f"trajectories are not judged: {refused}")
            return
        bases = [row for row in found if row.precision == "f64" and row.backend != "numpy" and row.seconds_per_step]
        bases = [row for row in bases if all(each.holds for each in findings[row])]
        if not bases or len(found) < 2:
            if refused:
                self.remarks.append(f"trajectories are not judged: {refused}")
            return
        base = min(bases, key=lambda row: row.seconds_per_step)
        left = self._once("seconds for neighbors", lambda: max(LEAST_SHARE * self._budget.seconds, end - self._budget.spent))
        most = int(min(usual, left / 2 / ((1 + len(precisions) + COPIES) * base.seconds_per_step)))
        if most < FURTHER * max(1, self.steps):
            return
        looks = spread(max(1, self.steps), most)
        course = self._course_of(base, found[base], precisions, looks)
        if course is None:
            return
        for row in found:
            if judge.turns(row.backend, row.precision) != judge.turns(base.backend, base.precision):
                self._reasons.setdefault(row, f"Vulkan has no sines in f64: its kicks are not those of {base.name}")
                continue
            mine = affordable(looks, row, left / 2 / len(found))
            if row is base or not mine or mine[-1] <= self.steps:
                continue
            evidence = self._gather(row, None, mine)
            if evidence is not None:
                found[row] = replace(found[row], steps=evidence.steps, places=evidence.places, speeds=evidence.speeds)
                findings[row] += course.findings(evidence, row.precision)
                told = course.looks(evidence, row.precision)
                row.certificate["looks_beside"] = {"base": base.name, **told}
                if course.limits is not None and not findings[row]:
                    self._reasons[row] = f"rounding of {row.precision} may decide which spheres meet, and when"
        mate = next((row for row in found if row is not base and row.precision == "f64" and findings[row]), None)
        if mate is not None and not findings[base]:  # either of the two may serve as the reference
            findings[base] = [replace(each, looked_at=f"{each.looked_at}: {mate.name}") for each in findings[mate]]
        self.remarks.append(f"trajectories of up to {looks[-1]:,} steps were compared with the trajectory of {base.name}")

    def _course_of(
        self, base: BackendRow, felt: Evidence, precisions: Sequence[str], looks: Sequence[int]
    ) -> ReferenceCourse | None:
        judge = self.judge
        self._tell(f"following {base.name} and its neighbors for {looks[-1]:,} steps")
        push = np.zeros_like(judge.start.position)
        if len(felt.acceleration):
            roundings = judge.roundings if judge.force_refusal is None else ROUNDINGS + judge.start.particle_count
            push = roundings * judge.dt * np.abs(felt.acceleration).max(axis=0)
        places, speeds = neighbors.starts(judge.start, precisions, judge.free, push)
        given, to = self._files / "starts.npz", self._files / "followed.npz"
        np.savez(given, position=places, velocity=speeds)
        if self._ask(base, "follow", starts=str(given), looks=list(looks), to=str(to)) is None:
            return None
        with np.load(to, allow_pickle=False) as arrays:
            return neighbors.course(
                precisions,
                looks,
                arrays["places"],
                arrays["speeds"],
                updates=1 + (base.facts.get("evaluations") or 1),
                size=judge.size,
                given_by=f"beside {base.name}",
                limits=self._limits(looks),
            )

    def _limits(self, looks: Sequence[int]) -> np.ndarray | None:
        judge, contacts = self.judge, self.judge.spec.contacts
        if contacts is None:
            return None
        return neighbors.limits_of_contacts(judge.start, judge.dt, looks, in_groups=contacts.solver.name == "simultaneous")


def spread(first: int, last: int) -> list[int]:
    """Counts of steps at which samples are taken, in a geometric series between two counts."""
    return sorted({round(first * (last / first) ** (k / (LOOKS - 1))) for k in range(LOOKS)})


def affordable(looks: Sequence[int], row: BackendRow, seconds: float) -> list[int]:
    """The samples that a row reaches in a time; the first of them in any case."""
    return [look for look in looks if look == looks[0] or look * row.seconds_per_step <= seconds]
