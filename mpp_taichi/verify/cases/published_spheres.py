"""Published numbers of balls: collisions that count the digits of π, Newton's cradle, a ball on a ball."""

import math
from functools import partial

import numpy as np

from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._published import DOUBLE_ONLY, FLYING, against, row
from mpp_taichi.verify.place import Place, sound


def _galperin(power: int, digits: int, place: Place) -> Found:
    """A ball of 100^k times the mass of another drives it into a wall."""
    scene = {
        "dimensions": 2,
        "particles": [
            {"body": {"mass": 1.0, "radius": 0.1, "position": [1.0, 0.0]}},
            {"body": {"mass": 100.0**power, "radius": 0.1, "position": [2.0, 0.0], "velocity": [-1.0, 0.0]}},
        ],
        "contacts": {"hard_spheres": {"solver": "event_driven"}},
        "walls": [{"plane": {"point": [0, 0], "normal": [1, 0]}}],
        "run": {"duration": 100.0},
    }
    with place.simulation(scene) as simulation:
        simulation.run()
        report = simulation.contact_report
    return Found(abs(report.pair_count + report.wall_count - digits), 0.0, f"a count: ⌊π 10^{power}⌋ = {digits}")


def _galperin_case(power: int, digits: int, **more):
    title = f"A ball of {100**power:,} times the mass of another makes {digits:,} contacts with it and a wall, digits of π"
    source = "G. Galperin, Regul. Chaotic Dyn. 8 (2003) 375"
    return row(__name__, f"galperin_{digits}", title, source, partial(_galperin, power, digits), **more)


galperin_3 = _galperin_case(0, 3, **FLYING)
galperin_31 = _galperin_case(1, 31, **FLYING)
galperin_314 = _galperin_case(2, 314, quick=True)
galperin_3141 = _galperin_case(3, 3141)


@case(
    "Of five equal balls in a row the last alone leaves, with the speed of the ball that comes in",
    "F. Herrmann and P. Schmälzle, Am. J. Phys. 49 (1981) 761",
    on=DOUBLE_ONLY,
)
def newtons_cradle(place: Place) -> Found:
    """Balls that touch, by the solver that resolves all contacts of an instant at once."""
    r = 0.125
    scene = {
        "dimensions": 2,
        "particles": [
            {"body": {"mass": 1.0, "radius": r, "position": [-1.0 - 2 * r, 0.0], "velocity": [1.0, 0.0]}},
            {"lattice": {"name": "row", "shape": [4], "lower": [0, 0], "upper": [6 * r, 0], "mass": 1.0, "radius": r}},
        ],
        "contacts": {"hard_spheres": {"solver": "simultaneous"}},
        "integrator": {"leapfrog": {"dt": 0.0078125}},
    }
    with place.simulation(scene) as simulation:
        simulation.run(duration=1.5)
        sound(simulation)
        v = simulation.snapshot().velocity[:, 0]
    contacts = 4
    return Found(
        float(np.abs(v - [0, 0, 0, 0, 1]).max()),
        2.0 * contacts**2 * place.force_u,
        f"roundings, u = {place.force_u:.1g}, of {contacts} impulses by the others, and of places that touch, by 2",
    )


def _two_balls(ratio: float, printed: str, place: Place) -> Found:
    """A light ball a little above a heavy ball: height of its rebound over the height of the fall."""
    h, gap, g, r = 1.0, 2.0**-10, 1.0, 0.125
    rise = (3.0 * ratio - 1.0) / (ratio + 1.0)
    v = math.sqrt(2.0 * g * h)
    apart = gap / (2.0 * v)
    scene = {
        "dimensions": 2,
        "particles": [
            {"body": {"mass": ratio, "radius": r, "position": [0.0, h + r]}},
            {"body": {"mass": 1.0, "radius": r, "position": [0.0, h + 3 * r + gap]}},
        ],
        "forces": [{"uniform_gravity": {"acceleration": [0.0, -g]}}],
        "contacts": {"hard_spheres": {"solver": "event_driven"}},
        "walls": [{"plane": {"point": [0, 0], "normal": [0, 1]}}],
        "run": {"duration": v / g + apart + (rise * v - g * apart) / g},
    }
    with place.simulation(scene) as simulation:
        simulation.run()
        height = float(simulation.snapshot().position[1, 1]) - 3 * r
    left = (rise - 1.0) * gap / 2.0 / h
    why = f"the gap's (α − 1) gap/2h = {left:.6g} is added; 20 roundings u = {place.force_u:.1g} of the height"
    light = abs(rise**2 - float(printed))
    return against(height / h + left, printed, light + 20.0 * float(printed) * place.force_u, why)


MELLEN = "W. R. Mellen, Am. J. Phys. 36 (1968) 845: ((3M − m)/(M + m))²"
two_balls_3 = row(
    __name__, "two_balls_3", "A ball on a ball of three times its mass rebounds to four times its height", MELLEN,
    partial(_two_balls, 3.0, "4.00000000000000"), **FLYING,
)  # fmt: skip
two_balls_heavy = row(
    __name__, "two_balls_heavy", "A ball on a ball of a million times its mass rebounds to nine times its height", MELLEN,
    partial(_two_balls, 1e6, "9.0000"), on=DOUBLE_ONLY,
)  # fmt: skip
