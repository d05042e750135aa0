"""Appearance: a frame prepared as the scene's `view:` asks: places, sizes and colours, and additional lines.

All renderers draw the prepared frame, so that they agree. This module uses no device.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpp_taichi.scene.body_view_spec import BodyViewSpec
from mpp_taichi.scene.view_spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.coloring import ColorBar, Coloring, GroupKey
from mpp_taichi.views.marks import Label, Marks, Segments


@dataclass(frozen=True, eq=False)
class Legend:
    """The legend: the meaning of the colours, and further lines of text."""

    entries: tuple[ColorBar | GroupKey, ...]
    lines: tuple[str, ...]


class DrawnPlaces:
    """The places at which bodies with a `distance_scale` are drawn; false where there is no such body."""

    def __init__(self, bodies: dict[tuple[int, int], BodyViewSpec]) -> None:
        """Find the bodies that are drawn farther from another body than they are."""
        self._moved = _primaries_first(bodies)

    def __bool__(self) -> bool:
        """Whether a body is drawn in another place."""
        return bool(self._moved)

    def of(self, vectors: np.ndarray) -> np.ndarray:
        """Positions (count, 3) as they are drawn, and velocities likewise."""
        drawn = np.array(vectors, dtype=float)
        for (first, group), body in self._moved:
            if body.around is None or body.around >= len(drawn):
                continue
            way = vectors[first : first + group] - vectors[body.around]
            drawn[first : first + group] = drawn[body.around] + body.distance_scale * way
        return drawn


class Appearance:
    """Prepares the frames of one view; ranges of colours and lengths of arrows are remembered from frame to frame."""

    def __init__(self, spec: ViewSpec, dimensions: int = 3) -> None:
        """No frame has been prepared yet."""
        self.spec = spec
        self._coloring = Coloring(spec.color_by, spec.spring_color_by)
        self._marks = Marks(spec, dimensions)
        self._drawn_places = DrawnPlaces(spec.bodies)

    def dress(self, frame: Frame) -> Frame:
        """The frame with display-only places, radii and colours; the frame itself where the scene asks for none."""
        changed: dict[str, Any] = {}
        if (colors := self._coloring.particle_colors(frame)) is not None:
            changed["color"] = colors
        if (colors := self._coloring.spring_colors(frame)) is not None:
            changed["spring_color"] = colors
        scaled = [(key, body) for key, body in self.spec.bodies.items() if body.radius_scale != 1.0]
        if scaled:
            radius = np.array(frame.radius, dtype=float)
            for (first, group), body in scaled:
                radius[first : first + group] *= body.radius_scale
            changed["radius"] = radius
        if self._drawn_places:
            changed["position"] = self._drawn_places.of(frame.position)
        return replace(frame, **changed) if changed else frame

    def with_drawn_velocity(self, frame: Frame) -> Frame:
        """A prepared frame with the velocities of the places drawn, for trails; samples between frames are of these already."""
        if frame.velocity is None or not self._drawn_places:
            return frame
        return replace(frame, velocity=self._drawn_places.of(frame.velocity))

    def segments(self, frame: Frame, camera: Camera) -> Segments:
        """The additional lines of a prepared frame: arrows, axes, grid."""
        return self._marks.segments(frame, camera)

    def labels(self) -> list[Label]:
        """Texts in the scene that belong to the last segments."""
        return self._marks.labels

    def legend(self) -> Legend:
        """The legend beside the picture; empty where the scene asks for no legend."""
        if not self.spec.legend:
            return Legend((), ())
        key = self._marks.arrow_key()
        return Legend((*self._coloring.legend(), *([key] if key is not None else [])), tuple(self._marks.lines()))


def _primaries_first(bodies: dict[tuple[int, int], BodyViewSpec]) -> list[tuple[tuple[int, int], BodyViewSpec]]:
    """The entries with distances scaled for display, centres before the entries around them; there is no circle among them."""
    left = {key: body for key, body in bodies.items() if body.around is not None}
    ordered: list[tuple[tuple[int, int], BodyViewSpec]] = []
    while left:
        waiting = [range(first, first + count) for first, count in left]
        ready = [key for key, body in left.items() if not any(body.around in indices for indices in waiting)]
        ordered += [(key, left.pop(key)) for key in ready]
        if not ready:
            break
    return ordered
