"""The scenes that come with the program: where they are, their names, and what is said of a scene that does not exist.

A bundled scene is named by its file without folder and suffix, as `ring` for `scenes/ring.yaml`. A file that exists goes before
a bundled scene of the same name.
"""

from functools import cache
from pathlib import Path

from mpp_taichi.scene.did_you_mean import nearest
from mpp_taichi.scene.faults import printable

PACKAGE = Path(__file__).parents[1]
PLACES = (PACKAGE / "scenes", PACKAGE.parent / "scenes")  # of an installed package, and of a checkout
SUFFIXES = (".yaml", ".yml")


@cache
def bundled_scenes() -> dict[str, Path]:
    """The file of each bundled scene by its name; empty where the program was installed without its scenes."""
    in_checkout = (PACKAGE.parent / "pyproject.toml").is_file()  # else the folder may belong to another package
    places = PLACES if in_checkout else PLACES[:1]
    folder = next((place for place in places if place.is_dir()), None)
    return {} if folder is None else {file.stem: file for file in sorted(folder.rglob("*.yaml"))}


def scene_file(source: str | Path) -> Path:
    """The file of the scene `source`: the file of this name, or the bundled scene of this name where there is no such file."""
    path = Path(source)
    if str(source) in bundled_scenes() and not _exists(path):
        return from_here(bundled_scenes()[str(source)])
    return path


def missing_scene(file: str) -> str:
    """The message about a scene file that does not exist: it names the nearest file and the nearest bundled scene."""
    path = Path(file)
    if file == "-":
        return "-: no scene is read from standard input; write a file, and make a scene of it by: mpp-taichi convert FILE"
    if path.suffix.lower() not in SUFFIXES:
        told = f"{printable(file)}: no such file and no scene of the program{_nearest(path) or ';'}"
        return f"{told} `mpp-taichi scenes` lists the scenes"
    if path.stem in bundled_scenes():
        return f"{printable(file)}: no such file; the program has a scene of this name: mpp-taichi run {path.stem}"
    return f"{printable(file)}: no such file{_nearest(path)}"


def _nearest(path: Path) -> str:
    try:
        beside = {each.stem: str(path.parent / each.name) for each in path.parent.iterdir() if each.suffix.lower() in SUFFIXES}
    except (OSError, ValueError):
        beside = {}
    known = {**{name: name for name in bundled_scenes()}, **beside}
    near = nearest(path.stem, known)
    return f", did you mean {printable(known[near])}?" if near is not None else ""


def from_here(path: Path) -> Path:
    """The path relative to the working folder where it lies below it, as a user would write it."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False
