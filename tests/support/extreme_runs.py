"""Runs one integrator or contact solver on extreme masses, places and steps, and prints one JSON object for each case.

    python tests/support/extreme_runs.py integrators leapfrog f64 masses

A process of its own, so that a case that hangs can be ended: each case is announced before it runs.
"""

import json
import sys
import warnings
from dataclasses import replace

import numpy as np

import mpp_taichi as mpp

STEPS = 3
STEPS_OF_TIME = (1e-300, 1e-30, 1e30, 1e300)
PLANETS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
SPHERES = np.array([[0.3, 0.5, 0.5], [0.7, 0.5, 0.5]]), np.array([[1.0, 0.0, 0.0], [-0.5, 0.1, 0.0]])
PLACES = {
    "far away": PLANETS[0] + 1e15,
    "far apart": np.array([[-1e15, 0.0, 0.0], [1e15, 0.0, 0.0]]),
    "coincident": np.zeros((2, 3)),
    "nearly coincident": np.array([[0.0, 0.0, 0.0], [1e-150, 0.0, 0.0]]),
}


def scene_of(kind, name, masses, count):
    """Bodies that orbit, or spheres in a box that meet."""
    position, velocity = PLANETS if kind == "integrators" else SPHERES
    bodies = [
        {"mass": m, "position": x.tolist(), "velocity": v.tolist(), "radius": 0.05}
        for m, x, v in zip(masses, position, velocity)
    ]
    scene = {"particles": [{"body": body} for body in bodies[:count]], "run": {"steps": STEPS}}
    if kind == "integrators":
        method = "ias15" if name == "event_driven" else name
        return scene | {"forces": [{"newtonian_gravity": {"strength": 1.0}}], "integrator": {method: {"dt": 0.01}}}
    method = {"event_driven": "event_driven", "located": "ias15"}.get(name, "symplectic_euler")
    scene["contacts"] = {"hard_spheres": {"solver": name}}
    scene["walls"] = [{"box": {"lower": [0, 0, 0], "upper": [1, 1, 1]}}]
    return scene | {"integrator": {method: {"dt": 0.1}}}


def cases_of(kind, group):
    """(name, masses, count of bodies, dt or None, positions or None) for each case."""
    if group == "masses":
        for masses in ((1.0, 1e-300), (1e-300, 1e-300), (1e300, 1e300), (1e-300, 1e300)):
            yield f"masses {masses}", masses, 2, None, None
        yield "one body", (1.0,), 1, None, None
        return
    usual = (1.0, 1e-3)
    yield "usual", usual, 2, None, None
    for dt in STEPS_OF_TIME:
        yield f"dt {dt:g}", usual, 2, dt, None
    for name, position in PLACES.items() if kind == "integrators" else ():
        yield name, usual, 2, None, position


def energy(snapshot, gravity):
    """Kinetic and potential energy; of the masses as they are."""
    kinetic = 0.5 * float(np.sum(snapshot.mass[:, None] * snapshot.velocity**2))
    distance = float(np.linalg.norm(snapshot.position[-1] - snapshot.position[0])) if gravity else 0.0
    potential = -float(np.prod(snapshot.mass)) / distance if snapshot.particle_count > 1 and distance > 0.0 else 0.0
    return kinetic, potential


def outcome(simulation, dt, position):
    """The state after a few steps, in numbers; MppError where the run is refused."""
    simulation.restart()
    if dt is not None:
        simulation.dt = dt
    start = simulation.start
    if position is not None:
        start = replace(start, position=position)
    simulation.phase.place(start, simulation.dt)
    simulation.run(steps=STEPS)
    end, gravity = simulation.snapshot(), bool(simulation.spec.forces)
    return {
        "finite": bool(np.isfinite(end.position).all() and np.isfinite(end.velocity).all()),
        "moved": float(np.abs(end.position - start.position).max()),
        "energies": [energy(start, gravity), energy(end, gravity)],
        "kinds": [each.kind for each in simulation.verdict.findings],
        "messages": [each.message for each in simulation.verdict.findings],
        "time": simulation.time,
    }


def main(kind, name, precision, group):
    """Run all cases of a group."""
    simulation, made_of = None, None
    for case, masses, count, dt, position in cases_of(kind, group):
        print(json.dumps({"began": case}), flush=True)
        try:
            if made_of != masses:
                scene = scene_of(kind, name, masses, count)
                simulation, made_of = mpp.Simulation(scene, backend="cpu", precision=precision), masses
            usual = simulation.course.phases[0].dt
            found = outcome(simulation, usual if dt is None else dt, position)
        except mpp.MppError as error:
            found = {"refused": str(error)}
        print(json.dumps({"case": case, **found}), flush=True)


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        main(*sys.argv[1:5])
