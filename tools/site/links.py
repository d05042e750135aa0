"""Links of the repository, as links of the site."""

import posixpath
import re
from collections.abc import Mapping
from pathlib import Path

_FENCES = re.compile(r"(^(?P<fence>```+).*?^(?P=fence)\s*$|`[^`\n]+`)", re.M | re.S)
_LINK = re.compile(r"(?P<picture>!?)\[(?P<words>(?:[^\[\]]|\[[^\]]*\])*)\]\((?P<target>[^)\s]+)\)")
_ELSEWHERE = ("http://", "https://", "mailto:")


class SiteMap:
    """Which page of the site shows which file of the repository."""

    def __init__(self, root: Path) -> None:
        """Begin without a page."""
        self.root = root
        self._pages: dict[str, str] = {}
        self._sources: dict[str, str] = {}
        self._parts: dict[str, tuple[Mapping[str, str], str]] = {}

    def shows(self, pages: Mapping[str, str]) -> None:
        """Add pages: file of the repository → page of the site."""
        self._pages |= pages
        for source, page in pages.items():
            self._sources.setdefault(page, source)

    def splits(self, source: str, topics: Mapping[str, str], rest: str) -> None:
        """A file is shown by several pages: anchor → page. Links without an anchor lead to `rest`."""
        self._parts[source] = (topics, rest)
        self._pages[source] = rest
        for page in {*topics.values(), rest}:
            self._sources[page] = source

    def rewritten(self, markdown: str, page: str) -> str:
        """The text of a page with its links between files of the repository turned into links between pages."""
        source = self._sources.get(page, f"docs/{page}")
        if source.startswith("scenes/"):
            return markdown  # made for the site
        pieces = _FENCES.split(markdown)
        # The pattern has two groups: of three pieces the first is text, the second code, the third the fence of the code.
        pieces = [
            _LINK.sub(lambda found: self._link(found, source, page), piece or "") if k % 3 == 0 else piece
            for k, piece in enumerate(pieces)
            if k % 3 != 2
        ]
        return "".join(piece or "" for piece in pieces)

    def _link(self, found: re.Match, source: str, page: str) -> str:
        target = found["target"]
        if target.startswith(_ELSEWHERE):
            return found[0]
        file, _, anchor = target.partition("#")
        path = posixpath.normpath(posixpath.join(posixpath.dirname(source), file)) if file else source
        goal = self._goal(path, anchor)
        if goal is None:
            if not (self.root / path).exists():
                return found[0]  # the strict build names it
            return found[0] if found["picture"] else found["words"]
        relative = posixpath.relpath(goal, posixpath.dirname(page) or ".")
        if goal == page and anchor:
            relative = ""
        return f"{found['picture']}[{found['words']}]({relative}{'#' + anchor if anchor else ''})"

    def _goal(self, path: str, anchor: str) -> str | None:
        if path in self._parts:
            topics, rest = self._parts[path]
            return topics.get(anchor, rest)
        return self._pages.get(path)
