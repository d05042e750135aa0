"""States of the Sun, the planets and the Moon from JPL's ephemeris DE421, as bodies of a scene and as a reference table.

Wants the packages `jplephem` and `de421` from PyPI. Prints the `body:` lines of scenes/solar_system.yaml, for the epoch
J2000.0; with `--table F.csv` writes the states at the epoch and some days after it, for tests/scenes/test_solar_system.py.

Positions [AU] and velocities [AU/day] are barycentric, turned from the Earth's equator to the ecliptic, both of J2000.
Source: Folkner, Williams & Boggs, The Planetary and Lunar Ephemeris DE 421, IPN Progress Report 42-178 (2009).
"""

import argparse
import csv
import math
import sys
from pathlib import Path

import numpy as np

EPOCH = 2451545.0  # J2000.0, 1 January 2000, 12h TDB, as a Julian date
DAYS = (0.0, 30.0, 365.0)
OBLIQUITY = math.radians(84381.448 / 3600.0)  # of the ecliptic, IAU 1976
MASSES = {
    "mercury": "GM1",
    "venus": "GM2",
    "mars": "GM4",
    "jupiter": "GM5",
    "saturn": "GM6",
    "uranus": "GM7",
    "neptune": "GM8",
    "pluto": "GM9",
}
ORDER = ("sun", "mercury", "venus", "earth", "moon", "mars", "jupiter", "saturn", "uranus", "neptune", "pluto")


def states(ephemeris, date: float) -> dict[str, tuple[float, np.ndarray, np.ndarray]]:
    """Mass [Sun's], position [AU] and velocity [AU/day] of each body, (3,) each; `date` is Julian, TDB."""

    def read(name: str) -> np.ndarray:
        return np.stack([array.ravel() / ephemeris.AU for array in ephemeris.position_and_velocity(name, date)])

    both, lunar, ratio = read("earthmoon"), read("moon"), ephemeris.EMRAT  # the Moon's is geocentric
    found = {"sun": (1.0, read("sun"))}
    found["earth"] = (ephemeris.GMB / ephemeris.GMS * ratio / (1.0 + ratio), both - lunar / (1.0 + ratio))
    found["moon"] = (ephemeris.GMB / ephemeris.GMS / (1.0 + ratio), both + lunar * ratio / (1.0 + ratio))
    for name, key in MASSES.items():
        found[name] = (getattr(ephemeris, key) / ephemeris.GMS, read(name))
    c, s = math.cos(OBLIQUITY), math.sin(OBLIQUITY)
    to_ecliptic = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    return {name: (found[name][0], *(found[name][1] @ to_ecliptic.T)) for name in ORDER}


def main() -> int:
    """Print the bodies, write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--table", type=Path, help="write the states at the epoch and later into this .csv")
    options = parser.parse_args()
    import de421
    from jplephem import Ephemeris

    ephemeris = Ephemeris(de421)
    write = sys.stdout.write
    write(f"# k2: {float(ephemeris.GMS)!r}\n")
    for name, (mass, position, velocity) in states(ephemeris, EPOCH).items():
        x, v = (", ".join(f"{number:.15g}" for number in vector) for vector in (position, velocity))
        write(f"  - body:\n      {{name: {name}, mass: {mass:.15g},\n       position: [{x}],\n       velocity: [{v}]}}\n")
    if options.table:
        with options.table.open("w", newline="", encoding="utf-8") as stream:
            table = csv.writer(stream, lineterminator="\n")
            table.writerow(["days", "name", "x", "y", "z", "vx", "vy", "vz"])
            for days in DAYS:
                for name, (_, position, velocity) in states(ephemeris, EPOCH + days).items():
                    table.writerow([f"{days:g}", name, *(f"{number:.15g}" for number in (*position, *velocity))])
    return 0


if __name__ == "__main__":
    sys.exit(main())
