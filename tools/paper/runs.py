"""How the sections run scenes: on the CPU in f64, with looks at the particles, pictures of them and measured quantities."""

import base64
import io
from pathlib import Path

import numpy as np
from PIL import Image

from mpp_taichi.errors import StabilityError
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.views._base import Frame
from mpp_taichi.views.offscreen import open_offscreen
from mpp_taichi.views.wall_outline import outline_of

SCENES = Path(__file__).parents[2] / "scenes"
SIZE = (640, 400)
COLOURS = 160  # of a picture in the page


def start(scene, overrides=(), **options):
    """A bundled scene by its name, or a mapping, on the CPU in f64."""
    source = SCENES / f"{scene}.yaml" if isinstance(scene, str) else scene
    return Simulation(source, overrides=overrides, **{"backend": "cpu", "precision": "f64", **options})


class Looks:
    """Keeps what `look(simulation)` gives, at the start and every so many steps."""

    def __init__(self, look, every):
        """`every` counts steps."""
        self.look, self.every, self.kept, self._due = look, every, [], None

    def steps_until_due(self, simulation):
        """Until the next look."""
        return 0 if self._due is None else self._due - simulation.step_count

    def record(self, simulation):
        """Look."""
        self._due = simulation.step_count + self.every
        self.kept.append(self.look(simulation))


def follow(run, look, *, duration=None, looks=400):
    """Run, and give back what `look` gave at evenly spaced steps as columns of an array."""
    span = run.spec.run.duration if duration is None else duration
    recorder = Looks(look, max(1, int(span / run.dt / looks)))
    run.run(duration=span, recorders=[recorder])
    return np.array(recorder.kept).T


def measure(scene, expect, overrides=None, duration=None):
    """Quantities of `expect:`, by their names, of a whole run; those that are named several times come as a list."""
    with start(scene, {**(overrides or {}), "expect": expect}) as run:
        watcher = Watcher(run.spec.expect, 100)
        run.run(duration=duration, recorders=[watcher])
        watcher.finish(run)
        verdicts = watcher.verdicts({}, "f64")
    found = {}
    for verdict in verdicts:
        if verdict.value is None:
            raise StabilityError(f"{verdict.label}: {verdict.reason}")
        found.setdefault(verdict.quantity, []).append(verdict.value)
    return {name: values[0] if len(values) == 1 else values for name, values in found.items()}


def energy(run):
    """Total energy now."""
    return float(run.diagnostics()["total_energy"])


def energy_error(run, *, duration=None, looks=200):
    """Largest relative error of the energy at so many looks of a run."""
    first = energy(run)
    return float(np.abs(follow(run, energy, duration=duration, looks=looks) / first - 1.0).max())


def show(run, moments, *, frames=1, size=SIZE):
    """Pictures at these times as data URIs; trails have so many pieces between two of them."""
    walls = outline_of(run.spec, run.start.position)
    view = open_offscreen(run.spec.view, size, dimensions=run.spec.dimensions)

    def frame(run):
        return Frame.of(run.snapshot(), title=run.spec.title, walls=walls)

    found = []
    try:
        for moment in moments:
            steps = round((moment - run.time) / run.dt)
            trail = Looks(lambda run: view.trails.add(frame(run)), max(1, steps // frames))
            run.run(steps=steps, recorders=[trail])
            found.append(png(view.draw(frame(run))))
    finally:
        view.close()
    return found


def png(picture):
    """A picture as a data URI, in a palette."""
    data = io.BytesIO()
    Image.fromarray(picture).quantize(COLOURS, dither=Image.Dither.NONE).save(data, format="PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(data.getvalue()).decode("ascii")
