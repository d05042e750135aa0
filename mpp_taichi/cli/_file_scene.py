"""The scene of any file that `convert` reads: a scene, a file of another program, or a saved state with the scene it is of."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpp_taichi.cli._shelves import STATE
from mpp_taichi.cli._terminal import say
from mpp_taichi.errors import MppError, SceneError
from mpp_taichi.importers.catalogue import import_scene
from mpp_taichi.recorders.trajectory_file import is_trajectory
from mpp_taichi.scene.bundled import SUFFIXES, bundled_scenes
from mpp_taichi.scene.faults import printable
from mpp_taichi.scene.load import load_resolved, load_scene
from mpp_taichi.scene.spec import SceneSpec, default_integrator
from mpp_taichi.simulation.course import course_of
from mpp_taichi.snapshot import Snapshot

ADDED = re.compile(r"(_\d{4,}|\.crash|\.interrupted)$")
"""The end of a name that the program adds to the name of a scene for the file of a state."""
STEP = 0.01  # of particles that move along straight lines, where their state does not know the step of its run


@dataclass(frozen=True, eq=False)
class FileScene:
    """A scene, and the state of a file from which it goes on; without a state it begins at its own start."""

    spec: SceneSpec
    state: Snapshot | None = None
    state_file: Path = Path()


def scene_in(file: Path, present: SceneSpec | None = None, written: SceneSpec | None = None) -> FileScene:
    """Read a file.

    A state goes on in the scene that is `present`, of which `written` is the part without moves of sliders, or else in a scene
    with the name of its file. Where no scene fits, its particles are shown by themselves.

    Raises:
        MppError: the file cannot be read.
    """
    suffix = file.suffix.lower()
    if suffix in SUFFIXES:
        return FileScene(load_scene(file))
    if suffix != STATE:
        return FileScene(load_resolved(import_scene(file)[1], str(file)))
    if is_trajectory(file):
        raise SceneError(f"{file}: is a trajectory, of which no state can be made")
    state = Snapshot.load(file)
    candidates = [] if present is None else [_up_to(state.time, present, written or present)]
    for spec in (*candidates, *_scenes_near(file)):
        try:
            course_of(spec, state)
        except MppError:
            continue
        return FileScene(spec, state, file)
    say(f"note: {file}: no scene of this state was found; its particles are shown without forces")
    return FileScene(load_resolved(_particles_of(file, state), str(file)))


def _scenes_near(file: Path) -> Iterator[SceneSpec]:
    """Scenes with the name of a state's file: beside the file, in the folder outside, in the working folder, of the program."""
    name = ADDED.sub("", file.stem)
    folder = file.absolute().parent
    near = [each / f"{name}{suffix}" for each in dict.fromkeys((folder, folder.parent, Path.cwd())) for suffix in SUFFIXES]
    for source in (*near, bundled_scenes().get(name)):
        if source is not None and source.is_file():
            try:
                yield load_scene(source)
            except MppError:
                continue  # a scene with a fault is not the scene of a state


def _particles_of(file: Path, state: Snapshot) -> dict[str, Any]:
    """A scene of the particles alone."""
    return {
        "title": f"{printable(file.name)}: particles without forces",
        "particles": [{"file": {"path": file.name}}],
        "integrator": {default_integrator(): {"dt": state.dt or STEP}},
    }


def _up_to(time: float, present: SceneSpec, written: SceneSpec) -> SceneSpec:
    """The present scene without the moves of sliders after a time: the state of this time does not know them."""
    own = written.resolved.get("timeline", [])
    moves = present.resolved.get("timeline", [])
    kept = [event for event in moves if event["at"] <= time or event in own]
    return present if kept == moves else load_resolved({**present.resolved, "timeline": kept}, present.source)
