"""The contacts of a run in its closing summary."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mpp_taichi.scene.contacts import merges

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


def contact_facts(simulation: "Simulation") -> dict[str, Any]:
    """{"contacts": {…}} for scenes with contacts: the solver, and its counts since the start."""
    contacts, solver = simulation.spec.contacts, simulation.contacts
    if contacts is None or solver is None:
        return {}
    report, elapsed = simulation.contact_report, simulation.time - simulation.start.time
    particles = simulation.start.particle_count
    facts = {
        "solver": contacts.solver.name,
        "pair_count": report.pair_count,
        "wall_count": report.wall_count,
        "elastic_count": report.elastic_count,
        "collisions_per_particle_and_time": 2 * report.pair_count / (particles * elapsed) if elapsed > 0.0 else None,
        "dissipated_energy": report.dissipated_energy,
        **({"wall_work": report.wall_work} if report.wall_work else {}),
        "largest_overlap": report.largest_overlap,
        "unresolved": report.unresolved,
        **(_merged(simulation) if merges(simulation.spec) else {}),
        "wall_impulse": {account: impulse for account, impulse in zip(solver.setup.enclosure.accounts, report.wall_impulse)},
    }
    return {"contacts": facts}


def _merged(simulation: "Simulation") -> dict[str, Any]:
    """The number of spheres that merged into others, and of the remaining spheres; a rate per particle has no meaning here."""
    report = simulation.contact_report
    return {
        "merge_count": report.merge_count,
        "spheres_left": int(simulation.snapshot().present.sum()),
        "potential_change": report.potential_change,
        "collisions_per_particle_and_time": None,
    }


def contact_line(found: Mapping[str, Any]) -> str:
    """`event_driven: 1,234 of spheres, 56 with walls; largest overlap 1e-16 radii`."""
    facts = found.get("contacts")
    if facts is None:
        return ""
    if "merge_count" in facts:
        counted = f"{facts['merge_count']:,} merged, {facts['spheres_left']:,} spheres left, {facts['wall_count']:,} with walls"
        lost, gained = facts["dissipated_energy"], facts["potential_change"]
        return f"{facts['solver']}: {counted}; {lost:.6g} of kinetic energy lost, {gained:+.6g} of potential energy"
    rate = facts["collisions_per_particle_and_time"]
    told = f" ({rate:.4g} per particle and time)" if rate else ""
    counted = f"{facts['pair_count']:,} collisions of spheres{told}, {facts['wall_count']:,} with walls"
    elastic = f", {facts['elastic_count']:,} made elastic" if facts["elastic_count"] else ""
    lost = f"; {facts['dissipated_energy']:.6g} of energy lost" if facts["dissipated_energy"] else ""
    lost += f"; work of the walls {facts['wall_work']:.6g}" if facts.get("wall_work") else ""
    overlap = f"; largest overlap {facts['largest_overlap']:.2g} radii"
    return f"{facts['solver']}: {counted}{elastic}{lost}{overlap}"
