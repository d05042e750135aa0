"""The camera as an aircraft: it goes and turns about its own place, while arrows are held together with Alt, Ctrl or Shift.

A roll turns the axis of the turntable, `up:` in the camera of a scene, so that every place and every turn can be printed by K
and written into a scene.
"""

import math

import numpy as np

from mpp_taichi.views.camera import POLE, Camera

ARROWS = ("Up", "Down", "Left", "Right")
MODIFIERS = ("Alt", "Control", "Shift")
GOING = 0.5  # heights of the picture, or distances to the target, in a second
TURNING = math.radians(45.0)  # in a second
LONGEST = 0.1  # seconds of a picture, of one that took longer: a camera does not leap while a step is compiled


def is_flight(key: str, modifiers: set[str]) -> bool:
    """Whether a key moves the camera with these modifiers; Shift with the left or right arrow is 50 steps of the run."""
    return key in ARROWS and bool({"Alt", "Control"} & modifiers or ("Shift" in modifiers and key in ("Up", "Down")))


def fly(camera: Camera, held: set[str], seconds: float) -> None:
    """Move by the arrows and modifiers that are held, for a time."""
    arrows = {key for key in ARROWS if key in held and is_flight(key, held)}
    right, up = ("Right" in arrows) - ("Left" in arrows), ("Up" in arrows) - ("Down" in arrows)
    seconds = min(seconds, LONGEST)
    way, angle = GOING * seconds, TURNING * seconds
    if "Control" in held and "Shift" in held:
        roll(camera, right * angle)
    elif "Control" in held:
        yaw(camera, right * angle)
        pitch(camera, up * angle)
    elif "Alt" in held:
        go(camera, right=right * way, forward=up * way)
    elif "Shift" in held:
        go(camera, up=up * way)


def go(camera: Camera, *, right: float = 0.0, up: float = 0.0, forward: float = 0.0) -> None:
    """Go aside and up by shares of the picture's height, and forward by shares of the distance to the target.

    Without perspective, where the distance cannot be seen, forward makes the picture larger.
    """
    if camera.orthographic:
        camera.zoom(math.exp(forward))
    else:
        camera.target = camera.target - forward * camera.distance * camera.backward
    camera.pan(-right, -up)


def yaw(camera: Camera, angle: float) -> None:
    """Turn to the right about the axis of the turntable, which keeps the horizon level [radians]."""
    _look(camera, turned(camera.backward, camera.axis, -angle))


def pitch(camera: Camera, angle: float) -> None:
    """Turn up [radians]. Beyond the pole the axis is the direction that is up there, so that a loop can be flown."""
    backward = turned(camera.backward, camera.right, angle)
    if abs(camera.axis @ backward) > math.sin(POLE):
        camera.axis = camera.up
    _look(camera, backward)


def roll(camera: Camera, angle: float) -> None:
    """Turn clockwise about the line of sight, as an aircraft does: the picture turns the other way [radians]."""
    camera.axis = turned(camera.axis, camera.backward, -angle)


def turn_to(camera: Camera, right: float, up: float, particle: np.ndarray | None = None) -> None:
    """Bring a point into the middle of the picture; the camera stays where it is.

    The point is the place of a particle, or is at the target's depth, so many heights of the picture from the middle. Without
    perspective the camera goes aside instead: it would lose sight of the scene if it turned.
    """
    aside = camera.visible_height * (right * camera.right + up * camera.up)
    point = camera.target + aside if particle is None else np.array(particle, dtype=float)
    if camera.orthographic:
        camera.target = point if particle is None else camera.target + _across(camera, point - camera.target)
        return
    position = camera.position
    offset = position - point
    distance = float(np.linalg.norm(offset))
    if distance > 0.0:
        camera.distance = distance
        camera.turn_to(offset, camera.axis)
        camera.target = position - distance * camera.backward


def turned(vector: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """A vector turned about a unit vector, counterclockwise for a viewer at whom the axis points [radians]."""
    along = axis * (axis @ vector)
    return np.asarray(along + math.cos(angle) * (vector - along) + math.sin(angle) * np.cross(axis, vector))


def _look(camera: Camera, backward: np.ndarray) -> None:
    """Look in another direction from the same place."""
    position = camera.position
    camera.backward = backward / np.linalg.norm(backward)
    camera.target = position - camera.distance * camera.backward


def _across(camera: Camera, offset: np.ndarray) -> np.ndarray:
    """The part of an offset that lies in the picture."""
    return np.asarray(offset - camera.backward * (camera.backward @ offset))
