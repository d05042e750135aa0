"""The orientation of a body that turns about its axis. NumPy on the host."""

import math

import numpy as np

from mpp_taichi.scene.body_view_spec import SpinSpec
from mpp_taichi.views.camera import Camera


def orientation(spin: SpinSpec | None, time: float, camera: Camera) -> np.ndarray:
    """Directions of the prime meridian, of 90° east and of the north pole in camera coordinates, shape (3, 3).

    The prime meridian is turned by W = phase + 2π t / period from where the equator rises through the x–y plane, as the
    International Astronomical Union counts rotations  [Archinal et al. 2018, Celest. Mech. Dyn. Astron. 130, 22]. With a
    precession the axis, and with it this point, turns about the z axis by 2π t / precession.
    """
    axis = np.array(spin.axis if spin is not None else (0.0, 0.0, 1.0), dtype=float)
    axis /= np.linalg.norm(axis)
    if spin is not None and spin.precession is not None:
        turned = 2.0 * math.pi * math.fmod(time / spin.precession, 1.0)
        x, y, z = axis
        axis = np.array([math.cos(turned) * x - math.sin(turned) * y, math.sin(turned) * x + math.cos(turned) * y, z])
    node = np.array([-axis[1], axis[0], 0.0])
    length = float(np.linalg.norm(node))
    node = node / length if length > 1e-12 else np.array([1.0, 0.0, 0.0])
    angle = spin.phase + 2.0 * math.pi * math.fmod(time / spin.period, 1.0) if spin is not None else 0.0
    east = np.cross(axis, node)
    meridian = math.cos(angle) * node + math.sin(angle) * east
    frame = np.stack([meridian, np.cross(axis, meridian), axis])
    return np.asarray(frame @ np.stack([camera.right, camera.up, -camera.backward], axis=1))
