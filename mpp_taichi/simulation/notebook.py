"""Notebook: the picture of the particles and the line of numbers that Jupyter shows of a simulation or a result.

Jupyter calls `_repr_html_` or `_repr_png_` of an object; nothing here is imported before. The simulation is `Any`, as its
class imports this module.
"""

import base64
import io
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from PIL import Image

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame
from mpp_taichi.views.wall_outline import outline_of

SIZE = (960, 540)  # pixels


def picture(simulation: Any, size: tuple[int, int] = SIZE, *, earlier: Sequence[Snapshot] = ()) -> np.ndarray:
    """The particles now, by the kernel renderer: uint8, shape (height, width, 3); trails lead through the `earlier` moments."""
    from mpp_taichi.views.renderer import Renderer  # the first import of Taichi, where nothing runs yet

    spec = simulation.scene
    walls = outline_of(spec, simulation.start.position)
    view = Renderer(spec.view, size, dimensions=spec.dimensions)
    for snapshot in earlier:
        view.trails.add(Frame.of(snapshot, walls=walls))
    acceleration = simulation.accelerations() if spec.view.wants_acceleration else None
    return view.draw(Frame.of(simulation.snapshot(), title=spec.title, walls=walls, acceleration=acceleration))


def png(simulation: Any, *, earlier: Sequence[Snapshot] = ()) -> bytes | None:
    """The picture as a PNG; None where the simulation has ended and its state is lost."""
    if not simulation.is_alive:
        return None
    stream = io.BytesIO()
    Image.fromarray(picture(simulation, earlier=earlier)).save(stream, format="PNG", optimize=True)
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
    return (
        f"{spec.title or spec.source}: t = {simulation.time:.6g}, {simulation.step_count:,} steps; "
        f"{simulation.start.particle_count:,} particles{springs}; {spec.integrator.name}, dt {simulation.dt:.6g}, "
        f"{device.precision} on {device.backend}" + ("" if simulation.is_alive else "; ended")
    )
