"""A property of a class marked `@ti.data_oriented` is overridden by no class that is not so marked.

Taichi's own `data_oriented` looks a property up in the marked class first, so that instances of the other class would have the
property of the base class. The launch cache, which can be switched off, hides this.
"""

import ast

import pytest
from conftest import ROOT

MARK = "ti.data_oriented"


def classes(folder):
    """Every class below a folder: name, base names, whether it is marked, and its properties and other members."""
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                marked = any(ast.unparse(each) == MARK for each in node.decorator_list)
                functions = [each for each in node.body if isinstance(each, ast.FunctionDef)]
                properties = {
                    each.name for each in functions if any("property" in ast.unparse(mark) for mark in each.decorator_list)
                }
                plain = {
                    each.target.id
                    for each in node.body
                    if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
                }
                plain |= {
                    name.id
                    for each in node.body
                    if isinstance(each, ast.Assign)
                    for name in each.targets
                    if isinstance(name, ast.Name)
                }
                members = properties | plain | {each.name for each in functions}
                yield (
                    node.name,
                    [ast.unparse(base).split(".")[-1].split("[")[0] for base in node.bases],
                    marked,
                    properties,
                    members,
                )


def overridden(folder):
    """Classes and the properties of a marked base class that they override without being marked."""
    found = list(classes(folder))
    named = {}
    for each in found:
        named.setdefault(each[0], []).append(each)  # some names stand for two classes
    faults = []
    for name, bases, marked, _, members in found:
        above, shadowed = list(bases), set()
        while above:
            for _, higher, base_marked, properties, _ in named.get(above.pop(), []):
                shadowed |= properties if base_marked else set()
                above += higher
        if not marked:
            faults += [f"{name}.{each}" for each in sorted(members & shadowed)]
    return faults


@pytest.mark.sampled(3)
def test_no_property_of_a_marked_class_is_overridden_by_an_unmarked_class():
    assert overridden(ROOT / "mpp_taichi") == []


@pytest.mark.parametrize("mark, faults", [("", ["Special.count"]), ("@ti.data_oriented\n", [])])
def test_a_planted_override_is_found(mark, faults, tmp_path):
    text = "@ti.data_oriented\nclass General:\n    @property\n    def count(self):\n        return 1\n\n"
    text += f"class Middle(General):\n    pass\n\n{mark}class Special(Middle):\n"
    text += "    @property\n    def count(self):\n        return 2\n"
    (tmp_path / "planted.py").write_text(text, encoding="utf-8")
    assert overridden(tmp_path) == faults
