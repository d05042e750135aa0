"""What an integrator needs of the forces of a scene, known without compiling anything."""

from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.spec import SceneSpec

# Methods made for certain forces, of which the scene must have one and no other, and the reason.
MADE_FOR = {"adaptive_leapfrog": (("newtonian_gravity",), "its step follows a potential that has one sign")}


def check_integrator(spec: SceneSpec, faults: Faults) -> None:
    """Refuse forces and springs beside a method that was not made for them."""
    forces, reason = MADE_FOR.get(spec.integrator.name, ((), ""))
    if not forces:
        return
    key = f"integrator.{spec.integrator.name}"
    others = [force.name for force in spec.forces if force.name not in forces] + (["springs"] if spec.springs else [])
    if others:
        faults.add(
            spec.integrator.location, key, f"knows no forces but {', '.join(forces)} ({reason}), not {', '.join(others)}"
        )
    elif not spec.forces:
        faults.add(spec.integrator.location, key, f"needs {', '.join(forces)}: {reason}")
