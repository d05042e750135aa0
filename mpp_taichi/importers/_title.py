"""The title of a scene that is read from another program's file."""

from pathlib import PurePath

from mpp_taichi.scene.faults import printable


def title_of(source: str) -> str:
    """The name of a file without its suffix; its bytes that are no letters are replaced."""
    return printable(PurePath(source).stem)
