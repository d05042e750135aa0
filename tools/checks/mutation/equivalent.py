"""Mutants that no test can catch, each with the reason, from a YAML file."""

from pathlib import Path

import yaml

from mutation.source import Mutant, Source

KEYS = {"file", "line", "becomes", "reason"}


def changed_line(source: Source, mutant: Mutant) -> tuple[str, str]:
    """The first line that a mutant changes, and its text afterwards, both without their indentation."""
    after = mutant.apply(source.text).splitlines()
    return source.lines[mutant.line - 1].strip(), after[mutant.line - 1].strip()


class Equivalents:
    """The mutants that are listed. A line that has changed since is judged anew, as the text of the line no longer matches."""

    def __init__(self, path: Path) -> None:
        """Read the file; each entry has exactly the keys `file`, `line`, `becomes` and `reason`."""
        self.entries = yaml.safe_load(path.read_text(encoding="utf-8")) or []
        for entry in self.entries:
            if set(entry) != KEYS or not all(isinstance(value, str) and value for value in entry.values()):
                raise SystemExit(f"{path}: an entry has the keys {sorted(entry)}, not the texts {sorted(KEYS)}")
        self._reasons = {(entry["file"], entry["line"], entry["becomes"]): entry["reason"] for entry in self.entries}

    def reason(self, source: Source, mutant: Mutant) -> str | None:
        """Why a mutant changes nothing that a test could see; None where it is not listed."""
        return self._reasons.get((mutant.path.as_posix(), *changed_line(source, mutant)))

    def stale(self, root: Path) -> list[str]:
        """Lines that are no longer in their files."""
        return [
            f"{entry['file']}: {entry['line']}"
            for entry in self.entries
            if not (root / entry["file"]).exists()
            or entry["line"] not in (line.strip() for line in (root / entry["file"]).read_text(encoding="utf-8").splitlines())
        ]
