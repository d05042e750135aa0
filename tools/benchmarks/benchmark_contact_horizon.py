"""`horizon: true` on scenes in which spheres touch: the time that is told beside the true time.

    python tools/benchmarks/benchmark_contact_horizon.py ["24 disks;pile"] [PART …]

The true time is the first of 1,200 times at which a sphere is farther than a thousandth of the system's size from a flight in
long double (`exact_flight.py`), or, where other forces or inelastic contacts act, from a run with much shorter steps or
another method. Each PART, such as 0.5, also searches with just the work that follows this part of the true time.
"""

import argparse

import numpy as np
from benchmark_horizon import BUNDLED, loaded
from exact_flight import ExactFlight

import mpp_taichi as mpp
from mpp_taichi.horizon.horizon import LIMIT
from mpp_taichi.horizon.search import find

LOOKS = 1200


def gas(count, side, radius, until, solver="event_driven", **more):
    """Disks in a square box."""
    return {
        "dimensions": 2,
        "seed": 1,
        "particles": [{"gas": {"count": count, "lower": [0, 0], "upper": [side, side], "radius": radius, "speed": 1}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "walls": [{"box": {"lower": [0, 0], "upper": [side, side]}}],
        "run": {"duration": until},
        **({} if solver == "event_driven" else {"integrator": {"leapfrog": {"dt": 0.05}}}),
        **more,
    }


FALL = {"forces": [{"uniform_gravity": {"acceleration": [0, -1]}}]}


def bundled(name):
    """A scene of the program."""
    return BUNDLED / f"{name}.yaml"


# name: (scene, precision, time up to which the truth is looked for, changes that make the scene the truth)
SCENES = {
    "24 disks": (gas(24, 10, 0.6, 60), "f64", 60, []),
    "24 disks, f32": (gas(24, 10, 0.6, 60), "f32", 60, []),
    "24 disks, swept": (gas(24, 10, 0.6, 60, "swept"), "f64", 60, []),
    "24 disks, pairwise": (gas(24, 10, 0.6, 60, "pairwise"), "f64", 5, []),
    "24 falling disks, swept": (gas(24, 10, 0.6, 60, "swept", **FALL), "f64", 10, []),
    "100 falling disks": (gas(100, 20, 0.5, 60, **FALL), "f64", 20, []),
    "5 disks": (gas(5, 10, 0.5, 400), "f64", 150, []),
    "maxwell_boltzmann": (bundled("maxwell_boltzmann"), "f64", 20, []),
    "piston": (bundled("piston"), "f64", 15, []),
    "mixing": (bundled("mixing"), "f64", 8, []),
    "brownian_motion": (bundled("brownian_motion"), "f64", 10, []),
    "newtons_cradle": (bundled("newtons_cradle"), "f64", 11, ["integrator.leapfrog.dt=0.001"]),
    "one_on_two": (bundled("one_on_two"), "f64", 5, ["integrator.leapfrog.dt=0.001"]),
    "billiard_break": (bundled("billiard_break"), "f64", 0.4, ["integrator.leapfrog.dt=1e-5"]),
    "bouncing_planets": (bundled("bouncing_planets"), "f64", 40, ["integrator={taylor: {dt: 0.02}}"]),
    "accretion": (bundled("accretion"), "f64", 8, ["integrator.velocity_verlet.dt=0.0005"]),
    "pile": (bundled("pile"), "f64", 3, ["integrator.leapfrog.dt=2e-5"]),
    "rocket": (bundled("rocket"), "f64", 2, ["integrator.leapfrog.dt=2e-5"]),
}


def exact_flight(simulation):
    """The same start in long double."""
    axes, start, enclosure = simulation.spec.dimensions, simulation.start, simulation.contacts.setup.enclosure
    planes = [(each.point[:axes], each.direction[:axes], each.velocity[:axes]) for each in enclosure.surfaces]
    gravity = sum(
        (np.array(force.parameters["acceleration"][:axes], float) for force in simulation.spec.forces), np.zeros(axes)
    )
    return ExactFlight(
        start.position[:, :axes], start.velocity[:, :axes], start.radius, start.mass, planes, gravity, enclosure.period[:axes]
    )


def places(simulation):
    """Positions of all spheres; of a merged sphere, the position of the sphere of which it is a part."""
    snapshot = simulation.snapshot()
    whole = np.arange(snapshot.particle_count)
    if snapshot.merged_into is not None:
        whole = np.where(snapshot.present, whole, snapshot.merged_into)
        while (whole[whole] != whole).any():
            whole = whole[whole]
    return snapshot.position[whole]


def own_path(scene, precision, until):
    """Times and positions of the run as it is."""
    found = []
    with mpp.Simulation(loaded(scene, []), backend="cpu", precision=precision) as simulation:
        for time in until * np.arange(1, LOOKS + 1) / LOOKS:
            if not simulation.launcher.takes_steps or simulation.integrator.controlled_by:
                simulation.run(until=time)
            elif (steps := round((time - simulation.time) / simulation.dt)) > 0:
                simulation.run(steps=steps)
            else:
                continue
            found.append((simulation.time, places(simulation)))
    return found


def true_time(scene, precision, until, truth):
    """The first time at which the error reaches LIMIT, None where it does not, and the error then."""
    path = own_path(scene, precision, until)
    own = np.array([place for _, place in path])
    size = np.sqrt(np.mean(np.sum((own - own.mean(axis=(0, 1))) ** 2, axis=-1)))
    largest = 0.0
    with mpp.Simulation(loaded(scene, truth), backend="cpu", precision="f64") as simulation:
        flight = None if truth else exact_flight(simulation)
        for time, place in path:
            if flight:
                right = np.zeros_like(place)
                right[:, : simulation.spec.dimensions] = flight.advance(time)
            else:
                if time > simulation.time:
                    simulation.run(until=time)
                right = places(simulation)
            largest = max(largest, float(np.linalg.norm(right - place, axis=1).max() / size))
            if largest > LIMIT:
                return time, largest
    return None, largest


def main():
    """Print a row for each scene, and for each part of its true time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="?", help="names of scenes, between semicolons")
    parser.add_argument("parts", nargs="*", type=float, help="parts of the true time after which the search ends")
    arguments = parser.parse_args()
    names = arguments.names.split(";") if arguments.names else SCENES
    for name in names:
        scene, precision, until, truth = SCENES[name]
        true, error = true_time(scene, precision, until, truth)
        with mpp.Simulation(loaded(scene, []), backend="cpu", precision=precision) as simulation:
            end = simulation.spec.run.duration
            tell(name, find(simulation, end), true, error)
            for part in arguments.parts if true else ():
                tell(f"  from {part:g} of it", find(simulation, end, 2.0 * part * true / end, least=0.0), true, error)


def tell(name, found, true, error):
    """Print a row."""
    ratio = f"{found.time / true:.2f}" if found.time is not None and true is not None else "–"
    told = "–" if found.time is None else f"{found.time:.4g}"
    truth = "to the end" if true is None else f"{true:.4g}"
    print(
        f"{name:24s} {found.found:13s} told {told:>6s} true {truth:>10s} ratio {ratio:>5s} by {found.by} error {error:.1e} "
        f"part {found.part:.3f} share {found.share:.3f} {found.reason}",
        flush=True,
    )


if __name__ == "__main__":
    main()
