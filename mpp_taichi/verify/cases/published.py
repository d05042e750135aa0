"""Published numbers of springs, pendulums and rockets."""

import math
from functools import cache, partial
from typing import Any

import numpy as np

from mpp_taichi.verify.bounds import grown, rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._published import EVERYWHERE, PLAIN, against, row
from mpp_taichi.verify.place import Place, sound

EIGHTH_ORDER, STAGES = "kahan_li8", 17
STEPS = 200

# The pendulum


def _agm(a: float, b: float) -> float:
    """Arithmetic–geometric mean of Gauss."""
    while abs(a - b) > 1e-15 * a:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return 0.5 * (a + b)


def _quarter_swing(degrees: float, printed: str, place: Place) -> Found:
    """K(sin² θ/2) in units of √(l/g): the time of a fall from rest at θ to the bottom."""
    angle = math.radians(degrees)
    expected = 0.5 * math.pi / _agm(1.0, math.cos(0.5 * angle))
    x, y = math.sin(angle), -math.cos(angle)
    scene = {
        "dimensions": 2,
        "particles": [
            {"body": {"mass": 1.0, "position": [0.0, 0.0], "free": False}},
            {"body": {"mass": 1.0, "position": [x, y]}},
        ],
        "springs": [{"rod": {"between": [0, 1]}}],
        "forces": [{"uniform_gravity": {"acceleration": [0.0, -1.0]}}],
        "integrator": {EIGHTH_ORDER: {"dt": expected / STEPS}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(steps=STEPS)
        sound(simulation)
        at, time = simulation.snapshot().position[1], simulation.time
    speed = 2.0 * math.sin(0.5 * angle)
    left = math.atan2(at[0], -at[1]) / speed
    # The pull along the circle changes by 1/cos(θ/2) at most: an error of a place near the top grows by its square on the way.
    off, why = grown(place, steps=STEPS, stages=STAGES, growth=1.0 / math.cos(0.5 * angle) ** 2, span=expected)
    return against(time + left, printed, off / speed, why)


LEGENDRE = (
    "M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions (1964) table 17.2; by the arithmetic–geometric mean"
)
pendulum_90 = row(
    __name__, "pendulum_90", "A pendulum let go at 90° is at the bottom after K(sin 45°) = 1.854074677301372", LEGENDRE,
    partial(_quarter_swing, 90.0, "1.854074677301372"), quick=True, **PLAIN,
)  # fmt: skip
pendulum_150 = row(
    __name__, "pendulum_150", "A pendulum let go at 150° is at the bottom after K(sin 75°) = 2.768063145368768", LEGENDRE,
    partial(_quarter_swing, 150.0, "2.768063145368768"), **PLAIN,
)  # fmt: skip

# Springs: amplitudes of modes after a time


def _frequency(amplitude: float, time: float) -> float:
    """ω of a mode that was let go with an amplitude of 1, from its amplitude cos ω t at a time ω t < π."""
    return math.acos(amplitude) / time


def _mode_error(place: Place, phase: float, scale: float, time: float) -> tuple[float, str]:
    """Of the frequency, where places of size 1 move by `scale`: rounding over it and over the slope sin ω t."""
    off, why = grown(place, steps=STEPS, stages=STAGES, growth=1.0, span=phase)
    return off / scale / (time * math.sin(phase)), f"over an amplitude of {scale:g}, {why}"


@case(
    "The two stretching vibrations of carbon dioxide have the ratio √(1 + 2 m_O/m_C) = 1.914854 in the model of two springs",
    "H. Goldstein, Classical Mechanics, 2nd ed. (1980) §6-4; measured: 2349/1388 = 1.69, as bonds act on each other",
    quick=True,
    **EVERYWHERE,
)
def carbon_dioxide(place: Place) -> Found:
    """Both vibrations at once, along the line, where springs are linear."""
    oxygen, carbon, amplitude, time = 16.0, 12.0, 0.125, 4.0
    scene = {
        "dimensions": 2,
        "particles": [
            {"body": {"mass": mass, "position": [float(k), 0.0], "displacement": [shift, 0.0]}}
            for k, (mass, shift) in enumerate(zip((oxygen, carbon, oxygen), (-0.125, 0.125, 0.125), strict=True))
        ],
        "springs": [{"link": {"between": [k, k + 1], "stiffness": 1.0, "rest_length": 1.0}} for k in (0, 1)],
        "integrator": {EIGHTH_ORDER: {"dt": time / STEPS}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(steps=STEPS)
        sound(simulation)
        x, time = simulation.snapshot().position[:, 0] - [0.0, 1.0, 2.0], simulation.time
    both, middle = _frequency((x[2] - x[0]) / 0.25, time), _frequency((x[1] - 0.5 * (x[0] + x[2])) / amplitude, time)
    errors = [_mode_error(place, each * time, amplitude, time) for each in (both, middle)]
    return against(middle / both, "1.914854", errors[0][0] * middle / both**2 + errors[1][0] / both, errors[0][1])


SHEET = {(1, 1): "2.445342", (2, 1): "1.578143", (2, 2): "1.254114"}
"""Periods of the modes of 8 × 8 masses of 1 on springs of stiffness 50, stretched to 1.5 of their length, with a held rim."""
SHEET_AMPLITUDE, SHEET_TIME = 2.0**-14, 0.4


@cache
def _sheet(place: Place) -> dict[tuple[int, int], float]:
    """Periods of the modes, from their amplitudes after a time; all are let go at once."""
    shapes = " + ".join(f"sin({r} * pi * u) * sin({s} * pi * v)" for r, s in SHEET)
    scene: dict[str, Any] = {
        "particles": [
            {
                "lattice": {
                    "name": "sheet",
                    "shape": [8, 8],
                    "lower": [-1, -1, 0],
                    "upper": [1, 1, 0],
                    "mass": 1,
                    "fixed": "rim",
                    "displacement": [0, 0, f"{SHEET_AMPLITUDE!r} * ({shapes})"],
                }  # fmt: skip
            }
        ],
        "springs": [{"lattice_links": {"of": "sheet", "stiffness": 50, "prestretch": 1.5}}],
        "integrator": {EIGHTH_ORDER: {"dt": SHEET_TIME / STEPS}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(steps=STEPS)
        sound(simulation)
        start, end, time = simulation.start.position[:, 2], simulation.snapshot().position[:, 2], simulation.time
    across, found = np.arange(8) / 7.0, {}
    for r, s in SHEET:
        shape = np.outer(np.sin(s * np.pi * across), np.sin(r * np.pi * across)).ravel()
        found[r, s] = 2.0 * math.pi / _frequency(float(end @ shape / (start @ shape)), time)
    return found


def _sheet_mode(mode: tuple[int, int], place: Place) -> Found:
    period = float(SHEET[mode])
    phase = 2.0 * math.pi / period * SHEET_TIME
    error, why = _mode_error(place, phase, SHEET_AMPLITUDE, SHEET_TIME)
    # A slope of the sheet stretches a spring by half of its square, and with it the tension, which is a third of D d.
    slope = 3.0 * SHEET_AMPLITUDE * math.pi
    return against(
        _sheet(place)[mode],
        SHEET[mode],
        period**2 / (2.0 * math.pi) * error + period * 1.5 * slope**2,
        f"squares of slopes; {why}",
    )


RAYLEIGH = (
    "Lord Rayleigh, The Theory of Sound I (1877) §§ 120, 195, a net of masses: m d ω² = 4 T [sin²(rπ/14) + sin²(sπ/14)], the "
    "sheet of T. Müller, arXiv:1403.1695, appendix A, with a tension"
)


def _sheet_case(mode: tuple[int, int], **more):
    name, title = "sheet_{}_{}".format(*mode), "The mode ({}, {}) of a net of 8 × 8 masses has the period {}"
    return row(__name__, name, title.format(*mode, SHEET[mode]), RAYLEIGH, partial(_sheet_mode, mode), **more)


sheet_1_1 = _sheet_case((1, 1))
sheet_2_1 = _sheet_case((2, 1))
sheet_2_2 = _sheet_case((2, 2))


@case(
    "The fifth mode of twelve masses on a chain has the frequency 2 √(D/m) sin(5π/26) = 1.136129",
    "L. Brillouin, Wave Propagation in Periodic Structures (1946) §1, after Lagrange, Mécanique analytique (1788)",
    **EVERYWHERE,
)
def chain_mode(place: Place) -> Found:
    """Along the chain, whose ends are held; springs are linear along their line."""
    count, mode, amplitude, time = 12, 5, 0.125, 1.5
    shape = np.sin(mode * np.pi * np.arange(count + 2) / (count + 1))
    shape[[0, -1]] = 0.0
    scene = {
        "dimensions": 2,
        "particles": [
            {
                "body": {
                    "mass": 1.0,
                    "position": [float(k), 0.0],
                    "displacement": [amplitude * float(each), 0.0],
                    "free": 0 < k <= count,
                }  # fmt: skip
            }
            for k, each in enumerate(shape)
        ],
        "springs": [{"link": {"between": [k, k + 1], "stiffness": 1.0, "rest_length": 1.0}} for k in range(count + 1)],
        "integrator": {EIGHTH_ORDER: {"dt": time / STEPS}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(steps=STEPS)
        sound(simulation)
        x, time = simulation.snapshot().position[:, 0] - np.arange(count + 2), simulation.time
    found = _frequency(float(x @ shape / (shape @ shape)) / amplitude, time)
    error, why = _mode_error(place, found * time, amplitude, time)
    return against(found, "1.136129", count * error, f"places are up to {count}; {why}")


# A rocket


@case(
    "A rocket that loses 1/60 of its mass in a second at 2.1 km/s needs 274 times its empty mass to escape at 11.2 km/s",
    "H. Goldstein, Classical Mechanics, 2nd ed. (1980) chapter 1, exercise 13: “almost 300 times”, by ln R = (11.2 + 60 g)/2.1",
    **PLAIN,
)
def rocket(place: Place) -> Found:
    """The speed after the burn, u ln R − g t, in a constant gravity as in the exercise."""
    exhaust, g, mass = 2.1, 9.8e-3, 274.0  # in km and s
    burn = 60.0 * (1.0 - 1.0 / mass)
    thrust = {"exhaust_speed": exhaust, "flow": mass / 60.0, "direction": [0, 0, 1], "empty_mass": 0.5}
    # The mass falls to 1/274 of itself: the last steps are short beside the time in which it would be nothing.
    scene = {
        "particles": [{"body": {"mass": mass, "position": [0, 0, 0]}}],
        "forces": [{"thrust": thrust}, {"uniform_gravity": {"acceleration": [0, 0, -g]}}],
        "integrator": {"rk4": {"dt": burn / ROCKET_STEPS}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(steps=ROCKET_STEPS)
        speed = float(simulation.snapshot().velocity[0, 2])
    # Fourth order: h⁵ u (4!/(h₀ − t)⁵)/2880 summed over the steps is u (h/(60/R))⁴ 4!/2880/4 at the end of the burn.
    method = exhaust * (burn / ROCKET_STEPS * mass / 60.0) ** 4 * 24.0 / 2880.0 / 4.0
    bound, why = rounding(place, steps=ROCKET_STEPS, stages=4, phase=1.0)
    # The mass that is left is the difference of numbers that are 274 times as large.
    return against(
        speed, "11.2", method + 11.2 * bound + exhaust * mass * place.force_u * 4.0, f"{method:.1g} of the fourth order, {why}"
    )


ROCKET_STEPS = 4000
