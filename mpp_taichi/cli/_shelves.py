"""The places of a window's list of scenes: folders, and the scenes of the program by topic."""

import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mpp_taichi.importers.catalogue import is_recognised
from mpp_taichi.scene.bundled import SUFFIXES as SCENE_FILES
from mpp_taichi.scene.bundled import bundled_scenes, from_here
from mpp_taichi.scene.catalogue import TOPICS, listed
from mpp_taichi.views.scene_list import ListRow, Shelf

OUTSIDE = ".."
STATE, STATE_MARK = ".npz", "meta.npy"  # of a saved state; trajectories and tables have no such part
PROGRAM = "scenes of the program"


@dataclass(frozen=True)
class Folder:
    """A folder of files: the scenes of the program, the folder outside, the folders inside, and the files that can be opened.

    Files and folders whose names begin with a dot are left out.
    """

    path: Path

    @staticmethod
    def of(path: Path) -> "Folder":
        """The folder of a file, or the folder itself."""
        path = Path(os.path.abspath(path))
        return Folder(path if path.is_dir() else path.parent)

    @property
    def name(self) -> str:
        """The path as a user would write it."""
        home = Path.home()
        inside_home = self.path.is_relative_to(home) and self.path != home
        return f"~/{self.path.relative_to(home).as_posix()}" if inside_home else str(self.path)

    def rows(self) -> Sequence[ListRow]:
        """The rows as they are now."""
        found = sorted(each for each in self.path.iterdir() if not each.name.startswith("."))
        inside = [ListRow(each.name, place=Folder(each)) for each in found if each.is_dir()]
        files = [each for each in found if each.is_file() and is_openable(each)]
        outside = [ListRow(OUTSIDE, place=Folder(self.path.parent))] if self.path.parent != self.path else []
        own = [ListRow(PROGRAM, place=Program(self.path))] if bundled_scenes() else []
        return [*outside, *own, *inside, *(ListRow(each.name, from_here(each)) for each in files)]


@dataclass(frozen=True)
class Program:
    """The topics of the scenes of the program; `folder` is the folder to which the way out leads."""

    folder: Path
    name = PROGRAM

    def rows(self) -> Sequence[ListRow]:
        """A row for each topic that has a scene."""
        topics = {each.topic for each in listed(bundled_scenes().values())}
        return [
            ListRow(OUTSIDE, place=Folder(self.folder)),
            *(ListRow(each, place=Topic(self, each)) for each in TOPICS if each in topics),
        ]


@dataclass(frozen=True)
class Topic:
    """The scenes of the program on a topic."""

    outside: Shelf
    topic: str

    @property
    def name(self) -> str:
        """The topic within the scenes of the program."""
        return f"{PROGRAM}: {self.topic}"

    def rows(self) -> Sequence[ListRow]:
        """A row for each scene."""
        scenes = [each for each in listed(bundled_scenes().values()) if each.topic == self.topic]
        return [ListRow(OUTSIDE, place=self.outside), *(ListRow(each.name, from_here(each.file)) for each in scenes)]


@dataclass(frozen=True)
class Beginning:
    """The place with which a window without a scene begins: the topics of the program's scenes, and the rows of a folder."""

    folder: Path

    @property
    def name(self) -> str:
        """Both parts."""
        return f"{PROGRAM}, and {Folder(self.folder).name}"

    def rows(self) -> Sequence[ListRow]:
        """A row for each topic, then the rows of the folder."""
        return [*_topics_in(self), *(row for row in Folder(self.folder).rows() if row.name != PROGRAM)]


def _topics_in(place: Shelf) -> Sequence[ListRow]:
    """A row for each topic that has a scene; the way out of a topic leads to `place`."""
    topics = {each.topic for each in listed(bundled_scenes().values())}
    return [ListRow(each, place=Topic(place, each)) for each in TOPICS if each in topics]


def is_openable(file: Path) -> bool:
    """Whether a file is a scene by its name, or begins like a state or like a file of another program."""
    suffix = file.suffix.lower()
    if suffix == STATE:
        try:
            with zipfile.ZipFile(file) as archive:
                return STATE_MARK in archive.namelist()
        except (OSError, zipfile.BadZipFile):
            return False
    return suffix in SCENE_FILES or is_recognised(file)
