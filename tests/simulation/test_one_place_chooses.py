"""One file decides how methods and contact solvers are launched; other files ask the launcher."""

import ast

from mpp_taichi import component
from mpp_taichi.component import PACKAGE_FOLDER
from mpp_taichi.device import backends

ASKED = {"launched_by", "launchers", "flies", "leads"}
"""Attributes of integrators and contact solvers that say how their steps are launched."""
FORMER = {"implicit", "own_state", "quickly_compiled", "writes_vectors", "keeps_force", "on_cpu_only"}
"""Flags that the attribute `launchers` replaces."""


def readers(names):
    """Files, and what they read of another object's attributes of these names."""
    for path in sorted(PACKAGE_FOLDER.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if any(f".{name}" in text for name in names) else ():
            if isinstance(node, ast.Attribute) and node.attr in names and ast.unparse(node.value) not in ("self", "method"):
                yield path.relative_to(PACKAGE_FOLDER).as_posix(), ast.unparse(node)


def test_one_file_reads_how_steps_are_launched():
    others = {(file, read) for file, read in readers(ASKED) if file != "step/choose.py"}
    assert others == {("integrators/_embedded.py", "Adaptive.launchers")}


def test_no_file_asks_what_the_launchers_know():
    assert [(file, read) for file, read in readers(FORMER) if "integrator" in read or "made" in read] == []


def test_every_method_and_contact_solver_names_launchers_that_are_there():
    backends.import_taichi()
    for name in component.names("integrators"):
        launchers = component.load("integrators", name).launchers
        for file in (launchers.serial, launchers.replicas, launchers.parallel):
            assert file in ("", "parallel") or (PACKAGE_FOLDER / "step" / f"{file}.py").is_file()
    for name in component.names("contacts"):
        assert (PACKAGE_FOLDER / "step" / f"{component.load('contacts', name).launched_by}.py").is_file()
