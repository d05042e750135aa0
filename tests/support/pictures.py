"""Frames for the tests of the views."""

from dataclasses import replace

import numpy as np

from mpp_taichi.scene.spec import CameraSpec, ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.offscreen import open_offscreen

SIZE = (320, 180)
BLACK = (0.0, 0.0, 0.0)

SCENE_WITH_VIEW = """particles:
  - body: {name: sun, mass: 1, position: [0, 0, 0]}
  - body: {name: moon, mass: 1, position: [1, 0, 0]}
forces: []
integrator: {leapfrog: {dt: 0.1}}
run: {duration: 1}
view:
  VIEW
"""
"""A scene of two bodies whose view is put in place of VIEW."""

FRONT = CameraSpec(position=(0.0, 0.0, 10.0), look_at=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))


def frame_of(position: object, radius: object, color: object = (1.0, 1.0, 1.0), **others: object) -> Frame:
    """A frame from nested lists; one colour may do for all."""
    places = np.array(position, dtype=float).reshape(-1, 3)
    colors = np.broadcast_to(np.array(color, dtype=float), places.shape)
    return Frame(position=places, radius=np.broadcast_to(np.array(radius, dtype=float), len(places)), color=colors, **others)


def crowd(count: int = 400, seed: int = 3) -> Frame:
    """Spheres of all sizes and springs among them, before, around and behind the camera of `FRONT`."""
    random = np.random.default_rng(seed)
    position = random.normal(size=(count, 3)) * (3.0, 2.0, 5.0)
    return Frame(
        position=position,
        radius=random.uniform(0.01, 0.4, count),
        color=random.uniform(0.1, 1.0, (count, 3)),
        between=random.integers(0, count, (count // 2, 2)),
        spring_color=random.uniform(0.1, 1.0, (count // 2, 3)),
        title="crowd",
    )


def view_spec(camera: CameraSpec = FRONT, **others: object) -> ViewSpec:
    """A black, bare picture."""
    return replace(ViewSpec(camera=camera, background=BLACK, caption=False, minimum_pixels=0.01), **others)


def draw(frame: Frame, spec: ViewSpec | None = None, size: tuple[int, int] = SIZE, renderer: str = "own") -> np.ndarray:
    """One picture."""
    view = open_offscreen(spec or view_spec(), size, renderer=renderer)
    try:
        return view.draw(frame)
    finally:
        view.close()
