"""Orbital elements: where a body is on a Kepler orbit, and how it moves, from the shape of the orbit and an angle."""

import math
from collections.abc import Callable

import numpy as np

from mpp_taichi.errors import PlacementError

FARTHEST = 1e100  # mean anomaly on a hyperbola, beyond which its sinh is no number


def on_orbit(
    attraction: float,
    semi_major_axis: float,
    eccentricity: float,
    inclination: float,
    ascending_node: float,
    argument_of_pericentre: float,
    true_anomaly: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Position [length] and velocity [length / time] relative to the primary, (3,) each; angles in radians.

    μ = `attraction` is G (m₁ + m₂), or G m₁ around a mass m₁ that is held, and p = a (1 − e²). Then
    r = p / (1 + e cos f), ṙ = √(μ/p) e sin f and r ḟ = √(μ/p) (1 + e cos f), turned by ω about z, then by the inclination
    about x, then by Ω about z. e < 1 and a > 0: an ellipse; e > 1 and a < 0: a hyperbola. PlacementError for others, and
    for an anomaly beyond a hyperbola's asymptotes.
    Source: Murray & Dermott, Solar System Dynamics (1999) §2.3 and §2.8.
    """
    if eccentricity == 1.0:
        raise PlacementError("eccentricity 1 is a parabola, which has no semi_major_axis; take one a little beside it")
    if (eccentricity < 1.0) != (semi_major_axis > 0.0):
        shape, sign = ("an ellipse", "above") if eccentricity < 1.0 else ("a hyperbola", "below")
        raise PlacementError(
            f"eccentricity {eccentricity:g} is {shape}, whose semi_major_axis is {sign} 0, not {semi_major_axis:g}"
        )
    parameter = semi_major_axis * (1.0 - eccentricity**2)
    opened = 1.0 + eccentricity * math.cos(true_anomaly)
    if not opened > 0.0:
        limit = math.acos(-1.0 / eccentricity)
        raise PlacementError(f"true_anomaly {true_anomaly:g} lies beyond the asymptotes of the hyperbola, ±{limit:g}")
    distance, speed = parameter / opened, math.sqrt(attraction / parameter)
    c, s = math.cos(argument_of_pericentre), math.sin(argument_of_pericentre)
    pericentre, along = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
    turn = _about_z(ascending_node) @ _about_x(inclination)
    position = distance * (math.cos(true_anomaly) * pericentre + math.sin(true_anomaly) * along)
    velocity = speed * (-math.sin(true_anomaly) * pericentre + (eccentricity + math.cos(true_anomaly)) * along)
    return turn @ position, turn @ velocity


def true_anomaly_at(mean_anomaly: float, eccentricity: float) -> float:
    """True anomaly f of a mean anomaly M, both in radians: E − e sin E = M, or e sinh H − H = M beyond e = 1.

    Newton's method inside a bracket that each step makes smaller, to round-off. tan f/2 = √((1+e)/|1−e|) tan E/2, or tanh H/2.
    """
    e = eccentricity
    if e < 1.0:
        mean = math.remainder(mean_anomaly, math.tau)
        low, high = mean - e, mean + e
        eccentric = _root(lambda x: (x - e * math.sin(x) - mean, 1.0 - e * math.cos(x)), low, high)
        half = math.tan(0.5 * eccentric) if abs(eccentric) < math.pi else math.inf
    else:
        if abs(mean_anomaly) > FARTHEST:
            raise PlacementError(f"mean_anomaly {mean_anomaly:g} is farther out than {FARTHEST:g}")
        reach = 1.0
        while e * math.sinh(reach) - reach < abs(mean_anomaly):
            reach *= 2.0
        half = math.tanh(0.5 * _root(lambda x: (e * math.sinh(x) - x - mean_anomaly, e * math.cosh(x) - 1.0), -reach, reach))
    return 2.0 * math.atan(math.sqrt((1.0 + e) / abs(1.0 - e)) * half)


def _root(function: Callable[[float], tuple[float, float]], low: float, high: float) -> float:
    """Root of a growing function (value, slope) between two places."""
    x = 0.5 * (low + high)
    for _ in range(200):  # halvings without Newton steps would take 64
        value, slope = function(x)
        low, high = (low, x) if value > 0.0 else (x, high)
        step = x - value / slope if slope > 0.0 else math.nan
        following = step if low < step < high else 0.5 * (low + high)
        if following == x:
            break
        x = following
    return x


def _about_z(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _about_x(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
