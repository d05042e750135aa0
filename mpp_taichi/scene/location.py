"""Location: where something was written."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Location:
    """Where in which file something was written; `file` is `--set …` for an override."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        """`file:line:column`, or the file alone where there are no lines (`--set path=value`, a dict)."""
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file
