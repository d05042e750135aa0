"""The shell commands, Python blocks and YAML blocks of the Markdown pages, each with its page and line."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROGRAMS = r"(?:python3?|\.venv/bin/\S+|mpp-taichi|pip|pytest)"
_FENCE = re.compile(r"^(?P<indent> *)```(?P<kind>\w*) *\n(?P<body>.*?)^(?P=indent)``` *$", re.M | re.S)
_INDENTED = re.compile(rf"(?<=\n)    (?P<text>{PROGRAMS} (?:.*\\\n)*.*)")
_INLINE = re.compile(rf"`(?P<text>(?:{PROGRAMS}|--set) [^`]+)`")


@dataclass(frozen=True)
class Block:
    """A piece of a page: `kind` is `command`, `python` or `yaml`."""

    page: str
    line: int
    kind: str
    text: str

    @property
    def place(self) -> str:
        """`README.md:35`."""
        return f"{self.page}:{self.line}"

    @property
    def code(self) -> int:
        """The exit code that the command's comment announces, `# refused: exit code 4`; else 0."""
        found = re.search(r"#.*exit code (\d+)", self.text)
        return int(found[1]) if found else 0

    def words(self) -> list[str]:
        """A command as a shell hands it over, without its comment."""
        return shlex.split(self.text, comments=True)


def pages() -> list[str]:
    """The pages that are tested: the README, CONTRIBUTING.md and all below docs/ that show a command, Python or YAML."""
    below = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md"))
    return ["README.md", "CONTRIBUTING.md", *(page for page in below if blocks(page))]


def blocks(page: str, text: str | None = None) -> list[Block]:
    """All blocks of a page, in its order.

    Commands are the lines of blocks marked `sh`; the lines after `$` of unmarked blocks; indented lines and inline code that
    begin with a program's name. A line is one or several commands, joined by `&&`; one that ends in a backslash goes on.
    Inline code that begins with `--set` is a command as well: the last one of the page that names a scene, with it added.
    """
    text = (ROOT / page).read_text(encoding="utf-8") if text is None else text
    found: list[Block] = []
    outside = text
    for fence in _FENCE.finditer(text):
        first = text.count("\n", 0, fence.start("body")) + 1
        body, kind = fence["body"], fence["kind"]
        outside = outside[: fence.start()] + re.sub(r"[^\n]", " ", fence[0]) + outside[fence.end() :]
        if kind in ("sh", ""):
            found += _shell(page, first, body, prompted=not kind)
        elif kind in ("python", "yaml"):
            found.append(Block(page, first, kind, body))
    for pattern in (_INDENTED, _INLINE):
        for match in pattern.finditer(outside):
            found += _commands(page, outside.count("\n", 0, match.start("text")) + 1, match["text"])
    return sorted(found, key=lambda block: block.line)


def _shell(page: str, first: int, body: str, *, prompted: bool) -> list[Block]:
    found: list[Block] = []
    lines = body.splitlines()
    number = 0
    while number < len(lines):
        start, text = number, lines[number]
        while text.endswith("\\") and number + 1 < len(lines):
            number += 1
            text = f"{text[:-1]} {lines[number]}"
        number += 1
        if prompted and not text.startswith("$ "):
            continue
        found += _commands(page, first + start, text.removeprefix("$ "))
    return found


def _commands(page: str, line: int, text: str) -> list[Block]:
    text = text.replace("\\\n", " ")
    parts = [part.strip() for part in text.split("&&")]
    return [Block(page, line, "command", part) for part in parts if part and not part.startswith("#")]
