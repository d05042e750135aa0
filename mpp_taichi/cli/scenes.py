"""List scenes by topic: those that come with the program, or those of a folder.

`mpp-taichi NAME` runs a scene of the program, and `mpp-taichi new my.yaml --like NAME` makes a copy to change.
"""

import argparse
import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mpp_taichi.cli._terminal import UsageError, put, put_json

if TYPE_CHECKING:
    from mpp_taichi.scene.catalogue import Listed

NARROWEST, WIDEST = 60, 120  # columns of the list
LONGEST_NAME = 28  # of the column of names


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    own = "a folder of scenes; absent: the program's own"
    parser.add_argument("folder", nargs="?", type=Path, metavar="FOLDER", help=own)
    words = "only scenes with this word in their name, topic, title or description"
    parser.add_argument("--about", metavar="WORD", help=words)
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")


def execute(arguments: argparse.Namespace) -> int:
    """Print the list."""
    from mpp_taichi.scene.bundled import bundled_scenes
    from mpp_taichi.scene.catalogue import listed

    folder: Path | None = arguments.folder
    if folder is not None and not folder.is_dir():
        raise UsageError(f"scenes: {folder} is no folder")
    files = list(bundled_scenes().values()) if folder is None else sorted(folder.glob("*.yaml"))
    if not files:
        raise UsageError("scenes: " + ("this installation has no scenes" if folder is None else f"{folder} holds no *.yaml"))
    found = [each for each in listed(files) if _is_about(each, arguments.about)]
    if not found:
        raise UsageError(f"scenes: no scene has {arguments.about!r} in its name, topic, title or description")
    if arguments.json:
        put_json({"scenes": [_as_json(each) for each in found], "status": "ok"})
    else:
        put(_text(found, own=folder is None))
    return 0


def _is_about(scene: "Listed", word: str | None) -> bool:
    texts = (scene.name, scene.topic, scene.title, scene.description)
    return word is None or any(word.casefold() in text.casefold() for text in texts)


def _as_json(scene: "Listed") -> dict[str, str]:
    entry = {"name": scene.name, "file": str(scene.file), "title": scene.title, "description": scene.description}
    return entry | {"topic": scene.topic} | ({"fault": scene.fault} if scene.fault else {})


def _text(scenes: "Sequence[Listed]", *, own: bool) -> str:
    """The list, as wide as the terminal."""
    width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
    names = min(max(len(scene.name) for scene in scenes), LONGEST_NAME)
    lines: list[str] = []
    for topic in dict.fromkeys(scene.topic for scene in scenes):
        lines += ["", topic] if lines else [topic]
        for scene in (each for each in scenes if each.topic == topic):
            told = scene.fault or " – ".join(filter(None, (scene.title, scene.description))) or "(no title)"
            head = f"  {scene.name:{names}}  "
            rest = " " * (names + 4)
            lines += textwrap.wrap(told, width, initial_indent=head, subsequent_indent=rest, break_on_hyphens=False)
    if own:
        lines += ["", "mpp-taichi NAME runs a scene; mpp-taichi new my.yaml --like NAME makes a copy to change"]
    return "\n".join(lines)
