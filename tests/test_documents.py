"""The documents agree with the code: layers, files, definitions and links that they name exist."""

import ast
import re
import sys

import pytest
from doc_commands import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # which pytest itself needs there

DECISIONS = ROOT / "docs" / "decisions"
HEADINGS = ["Context", "Decision", "What was measured", "What would change it"]
PAGES = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")})
NAMED_FILES = re.compile(r"`([\w./-]+\.(?:py|c|ll|js|md|yaml|json))`")
NAMED_FOLDERS = re.compile(r"`([a-z_]+(?:/[a-z_]+)*/)`")
FEATURES = 18


def section(text, heading):
    return re.split(r"^## ", text.partition(f"\n## {heading}\n")[2], flags=re.M)[0]


def named(path):
    """The page and what it names, for a message."""
    return str(path.relative_to(ROOT))


def test_the_layers_that_are_drawn_are_those_of_the_contract():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    layers = next(contract for contract in contracts if contract["type"] == "layers")
    drawn = section((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"), "Layers").split("```")[1]
    assert drawn.strip().splitlines() == layers["layers"]
    assert layers["exhaustive"] is True


def test_the_architecture_is_one_page():
    assert len((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").splitlines()) <= 120


def features():
    rows = re.findall(
        r"^\| (.+?) \| `([^`]+)` \| (.+?) \|$",
        section((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), "Where is what"),
        re.M,
    )
    return [(feature, file, re.findall(r"`([\w.]+)`", definitions)) for feature, file, definitions in rows]


def test_the_table_of_features_is_whole():
    assert len(features()) == FEATURES


@pytest.mark.parametrize(("feature", "file", "definitions"), features())
def test_each_feature_is_defined_where_the_table_says(feature, file, definitions):
    path = ROOT / file
    assert path.is_file(), f"{feature}: {file} is not there"
    assert definitions
    for definition in definitions:
        scope = ast.parse(path.read_text(encoding="utf-8")).body
        for name in definition.split("."):
            found = [node for node in scope if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name == name]
            assert found, f"{feature}: {file} does not define {definition}"
            scope = found[0].body


@pytest.mark.parametrize("note", [note for note in sorted(DECISIONS.glob("*.md")) if note.name != "README.md"], ids=named)
def test_each_decision_has_its_four_headings_and_its_line(note):
    text = note.read_text(encoding="utf-8")
    assert re.findall(r"^## (.+)$", text, re.M)[: len(HEADINGS)] == HEADINGS
    assert f"({note.name})" in (DECISIONS / "README.md").read_text(encoding="utf-8"), f"{note.name} is not listed"


def test_the_changelog_has_the_headings_of_keep_a_changelog():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    for version in re.split(r"^## ", text, flags=re.M)[1:]:
        kinds = re.findall(r"^### (.+)$", version, re.M)
        assert kinds and set(kinds) <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_files_and_folders_that_a_page_names_are_there(page):
    text = page.read_text(encoding="utf-8")
    written = re.compile(r"^(?:out/|mine/|[a-z]+\.(?:yaml|json)$)")  # by the program, or by a reader
    missing = [name for name in NAMED_FILES.findall(text) if not written.match(name) and not is_there(name)]
    missing += [name for name in NAMED_FOLDERS.findall(text) if not written.match(name) and not is_there(name)]
    assert not missing


def is_there(name):
    """A path from the root, from the package, or the end of a path of the package; `_base.py` as well as `forces/_base.py`."""
    if (ROOT / name).exists() or (ROOT / "mpp_taichi" / name).exists():
        return True
    return any(ROOT.glob(f"mpp_taichi/**/{name.rstrip('/')}"))


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_of_a_page_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    links = [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if not link.startswith(("http://", "https://", "mailto:"))]
    missing = []
    for link in links:
        file, _, anchor = link.partition("#")
        target = page.parent / file if file else page
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            missing.append(link)
    assert not missing


def anchors(page):
    """The anchors that GitHub makes of headings."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
