"""The text of one module: its tree, offsets of characters, and the parts in which no mutant is drawn."""

import ast
import builtins
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

# Calls whose arguments are texts for people, or which only tell the program what a text is.
TELLING = {"debug", "info", "warning", "error", "exception", "log", "print", "isinstance", "issubclass", "getattr", "hasattr"}
KEYWORDS_OF_TEXT = {"help", "unit", "label", "encoding", "newline", "strict", "symbol", "description", "title", "metavar"}


@dataclass(frozen=True)
class Mutant:
    """One change of characters: those from `start` to `end` of the text of `path` become `replacement`."""

    path: Path  # relative to the root of the source tree
    line: int
    operator: str
    start: int
    end: int
    replacement: str

    def apply(self, text: str) -> str:
        """The text with the change."""
        return text[: self.start] + self.replacement + text[self.end :]


class Source:
    """A module that can be mutated."""

    def __init__(self, root: Path, path: Path) -> None:
        """Read and parse the file `path` below `root`."""
        self.path, self.text = path, (root / path).read_text(encoding="utf-8")
        self.lines = self.text.splitlines(keepends=True)
        self._begins = [0]
        for line in self.lines:
            self._begins.append(self._begins[-1] + len(line))
        self.tree = ast.parse(self.text)
        self.parent: dict[ast.AST, ast.AST] = {}
        for node in ast.walk(self.tree):
            self.parent.update(dict.fromkeys(ast.iter_child_nodes(node), node))

    def offset(self, line: int, column: int, *, in_bytes: bool = True) -> int:
        """Offset in the text of a place that the tree names; `ast` counts columns in bytes, parso in characters."""
        if in_bytes:
            column = len(self.lines[line - 1].encode()[:column].decode())
        return self._begins[line - 1] + column

    def span(self, node: ast.AST) -> tuple[int, int]:
        """Offsets of the first character of a node, and of the character after it."""
        return self.offset(node.lineno, node.col_offset), self.offset(node.end_lineno, node.end_col_offset)

    def text_of(self, node: ast.AST) -> str:
        """The characters of a node."""
        start, end = self.span(node)
        return self.text[start:end]

    def line_of(self, offset: int) -> int:
        """Number of the line that holds an offset, from 1."""
        return next(number for number, begin in enumerate(self._begins) if begin > offset)

    @cached_property
    def closed(self) -> list[tuple[int, int]]:
        """Spans without mutants: docstrings, annotations, imports, refusals, texts and what only type checkers read."""
        return [self.span(node) for node in ast.walk(self.tree) if hasattr(node, "lineno") and self._is_closed(node)]

    @cached_property
    def formatted(self) -> list[tuple[int, int]]:
        """Spans of f-strings: Python 3.11 does not tell the places of the expressions in them."""
        return [self.span(node) for node in ast.walk(self.tree) if isinstance(node, ast.JoinedStr)]

    def is_open(self, start: int, end: int, *, formatted: bool = False) -> bool:
        """Whether no closed span has a character between the two offsets; nor an f-string, unless `formatted`."""
        spans = self.closed if formatted else self.closed + self.formatted
        return not any(start < last and first < end for first, last in spans)

    def _is_closed(self, node: ast.AST) -> bool:
        above = self.parent.get(node)
        if isinstance(node, (ast.Import, ast.ImportFrom, ast.Raise, ast.Assert, ast.Global, ast.Nonlocal)):
            return True
        if isinstance(node, ast.Expr):
            return isinstance(node.value, ast.Constant) or _called(node.value) in TELLING
        if isinstance(node, ast.If):
            return "TYPE_CHECKING" in ast.unparse(node.test)
        if isinstance(node, ast.Assign):
            return any(isinstance(target, ast.Name) and target.id == "__all__" for target in node.targets)
        if isinstance(node, ast.keyword):
            return node.arg in KEYWORDS_OF_TEXT
        if isinstance(node, ast.Call):
            return _called(node) in TELLING or _is_exception(_called(node))
        if isinstance(above, (ast.AnnAssign, ast.arg)):
            return node is above.annotation
        if isinstance(above, (ast.FunctionDef, ast.AsyncFunctionDef)):
            return node is above.returns or node in above.decorator_list
        return isinstance(above, ast.ClassDef) and node in (*above.bases, *above.decorator_list)


def _called(node: ast.AST) -> str:
    """The last word of what a call calls."""
    if not isinstance(node, ast.Call):
        return ""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _is_exception(name: str) -> bool:
    known = getattr(builtins, name, None)
    return name.endswith(("Error", "Warning")) or (isinstance(known, type) and issubclass(known, BaseException))
