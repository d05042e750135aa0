"""Two bodies under Newtonian gravity with G = 1: the scene, and its motion by Kepler's equation."""

import math
from typing import Any

import numpy as np


def orbit(
    eccentricity: float, integrator: dict[str, Any], *, ratio: float = 1e-3, from_apocentre: bool = False
) -> dict[str, Any]:
    """A body of mass 1 and a body of mass `ratio`, semi-major axis 1, at pericentre or apocentre; period 2π/√(1 + ratio)."""
    end = -1.0 if from_apocentre else 1.0
    distance = 1.0 - end * eccentricity
    speed = math.sqrt((1.0 + ratio) * (2.0 / distance - 1.0))
    shares = -ratio / (1.0 + ratio), 1.0 / (1.0 + ratio)  # of the distance from the centre of mass
    bodies = [
        {"mass": mass, "position": [end * share * distance, 0.0, 0.0], "velocity": [0.0, end * share * speed, 0.0]}
        for mass, share in zip((1.0, ratio), shares)
    ]
    return {
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": integrator,
    }


def period(ratio: float = 1e-3) -> float:
    """Of a revolution [time]."""
    return 2.0 * math.pi / math.sqrt(1.0 + ratio)


def separation(eccentricity: float, phase: float) -> np.ndarray:
    """Place of the second body as seen from the first, (3,), so many radians of mean anomaly after pericentre."""
    anomaly = math.pi if eccentricity > 0.8 else phase
    for _ in range(200):
        anomaly -= (anomaly - eccentricity * math.sin(anomaly) - phase) / (1.0 - eccentricity * math.cos(anomaly))
    y = math.sqrt(1.0 - eccentricity**2) * math.sin(anomaly)
    return np.array([math.cos(anomaly) - eccentricity, y, 0.0])
