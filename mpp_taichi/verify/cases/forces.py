"""Forces against an independent sum in NumPy, their symmetry, and the energy whose gradient they are."""

import math
from typing import Any

import numpy as np

from mpp_taichi.precision import PRECISIONS
from mpp_taichi.verify.case import Case, Found, case
from mpp_taichi.verify.cases._random_bodies import GRID, random_bodies
from mpp_taichi.verify.place import Place

OF_A_PAIR = 10.0  # roundings of the force of a pair, at most
SOURCE = "a sum over pairs in NumPy in double precision"


def _pair_sum(position: np.ndarray, weight: np.ndarray, softening: float) -> tuple[np.ndarray, np.ndarray]:
    """Σ w_j d/(d² + ε²)^(3/2) over the others, and the sum of the sizes of its terms: (n, 3), (n,)."""
    apart = position[None] - position[:, None]
    squared = np.sum(apart**2, axis=2) + softening**2
    np.fill_diagonal(squared, 1.0)
    terms = weight / squared**1.5
    np.fill_diagonal(terms, 0.0)
    size = np.sqrt(np.sum(apart**2, axis=2)) * np.abs(terms)
    return np.einsum("ij,ijk->ik", terms, apart), size.sum(axis=1)


def _sum_bound(place: Place, count: int) -> tuple[float, str]:
    """Of the error of a sum over its terms' sizes."""
    u = place.force_u
    why = f"{OF_A_PAIR:.0f} u of each pair, and √n u of adding n = {count} terms, u = {u:.1g}, in parts of the sum of sizes"
    return (OF_A_PAIR + math.sqrt(count)) * u, why


def _gravity_of(count: int, *, quick: bool) -> Case:
    def ask(place: Place) -> Found:
        forces = [{"newtonian_gravity": {"strength": 1.0, "softening": 0.125}}]
        scene = {"particles": random_bodies(count), "forces": forces, "integrator": {"leapfrog": {"dt": 2.0**-10}}}
        with place.simulation(scene) as simulation:
            found, start = simulation.accelerations(), simulation.start
        wanted, sizes = _pair_sum(start.position, start.mass, 0.125)
        reached = float(np.max(np.linalg.norm(found - wanted, axis=1) / sizes))
        return Found(reached, *_sum_bound(place, count))

    title = f"The gravity of {count:,} bodies is the sum over all pairs"
    return Case(f"gravity_of_{count}", "forces", title, SOURCE, ask, quick, PRECISIONS)


GRAVITY = [_gravity_of(count, quick=count in (2, 257)) for count in (2, 255, 256, 257, 1025)]


@case("Charges attract and repel as the sum over all pairs says", SOURCE, quick=True, solved_in=PRECISIONS)
def charges(place: Place) -> Found:
    """Charges of both signs; the acceleration is q_i Σ −q_j d/d³ over the mass."""
    count = 64
    scene = {
        "particles": random_bodies(count, charged=True),
        "forces": [{"coulomb": {"coulomb_constant": 0.5, "softening": 0.125}}],
        "integrator": {"leapfrog": {"dt": 2.0**-10}},
    }
    with place.simulation(scene) as simulation:
        found, start = simulation.accelerations(), simulation.start
    wanted, sizes = _pair_sum(start.position, start.charge, 0.125)
    factor = 0.5 * start.charge / start.mass
    reached = float(np.max(np.linalg.norm(found + factor[:, None] * wanted, axis=1) / (np.abs(factor) * sizes)))
    return Found(reached, *_sum_bound(place, count))


