"""What the site adds to the pages of docs/: pages that are made from the repository, links into it, and typeset equations.

MkDocs calls these functions (`hooks:` in mkdocs.yml).
"""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

from api import api_pages  # noqa: E402
from equations import as_mathml  # noqa: E402
from gallery import gallery_pages  # noqa: E402
from links import SiteMap  # noqa: E402
from reference import reference_pages, topics  # noqa: E402

PROJECT = ("CONTRIBUTING.md", "ARCHITECTURE.md", "CONVENTIONS.md", "CHANGELOG.md")
"""Pages at the root of the repository that the site shows."""
SCENE = ROOT / "docs" / "scene.md"
"""The scene reference, which the site shows as a page for each topic."""
RECORDED = ROOT / "out" / "site_pages"
"""The playing pages of scenes, where they were recorded."""

_map = SiteMap(ROOT)
_made: dict[str, str | bytes] = {}


def on_config(config: Any) -> Any:
    """Make the pages, and put them into the navigation below the first page of their folder."""
    _made.clear()
    _made.update({f"project/{name}": (ROOT / name).read_text(encoding="utf-8") for name in PROJECT})
    _made.update(reference_pages(SCENE) | gallery_pages(ROOT, RECORDED) | api_pages(ROOT))
    decisions = [f"decisions/{path.name}" for path in sorted((ROOT / "docs" / "decisions").glob("*.md"))]
    config["nav"] = _expanded(config["nav"], [*_made, *decisions])
    return config


def _expanded(entries: list, pages: Iterable[str]) -> list:
    """The navigation, in which the first page of a folder is followed by the other pages of the folder that are made."""
    found: list = []
    for entry in entries:
        if isinstance(entry, dict):
            found.append(
                {title: _expanded(below, pages) if isinstance(below, list) else below for title, below in entry.items()}
            )
            continue
        found.append(entry)
        folder, _, name = entry.rpartition("/")
        if name == "README.md" and folder:
            found += [each for each in pages if each.endswith(".md") and each.startswith(f"{folder}/") and each != entry]
    return found


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made, and take out the page that they replace."""
    files.remove(files.get_file_from_path("scene.md"))
    own = {f"docs/{file.src_uri}": file.src_uri for file in files}
    for path, content in _made.items():
        if (there := files.get_file_from_path(path)) is not None:
            files.remove(there)
        files.append(File.generated(config, path, content=content))
    _map.shows(own)
    _map.shows({name: f"project/{name}" for name in PROJECT} | {"README.md": "README.md"})
    _map.shows({str(path.relative_to(ROOT)): f"gallery/{path.stem}.md" for path in (ROOT / "scenes").rglob("*.yaml")})
    _map.splits("docs/scene.md", topics(SCENE), "reference/README.md")
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Let links lead to pages of the site; a link to a file that the site does not show becomes its words alone."""
    return _map.rewritten(markdown, page.file.src_uri)


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """Typeset the equations."""
    return as_mathml(html)
