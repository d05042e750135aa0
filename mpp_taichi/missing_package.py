"""Packages that this Python lacks: one line with the package, the Python and the cure. It imports no package itself.

The usual reason is a Python outside of the virtual environment in which the program was installed, so the line names the
environment where there is one.
"""

import contextlib
import importlib.util
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from mpp_taichi.errors import MissingPackageError

# Modules of the packages that the program needs, and the names that pip knows the packages by.
PACKAGES = {
    "taichi": "taichi",
    "numpy": "numpy",
    "yaml": "pyyaml",
    "pydantic": "pydantic",
    "rich": "rich",
    "PIL": "pillow",
    "imageio_ffmpeg": "imageio-ffmpeg",
    "pyopencl": "pyopencl",
    "sympy": "sympy",
}
PROJECT = Path(__file__).parents[1]
PROGRAM_INSIDE = ("Scripts", "python.exe") if os.name == "nt" else ("bin", "python")
OWN_NAME = "mpp_taichi"


@contextlib.contextmanager
def missing_packages_named() -> Iterator[None]:
    """Turn the failed import of a package into a line for the user.

    Raises:
        MissingPackageError: a package is not there.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        name = error.name or ""
        # A missing part of a package that is there, of this program or of Python is no missing package.
        if not name or "." in name or name.startswith(OWN_NAME) or name in sys.stdlib_module_names:
            raise
        raise MissingPackageError(missing_line(name)) from error


def missing_line(name: str, places: Sequence[Path] | None = None) -> str:
    """The message about the module `name` that cannot be found; `places` are the folders that may hold a `.venv`."""
    absent = [PACKAGES.get(name, name)]
    absent += [package for module, package in PACKAGES.items() if module != name and is_absent(module)]
    packages = f"package{'s' if len(absent) > 1 else ''} {', '.join(absent)}"
    return f"this Python, {sys.executable}, does not have the {packages}; {_cure(absent, places or (Path.cwd(), PROJECT))}"


def is_absent(module: str) -> bool:
    """Whether this Python finds no module of this name."""
    try:
        return importlib.util.find_spec(module) is None
    except (ImportError, ValueError):
        return True


def _cure(absent: Sequence[str], places: Sequence[Path]) -> str:
    for place in places:
        environment = place / ".venv"
        python = environment.joinpath(*PROGRAM_INSIDE)
        if python.is_file() and python != Path(sys.executable) and environment != Path(sys.prefix):
            shown = python.relative_to(Path.cwd()) if python.is_relative_to(Path.cwd()) else python
            return f"activate the environment, or run: {shown} -m mpp_taichi …"
    source = str(PROJECT) if (PROJECT / "pyproject.toml").is_file() else " ".join(absent)
    return f"activate the environment that has it, or run: {sys.executable} -m pip install {source}"