@case(
    "Springs pull as the textbook sum says",
    "Hooke's law with friction along the springs, in NumPy",
    quick=True,
    solved_in=PRECISIONS,
)
def springs(place: Place) -> Found:
    """200 springs between 64 bodies that move."""
    random = np.random.default_rng(3)
    bodies = random_bodies(64, seed=3)
    speeds = np.round(random.uniform(-1, 1, (64, 3)) / GRID) * GRID
    for entry, velocity in zip(bodies, speeds):
        entry["body"]["velocity"] = [float(v) for v in velocity]
    pairs = sorted({tuple(sorted(map(int, random.choice(64, 2, replace=False)))) for _ in range(200)})
    links = [
        {"link": {"between": list(pair), "stiffness": 4.0 + k % 8, "damping": 0.25, "rest_length": 0.75}}
        for k, pair in enumerate(pairs)
    ]
    scene = {"particles": bodies, "springs": links, "integrator": {"leapfrog": {"dt": 2.0**-10}}}
    with place.simulation(scene) as simulation:
        found, start = simulation.accelerations(), simulation.start
    first, second = np.array(pairs).T
    apart = start.position[second] - start.position[first]
    length = np.linalg.norm(apart, axis=1)
    along = apart / length[:, None]
    rate = np.sum((start.velocity[second] - start.velocity[first]) * along, axis=1)
    stiffness = 4.0 + np.arange(len(pairs)) % 8
    pull = stiffness * (length - 0.75) + 0.25 * rate
    wanted, sizes = np.zeros((64, 3)), np.zeros(64)
    scale = stiffness * (length + 0.75) + 0.25 * np.linalg.norm(start.velocity[second] - start.velocity[first], axis=1)
    for end, sign in ((first, 1.0), (second, -1.0)):
        np.add.at(wanted, end, sign * pull[:, None] * along)
        np.add.at(sizes, end, scale)
    error = np.linalg.norm(found * start.mass[:, None] - wanted, axis=1)
    reached = float(np.max(error[sizes > 0.0] / sizes[sizes > 0.0]))
    return Found(reached, *_sum_bound(place, int(np.bincount(np.array(pairs).ravel()).max())))


@case("Internal forces add up to nothing", "Newton's third law", quick=True, solved_in=PRECISIONS)
def third_law(place: Place) -> Found:
    """|Σ m a| over Σ m |a| of 257 bodies under gravity and with charges."""
    count = 257
    scene = {
        "particles": random_bodies(count, charged=True),
        "forces": [
            {"newtonian_gravity": {"strength": 1.0, "softening": 0.125}},
            {"coulomb": {"coulomb_constant": 0.5, "softening": 0.125}},
        ],
        "integrator": {"leapfrog": {"dt": 2.0**-10}},
    }
    with place.simulation(scene) as simulation:
        force = simulation.accelerations() * simulation.start.mass[:, None]
    reached = float(np.linalg.norm(force.sum(axis=0)) / np.linalg.norm(force, axis=1).sum())
    bound = (OF_A_PAIR + math.sqrt(count)) * place.force_u
    return Found(reached, bound, f"the roundings of each of n = {count} forces, (10 + √n) u, u = {place.force_u:.1g}")


@case("Forces are the gradient of the energy that is reported", "central differences of the potential energy", quick=True)
def gradient(place: Place) -> Found:
    """Gravity, charges and springs of 12 bodies; the potential energy along a direction against the force."""
    scene = {
        "particles": random_bodies(12, charged=True, seed=5),
        "springs": [{"link": {"between": [k, k + 1], "stiffness": 4.0, "rest_length": 0.75}} for k in range(11)],
        "forces": [
            {"newtonian_gravity": {"strength": 1.0, "softening": 0.125}},
            {"coulomb": {"coulomb_constant": 0.5, "softening": 0.125}},
            {"uniform_gravity": {"acceleration": [0.0, -1.0, 0.25]}},
        ],
        "integrator": {"leapfrog": {"dt": 2.0**-10}},
    }
    way = np.random.default_rng(7).normal(size=(12, 3))
    way /= np.linalg.norm(way)
    # The error of a central difference is h² U'''/6 and rounding |U| u / h: the least sum is at h = (3 u)^(1/3).
    h = (3.0 * place.force_u) ** (1.0 / 3.0)
    with place.simulation(scene) as simulation:
        start = simulation.start
        energies = []
        for sign in (1.0, -1.0):
            simulation.phase.place(_moved(start, sign * h * way), simulation.dt)
            energies.append(simulation.diagnostics()["potential_energy"])
        simulation.restart()
        slope = -float(np.sum(simulation.accelerations() * start.mass[:, None] * way))
        size = float(np.linalg.norm(simulation.accelerations() * start.mass[:, None]))
        whole = abs(simulation.diagnostics()["potential_energy"])
    third = whole / 0.125**3  # a bound of the third derivative: the softening is the shortest length
    bound = (h**2 * third / 6.0 + 20.0 * place.u * whole / h) / size
    return Found(
        abs((energies[0] - energies[1]) / (2.0 * h) - slope) / size,
        bound,
        f"a step of h = {h:.1g}: h²/6 of the third derivative, |U|/ε³ at most, and rounding of |U| over h, over the forces",
    )


def _moved(start: Any, by: np.ndarray) -> Any:
    from dataclasses import replace

    return replace(start, position=start.position + by)
