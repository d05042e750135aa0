"""Does each scene notice an effect that is one per cent off? Each effect of a scene is planted so in turn.

    python tools/checks/plant_errors.py [SCENE …] [--by 1.01] [--backend cpu] [--precision f32] [--json FILE]

Effects are every force, the stiffness of all springs, of hinges, the damping and the limits of springs, the temperature and the
friction of a bath of heat, and the friction of all walls, which are too strong, and the restitution of spheres and that of all
walls, which is too low.
An error is caught where an expectation fails that held before. A run that ends without a verdict, for example by a fault of a
GPU's driver, catches nothing; its line begins with BROKEN and ends with the error.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout that is not installed

from verdicts import finish  # noqa: E402

from mpp_taichi import component  # noqa: E402
from mpp_taichi.scene.load import load_scene  # noqa: E402

STRENGTHS = {
    "newtonian_gravity": "strength",
    "coulomb": "strength",
    "uniform_gravity": "acceleration",
    "linear_drag": "coefficient",
    "harmonic_drive": "force",
    "thrust": "exhaust_speed",
}
DEFAULTS = {"strength": 1.0}
SECOND = {"migration": "circularization"}  # a second effect of a force, with a rate of its own


def errors_of(scene, by):
    """Name of each effect, and the settings that make it wrong."""
    resolved = load_scene(scene).resolved
    for number, entry in enumerate(resolved.get("forces") or ()):
        (name, given) = next(iter(entry.items())) if isinstance(entry, dict) else (entry, None)
        key = STRENGTHS.get(name) or factor_of(name, given or {})
        value = (given or {}).get(key, DEFAULTS.get(key))
        if value not in (0, [0] * 2, [0] * 3):  # a force that is off, for example until a key of the window is pressed
            yield name, [f"forces[{number}].{name}.{key}={scaled(value, by)}"]
        if given and given.get(SECOND.get(name, "")):
            yield SECOND[name], [f"forces[{number}].{name}.{SECOND[name]}={scaled(given[SECOND[name]], by)}"]
    yield from errors_of_springs(resolved, by)
    yield from errors_of_bath(resolved, by)
    yield from errors_of_contacts(resolved, 1.0 / by)
    yield from errors_of_friction(resolved, by)


def factor_of(name, given):
    """The parameter that a force grows with: its formula, where the scene has one, its strength, or its first number."""
    written = [key for key in ("potential", "acceleration") if key in given]
    parameters = component.declaration("forces", name).parameters
    strengths = [parameter.name for parameter in parameters if parameter.strength]
    numbers = [parameter.name for parameter in parameters if parameter.type in ("float", "Vector", "AxialVector")]
    return (written or strengths or numbers)[0]


def errors_of_springs(resolved, by):
    """The stiffness of all springs and hinges, and the damping and the limits of all springs that have any."""
    entries = [
        (f"springs[{number}].{kind}", given)
        for number, entry in enumerate(resolved.get("springs") or ())
        for kind, given in entry.items()
    ]
    entries += [(f"spring_types.{name}", given) for name, given in (resolved.get("spring_types") or {}).items()]
    kinds = {"springs": "stiffness", "hinges": "bending_stiffness", "damping of springs": "damping"}
    kinds |= {"breaking strain": "breaks_at", "yield strain": "yields_at"}
    for effect, key in kinds.items():
        settings = [f"{place}.{key}={scaled(given[key], by)}" for place, given in entries if given.get(key)]
        if settings:
            yield effect, settings


def errors_of_bath(resolved, by):
    """The temperature of the bath and its friction, of a method that has a bath; and the temperature of all thermal walls."""
    for name, given in (resolved.get("integrator") or {}).items():
        if component.flag("integrators", name, "draws_random"):
            for key in ("temperature", "friction"):
                yield f"{key} of the bath", [f"integrator.{name}.{key}={scaled(given[key], by)}"]
    thermal = [(f"walls[{number}].{kind}", given) for number, kind, given in walls_of(resolved) if "temperature" in given]
    settings = [f"{wall}.temperature={scaled(given['temperature'], by)}" for wall, given in thermal if given["temperature"]]
    if settings:
        yield "temperature of the walls", settings


def errors_of_contacts(resolved, by):
    """The restitution of spheres, and of all walls, unless it is 0; `by` is below 1, since a restitution may not be above 1."""
    particles = [pair for entry in resolved.get("particles") or () for pair in entry.items()]
    spheres = [kind for kind, given in particles if given.get("radius", 1) != 0]
    meets = not particles or len(spheres) > 1 or bool(set(spheres) - {"body"})  # points and a single sphere meet walls alone
    for solver, given in (resolved.get("contacts") or {}).items() if meets else ():
        if bounces("contacts", given["solver"]) and given.get("restitution") != 0:
            yield "contacts", [f"contacts.{solver}.restitution={scaled(given.get('restitution', 1.0), by)}"]
    walls = walls_of(resolved)
    settings = [
        f"walls[{number}].{kind}.restitution={scaled(given.get('restitution', 1.0), by)}"
        for number, kind, given in walls
        if bounces("walls", kind) and given.get("restitution") != 0 and given.get("temperature") is None
    ]
    if settings:
        yield "walls", settings


def errors_of_friction(resolved, by):
    """The friction of all walls."""
    rough = [(f"walls[{number}].{kind}", given) for number, kind, given in walls_of(resolved) if given.get("friction")]
    settings = [f"{wall}.friction={scaled(given['friction'], by)}" for wall, given in rough]
    if settings:
        yield "friction of the walls", settings


def walls_of(resolved):
    """Number, kind and parameters of each wall."""
    return [(number, *pair) for number, entry in enumerate(resolved.get("walls") or ()) for pair in entry.items()]


def bounces(kind, name):
    """Whether a solver or a wall has a restitution."""
    return any(parameter.name == "restitution" for parameter in component.declaration(kind, name).parameters)


def scaled(value, by):
    """A number, an expression or a vector of them, as a setting."""
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(scaled(each, by) for each in value) + "]"
    return f"{by} * ({value})"


def run(scene, settings, device):
    """The exit code of a run, the expectations that failed, and the line of an error that ended the run."""
    words = [sys.executable, "-m", "mpp_taichi", "run", str(scene), "--headless", "--json", "--quiet", "--no-archive", *device]
    for setting in settings:
        words += ["--set", setting]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=False)
    if not done.stdout.strip():
        return done.returncode, [], (done.stderr.strip().splitlines() or [""])[-1]
    found = json.loads(done.stdout)
    return done.returncode, [row["label"] for row in found.get("expect", []) if not row["passed"]], found.get("error", "")


def main():
    """Run them all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=Path, default=sorted((ROOT / "scenes").glob("*.yaml")))
    parser.add_argument("--by", type=float, default=1.01)
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--precision", help="absent: that of the scene")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    device = ["--backend", arguments.backend, *(["--precision", arguments.precision] if arguments.precision else [])]
    rows, verdicts = [], []
    for scene in arguments.scenes:
        planted = list(errors_of(scene, arguments.by))
        held = not planted or run(scene, [], device)[0] == 0  # what fails by itself catches nothing
        if not held:
            print(f"FAILS   {scene.stem}  as it is", flush=True)
        for effect, settings in planted:
            code, failed, error = run(scene, settings, device)
            rows.append({"scene": scene.stem, "effect": effect, "code": code, "failed": failed, "error": error})
            caught = held and code == 4 and bool(failed)
            verdicts.append(
                (f"{scene.stem}: {effect} times {arguments.by}, expectations that fail, at least", len(failed), 1, caught)
            )
            word = "caught" if caught else "MISSED" if code in (0, 4) else "BROKEN"
            print(f"{word}  {scene.stem}  {effect}  {code}  {', '.join(failed) or error}", flush=True)
    return finish(verdicts, rows, arguments.json)


if __name__ == "__main__":
    sys.exit(main())
