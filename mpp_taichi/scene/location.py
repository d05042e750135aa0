"""Location: the place of a value in a file."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Location:
    """The file, line and column of a value; `file` is `--set …` for an override."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        """`file:line:column`, or only the file where there are no lines (`--set path=value`, a dict)."""
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file
