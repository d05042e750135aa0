"""The moments of a result as the page that plays a run in a browser, and this page within a notebook's cell."""

import tempfile
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from mpp_taichi.recorders.html import MOST_ENTRIES, HtmlRecorder
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame
from mpp_taichi.views.wall_outline import outline_of

SIZE = (960, 540)  # pixels, as the picture of a result
MOST_BYTES = 2_000_000  # of a page within a cell, which the file of the notebook keeps
FEWEST_FRAMES = 20  # below so many a page in a cell shows no motion, and the picture is shown alone
FASTEST = 60.0  # frames a second


def page(simulation: Any, moments: Sequence[Snapshot], rows: Sequence[dict[str, Any]], size: tuple[int, int]) -> str:
    """The page as text; it plays as long as a film of the scene. Arrows of accelerations are not drawn.

    Raises:
        CapacityError: so many particles in so many moments are more than a page can hold.
    """
    spec = simulation.scene
    walls = outline_of(spec, simulation.start.position)
    fps = min(FASTEST, max(1.0, len(moments) / spec.record.seconds))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.html"
        with HtmlRecorder(path, size, fps) as recorder:
            recorder.begin(spec, simulation.start.name, rows, len(moments))
            for moment in moments:
                recorder.add(Frame.of(moment, title=spec.title, walls=walls))
        return path.read_text(encoding="utf-8")


def frame(simulation: Any, moments: Sequence[Snapshot], rows: Sequence[dict[str, Any]]) -> str:
    """The page in an `iframe` that needs no server, of a long run every second moment, every fourth, …; empty if too large.

    The frame may run the scripts of the page, and cannot reach the notebook around it.
    """
    every = 1
    while len(moments[::every]) * simulation.start.particle_count > MOST_ENTRIES:
        every *= 2
    while len(moments[::every]) >= FEWEST_FRAMES:
        made = page(simulation, moments[::every], rows, SIZE)
        if len(made) <= MOST_BYTES:
            style = f"width: 100%; max-width: {SIZE[0]}px; height: {SIZE[1]}px; border: 0"
            return f'<iframe srcdoc="{escape(made)}" sandbox="allow-scripts" loading="lazy" style="{style}"></iframe>'
        every *= 2 if len(made) < 4 * MOST_BYTES else 4
    return ""
