"""Components: one class per file, found by file name, described without being imported.

`forces/newtonian_gravity.py` holds `NewtonianGravity` and is called `newtonian_gravity` in a scene. Its parameters are
class attributes `name: type = param(default, …)`; a key that is a word of Python is written with a `_` at its end, `from_`.
The scene layer reads them from the source text with `ast`, so that a scene is checked, and the JSON Schema written, without
importing Taichi or any effect that the scene does not name.

Whatever the rest of the program must know of a component beforehand, the component says itself, by attributes with literal
values: its flags, such as `moves_forward_alone = True`. No other file names the component (tests/test_component_names.py).
"""

import ast
import importlib
import importlib.util
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from mpp_taichi.errors import ComponentError

PACKAGE_FOLDER = Path(__file__).parent
KINDS = ("generators", "networks", "forces", "contacts", "walls", "integrators", "quantities", "diagnostics")
"""Every kind of component, named as its folder is, in the order of the scene reference."""
# What the annotation of a parameter may say; the scene layer has one checked type for each.
PARAMETER_TYPES = (
    *("float", "int", "bool", "str", "Vector", "AxialVector", "Color", "Axes", "Shape"),
    *("Formula", "FormulaVector", "Law", "LawVector", "Numbers", "Groups"),
    *("Particle", "Particles", "Pair", "FourInRow", "Path", "Lattice", "ModeNumbers", "Points", "Turning"),
)
REQUIRED = object()


@dataclass(frozen=True)
class Parameter:
    """One parameter of a component, as the source file declares it."""

    name: str
    type: str
    default: Any = REQUIRED
    unit: str = ""
    help: str = ""
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None  # exclusive minimum
    choices: tuple = ()  # of words or whole numbers
    optional: bool = False  # absent means None
    strength: bool = False  # of a force: without it, where it is zero, there is no force
    slider: bool = False  # a number, or a vector, that formulas only calculate with: it may be moved while a scene runs
    names: tuple[str, ...] = ()  # names that a Formula or a Law may use


@dataclass(frozen=True)
class Declaration:
    """A component read from its source: the data about it that the scene layer needs."""

    kind: str
    name: str
    class_name: str
    base: str  # name of the base class, which tells the family (PairForce, Splitting, …)
    summary: str
    parameters: tuple[Parameter, ...]
    path: Path

    @property
    def flags(self) -> Mapping[str, Any]:
        """The attributes with literal values, of the class and of the classes that it derives from; read when first asked."""
        return _read_flags(self.path, self.class_name)


def param(default: Any = REQUIRED, **description: Any) -> Any:
    """Declare a parameter; keywords are the fields of `Parameter`. All arguments must be literals."""
    return Parameter(name="", type="", default=default, **description)


def component(cls: type) -> type:
    """Give a class whose attributes are `param(…)` an `__init__(**parameters)`; identity is equality.

    Kernels are cached by object, so two components must never compare equal because their numbers are.
    """
    declared = {key: value for key, value in vars(cls).items() if isinstance(value, Parameter)}

    def __init__(self: Any, **values: Any) -> None:
        unknown = set(values) - {key.removesuffix("_") for key in declared}
        if unknown:
            raise TypeError(f"{cls.__name__} has no parameter {sorted(unknown)}")
        for key, parameter in declared.items():
            value = values.get(key.removesuffix("_"), parameter.default)
            if value is REQUIRED:
                raise TypeError(f"{cls.__name__} needs {key.removesuffix('_')}")
            setattr(self, key, value)

    cls.__init__ = __init__  # type: ignore[misc]
    for key in declared:
        delattr(cls, key)
    return cls


def class_name_of(name: str) -> str:
    """`newtonian_gravity` → `NewtonianGravity`."""
    return "".join(part.capitalize() for part in name.split("_"))


def names(kind: str) -> list[str]:
    """Every component of a kind (one of `KINDS`): the files that hold a class of their name marked `@component`."""
    return sorted({path.stem for folder in folders(kind) for path in folder.glob("[!_]*.py") if _read(kind, path)})


def folders(kind: str) -> list[Path]:
    """The folders that are searched for components of a kind: the package itself, then `extra_folders`."""
    return [PACKAGE_FOLDER / kind, *(folder / kind for folder in extra_folders)]


FOLDERS_VARIABLE = "MPP_TAICHI_COMPONENTS"
extra_folders: list[Path] = [Path(each) for each in os.environ.get(FOLDERS_VARIABLE, "").split(os.pathsep) if each]
"""Folders outside the package that hold `forces/…`, `integrators/…`, for one's own components (scene/own_components.py)."""


