"""Orbital elements: the Kepler orbit on which a body is at one moment, from its position and velocity. Host only, float64."""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.snapshot import Snapshot

NO_DIRECTION = 1e-10
"""Eccentricity, and sine of the inclination, below which rounding alone would give the pericentre, or the node, a direction."""


@dataclass(frozen=True)
class Orbit:
    """The elements of an osculating Kepler orbit: the orbit on which two bodies would go on if there were no others.

    semi_major_axis         a [length]: below 0 for a hyperbola, infinite for a parabola
    eccentricity            e
    inclination             i to the x–y plane, 0…π [radians]
    ascending_node          longitude Ω of the ascending node, −π…π; 0 where the orbit lies in the x–y plane
    argument_of_pericentre  ω, the angle from the node to the pericentre, −π…π; 0 for a circle
    true_anomaly            f, the angle from the pericentre to the body, −π…π
    mean_anomaly            M, −π…π for an ellipse; NaN for a parabola
    period                  2π √(a³/μ) [time]; infinite for a hyperbola and a parabola
    """

    semi_major_axis: float
    eccentricity: float
    inclination: float
    ascending_node: float
    argument_of_pericentre: float
    true_anomaly: float
    mean_anomaly: float
    period: float


def attraction(strength: float, first: tuple[float, float], second: tuple[float, float]) -> float:
    """μ = G (m₁ s₂ + m₂ s₁) of a relative motion, from the mass m and the movable share s of both [length³ / time²].

    s is 1 for what is free, so that μ is G (m₁ + m₂), and 0 for what is held along every axis, which attracts and is not
    accelerated itself.
    """
    return strength * (first[0] * second[1] + second[0] * first[1])


def attraction_between(strength: float, snapshot: Snapshot, first: np.ndarray, second: np.ndarray) -> float:
    """μ of two groups of particles, given by their indices; the share of a group that can move is a share of its mass."""
    return attraction(strength, *((float(snapshot.mass[group].sum()), _movable(snapshot, group)) for group in (first, second)))


def _movable(snapshot: Snapshot, group: np.ndarray) -> float:
    mass, moves = snapshot.mass[group], snapshot.free[group].any(axis=1)
    return float(mass @ moves / mass.sum()) if mass.sum() > 0.0 else float(moves.mean())


def orbit_of(separation: np.ndarray, motion: np.ndarray, attraction: float) -> Orbit:
    """The orbit of a relative position and velocity, (3,) each, with μ = `attraction` above 0.

    h = r × v, e = v × h/μ − r/r, 1/a = 2/r − v²/μ. Angles are found from two components each, so that they are right
    to round-off everywhere. ValueError where the two bodies are at one place or move along one line, where no plane exists.
    Source: Murray & Dermott, Solar System Dynamics (1999) §2.8; the conventions of REBOUND for circles and for orbits in
    the x–y plane.
    """
    distance = float(np.linalg.norm(separation))
    turning = np.cross(separation, motion)
    size = float(np.linalg.norm(turning))
    if not size > 0.0:
        raise ValueError("the two move along one line, or are at one place, so that there is no orbit")
    normal = turning / size
    inverse_axis = 2.0 / distance - float(motion @ motion) / attraction
    axis = 1.0 / inverse_axis if inverse_axis else math.inf
    towards = np.cross(motion, turning) / attraction - separation / distance  # the pericentre, with the length e
    eccentricity = float(np.linalg.norm(towards))
    across = math.hypot(normal[0], normal[1])  # the sine of the inclination
    in_plane = across < NO_DIRECTION
    node = np.array([1.0, 0.0, 0.0]) if in_plane else np.array([-normal[1], normal[0], 0.0]) / across
    beside = np.cross(normal, node)
    pericentre = math.atan2(towards @ beside, towards @ node) if eccentricity > NO_DIRECTION else 0.0
    anomaly = math.remainder(math.atan2(separation @ beside, separation @ node) - pericentre, math.tau)
    return Orbit(
        semi_major_axis=axis,
        eccentricity=eccentricity,
        inclination=math.atan2(across, normal[2]),
        ascending_node=0.0 if in_plane else math.atan2(node[1], node[0]),
        argument_of_pericentre=pericentre,
        true_anomaly=anomaly,
        mean_anomaly=mean_anomaly_at(anomaly, eccentricity),
        period=math.tau * math.sqrt(axis**3 / attraction) if math.isfinite(axis) and axis > 0.0 else math.inf,
    )


def mean_anomaly_at(true_anomaly: float, eccentricity: float) -> float:
    """M = E − e sin E with tan E/2 = √((1−e)/(1+e)) tan f/2, or e sinh H − H with tanh H/2; NaN for a parabola.

    Infinite where rounding leaves the body beyond the asymptotes of a hyperbola.
    """
    e = eccentricity
    if e == 1.0:
        return math.nan
    half, root = math.tan(0.5 * true_anomaly), math.sqrt(abs(1.0 - e) / (1.0 + e))
    if e < 1.0:
        eccentric = 2.0 * math.atan(root * half)
        return eccentric - e * math.sin(eccentric)
    if abs(root * half) >= 1.0:
        return math.copysign(math.inf, half)
    hyperbolic = 2.0 * math.atanh(root * half)
    return e * math.sinh(hyperbolic) - hyperbolic
