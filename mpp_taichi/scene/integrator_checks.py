"""What an integrator needs of the forces of a scene, known without compiling anything."""

from mpp_taichi import component
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.spec import SceneSpec

# Methods made for certain forces, of which the scene must have one and no other, and the reason.
MADE_FOR = {"adaptive_leapfrog": (("newtonian_gravity",), "its step follows a potential that has one sign")}


def check_integrator(spec: SceneSpec, faults: Faults) -> None:
    """Refuse forces and springs beside a method that was not made for them."""
    place, key = spec.integrator.location, f"integrator.{spec.integrator.name}"
    rule = refused_formulas(spec.integrator.name, spec)
    if rule:
        faults.add(place, key, rule)
    forces, reason = MADE_FOR.get(spec.integrator.name, ((), ""))
    if not forces:
        return
    others = [force.name for force in spec.forces if force.name not in forces] + (["springs"] if spec.springs else [])
    if others:
        faults.add(place, key, f"knows no forces but {', '.join(forces)} ({reason}), not {', '.join(others)}")
    elif not spec.forces:
        faults.add(place, key, f"needs {', '.join(forces)}: {reason}")


def refused_formulas(integrator: str, spec: SceneSpec) -> str:
    """Why a method cannot go with formulas of these forces, or nothing.

    Jerks want derivatives, which a force says that it has; what depends on velocity is refused for that, in check_physics. A
    force that depends on time finds other times on the way back, where they are sums of steps: no bit is sure then.
    """
    wants = component.declaration("integrators", integrator).flags
    forces = {force.name: component.declaration("forces", force.name).flags for force in spec.forces}
    if wants.get("needs_derivatives"):
        without = [n for n, says in forces.items() if not (says.get("has_derivatives") or says.get("depends_on_velocity"))]
        if without:
            names = component.names("forces")
            allowed = [n for n in names if n != "spring" and component.declaration("forces", n).flags.get("has_derivatives")]
            return (
                f"needs the derivative of every force, which {', '.join(without)} lacks, allowed: {', '.join(allowed)}, springs"
            )
    if not wants.get("takes_time", True):
        timed = [name for name, says in forces.items() if says.get("depends_on_time")]
        if timed:
            return f"goes back bit for bit by forces of places alone, not by {', '.join(timed)}, which depends on time"
    return ""
