"""Which test files belong to a module, the most telling first."""

import re
from pathlib import Path

OF_COMPONENTS = "test_scene_schema.py"  # the reference page and the schema, which are made of the components' declarations
ROOMS = {"exporters": ("files",), "importers": ("files",), "forces": ("forces", "networks"), "networks": ("networks", "forces")}


def chosen_tests(root: Path, module: Path) -> list[Path]:
    """Test files of a module below `root`: files that import it; files that name it, first of its room; the rest of it;
    and files that import another module of its folder.

    A component is named by its scene key, which is the name of its file, other modules by a word of the name of a class or of a
    function that they define.
    """
    dotted = ".".join(module.with_suffix("").parts)
    folder, stem = dotted.rsplit(".", 1)
    component = "\n@component" in (root / module).read_text(encoding="utf-8")
    words = [re.escape(stem)] if component or not stem.startswith("_") and "_" in stem else []
    words += re.findall(r"^(?:class|def) ([A-Za-z]\w{5,})", (root / module).read_text(encoding="utf-8"), re.MULTILINE)
    imports = re.compile(rf"\b{re.escape(dotted)}\b|from {re.escape(folder)} import [^\n]*\b{stem}\b")
    names = re.compile(rf"\b(?:{'|'.join(words)})\b") if words else re.compile(r"(?!)")
    beside = re.compile(rf"\b{re.escape(folder)}\b")
    room = module.parts[min(1, len(module.parts) - 2)]
    rooms = ROOMS.get(room, (room,))
    ranked = []
    for path in sorted((root / "tests").rglob("test_*.py")):
        text, in_room = path.read_text(encoding="utf-8"), path.parent.name in rooms
        if imports.search(text) or component and path.name == OF_COMPONENTS:
            rank = 0
        elif names.search(text):
            rank = 1
        elif in_room:
            rank = 2
        elif beside.search(text):
            rank = 3
        else:
            continue
        ranked.append((rank, not in_room, len(text), path.relative_to(root)))
    return [path for *_, path in sorted(ranked)]
