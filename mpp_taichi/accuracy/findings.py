"""Findings: all results of a study as plain data, for reports and files."""

from collections.abc import Sequence
from typing import Any

from mpp_taichi.accuracy.front import StudyRow
from mpp_taichi.accuracy.phase_studies import PhaseStudy
from mpp_taichi.accuracy.study import Study
from mpp_taichi.accuracy.verdict import sentence, verdict

BROKEN_OFF = ("out of time", "interrupted", "unfinished")


def findings(study: Study, target: float, phases: Sequence[PhaseStudy] = ()) -> dict[str, Any]:
    """All results, and the verdict for a target; with a timeline those of its phases too."""
    reference, chaos = study.reference, study.chaos
    rows = study.rows()
    said = verdict(rows, study.quantity, target) | tried(study)
    return {
        "scene": study.problem.spec.source,
        "title": study.problem.spec.title,
        "status": study.status,
        "known": study.store.known,
        "other_devices": {name: facts["device"] for name, facts in study.store.notes.get("elsewhere", {}).items()},
        "particle_count": study.problem.start.particle_count,
        "span": study.problem.span,
        "whole_span": study.whole,
        "quantity": study.quantity,
        "wanted": None if study.problem.wanted is None else study.problem.wanted.column,
        "quantity_because": study.reason,
        "reference": None if reference is None else reference.facts(),
        "values": None
        if study.value_reference is None
        else {**study.value_reference.facts(), "told": study.value_reference.told},
        "chaos": None if chaos is None else chaos.facts(),
        "remarks": study.remarks,
        "budget_seconds": study.budget.seconds,
        "spent_seconds": study.budget.spent,
        "resumed_samples": study.store.resumed,
        "rows": [row_facts(row) for row in rows],
        "verdict": said,
        "sentence": sentence(said, study.reason),
        "phases": [phase_facts(phase, target) for phase in phases],
    }


def tried(study: Study) -> dict[str, Any]:
    """The methods of which a run was done, all that suit the scene, and whether the budget ended before all were tried."""
    begun = {row.sample.configuration.integrator for row in study.rows()} & set(study.methods)
    ended = study.status in BROKEN_OFF or any(study.cut.values())
    counts = {"methods_tried": len(begun), "methods_suited": len(study.methods)}
    return {**counts, "budget_ended": ended and len(begun) < len(study.methods)}


def phase_facts(phase: PhaseStudy, target: float) -> dict[str, Any]:
    """The results of a phase."""
    found = findings(phase.study, target)
    same = ("scene", "title", "known", "other_devices", "whole_span", "particle_count", "phases")
    facts = {key: value for key, value in found.items() if key not in same}
    times = {"began": phase.stretch.began, "ended": phase.stretch.ended, "changes": list(phase.stretch.changes)}
    return {"phase": phase.stretch.number + 1, **times, "told": phase.told, **facts}


def row_facts(row: StudyRow) -> dict[str, Any]:
    """One row as plain data: each error as {value, at_most}, of which one at most is a number."""
    names = ("position", "position_rms", "energy", "momentum", "angular_momentum")
    errors = {name: vars(getattr(row, name)) for name in (*names, "wanted")}
    sample = {key: value for key, value in row.sample.facts().items() if key not in names}
    key = row.sample.configuration.key
    return {"key": key, "is_own": row.is_own, **sample, "median_seconds": row.seconds, "errors": errors}
