"""The verdicts of a check that was cut off, taken by the same command."""

import argparse
import hashlib
import json
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpp_taichi.cli._options import OUTPUT_FOLDER
from mpp_taichi.cli._study_journal import program_digest, study_journal, torn
from mpp_taichi.cli._terminal import plain, say

OPTIONS = ("backend", "precision", "plan", "threads")
WORDS = re.compile(rb"[\w./+-]+\.\w+")  # of a scene, of which some may name files that it reads


class Verdicts:
    """The finished verdicts of one check, by scene and by the content of its files; a context manager.

    The file is out/check-….journal, with a name that belongs to the list of scenes, so that different checks do not meet.
    Beside it, a folder has the archives of runs that take their time.
    """

    def __init__(self, scenes: Sequence[Path], arguments: argparse.Namespace) -> None:
        """Look for the journal of the same check; see `study_journal`."""
        name = hashlib.sha256(b"\n".join(os.fsencode(scene.absolute()) for scene in scenes)).hexdigest()[:8]
        known = {option: getattr(arguments, option) for option in OPTIONS}
        self.journal = study_journal(OUTPUT_FOLDER / f"check-{name}.journal", "check", arguments, known)
        self._keys = {scene: f"{scene} {digest(scene)}" for scene in scenes}
        self._runs = None if arguments.no_archive else OUTPUT_FOLDER / f"check-{name}.runs"
        self._facts = json.dumps({**known, "program": program_digest()}, sort_keys=True)
        if arguments.fresh:
            self._remove_runs()
        self._known = {scene: found for scene in self._keys if (found := self.journal.get(self._keys[scene])) is not None}
        if self.journal.holds and not arguments.quiet:
            said = f"{len(self._known)} of {len(scenes)} scenes are taken from it{torn(self.journal)}"
            say(f"going on with {self.journal.path}: {said}; --fresh begins anew")

    def __enter__(self) -> "Verdicts":
        """Return these verdicts."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Remove the journal and the archives of runs where the check has ended, and keep them where it was cut off."""
        if kind is None:
            self.journal.end()
            self._remove_runs()
        else:
            self.journal.close()

    def run_of(self, scene: Path) -> Path | None:
        """The archive of the run of a scene, from which a check goes on within the scene; None where none is kept."""
        if self._runs is None:
            return None
        name = hashlib.sha256(os.fsencode(self._keys[scene] + self._facts)).hexdigest()[:16]
        return self._runs / f"{name}.run"

    def _remove_runs(self) -> None:
        if self._runs is not None:
            shutil.rmtree(self._runs, ignore_errors=True)

    def get(self, scene: Path) -> dict[str, Any] | None:
        """The verdict of a scene whose files have not changed since; None where there is none."""
        return self._known.get(scene)

    def keep(self, scene: Path, result: dict[str, Any]) -> None:
        """Keep the verdict of a scene; what had no verdict, because of a fault of any kind, is checked again."""
        if "error" not in result:
            self.journal.put(self._keys[scene], plain(result))


def digest(scene: Path) -> str:
    """A digest of the bytes of a scene, and of all files that it names; empty where the scene cannot be read."""
    try:
        text = scene.read_bytes()
        found = hashlib.sha256(text)
        for word in sorted(set(WORDS.findall(text))):
            named = scene.parent / word.decode(errors="replace")
            if named.is_file():
                found.update(json.dumps(str(named)).encode() + named.read_bytes())
    except OSError:
        return ""
    return found.hexdigest()[:16]
