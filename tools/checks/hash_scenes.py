"""Hash the state after some steps of each scene, method and contact solver, to compare two commits bit for bit.

    python tools/checks/hash_scenes.py --json before.json       # at one commit
    python tools/checks/hash_scenes.py --against before.json    # at another commit, on the same machine: exit code 1 where
        bits differ

A hash is that of positions, velocities, masses and the time after `--steps` steps, on the CPU. Besides the scenes, every
integrator runs under every plan on a small system of bodies and springs, and every contact solver on a small gas. The last bits
of a sum over pairs depend on the processor, so hashes are compared on one machine only.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # so that it also runs from a checkout

import mpp_taichi as mpp  # noqa: E402
from mpp_taichi import component  # noqa: E402

BODIES: dict[str, Any] = {
    "title": "Three bodies, two springs",
    "dimensions": 3,
    "particles": [
        {"body": {"mass": 1.0, "position": [0, 0, 0], "velocity": [0, 0, 0]}},
        {"body": {"mass": 0.01, "position": [1, 0, 0], "velocity": [0, 1, 0.1]}},
        {"body": {"mass": 0.02, "position": [-2, 0.1, 0], "velocity": [0, -0.7, 0]}},
    ],
    "forces": [{"newtonian_gravity": {"strength": 1.0}}],
}
SPRINGS = [{"link": {"between": [0, 1], "stiffness": 0.3}}, {"link": {"between": [1, 2], "stiffness": 0.1, "damping": 0.01}}]
BOX = [{"box": {"lower": [0, 0], "upper": [4, 4]}}]
GAS: dict[str, Any] = {
    "title": "A gas",
    "dimensions": 2,
    "seed": 3,
    "particles": [{"gas": {"count": 40, "lower": [0, 0], "upper": [4, 4], "radius": 0.12, "radius_spread": 0.2, "speed": 1.5}}],
    "walls": BOX,
}
LARGE_GAS: dict[str, Any] = {
    **GAS,
    "particles": [
        {"gas": {"count": 6000, "lower": [0, 0], "upper": [4, 4], "radius": 0.012, "radius_spread": 0.2, "speed": 1.5}}
    ],
}
REQUIRED = {"langevin": {"temperature": 0.5, "friction": 1.0}}  # parameters without a default
METHOD_BESIDE = {
    "event_driven": {"event_driven": {"dt": 0.01}},
    "located": {"ias15": {"dt": 0.01}},
}  # solvers that leapfrog does not go with


def cases() -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Name, scene and arguments of every run."""
    for path in sorted((ROOT / "scenes").glob("*.yaml")):
        for precision in ("f64", "f32"):
            yield f"scene {path.stem} {precision}", path, {"precision": precision}
    for name in component.names("integrators"):
        if name == "event_driven":
            continue
        numbers = {parameter.name for parameter in component.declaration("integrators", name).parameters}
        integrator = {name: ({"dt": 0.01} if "dt" in numbers else {}) | REQUIRED.get(name, {})}
        for label, scene in (
            ("bodies", BODIES),
            ("springs", {**BODIES, "forces": [], "springs": SPRINGS}),
            ("both", {**BODIES, "springs": SPRINGS}),
        ):
            for plan in ("serial", "parallel"):
                for precision in ("f64", "f32", "f32c", "ds", "df64") if label == "both" else ("f64", "f32"):
                    yield (
                        f"method {name} {label} {plan} {precision}",
                        {**scene, "integrator": integrator},
                        {"precision": precision, "plan": plan},
                    )
    for name in component.names("contacts"):
        for label, gas, restitution in (("elastic", GAS, 1.0), ("inelastic", GAS, 0.8), ("large", LARGE_GAS, 1.0)):
            if name == "located" and label == "large":
                continue  # minutes: it is made for few spheres
            spheres: dict[str, Any] = {"solver": name}
            if name != "merging":
                spheres["restitution"] = restitution
                if restitution < 1.0 and name not in ("resting", "pairwise"):
                    spheres["contact_time"] = 1e-4
            integrator = METHOD_BESIDE.get(name, {"leapfrog": {"dt": 0.01}})
            fall = [{"uniform_gravity": {"acceleration": [0, -1, 0]}}] if name == "located" else []
            scene = {**gas, "contacts": {"hard_spheres": spheres}, "integrator": integrator, "forces": fall}
            for precision in ("f64", "f32"):
                yield f"contacts {name} {label} {precision}", scene, {"precision": precision}
    crowd = {"dimensions": 3, "seed": 5, "particles": [{"plummer": {"count": 3000}}], "integrator": {"leapfrog": {"dt": 0.01}}}
    for solver in ("direct", "tree"):
        gravity = [{"newtonian_gravity": {"strength": 1.0, "softening": 0.05, "solver": solver}}]
        for precision in ("f64", "f32"):
            yield f"crowd {solver} {precision}", {**crowd, "forces": gravity}, {"precision": precision}


def state_hash(scene: Any, arguments: dict[str, Any], steps: int) -> str:
    """Hash of the state after so many steps, or the kind of the error that the run ends with."""
    try:
        spec = mpp.load_scene(scene)
        with mpp.Simulation(spec, backend="cpu", **arguments) as simulation:
            simulation.run(steps=steps)
            snapshot = simulation.snapshot()
            digest = hashlib.sha256()
            for array in (snapshot.position, snapshot.velocity, snapshot.mass):
                digest.update(array.tobytes())
            digest.update(repr(simulation.time).encode())
            return digest.hexdigest()[:16]
    except mpp.MppError as error:
        return type(error).__name__


def main() -> int:
    """Print the hashes; compare them where asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=40, help="steps of each run (40)")
    parser.add_argument("--only", default="", help="only cases whose names hold this text")
    parser.add_argument("--json", type=Path, help="write the hashes to this file")
    parser.add_argument("--against", type=Path, help="compare with the hashes of this file")
    arguments = parser.parse_args()
    before = json.loads(arguments.against.read_text()) if arguments.against else None
    found, differing = {}, 0
    for name, scene, options in cases():
        if arguments.only not in name:
            continue
        found[name] = state_hash(scene, options, arguments.steps)
        differs = before is not None and name in before and before[name] != found[name]
        differing += differs
        print(f"{found[name]:16} {name}" + (f"  DIFFERS, was {before[name]}" if before and differs else ""), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n")
    if before is not None:
        print(f"{len(found)} compared, {differing} differ")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