def read_file(kind: str, path: Path) -> Declaration | None:
    """The component that a file declares; None where it declares no component of its name."""
    return _read(kind, path)


def forget(path: Path) -> None:
    """Read a file anew that has changed."""
    _read.cache_clear()
    _read_flags.cache_clear()
    _tree.cache_clear()
    for kind in KINDS:
        sys.modules.pop(f"mpp_taichi_extra.{kind}.{path.stem}", None)


def in_own_component(error: Exception) -> str:
    """The place and the last line of an error that Taichi reports of a file in `extra_folders`; empty for other errors."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip(" ^")]
    places = re.findall(r'File "([^"]+)", line (\d+)', str(error))
    own = [(file, line) for file, line in places if any(Path(file).is_relative_to(folder) for folder in extra_folders)]
    return f"{own[-1][0]}:{own[-1][1]}: {lines[-1]}" if own else ""


def find_file(kind: str, name: str) -> Path | None:
    """The file of a component, or None."""
    declared = _find(kind, name)
    return None if declared is None else declared.path


def declaration(kind: str, name: str) -> Declaration:
    """The declarations of a component, read from its source without importing it."""
    declared = _find(kind, name)
    if declared is None:
        raise KeyError(
            f"{kind} has no component {name!r}: no file {name}.py with a class {class_name_of(name)} marked @component"
        )
    return declared


def flag(kind: str, name: str, key: str, default: Any = None) -> Any:
    """The literal value that a component gives to an attribute, or `default` where it gives none."""
    return declaration(kind, name).flags.get(key, default)


def marked(kind: str, key: str) -> list[str]:
    """The components of a kind whose flag `key` is true, in alphabetical order."""
    return [name for name in names(kind) if flag(kind, name, key)]


def proposed(kind: str, purpose: str) -> list[str]:
    """The components of a kind whose `proposed_for` holds a purpose, which messages then name; the lowest order first."""
    found = [name for name in names(kind) if purpose in flag(kind, name, "proposed_for", ())]
    return sorted(found, key=lambda name: (flag(kind, name, "order", 0), name))


@contextmanager
def files_stay() -> Iterator[None]:
    """A block in which no component is added or changed, so that each is looked up once: the members of a sweep ask often."""
    global _looked_up
    before, _looked_up = _looked_up, cache(_search)
    try:
        yield
    finally:
        _looked_up = before


_looked_up: Callable[[str, str], "Declaration | None"] | None = None


def _find(kind: str, name: str) -> Declaration | None:
    return _search(kind, name) if _looked_up is None else _looked_up(kind, name)


def _search(kind: str, name: str) -> Declaration | None:
    for folder in folders(kind):
        path = folder / f"{name}.py"
        if name.isidentifier() and not name.startswith("_") and path.is_file() and (declared := _read(kind, path)):
            return declared
    return None


@cache
def _read(kind: str, path: Path) -> Declaration | None:
    """The component that a file declares; None where it declares no component."""
    tree = _tree(path)
    wanted = class_name_of(path.stem)
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == wanted and "component" in map(ast.unparse, node.decorator_list):
            found = tuple(p for statement in node.body if (p := _read_parameter(statement)) is not None)
            base = ast.unparse(node.bases[0]) if node.bases else ""
            return Declaration(kind, path.stem, wanted, base, ast.get_docstring(node) or "", found, path)
    return None


@lru_cache(maxsize=32)  # a class and its flags are often read one after the other; all trees would take tens of megabytes
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def _read_parameter(statement: ast.stmt) -> Parameter | None:
    if not isinstance(statement, ast.AnnAssign) or not isinstance(statement.value, ast.Call):
        return None
    call = statement.value
    if not (isinstance(call.func, ast.Name) and call.func.id == "param" and isinstance(statement.target, ast.Name)):
        return None
    annotation = ast.unparse(statement.annotation)
    place = f"line {statement.lineno}: parameter {statement.target.id}"
    if annotation not in PARAMETER_TYPES:
        raise TypeError(f"{place}: type {annotation} is none of {', '.join(PARAMETER_TYPES)}")
    known = [each.name for each in fields(Parameter) if each.name not in ("name", "type", "default")]
    if unknown := [each.arg for each in call.keywords if each.arg not in known]:
        raise TypeError(f"{place}: param knows no {unknown[0]}, but {', '.join(known)}")
    keywords = {keyword.arg: _literal(keyword.value) for keyword in call.keywords if keyword.arg}
    default = _literal(call.args[0]) if call.args else REQUIRED
    return Parameter(name=statement.target.id.removesuffix("_"), type=annotation, default=default, **keywords)


def _literal(value: ast.expr) -> Any:
    """A value of `param`, which is read without running the file."""
    try:
        return ast.literal_eval(value)
    except ValueError:
        raise ValueError(
            f"line {value.lineno}: {ast.unparse(value)} must be written out, as a number, a text or None"
        ) from None


@cache
def _read_flags(path: Path, class_name: str) -> Mapping[str, Any]:
    """The attributes of a class that have literal values, read from its file and from the files of its base classes."""
    tree = _tree(path)
    found = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == class_name)
    flags: dict[str, Any] = {}
    for base in map(ast.unparse, found.bases):
        home = path if any(isinstance(node, ast.ClassDef) and node.name == base for node in tree.body) else _home(tree, base)
        flags |= _read_flags(home, base) if home is not None else {}
    for statement in found.body:
        for name, value in _assigned(statement):
            flags.pop(name, None)  # a property, say, replaces the literal value of a base class
            if value is not None:
                try:
                    flags[name] = ast.literal_eval(value)
                except (ValueError, TypeError):  # an expression, which only Python can evaluate
                    continue
    return flags


def _assigned(statement: ast.stmt) -> list[tuple[str, ast.expr | None]]:
    """The names that a statement of a class body binds, each with the expression that gives its value, if there is one."""
    if isinstance(statement, ast.FunctionDef):
        return [(statement.name, None)]
    if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
        return [(statement.target.id, statement.value)]
    if isinstance(statement, ast.Assign):
        alone = len(statement.targets) == 1 and isinstance(statement.targets[0], ast.Name)
        bound = [node.id for target in statement.targets for node in ast.walk(target) if isinstance(node, ast.Name)]
        return [(name, statement.value if alone else None) for name in bound]
    return []


def _home(tree: ast.Module, class_name: str) -> Path | None:
    """The file of this package from which a module imports a class; None for a class from elsewhere."""
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module and any(alias.name == class_name for alias in node.names):
            package, *parts = node.module.split(".")
            path = PACKAGE_FOLDER.joinpath(*parts).with_suffix(".py")
            return path if package == PACKAGE_FOLDER.name and path.is_file() else None
    return None


def load(kind: str, name: str) -> type:
    """Import one component and return its class. This is the only place that imports components."""
    path = declaration(kind, name).path
    if path.is_relative_to(PACKAGE_FOLDER):
        module = importlib.import_module(f"mpp_taichi.{kind}.{name}")
    else:
        module = _import_file(f"mpp_taichi_extra.{kind}.{name}", path)
    return getattr(module, class_name_of(name))


def _import_file(module_name: str, path: Path) -> Any:
    if module_name not in sys.modules:
        specification = importlib.util.spec_from_file_location(module_name, path)
        assert specification is not None and specification.loader is not None
        module = importlib.util.module_from_spec(specification)
        sys.modules[module_name] = module
        try:
            specification.loader.exec_module(module)
        except Exception as error:
            del sys.modules[module_name]
            lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
            line = lines[-1] if lines else getattr(error, "lineno", None) or 1
            raise ComponentError(f"{path}:{line}: {type(error).__name__}: {error}") from error
    return sys.modules[module_name]


def build(kind: str, name: str, parameters: dict[str, Any]) -> Any:
    """Import a component and make an instance."""
    make: Callable[..., Any] = load(kind, name)
    return make(**parameters)


# The names a parameter's annotation may use in a component file, so that the file also reads well to Python.
Vector = tuple  # three numbers
AxialVector = tuple  # three numbers along the axis of a turn or a magnetic field; in two dimensions only the third acts
Color = tuple  # red, green, blue in 0…1
Formula = Any  # number, or an expression over per-particle names, evaluated by the generator
FormulaVector = tuple  # three Formulas
Law = str  # formula of a force, over `names`, the numbers of the force, and the constants of the scene
LawVector = tuple  # a Law for each axis
Numbers = dict  # numbers by the names that a Law gives them
Particle = int  # index of a particle, given as an index or a name
Particles = tuple  # a particle or a whole group: first index, count; given by index or name
Pair = tuple  # two different Particles
FourInRow = tuple  # four Particles of one count: of each the first particle, then the second, … are four in a row
Groups = tuple  # two Particles, each (first, count), which may be the same
Axes = tuple  # three booleans, one for each axis
Shape = tuple  # counts along the axes
Lattice = str  # name of a lattice
Points = tuple  # vectors, any number of them
Turning = tuple  # an angle as a Law of the time, a point, and an axis
ModeNumbers = tuple  # numbers of a mode of the lattice that the parameter `of` names
