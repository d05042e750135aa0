"""Components of one's own: folders of files, and forces that are written in a script or a notebook.

A folder has the folders of the package, `forces/`, `integrators/`, `quantities/` and so on, with one component in each file, by
the rules of component.py. Processes that a run starts find the folders by the environment variable MPP_TAICHI_COMPONENTS.
"""

import ast
import inspect
import os
import sys
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpp_taichi import component
from mpp_taichi.errors import ComponentError

_HEADER = '''"""A force of a script."""

import math

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import is_not_zero, parameter, parameter_vector, where, wide_number
from mpp_taichi.arithmetic.particle_update import separation, wide_position
from mpp_taichi.component import Particles, Vector, component, param
from mpp_taichi.forces._base import ExternalForce, PairForce
from mpp_taichi.forces._inverse_square import InverseSquareForce
from mpp_taichi.types import Template
'''
MODULES = ("math", "np", "numpy", "ti")
"""Modules whose functions a function that is a formula may call; the formula has them by their names alone."""
PLACES = ("x", "y", "z")


def add_components(folder: str | os.PathLike) -> None:
    """Let scenes name the components of a folder, of this process and of those that it starts.

    Raises:
        ComponentError: the folder or one of its files is no folder or file of components; the line names file and line.
    """
    path = Path(folder).resolve()
    if not path.is_dir():
        raise ComponentError(f"{folder}: no folder")
    files = [(kind, file) for kind in component.KINDS for file in sorted((path / kind).glob("[!_]*.py"))]
    if not files:
        raise ComponentError(f"{folder}: no components, must have files in {', '.join(f'{kind}/' for kind in component.KINDS)}")
    for kind, file in files:
        _check(kind, file)
    if path not in component.extra_folders:
        component.extra_folders.append(path)
    os.environ[component.FOLDERS_VARIABLE] = os.pathsep.join(map(str, component.extra_folders))


def _check(kind: str, file: Path) -> None:
    """Refuse a file that is no component, or that has the name of a component of the program."""
    if (component.PACKAGE_FOLDER / kind / file.name).is_file():
        raise ComponentError(f"{file}: {file.stem} is in {kind}/ of the program already, choose another name")
    try:
        declared = component.read_file(kind, file)
    except SyntaxError as error:
        raise ComponentError(f"{file}:{error.lineno or 1}: {error.msg}") from None
    except (TypeError, ValueError, UnicodeDecodeError) as error:
        raise ComponentError(f"{file}: {error}") from None
    if declared is None:
        raise ComponentError(f"{file}: no class {component.class_name_of(file.stem)} marked @component")


def force(made: Any) -> Any:
    """A force of one's own in a script or a notebook: a decorator of a function or of a class.

    A function returns a potential: of `r` the potential of a pair, of `x`, `y`, `z` the potential of one particle. It has one
    line, `return …`, which is a formula of a scene; its other parameters have numbers as defaults. Called with some of them, it
    gives an entry of `forces:`.

        @mpp.force
        def lennard_jones(r, eps=1.0, s=0.3):
            return 4 * eps * ((s / r) ** 12 - (s / r) ** 6)

        mpp.run({…, "forces": [lennard_jones(eps=2)]})

    A class is written like the class of a file in `forces/`, and is known by its name in small letters with underscores.

    Raises:
        ComponentError: the function is more than a formula, or the class is no force.
    """
    return _of_class(made) if isinstance(made, type) else _of_function(made)


def _of_function(function: Callable[..., Any]) -> Callable[..., dict[str, Any]]:
    name = function.__name__
    tree = ast.parse(_text_of(function)).body[0]
    assert isinstance(tree, ast.FunctionDef)
    body = [line for line in tree.body if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))]
    if len(body) != 1 or not isinstance(body[0], ast.Return) or body[0].value is None:
        raise ComponentError(f"{name}: a function that is a force has one line, return …, with the formula of its potential")
    formula = ast.unparse(_Bare().visit(body[0].value))
    numbers = {key: each.default for key, each in inspect.signature(function).parameters.items()}
    variables = [key for key, value in numbers.items() if value is inspect.Parameter.empty]
    defaults = {key: value for key, value in numbers.items() if key not in variables}
    kind = "pair" if variables[:1] == ["r"] else "external"

    def entry(**values: float) -> dict[str, Any]:
        if unknown := sorted(set(values) - set(defaults)):
            raise ComponentError(f"{name} has no parameter {unknown[0]}, it has {', '.join(defaults) or 'none'}")
        return {kind: {"name": name, "potential": formula, "parameters": defaults | values}}

    entry.__name__, entry.__doc__ = name, function.__doc__
    return entry


def _text_of(made: Any) -> str:
    """The source text of a function or of a class."""
    try:
        return textwrap.dedent(inspect.getsource(made))
    except (OSError, TypeError):
        told = "its source text cannot be read, as in an interactive Python; write it into a file or a notebook"
        raise ComponentError(f"{made.__name__}: {told}") from None


class _Bare(ast.NodeTransformer):
    """math.exp(x) as exp(x)."""

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """The name alone, where it is one of a module of functions."""
        if isinstance(node.value, ast.Name) and node.value.id in MODULES:
            return ast.Name(node.attr)
        return node


def _taken_from_script(made: type, text: str) -> list[str]:
    """Lines that define the names of its script which a class uses: what the script has imported, and its numbers."""
    script, lines = vars(sys.modules[made.__module__]), []
    for name in sorted({node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)} & set(script)):
        value = script[name]
        if inspect.ismodule(value):
            lines.append(f"import {value.__name__} as {name}\n")
        elif isinstance(value, (bool, int, float, str)):
            lines.append(f"{name} = {value!r}\n")
        else:
            home, known = getattr(value, "__module__", None), getattr(value, "__name__", "")
            if home in sys.modules and home != made.__module__ and getattr(sys.modules[home], known, None) is value:
                lines.append(f"from {home} import {known} as {name}\n")
    return lines


_scripts: list[Any] = []  # the folder with the classes of this process, which goes away with it


def _of_class(made: type) -> type:
    name = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in made.__name__).lstrip("_")
    if component.class_name_of(name) != made.__name__:
        raise ComponentError(f"{made.__name__} is no name of a force, such as {component.class_name_of(name)}")
    if not any(base.__module__.startswith("mpp_taichi.forces") for base in made.__mro__):
        raise ComponentError(
            f"{made.__name__} is no force, must be made of PairForce or ExternalForce, of mpp_taichi.forces._base"
        )
    if not _scripts:
        _scripts.append(tempfile.TemporaryDirectory(prefix="mpp_taichi_forces_"))
    folder = Path(_scripts[0].name)
    lines = _text_of(made).splitlines()
    begin = next(k for k, line in enumerate(lines) if line.startswith("class "))
    file = folder / "forces" / f"{name}.py"
    file.parent.mkdir(exist_ok=True)
    text = "\n".join(lines[begin:])
    head = [_HEADER, *_taken_from_script(made, text), "\n\n@component\n"]
    file.write_text("".join(head) + text + "\n", encoding="utf-8")
    component.forget(file)
    add_components(folder)
    return component.load("forces", name)
