"""Statistics of gases: pressures, collisions, speeds, equipartition, Brownian motion and cooling, each by a test of its chance.

A row is red on a sound program once in α⁻¹ = 60,000 runs, so that a report of 60 such rows is red at most once in a thousand.
`MEASURES` gives a row's number for any seed; the cases take `SEED`, so that a report repeats.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from mpp_taichi.kinetic_theory import kolmogorov_smirnov
from mpp_taichi.kinetic_theory.collision_rate import enskog_rates_of_mixture
from mpp_taichi.kinetic_theory.equation_of_state import hard_spheres_carnahan_starling, hard_spheres_kolafa
from mpp_taichi.kinetic_theory.packing import UNIT_SURFACE
from mpp_taichi.kinetic_theory.speeds import mean_speed, speed_cumulative
from mpp_taichi.verify.cases._gas import (
    BLOCKS,
    Distances,
    Measured,
    box_of,
    equal_spheres,
    in_blocks,
    of_blocks,
    of_finite,
    scene,
    slowing,
    temperature,
    virial_series,
)
from mpp_taichi.verify.cases._published import FLYING, row
from mpp_taichi.verify.place import Place, sound

SEED = 1
SETTLING, BLOCK = 40.0, 120.0  # collisions of a sphere, until the start is forgotten, and in a block

# Gases of equal spheres: pressure, rate, path and speeds of one run


@dataclass(frozen=True)
class Gas:
    """What the blocks of a run gave, with k T = 1: Z and rate and mean speed (n,), and speeds at the ends of the blocks."""

    dimensions: int
    packing: float
    count: int
    compressibility: np.ndarray
    rate: np.ndarray
    speed: np.ndarray
    speeds: np.ndarray


@cache
def _gas(dimensions: int, packing: float, count: int, place: Place, seed: int) -> Gas:
    page, density = equal_spheres(count, packing, dimensions, seed)
    time = 1.0 / _rate(virial_series(packing, dimensions)[0], dimensions, density, packing)

    def look(simulation):
        report, snapshot = simulation.contact_report, simulation.snapshot()
        return simulation.time, report.virial, report.pair_count, np.linalg.norm(snapshot.velocity, axis=1)

    with place.simulation(page) as simulation:
        simulation.run(duration=SETTLING * time)
        looks = in_blocks(simulation, BLOCK * time, look)
        sound(simulation)
        energy = temperature(simulation.snapshot().velocity, dimensions)
    times, virials, pairs, speeds = (np.array(each) for each in zip(*looks, strict=True))
    spans = np.diff(times)
    return Gas(
        dimensions,
        packing,
        count,
        1.0 + np.diff(virials) / (dimensions * count * energy * spans),
        2.0 * np.diff(pairs) / (count * spans * math.sqrt(energy)),
        speeds[1:].mean(axis=1) / math.sqrt(energy),
        speeds[1:] / math.sqrt(energy),
    )


def _rate(compressibility: float, dimensions: int, density: float, packing: float) -> float:
    """Enskog's rate of spheres of diameter 1 at k T = m = 1, with the contact value of Z = 1 + 2^(d−1) η g."""
    contact = (compressibility - 1.0) / (2.0 ** (dimensions - 1) * packing)
    return density * UNIT_SURFACE[dimensions] * contact / math.sqrt(math.pi)


def _series(dimensions: int, packing: float, count: int) -> tuple[float, float, str]:
    """Z of the virial series for so many spheres, its error, and the words."""
    value = of_finite(lambda eta: virial_series(eta, dimensions)[0], packing, count)
    error = virial_series(packing, dimensions)[1]
    return value, error + value / count**2, f"what the virial series leaves out, and Z/N² of N = {count}"


def _pressure(dimensions: int, packing: float, count: int, place: Place, seed: int) -> Measured:
    value, error, words = _series(dimensions, packing, count)
    return of_blocks(_gas(dimensions, packing, count, place, seed).compressibility, value, error, words)


