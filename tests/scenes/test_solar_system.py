"""The scene solar_system against JPL's ephemeris DE421, which includes general relativity."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi import Simulation

SCENE = Path(__file__).parents[2] / "scenes" / "solar_system.yaml"
TABLE = Path(__file__).parents[1] / "reference" / "solar_system_de421.csv"  # by tools/make/ephemeris_states.py
SUN = 2.959122082855911e-4 / (299_792_458.0 * 86_400.0 / 149_597_870_699.6) ** 2  # G M/c² [AU]
PERIODS = {"mercury": 87.97, "venus": 224.70, "earth": 365.26, "mars": 686.98}


def de421():
    """By day: names, positions [AU] and velocities [AU/day], (11, 3) each."""
    found = {}
    with TABLE.open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            state = [float(row[key]) for key in ("x", "y", "z", "vx", "vy", "vz")]
            found.setdefault(float(row["days"]), {})[row["name"]] = state
    return {
        days: (tuple(states), np.array(list(states.values()))[:, :3], np.array(list(states.values()))[:, 3:])
        for days, states in found.items()
    }


@pytest.fixture(scope="module")
def off():
    """By day: what this program's places differ by from DE421's [AU], by name; and DE421's velocities."""
    found = {}
    with Simulation(SCENE, backend="cpu", precision="f64") as simulation:
        for days, (names, position, velocity) in de421().items():
            simulation.run(until=days)
            now = simulation.snapshot()
            assert now.name == names
            found[days] = (dict(zip(names, now.position - position)), dict(zip(names, velocity)))
    return found


def test_the_scene_begins_where_the_ephemeris_is(off):
    # Printed with 15 digits on both sides.
    assert max(np.abs(error).max() for error in off[0.0][0].values()) <= 1e-14 * 40


def test_thirty_days_later_all_are_where_the_ephemeris_has_them(off):
    # Einstein's terms put planets behind by 6 G M/c² a radian, see below; Mercury goes farthest, 2.14 radians.
    farthest = 6 * SUN * math.tau * 30 / PERIODS["mercury"]
    assert farthest < 1.3e-7, "20 km"
    errors = {name: np.linalg.norm(error) for name, error in off[30.0][0].items()}
    assert max(errors.values()) < farthest
    # Round-off alone would be 1e-14; the giants feel the asteroids and Einstein's terms least.
    assert max(errors[name] for name in ("jupiter", "saturn", "uranus", "neptune", "pluto")) < 1e-10


@pytest.mark.parametrize("name", ["venus", "earth"])
def test_after_a_year_newtons_planets_are_ahead_by_what_einstein_takes(off, name):
    """On a circle the first post-Newtonian terms weaken the pull by 3 ε, ε = G M/(c² r).

    From the same place and velocity Newton's orbit is then smaller by 3 ε, and its mean motion larger by (3/2 + 9/2) ε = 6 ε.
    Source: the one-body acceleration of Soffel et al., Astron. J. 126 (2003) 2687, in harmonic coordinates.
    """
    errors, velocities = off[365.0]
    error, heading = errors[name], velocities[name] / np.linalg.norm(velocities[name])
    ahead = 6 * SUN * math.tau * 365.0 / PERIODS[name]
    # The eccentricity, 0.017, begins at perihelion for the Earth and makes ± 6 e; the Moon and the other planets some per cent.
    assert error @ heading == pytest.approx(ahead, rel=0.2)
    assert np.linalg.norm(error - (error @ heading) * heading) < 0.2 * ahead


def test_the_moon_misses_no_more_than_the_flattening_of_the_earth(off):
    errors, _ = off[365.0]
    # 3/2 J₂ (R/r)² of the pull, three times that of the mean motion, for 84 radians at 0.00257 AU.
    flattening = 1.5 * 1.083e-3 * (6378.0 / 384_400.0) ** 2
    assert np.linalg.norm(errors["moon"] - errors["earth"]) < 3 * flattening * math.tau * 365 / 27.32 * 0.00257
