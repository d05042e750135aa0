"""Log: a scene file that repeats a run with the changes made during it: the scene that it extends, a timeline and the end."""

from pathlib import Path
from typing import Any

from mpp_taichi.atomic_file import whole_text
from mpp_taichi.errors import OutputError
from mpp_taichi.scene import extends
from mpp_taichi.scene.document import read_file
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.write import scene_text

WITHOUT = ("timeline", "run", "expect")  # keys that the log sets itself, or that do not hold for the log


def write_log(path: Path, scene: SceneSpec, end: float, comment: str) -> None:
    """Write the scene file; `end` is the time that the run has reached, `comment` says how else to repeat the run.

    The log extends the scene's own file where that file is in the same folder or below; otherwise it holds the whole scene.

    Raises:
        OutputError: the file cannot be written, or not in this folder.
    """
    whole_text(path, scene_text(_as_mapping(path, scene, end), comment), "the log")


def _as_mapping(path: Path, scene: SceneSpec, end: float) -> dict[str, Any]:
    base = _base(path, scene)
    timeline = [{"at": event.at, "set": event.changes} for event in scene.timeline if event.at < end]
    if base is None:
        _check_files(path, scene)
        found = {key: value for key, value in scene.resolved.items() if key not in WITHOUT}
    else:
        name, plain = base
        changed = {key: value for key, value in scene.resolved.items() if key not in WITHOUT and plain.get(key) != value}
        found = {"extends": name, **changed}
        if "expect" in plain:
            found["expect"] = None  # the expectations of the scene hold for a run without changes
        if plain.get("timeline") and not timeline:
            found["timeline"] = []
    if end > 0.0:
        found["run"] = {"duration": end}
    return {**found, "timeline": timeline} if timeline else found


def _base(path: Path, scene: SceneSpec) -> tuple[str, dict[str, Any]] | None:
    """The path of the scene's own file relative to the log, and its content; None where the log cannot extend the file."""
    source, folder = Path(scene.source), path.absolute().parent
    if not source.is_file() or not source.absolute().is_relative_to(folder) or source.absolute() == path.absolute():
        return None
    if source.absolute().parent != folder and reads_files(scene):
        return None
    faults = Faults()
    tree = extends.resolve(read_file(source, str(source), faults), source, source.parent, faults)
    plain = tree.plain()
    gone = any(key not in scene.resolved for key in plain if key not in WITHOUT)
    if faults.found or gone or "steps" in (plain.get("run") or {}):
        return None  # a log cannot remove keys that the file has
    return source.absolute().relative_to(folder).as_posix(), plain


def reads_files(scene: SceneSpec) -> bool:
    """Whether the scene reads other files of its folder."""
    return any(entry.name == "file" for entry in scene.particles)


def _check_files(path: Path, scene: SceneSpec) -> None:
    folder = Path(scene.source).absolute().parent
    if reads_files(scene) and path.absolute().parent != folder:
        raise OutputError(f"{path}: the scene reads files beside it, so its log must be in its folder, {folder}")
