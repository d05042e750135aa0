"""Location: the place of a value in a file."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Location:
    """The file, line and column of a value; `file` is `--set …` for an override.

    where   the values of the variables of the repeats around it, `i = 3, j = 0`; empty outside of a repeat
    """

    file: str
    line: int
    column: int
    where: str = ""

    def __str__(self) -> str:
        """`file:line:column (i = 3)`, or only the file where there are no lines (`--set path=value`, a dict)."""
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        return f"{place} ({self.where})" if self.where else place
