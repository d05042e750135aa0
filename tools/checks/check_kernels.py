"""Linter for Taichi code: rules whose breach gives wrong numbers or confusing errors, and that no general linter knows.

    python tools/checks/check_kernels.py [FOLDER]

Prints `file:line: rule` for each breach; exit code 1 if there is any.
"""

import argparse
import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from mpp_taichi import component

ONLY_STARTER = "backends.py"
OWN_SUMS = ("integrators", "solvers")  # folders whose threads have a copy or a particle to themselves
FUNCTIONS = ("exp", "log", "pow", "sin", "cos", "tan", "atan2")
IN_SINGLE_ONLY = {f"{place}.{name}" for place in ("ti", "ti.math") for name in FUNCTIONS}
MAY_HAVE_THEM = {  # where such functions are computed, or no kernel is compiled for Vulkan in f64
    "rough_functions.py",
    "random_numbers.py",  # in f32 in every precision
    "harmonic_drive.py",  # refused there, as `takes_sine` says
    "_kepler.py",  # of wisdom_holman, which runs on the CPU only
    "merger.py",  # of merging, which runs on the CPU only
    "cell_grid.py",  # of the CPU; device_grid.py is for others
    "_roots.py",  # its quartics are of event_driven, which runs on the CPU only
    "tangent_meter.py",  # which has a logarithm for each device
}
FIELD_MAKERS = {"field", "Vector.field", "Matrix.field", "ndarray"}


def main() -> int:
    """Check every module of the package, or of the folder named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parents[2] / "mpp_taichi")
    folder = parser.parse_args().folder
    breaches = [breach for path in sorted(folder.rglob("*.py")) for breach in check(path)]
    sys.stdout.write("".join(f"{breach}\n" for breach in breaches))
    return 1 if breaches else 0


def check(path: Path) -> Iterator[str]:
    """Every breach in one file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    has_kernels = any(is_kernel(node) for node in ast.walk(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == "__future__" and has_kernels:
            yield f"{path}:{node.lineno}: a __future__ import turns kernel annotations into strings"
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "ti.init" and path.name != ONLY_STARTER:
            yield f"{path}:{node.lineno}: ti.init belongs in {ONLY_STARTER}"
        if is_kernel(node):
            yield from check_kernel(path, node)
            if path.parent.name in OWN_SUMS:
                yield from check_sums(path, node)
            if path.name not in MAY_HAVE_THEM and "views" not in path.parts:
                yield from check_functions(path, node)
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and makes_field(node.value):
            yield f"{path}:{node.lineno}: a field at module level starts a device at import"
    yield from check_component(path, tree)


def is_kernel(node: ast.AST) -> bool:
    """A function marked @ti.kernel or @ti.func."""
    return isinstance(node, ast.FunctionDef) and any(
        ast.unparse(mark) in ("ti.kernel", "ti.func") for mark in node.decorator_list
    )


def check_kernel(path: Path, kernel: ast.FunctionDef) -> Iterator[str]:
    """Rules for the inside of a kernel."""
    for node in ast.walk(kernel):
        if isinstance(node, ast.Compare) and any(is_self_comparison(node.left, other) for other in node.comparators):
            yield f"{path}:{node.lineno}: a comparison with itself is folded away; use ti.math.isnan"
        if isinstance(node, ast.Compare) and any(isinstance(op, ast.In | ast.NotIn) for op in node.ops):
            yield f"{path}:{node.lineno}: `in` does not work in a kernel"
        if isinstance(node, ast.Return) and node is not kernel.body[-1]:
            yield f"{path}:{node.lineno}: a kernel or func returns once, at its end"


def check_functions(path: Path, kernel: ast.FunctionDef) -> Iterator[str]:
    """Vulkan has exponentials, powers and angles in f32 only; Taichi ends the program where a kernel asks for f64."""
    for node in ast.walk(kernel):
        is_call = isinstance(node, ast.Call) and ast.unparse(node.func) in IN_SINGLE_ONLY
        is_power = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and not is_known(node)
        if is_power or (is_call and not is_in_single(node)):
            yield f"{path}:{node.lineno}: Vulkan computes this in f32 only; use arithmetic/rough_functions.py"


def is_known(power: ast.BinOp) -> bool:
    """Whether a power is known while the kernel is compiled, or is to a whole number, which is a product."""
    exponent = power.right.operand if isinstance(power.right, ast.UnaryOp) else power.right
    whole = isinstance(exponent, ast.Constant) and isinstance(exponent.value, int)
    return whole or isinstance(power.left, ast.Constant)


def is_in_single(call: ast.Call) -> bool:
    """Whether the argument is of f32 on every device."""
    return all(isinstance(each, ast.Call) and ast.unparse(each).endswith("ti.f32)") for each in call.args)


def check_sums(path: Path, kernel: ast.FunctionDef) -> Iterator[str]:
    """A sum into a field by `+=` is an atomic: slow in a loop over copies, and software Vulkan may leave `while` too early."""
    for node in ast.walk(kernel):
        if isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Add | ast.Sub) and is_field(node.target):
            yield f"{path}:{node.lineno}: `+=` on a field is an atomic; write field[i] = field[i] + value"


def is_field(target: ast.expr) -> bool:
    """An entry of a field of `state` or `self`."""
    while isinstance(target, ast.Subscript):
        target = target.value
        if isinstance(target, ast.Attribute) and ast.unparse(target).partition(".")[0] in ("state", "self"):
            return True
    return False


def is_self_comparison(left: ast.expr, right: ast.expr) -> bool:
    """`x == x`, which was meant to find NaN."""
    return not isinstance(left, ast.Constant) and ast.unparse(left) == ast.unparse(right)


def makes_field(value: ast.expr | None) -> bool:
    """A call of ti.field and its kin."""
    return isinstance(value, ast.Call) and ast.unparse(value.func).removeprefix("ti.") in FIELD_MAKERS


def check_component(path: Path, tree: ast.Module) -> Iterator[str]:
    """A component file holds one class, named like the file."""
    if path.parent.name not in component.KINDS or path.name.startswith("_"):
        return
    wanted = component.class_name_of(path.stem)
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    if [node.name for node in classes] != [wanted]:
        yield f"{path}:1: must hold exactly one class, {wanted}"
    elif "component" not in [ast.unparse(mark) for mark in classes[0].decorator_list]:
        yield f"{path}:{classes[0].lineno}: {wanted} is not marked @component"


if __name__ == "__main__":
    sys.exit(main())
