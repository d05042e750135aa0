"""Forces that are formulas: sums over pairs and over lists of neighbours, fields, and the perihelion of Mercury."""

import math
from typing import Any

import numpy as np

from mpp_taichi.verify.bounds import half_digit, rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._random_bodies import GRID, random_bodies
from mpp_taichi.verify.place import Place, sound

POWERS = 14  # of the distance, in the force of Lennard-Jones
ROUGH = 4.0  # roundings of a rough inverse root in single precision
PLAIN = ("f32", "f64")
SOURCE = "a sum over pairs in NumPy in double precision"
STEP: dict[str, Any] = {"velocity_verlet": {"dt": 2.0**-10}}


def _argon(start: Any, length: float, cutoff: float, edge: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations by the Lennard-Jones force, and the sums of the sizes of their terms: (n, 3), (n,)."""
    apart = start.position[None] - start.position[:, None]
    if edge is not None:
        apart -= edge * np.round(apart / edge)
    distance = np.sqrt(np.sum(apart**2, axis=2))
    np.fill_diagonal(distance, 1.0)
    u = length / distance
    terms = np.where(distance < cutoff, 24.0 * (2.0 * u**12 - u**6) / distance**2, 0.0)
    np.fill_diagonal(terms, 0.0)
    sizes = np.where(distance < cutoff, 24.0 * (2.0 * u**12 + u**6) / distance, 0.0)
    np.fill_diagonal(sizes, 0.0)
    mass = start.mass[:, None]
    return -np.einsum("ij,ijk->ik", terms, apart) / mass, sizes.sum(axis=1) / start.mass


def _error(place: Place, scene: dict[str, Any], length: float, cutoff: float, edge: float | None = None) -> Found:
    with place.simulation(scene) as simulation:
        found, start = simulation.accelerations(), simulation.start
    wanted, sizes = _argon(start, length, cutoff, edge)
    reached = float(np.max(np.linalg.norm(found - wanted, axis=1) / sizes))
    count, u = len(sizes), place.force_u
    of_distance = f"{POWERS} times the {ROUGH + 1:.0f} u of an inverse distance"
    why = f"{of_distance}, and √n u of n = {count} terms, u = {u:.1g}, in parts of the sum of sizes"
    return Found(reached, (POWERS * (ROUGH + 1.0) + math.sqrt(count)) * u, why)


@case("The Lennard-Jones force is the sum over all pairs", SOURCE, quick=True, solved_in=("f32", "f32c", "f64"))
def lennard_jones(place: Place) -> Found:
    """64 bodies at random places, in a box of some lengths of the force."""
    forces = [{"lennard_jones": {"length": 0.25}}]
    return _error(place, {"particles": random_bodies(64), "forces": forces, "integrator": STEP}, 0.25, math.inf)


@case("A cutoff is summed over the nearest copies in a periodic box", SOURCE, quick=True, solved_in=PLAIN, on=PLAIN)
def lists_of_neighbours(place: Place) -> Found:
    """729 bodies near the places of a lattice, whose lists lead through the faces of the box."""
    random, side, edge = np.random.default_rng(2), 9, 4.5
    lattice = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3) * 0.5 + 0.25
    places = np.round((lattice + random.uniform(-0.05, 0.05, lattice.shape)) / GRID) * GRID
    scene = {
        "particles": [{"body": {"mass": 1.0, "position": x.tolist()}} for x in places],
        "forces": [{"lennard_jones": {"length": 0.5, "cutoff": 1.25}}],
        "walls": [{"periodic_box": {"lower": [0.0] * 3, "upper": [edge] * 3}}],
        "integrator": STEP,
    }
    return _error(place, scene, 0.5, 1.25, edge)


@case(
    "A charge in crossed fields drifts with E/B",
    "Jackson, Classical Electrodynamics (1999), §12.3",
    quick=True,
    solved_in=PLAIN,
)
def cyclotron_drift(place: Place) -> Found:
    """From rest the charge rolls on a cycloid, x = 1 + (E/B²) (1 − cos Bt), y = (E/B²) (sin Bt − Bt), for 3 turns."""
    field, electric, steps = 2.0, 0.5, 300
    scene = {
        "particles": [{"body": {"mass": 1.0, "charge": 1.0, "position": [1.0, 0.0, 0.0]}}],
        "forces": [
            {"magnetic_field": {"field": [0.0, 0.0, field]}},
            {"uniform_gravity": {"acceleration": [electric, 0.0, 0.0]}},
        ],
        "integrator": {"dop853": {"dt": 3.0 * math.tau / field / steps}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(steps=steps)
        sound(simulation)
        x, y, _ = simulation.snapshot().position[0]
        turned = field * simulation.time
    small = electric / field**2
    wanted = 1.0 + small * (1.0 - math.cos(turned)), small * (math.sin(turned) - turned)
    size = 1.0 + small * turned
    bound, why = rounding(place, steps=steps, stages=12, phase=turned, leverage=0.0)
    # An eighth-order step of 0.063 rad has an error of some 0.063⁹/9! of the circle.
    method = steps * (turned / steps) ** 9 / math.factorial(9)
    return Found(
        math.hypot(x - wanted[0], y - wanted[1]) / size, bound + method, f"the error of the method {method:.1g}, and {why}"
    )


@case(
    "The perihelion of Mercury turns by 42.98″ a century",
    "Will, Living Rev. Relativity 17 (2014) 4, §3.5: 42.98″ by general relativity; Nobili & Roxburgh (1986) for the potential",
    solved_in=("f64",),
    on=("f64",),
)
def perihelion_of_mercury(place: Place) -> Found:
    """Twelve revolutions with general relativity, from one perihelion to another; in au and days."""
    printed, gm, c = "42.98", 0.01720209895**2, 173.1446327
    axis, eccentricity, turns, per_turn = 0.38709893, 0.20563069, 12, 240
    k = 3.0 * gm**2 / c**2
    near = axis * (1.0 - eccentricity)
    fast = math.sqrt(gm * (1.0 + eccentricity) / near)
    period = math.tau * gm * (2.0 * (gm / near + k / near**2 - fast**2 / 2.0)) ** -1.5
    scene = {
        "particles": [
            {"body": {"mass": 1.0, "position": [0.0, 0.0, 0.0], "free": [False, False, False]}},
            {"body": {"mass": 1e-12, "position": [near, 0.0, 0.0], "velocity": [0.0, fast, 0.0]}},
        ],
        "forces": [
            {"newtonian_gravity": {"strength": gm}},
            {"post_newtonian": {"strength": gm, "central_mass": 1.0, "speed_of_light": c}},
        ],
        "integrator": {"dop853": {"dt": period / per_turn}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(steps=turns * per_turn)
        sound(simulation)
        now = simulation.snapshot()
    x, v = now.position[1, :2], now.velocity[1, :2]
    spin = x[0] * v[1] - x[1] * v[0]
    pericentre = np.array([v[1] * spin, -v[0] * spin]) / gm - x / np.linalg.norm(x)
    century = 36525.0 / period * math.degrees(math.atan2(pericentre[1], pericentre[0])) / turns * 3600.0
    bound, why = rounding(place, steps=turns * per_turn, stages=12, phase=math.tau * turns, leverage=1.0 / (1.0 - eccentricity))
    error = math.degrees(bound / eccentricity) * 3600.0 / turns * 36525.0 / period
    digit = half_digit(printed)
    told = f"{digit:.1g}, half a unit of the last digit of {printed}, and {error:.2g} by {why}, over the eccentricity"
    return Found(abs(century - float(printed)), digit + error, told)
