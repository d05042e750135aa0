"""Words: the results of a comparison, in lines for a person."""

from typing import Any

from mpp_taichi.accuracy.verdict import duration
from mpp_taichi.compare.table import number

EXPLANATION = (
    "Decided by: of all comparisons with the reference the one nearest to, or farthest beyond, its allowance; off and allowed "
    "are relative to the largest acceleration, the system’s size or the typical velocity. Energy: change to the last sample. "
    "Compile: with empty caches, and again with what was kept. Copy: of all positions to the host. Launches: of a step. "
    "Step: median, ± interquartile range. Pairs/s: ordered pairs, "
    "N (N − 1) for each evaluation of the force. GFLOP/s: 20 for a pair in f32, 30 in f64, by convention. Of peak: of the most "
    "that probes reached on the same device, in sums of products, for springs in copied bytes. Rendering is not measured."
)


def sentence(found: dict[str, Any]) -> str:
    """Whether the backends agree, and which is the fastest."""
    rows = [row for row in found["rows"] if row["status"] == "ok"]
    bugs = [row for row in rows if row.get("verdict") == "bug"]
    judged = [row for row in rows if row.get("verdict") in ("bug", "rounding")]
    if bugs:
        said = "; ".join(f"{_name(row)}: {_decision(row)}" for row in bugs)
        first = f"not all agree: {said}"
    elif judged:
        first = f"all {len(judged)} that could be judged agree to rounding" if len(judged) > 1 else "it agrees to rounding"
    else:
        first = "nothing could be judged"
    timed = [row for row in rows if row["step_seconds"]]
    parts = [first]
    for precision in ("f64", "f32"):
        best = sorted((row for row in timed if row["precision"] == precision), key=lambda row: row["step_seconds"])
        if len(best) > 1:
            ratio = best[1]["step_seconds"] / best[0]["step_seconds"]
            parts.append(
                f"in {precision} {best[0]['label']} is the fastest, {duration(best[0]['step_seconds'])} a step, "
                f"{best[1]['label']} takes {ratio:.3g} times that"
            )
    return "; ".join(parts)


def _name(row: dict[str, Any]) -> str:
    return f"{row['label']} {row['precision']}"


def _decision(row: dict[str, Any]) -> str:
    decided = row["decided_by"]
    return (
        f"bug, {decided['check']} of particle {decided['particle']} is off by {number(decided['difference'])} "
        f"of {decided['of']}, allowed {number(decided['allowance'])}"
    )


def circumstances(found: dict[str, Any]) -> list[str]:
    """The things compared, and warnings about the reliability of the results."""
    springs = f", {found['spring_count']:,} springs" if found["spring_count"] else ""
    lines = [
        f"{found['particle_count']:,} particles{springs}; {', '.join(found['effects']) or 'no effect'}; "
        f"{found['integrator']}, dt = {found['dt']:.6g}, {found['evaluations_per_step']} force evaluations a step."
    ]
    if found["steps_compared"]:
        lines.append(f"Trajectories were compared with the reference over {found['steps_compared']:,} steps.")
    lines += list(dict.fromkeys(_horizon(row) for row in found["rows"] if "meaning_until_step" in row))
    lines += [
        f"{each['faster']} is faster than {each['than']} from about {each['from']:,} particles on."
        for each in found["crossovers"]
    ]
    lines += [f"Warning: {warning}." for warning in found["warnings"]]
    return [*lines, *(f"Note: {remark}." for remark in found["remarks"])]


def _horizon(row: dict[str, Any]) -> str:
    """The step from which rounding leaves positions no meaning, if it is before the last sample."""
    return f"In {row['precision']} rounding leaves positions a meaning for {row['meaning_until_step']:,} steps."


def machine(found: dict[str, Any]) -> str:
    """Machine, versions and effort in one line."""
    known = found["known"]
    versions = ", ".join(f"{name} {known[name]}" for name in ("mpp_taichi", "taichi", "numpy", "python"))
    devices = "; ".join(dict.fromkeys(f"{row['backend']}: {row['device']}" for row in found["rows"] if row["status"] == "ok"))
    effort = f"{found['spent_seconds']:.0f} s of a budget of {found['budget_seconds']:.0f} s"
    return f"{known['cpu']}, {known['processors']} processors, {known['system']}; {devices}; {versions}; {effort}"
