"""No file names a component of another file: the rest of the program reads the flags of components."""

import ast
import re

import pytest

from mpp_taichi import component

MAY_NAME_COMPONENTS = ("importers", "exporters", "compare", "verify")
"""Folders that translate between this program and others, whose forces and methods they match by name, or that hold scenes."""
UNMISTAKABLE_KINDS = ("forces", "integrators", "contacts")
"""Kinds whose names mean nothing else in this program.

Other kinds have names such as `body`, `link`, `box` or `position`, which are also keys of scenes, fields of a snapshot or
columns of a table; of generators, networks and walls only names with an underscore are looked for. Quantities and
diagnostics are left out, since `total_energy` is a column of a table as well.
"""
ORDINARY_WORDS = ("logarithmic", "pair", "external", "bond")
"""Forces whose names are also words for other things, such as a scale."""
COMPOUND_KINDS = ("generators", "networks", "walls")


def names_looked_for():
    """Every name that the rule covers, with the files of the components that have it."""
    homes = {}
    for kind in UNMISTAKABLE_KINDS + COMPOUND_KINDS:
        for name in component.names(kind):
            if (kind in UNMISTAKABLE_KINDS and name not in ORDINARY_WORDS) or "_" in name:
                homes.setdefault(name, set()).add(component.PACKAGE_FOLDER / kind / f"{name}.py")
    return homes


def strings_of(tree):
    """The string literals of a module, without its docstrings."""
    statements = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    strings = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return [node for node in strings if id(node) not in statements]


def named_in(text, names):
    """The components that a literal stands for: it is a name, a list of names, or a path such as `integrator.rk4`.

    A sentence that mentions a component as an example is not meant: some word of it is neither a name nor a key of scenes.
    """
    words = re.findall(r"\w+", text)
    known = {"integrator", "solver", *component.KINDS}
    return [word for word in words if word in names] if all(word in names or word in known for word in words) else []


def violations(files, homes):
    found = []
    for path in files:
        for node in strings_of(ast.parse(path.read_text(encoding="utf-8"))):
            for name in named_in(node.value, homes):
                if path not in homes[name]:
                    found.append(f"{path.name}:{node.lineno}: {name}")
    return found


@pytest.mark.sampled(3)
def test_no_component_is_named_outside_its_own_file():
    package = component.PACKAGE_FOLDER
    files = [path for path in package.rglob("*.py") if path.relative_to(package).parts[0] not in MAY_NAME_COMPONENTS]
    assert len(files) > 400
    assert not violations(files, names_looked_for())


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ('if spec.integrator.name == "leapfrog":', "leapfrog"),
        ('if spec.contacts.solver.name == "merging":', "merging"),
        ('ALLOWED = "leapfrog, yoshida4, rk4"', "yoshida4"),
        ('faults.add("integrator.event_driven")', "event_driven"),
        ('if wall.name == "periodic_box":', "periodic_box"),
        ('key = f"forces.linear_drag.{parameter}"', "linear_drag"),
    ],
)
def test_a_planted_name_is_found(line, name, tmp_path):
    planted = tmp_path / "planted.py"
    planted.write_text(line + ("\n    pass\n" if line.endswith(":") else "\n"), encoding="utf-8")
    assert f"planted.py:1: {name}" in violations([planted], names_looked_for())


@pytest.mark.parametrize(
    "line",
    [
        '"""leapfrog"""',
        'help = "path=value, as in integrator=rk4"',
        'row = {"position": 0, "time": 1, "total_energy": 2, "body": 3, "plane": 4}',
    ],
)
def test_docstrings_examples_and_ordinary_words_are_no_names(line, tmp_path):
    planted = tmp_path / "planted.py"
    planted.write_text(line + "\n", encoding="utf-8")
    assert not violations([planted], names_looked_for())


@pytest.mark.parametrize("kind", component.KINDS)
def test_flags_are_read_from_the_text_as_python_evaluates_them(kind):
    """The literal attributes of a class and of its base classes; a property replaces the literal value of a base class."""
    for name in component.names(kind):
        cls, flags = component.load(kind, name), component.declaration(kind, name).flags
        of_class = {key: getattr(cls, key) for key in flags if hasattr(cls, key)}  # a parameter is no attribute of its class
        assert {key: flags[key] for key in of_class} == of_class
        literal = {key for key in public(cls) if isinstance(getattr(cls, key), bool)}
        assert literal <= set(flags), f"{kind}/{name}.py: {literal - set(flags)}"


@pytest.mark.parametrize("kind", UNMISTAKABLE_KINDS)
def test_every_flag_of_a_component_is_declared_by_a_base_class_of_its_kind(kind):
    """A flag that no base class declares is a misspelling: nothing asks it."""
    classes = {name: component.load(kind, name) for name in component.names(kind)}
    declared = set().union(*(public(base) for cls in classes.values() for base in cls.__mro__[1:]))
    for name, cls in classes.items():
        own = {key for key in vars(cls) if key in public(cls) and isinstance(getattr(cls, key), bool)}
        assert own <= declared, f"{kind}/{name}.py: {own - declared}"


def public(cls):
    return {key for base in cls.__mro__ for key in vars(base) if not key.startswith("_")}
