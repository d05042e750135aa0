"""House rule: every flag of a component that the program asks for by its name is declared by a class of this kind."""

import ast

import pytest
from conftest import ROOT

from mpp_taichi import component


def asked():
    """(file, line, kind, flag) of each call of `flag(kind, [name,] key)` and `marked(kind, key)` with literal words."""
    for path in sorted((ROOT / "mpp_taichi").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            words = [each.value if isinstance(each, ast.Constant) else None for each in node.args]
            if name not in ("flag", "marked") or words[0] not in component.KINDS:
                continue
            key = words[1] if name == "marked" or len(words) == 2 else words[2]
            if key is not None:
                yield path.relative_to(ROOT), node.lineno, words[0], key


@pytest.mark.parametrize("kind", component.KINDS)
def test_flags_that_are_asked_for_are_declared(kind):
    """Without this rule a misspelt flag is silently false: the order of implicit methods was sought with too many steps."""
    declared = set().union(*(component.declaration(kind, name).flags for name in component.names(kind)))
    assert not [entry for entry in asked() if entry[2] == kind and entry[3] not in declared]
    assert any(entry[2] == kind for entry in asked()) or kind in ("generators", "networks", "diagnostics")