def _carnahan_starling(packing: float, count: int, place: Place, seed: int) -> Measured:
    value = of_finite(hard_spheres_carnahan_starling, packing, count)
    error = abs(float(hard_spheres_carnahan_starling(packing) - hard_spheres_kolafa(packing))) + 5e-4 * value
    words = f"the distance of Kolafa's equation, with its own 0.05 %, and Z/N² of N = {count}"
    return of_blocks(_gas(3, packing, count, place, seed).compressibility, value, error + value / count**2, words)


def _collisions(dimensions: int, packing: float, count: int, place: Place, seed: int) -> Measured:
    gas = _gas(dimensions, packing, count, place, seed)
    value, error, words = _series(dimensions, packing, count)
    rate = _enskog(dimensions, packing, count, value)
    return of_blocks(gas.rate, rate, rate * error / (value - 1.0), f"{words}, for the contact value of the rate")


def _enskog(dimensions: int, packing: float, count: int, compressibility: float) -> float:
    """Of a finite number of spheres, whose energy is fixed."""
    density = equal_spheres(count, packing, dimensions, SEED)[1]
    return _rate(compressibility, dimensions, density, packing) * slowing(dimensions * (count - 1))


def _path(dimensions: int, packing: float, count: int, place: Place, seed: int) -> Measured:
    """Mean way of a sphere between two of its collisions, block by block."""
    gas = _gas(dimensions, packing, count, place, seed)
    value, error, words = _series(dimensions, packing, count)
    # Without a common motion a sphere has (N − 1)/N of the mean square; the mean of the root is that of a fixed energy.
    freedoms = dimensions * (count - 1)
    speed = mean_speed(1.0, 1.0, dimensions) * math.sqrt((count - 1.0) / count) * slowing(freedoms)
    path = speed / _enskog(dimensions, packing, count, value)
    return of_blocks(gas.speed / gas.rate, path, path * error / (value - 1.0), f"{words}, for the contact value of the rate")


def _maxwell(dimensions: int, packing: float, count: int, place: Place, seed: int) -> Distances:
    """Speeds at the ends of all blocks, 120 collisions of each sphere apart; the energy of a sphere is (N − 1)/N of d/2 k T."""
    gas = _gas(dimensions, packing, count, place, seed)
    speeds = gas.speeds.ravel() * math.sqrt(count / (count - 1.0))
    return Distances(kolmogorov_smirnov.distance(speed_cumulative(speeds, math.sqrt(2.0), dimensions)), len(speeds))


# Heavy spheres among light spheres

HEAVY, LIGHT, HEAVY_MASS, HEAVY_RADIUS, LIGHT_RADIUS, EDGE = 8, 300, 20.0, 1.0, 0.25, 10.0
SHORT = 0.2  # in which heavy spheres change their velocities by a small part, see `_brownian`
SHORTS = 200  # of them in a block, which is 8 times as long as velocities are remembered


