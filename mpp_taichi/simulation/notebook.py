"""Notebook: the picture of the particles and the line of numbers that Jupyter shows of a simulation or a result.

Jupyter calls `_repr_html_` or `_repr_png_` of an object; nothing here is imported before. The simulation is `Any`, as its
class imports this module.
"""

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np
from PIL import Image

from mpp_taichi.scene.human_units import TimeScale
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame
from mpp_taichi.views.motion_places import chooses_its_place, places_of
from mpp_taichi.views.wall_outline import outline_of

SIZE = (960, 540)  # pixels
Paths = Mapping[str, Any]


def picture(
    simulation: Any, size: tuple[int, int] = SIZE, *, earlier: Sequence[Snapshot] = (), paths: Sequence[Paths] = ()
) -> np.ndarray:
    """The particles now, by the kernel renderer: uint8, shape (height, width, 3).

    Trails lead through the `earlier` moments. `paths` are the samples before the last of these moments, and before the
    present, as fields of `Frame`.
    """
    from mpp_taichi.views.renderer import Renderer  # the first import of Taichi, where nothing runs yet

    spec = simulation.scene
    walls = outline_of(spec, simulation.start.position)
    view = Renderer(spec.view, size, dimensions=spec.dimensions)
    more: dict[str, Any] = {"walls": walls, "collides": bool(spec.contacts)}
    known: list[Paths] = [{}] * (len(earlier) + 1 - len(paths)) + list(paths[-len(earlier) - 1 :])
    for snapshot, path in zip(earlier, known[:-1], strict=True):
        view.lead_trails_through(replace(Frame.of(snapshot, **more), **path))
    acceleration = simulation.accelerations() if spec.view.wants_acceleration else None
    now = simulation.snapshot()
    clock = TimeScale.of(spec.units, now.time).text(now.time)
    words: dict[str, Any] = {"title": spec.title, "clock": clock, "units": spec.units}
    motion = None
    if earlier and chooses_its_place(spec):
        alike = [each for each in (*earlier, now) if len(each.position) == len(now.position)]
        motion = np.concatenate([places_of(each, spec) for each in alike])
    return view.draw(replace(Frame.of(now, **words, **more, acceleration=acceleration), motion=motion, **known[-1]))


def png(simulation: Any, *, earlier: Sequence[Snapshot] = (), paths: Sequence[Paths] = ()) -> bytes | None:
    """The picture as a PNG; None where the simulation has ended and its state is lost."""
    if not simulation.is_alive:
        return None
    stream = io.BytesIO()
    Image.fromarray(picture(simulation, earlier=earlier, paths=paths)).save(stream, format="PNG", optimize=True)
    return stream.getvalue()


def html(simulation: Any) -> str:
    """The picture, and below it the line and the energy."""
    energy = f"; energy {simulation.diagnostics()['total_energy']:.9g}" if simulation.is_alive else ""
    return figure(png(simulation), escape(line(simulation) + energy))


def figure(png: bytes | None, caption: str) -> str:
    """A picture and its caption, as HTML."""
    return f"<figure>{image(png)}<figcaption>{caption}</figcaption></figure>"


def image(png: bytes | None) -> str:
    """A picture as HTML; empty without a picture."""
    if not png:
        return ""
    encoded = base64.b64encode(png).decode("ascii")
    return f'<img src="data:image/png;base64,{encoded}" width="{SIZE[0] * 2 // 3}" alt="the particles now">'


def line(simulation: Any) -> str:
    """Title, time, steps, particles and method; nothing is computed or copied from the device for it."""
    spec, device = simulation.spec, simulation.device
    springs = f", {len(simulation.start.springs):,} springs" if len(simulation.start.springs) else ""
    springs += f", {len(simulation.start.rods):,} rods" if len(simulation.start.rods) else ""
    return (
        f"{spec.title or spec.source}: t = {simulation.time:.6g}, {simulation.step_count:,} steps; "
        f"{simulation.start.particle_count:,} particles{springs}; {spec.integrator.name}, dt {simulation.dt:.6g}, "
        f"{device.precision} on {device.backend}" + ("" if simulation.is_alive else "; ended")
    )
