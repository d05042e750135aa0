"""The scene reference, docs/scene.md, as one page for each topic."""

import re
from functools import cache
from pathlib import Path

FOLDER = "reference"


@cache
def _sections(file: Path) -> tuple[tuple[str, str], ...]:
    """The text before the first section, under an empty title, and the sections: title and text."""
    first, *rest = re.split(r"^## ", file.read_text(encoding="utf-8"), flags=re.M)
    return (("", first), *((title, text) for title, _, text in (section.partition("\n") for section in rest)))


def reference_pages(file: Path) -> dict[str, str]:
    """Path and text of every page."""
    (_, introduction), *sections = _sections(file)
    rows = "\n".join(f"- [{_words(title)}]({_name(title)})" for title, _ in sections)
    pages = {f"{FOLDER}/README.md": f"{introduction}\n{rows}\n"}
    for title, text in sections:
        raised = re.sub(r"^##(#+ )", r"#\1", text, flags=re.M)
        pages[f"{FOLDER}/{_name(title)}"] = f"# {title}\n{raised}"
    return pages


def topics(file: Path) -> dict[str, str]:
    """The page of each anchor."""
    found = {}
    for title, text in _sections(file)[1:]:
        for heading in (title, *re.findall(r"^#+ (.+)$", text, re.M)):
            found[_anchor(heading)] = f"{FOLDER}/{_name(title)}"
    return found


def _words(title: str) -> str:
    return re.sub(r"`", "", title.partition(":")[0])


def _name(title: str) -> str:
    return _anchor(_words(title)).replace("-", "_") + ".md"


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
