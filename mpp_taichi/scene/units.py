"""Units of a scene: one length, one time and one mass, from which the constant of gravitation follows.

Masses are held as G·M, because astronomy measures this product: G·M of the Sun is known to ten digits, G to five. With
`units: {length: AU, time: day, mass: Msun}` the constant comes out as Gauss's k² = 0.01720209895² to 1e-9.

Sources: IAU 2012 resolution B2 (AU); GM of the Sun JPL DE405, of the Earth IERS 2010, of Jupiter without its moons JUP230, of
the Moon DE421; CODATA 2018 (G); nominal radii IAU 2015 B3; Julian year of 365.25 d; parsec 648000/π AU.
"""

import math

G_SI = 6.67430e-11  # m³ kg⁻¹ s⁻², CODATA 2018, relative uncertainty 2.2e-5
ASTRONOMICAL_UNIT = 149_597_870_700.0  # m
DAY = 86_400.0  # s
LIGHT_YEAR = 299_792_458.0 * 365.25 * DAY

LENGTHS = {  # metres
    "nm": 1e-9,
    "um": 1e-6,
    "mm": 1e-3,
    "cm": 1e-2,
    "m": 1.0,
    "km": 1e3,
    "Rearth": 6.3781e6,
    "Rsun": 6.957e8,
    "AU": ASTRONOMICAL_UNIT,
    "ly": LIGHT_YEAR,
    "pc": ASTRONOMICAL_UNIT * 648_000.0 / math.pi,
    "kpc": 1e3 * ASTRONOMICAL_UNIT * 648_000.0 / math.pi,
}
TIMES = {  # seconds
    "ns": 1e-9,
    "us": 1e-6,
    "ms": 1e-3,
    "s": 1.0,
    "min": 60.0,
    "hour": 3600.0,
    "day": DAY,
    "yr": 365.25 * DAY,
    "kyr": 365.25e3 * DAY,
    "Myr": 365.25e6 * DAY,
}
GRAVITATIONAL_PARAMETERS = {  # G·M in m³ s⁻²
    "g": 1e-3 * G_SI,
    "kg": G_SI,
    "t": 1e3 * G_SI,
    "Mmoon": 4.9028001e12,
    "Mearth": 3.986004418e14,
    "Mjup": 1.26686534e17,
    "Msun": 1.32712440018e20,
}


def gravitational_constant(length: str, time: str, mass: str) -> float:
    """G in the given units: length³ mass⁻¹ time⁻²."""
    return GRAVITATIONAL_PARAMETERS[mass] * TIMES[time] ** 2 / LENGTHS[length] ** 3