@cache
def _mixture(place: Place, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Of each block the mean energy of a heavy sphere over k T and the mean square of its change of velocity; and k T."""
    box = box_of(EDGE, 3)
    quarter = EDGE / 4.0
    lattice = {"name": "heavy", "shape": [2, 2, 2], "lower": [quarter] * 3, "upper": [3 * quarter] * 3}
    particles: list[dict[str, Any]] = [
        {"lattice": {**lattice, "mass": HEAVY_MASS, "radius": HEAVY_RADIUS}},
        {"gas": {**box, "count": LIGHT, "radius": LIGHT_RADIUS, "mass": 1.0, "temperature": 1.0, "zero_momentum": True}},
    ]
    with place.simulation(scene(particles, EDGE, 3, seed)) as simulation:
        simulation.run(duration=5.0 / _friction(1.0))
        velocities = [simulation.snapshot().velocity[:HEAVY]]
        simulation.run(
            duration=BLOCKS * SHORTS * SHORT,
            every=SHORT,
            call=lambda run: velocities.append(run.snapshot().velocity[:HEAVY]),
        )
        sound(simulation)
        end = simulation.snapshot()
    thermal = float(end.mass @ np.sum(end.velocity**2, axis=1)) / (3.0 * (len(end.mass) - 1))
    seen = np.array(velocities)
    energies = 0.5 * HEAVY_MASS * np.mean(np.sum(seen[1:] ** 2, axis=2), axis=1)
    changes = np.mean(np.sum(np.diff(seen, axis=0) ** 2, axis=2), axis=1)
    return energies.reshape(BLOCKS, SHORTS).mean(axis=1) / thermal, changes.reshape(BLOCKS, SHORTS).mean(axis=1), thermal


def _friction(thermal: float) -> float:
    """ξ of a heavy sphere: (4/d) Γ μ / M, Γ by Enskog's theory of mixtures."""
    density = np.array([HEAVY, LIGHT]) / EDGE**3
    radius, mass = np.array([HEAVY_RADIUS, LIGHT_RADIUS]), np.array([HEAVY_MASS, 1.0])
    rate = float(enskog_rates_of_mixture(density, radius, mass, thermal, 3)[0, 1])
    return 4.0 / 3.0 * rate / (HEAVY_MASS + 1.0)


def _equipartition(place: Place, seed: int) -> Measured:
    total = HEAVY * HEAVY_MASS + LIGHT
    theory = 1.5 * (1.0 - HEAVY_MASS / total)
    words = "nothing: 3/2 k T (1 − m/Σm) is exact without a common motion"
    return of_blocks(_mixture(place, seed)[0], theory, 0.0, words)


def _brownian(place: Place, seed: int) -> Measured:
    """⟨ΔV²⟩ in a short time t, 2 d k T/M (1 − e^(−ξt)): its first order, 2 d k T ξ t / M, is exact with Enskog's rate."""
    changes, thermal = _mixture(place, seed)[1:]
    friction = _friction(thermal)
    theory = 6.0 * thermal / HEAVY_MASS * -math.expm1(-friction * SHORT)
    # Heavy spheres also meet each other, at a rate that the same theory has.
    density = np.array([HEAVY, LIGHT]) / EDGE**3
    radius, mass = np.array([HEAVY_RADIUS, LIGHT_RADIUS]), np.array([HEAVY_MASS, 1.0])
    each_other = 2.0 / 3.0 * float(enskog_rates_of_mixture(density, radius, mass, thermal, 3)[0, 0]) * (HEAVY - 1.0) / HEAVY
    theory += 6.0 * thermal / HEAVY_MASS * each_other * SHORT
    part = 0.5 * (friction + each_other) * SHORT + 1.0 / LIGHT
    words = f"ξt/2 = {0.5 * friction * SHORT:.2g} of it for memory, 1/N of N = {LIGHT} for the contact value"
    return of_blocks(changes, theory, theory * part, words)


# Cooling

RESTITUTION, COOLING_COUNT, COOLING_PACKING, COOLING_END = 0.9, 500, 0.02, 16.0


def _haff(place: Place, seed: int) -> Measured:
    """1/√T grows by 1/τ in a unit of time, T₀ = 1: its growth over τ⁻¹ in spans between times (1 + t/τ) of equal ratios."""
    e, count, packing = RESTITUTION, COOLING_COUNT, COOLING_PACKING
    page, density = equal_spheres(count, packing, 3, seed, restitution=e)
    value = of_finite(lambda eta: virial_series(eta, 3)[0], packing, count)
    rate = _rate(value, 3, density, packing)
    tau = 6.0 / ((1.0 - e**2) * rate)
    times = tau * (COOLING_END ** (np.arange(21) / 20.0) - 1.0)
    with place.simulation(page) as simulation:
        roots = []
        for time in times:
            simulation.run(until=float(time))
            roots.append(temperature(simulation.snapshot().velocity, 3) ** -0.5)
        sound(simulation)
    growth = tau * np.diff(roots) / np.diff(times)
    excess = 16.0 * (1.0 - e) * (1.0 - 2.0 * e**2) / (81.0 - 17.0 * e + 30.0 * e**2 * (1.0 - e))
    loss = 1.0 + 3.0 / 16.0 * excess
    systematic = abs(loss - 1.0) + (1.0 - e**2) * packing + 1.0 / count
    words = (
        f"3 a₂/16 of the distribution of speeds while it settles, (1 − e²) η = {(1.0 - e**2) * packing:.2g} for velocities "
        "that know of each other, 1/N"
    )
    return of_blocks(growth, loss, systematic, words)


# The rows

THIN, DENSE, DISKS = (3, 0.2, 256), (3, 0.4, 256), (2, 0.3, 256)
MEASURES: dict[str, Callable[[Place, int], Measured | Distances]] = {
    "carnahan_starling_20": partial(_carnahan_starling, 0.2, 256),
    "carnahan_starling_40": partial(_carnahan_starling, 0.4, 256),
    "virial_spheres": partial(_pressure, *THIN),
    "virial_disks": partial(_pressure, *DISKS),
    "enskog_spheres": partial(_collisions, *THIN),
    "enskog_disks": partial(_collisions, *DISKS),
    "mean_free_path": partial(_path, *THIN),
    "maxwell_spheres": partial(_maxwell, *THIN),
    "maxwell_disks": partial(_maxwell, *DISKS),
    "equipartition": _equipartition,
    "brownian": _brownian,
    "haff": _haff,
}
"""What each row measures on a place from a seed."""


def _case(name: str, title: str, source: str, *, quick: bool = False):
    return row(__name__, name, title, source, lambda place: MEASURES[name](place, SEED).found(), quick=quick, **FLYING)


CARNAHAN = "N. F. Carnahan and K. E. Starling, J. Chem. Phys. 51 (1969) 635"
CLISBY = "virial coefficients to the tenth: N. Clisby and B. M. McCoy, J. Stat. Phys. 122 (2006) 15"
ENSKOG = "S. Chapman and T. G. Cowling, The Mathematical Theory of Non-Uniform Gases, 3rd ed. (1970) ch. 16; " + CLISBY
MAXWELL = "J. C. Maxwell, Phil. Mag. 19 (1860) 19"
carnahan_starling_20 = _case("carnahan_starling_20", "Hard spheres at η = 0.2 have Carnahan and Starling's pressure", CARNAHAN)
carnahan_starling_40 = _case("carnahan_starling_40", "Hard spheres at η = 0.4 have Carnahan and Starling's pressure", CARNAHAN)
virial_spheres = _case("virial_spheres", "Hard spheres at η = 0.2 have the pressure of ten virial coefficients", CLISBY)
virial_disks = _case("virial_disks", "Hard disks at η = 0.3 have the pressure of ten virial coefficients", CLISBY, quick=True)
enskog_spheres = _case("enskog_spheres", "Hard spheres at η = 0.2 collide at Enskog's rate", ENSKOG)
enskog_disks = _case("enskog_disks", "Hard disks at η = 0.3 collide at Enskog's rate", ENSKOG, quick=True)
mean_free_path = _case("mean_free_path", "Hard spheres at η = 0.2 have the mean free path ⟨v⟩/Γ", ENSKOG)
maxwell_spheres = _case("maxwell_spheres", "Speeds of hard spheres have Maxwell's distribution", MAXWELL)
maxwell_disks = _case("maxwell_disks", "Speeds of hard disks have Maxwell's distribution in the plane", MAXWELL, quick=True)
equipartition = _case("equipartition", "Spheres of twenty times the mass come to the same energy as light spheres", MAXWELL)
brownian = _case(
    "brownian", "A heavy sphere in a gas is shaken with the strength of its friction",
    "L. S. Ornstein and G. E. Uhlenbeck, Phys. Rev. 36 (1930) 823; friction by Enskog's rate of mixtures",
)  # fmt: skip
haff = _case(
    "haff", "A gas of spheres of restitution 0.9 cools by Haff's law, before it clusters",
    "P. K. Haff, J. Fluid Mech. 134 (1983) 401; a₂ of T. P. C. van Noije and M. H. Ernst, Granular Matter 1 (1998) 57",
)  # fmt: skip
