"""The page of the Python interface: docs/api.md, and below it the docstrings of every public name."""

import ast
from pathlib import Path


def api_pages(root: Path) -> dict[str, str]:
    """Path and text of the page; the names are those of `__all__` and the modules that the package imports them from."""
    tree = ast.parse((root / "mpp_taichi" / "__init__.py").read_text(encoding="utf-8"))
    homes = {
        alias.name: statement.module
        for statement in ast.walk(tree)
        if isinstance(statement, ast.ImportFrom) and (statement.module or "").startswith("mpp_taichi.")
        for alias in statement.names
    }
    text = (root / "docs" / "api.md").read_text(encoding="utf-8")
    described = "\n".join(f"::: {homes[name]}.{name}\n" for name in sorted(homes) if not name.startswith("_"))
    return {"api.md": f"{text}\n{described}"}
