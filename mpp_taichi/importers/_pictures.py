"""Pictures that a file of another program names: a picture beside the file goes into the scene, a line tells of others."""

import logging
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

logger = logging.getLogger(__name__)
MOST_TOLD = 6  # in a line


class Pictures:
    """Finds pictures beside a file, and collects the names of the pictures that the scene leaves out, by the reason."""

    def __init__(self, source: str) -> None:
        """Look for pictures in the folder of the file and below it."""
        self.source, self.folder = source, Path(source).parent
        self._left: dict[str, list[str]] = {}

    def find(self, name: str, what: str) -> str | None:
        """The path of a picture relative to the folder. Without such a file None, and the picture is noted as left out.

        Separators of Windows, and separators written twice, are read as one; capitals need not agree.
        """
        folder = self.folder
        words = [word for word in name.strip().replace("\\", "/").split("/") if word not in ("", ".")]
        for word in words:
            folder = folder / _as_spelt(folder, word)
        inside = words and ".." not in words and not Path(name).is_absolute() and ":" not in words[0]
        if inside and folder.is_file():
            return folder.relative_to(self.folder).as_posix()
        self.leave_out(what, "there is no such picture in its folder or below")
        return None

    def leave_out(self, what: str, why: str) -> None:
        """Note a part of the file that the scene does not have."""
        self._left.setdefault(why, []).append(what)

    def tell(self) -> None:
        """Say in a line for each reason what has been left out."""
        _tell(self.source, self._left)


def beside(scene: Mapping[str, Any], source: Path, target: Path) -> dict[str, Any]:
    """A scene made from the file `source`, with the names of its pictures relative to the folder of `target`.

    A scene may only name files in its own folder or below: other pictures are left out, and a line tells which.
    """
    start = target.absolute().parent.resolve()
    left: list[str] = []
    bodies: dict[str, Any] = {}
    for name, body in (scene.get("view", {}).get("bodies") or {}).items():
        bodies[name] = {}
        for key, value in body.items():
            if isinstance(value, Mapping) and "file" in value:
                path = (source.absolute().parent / value["file"]).resolve()
                if not path.is_relative_to(start):
                    left.append(f"{key} of {name}")
                    continue
                value = {**value, "file": Path(os.path.relpath(path, start)).as_posix()}
            bodies[name][key] = value
    _tell(str(source), {f"its pictures are not in the folder of {target.name} or below": left} if left else {})
    return {**scene, "view": {**scene["view"], "bodies": bodies}} if bodies else dict(scene)


def _as_spelt(folder: Path, word: str) -> str:
    """The name of an entry of a folder, with the capitals that it has there."""
    if (folder / word).exists():
        return word
    return next((name for name in _names(folder) if name.lower() == word.lower()), word)


def _names(folder: Path) -> Iterator[str]:
    try:
        yield from sorted(os.listdir(folder))
    except OSError:
        return


def _tell(source: str, left: Mapping[str, list[str]]) -> None:
    for why, parts in left.items():
        more = f" and {len(parts) - MOST_TOLD} more" if len(parts) > MOST_TOLD else ""
        logger.warning("%s: left out: %s%s (%s)", source, ", ".join(parts[:MOST_TOLD]), more, why)
