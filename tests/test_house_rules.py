"""The rules of CONVENTIONS.md that a machine can check."""

import ast
import builtins
import subprocess
import sys
from pathlib import Path

import pytest

from mpp_taichi import component

ROOT = Path(__file__).parents[1]


def run(*command):
    done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-3000:]


def test_ruff_finds_nothing():
    run("-m", "ruff", "check", "--no-cache", "mpp_taichi", "opencl", "tests", "tools")


def test_code_is_formatted():
    run("-m", "ruff", "format", "--no-cache", "--check", "mpp_taichi", "opencl", "tests", "tools")


def test_types_agree():
    run("-m", "mypy", "--no-incremental")


def test_layers_hold_and_no_import_runs_in_a_circle():
    run("-c", "import sys; from importlinter.cli import lint_imports_command as lint; sys.argv = ['lint-imports']; lint()")


def test_kernels_follow_their_rules():
    run("tools/checks/check_kernels.py")


@pytest.mark.parametrize(
    "fault",
    [
        "from __future__ import annotations\nimport taichi as ti\n@ti.func\ndef f(x):\n    return x\n",
        "import taichi as ti\nti.init()\n",
        "import taichi as ti\n@ti.kernel\ndef f(x: float) -> ti.i32:\n    return x != x\n",
        "import taichi as ti\nplaces = ti.field(ti.f32, 3)\n",
        "import taichi as ti\n@ti.func\ndef f(x):\n    if x > 0:\n        return 1\n    return 2\n",
        "import taichi as ti\n@ti.func\ndef f(state: ti.template()):\n    state.count[0] += 1\n",
        "import taichi as ti\n@ti.func\ndef f(x):\n    return ti.exp(x)\n",
        "import taichi as ti\n@ti.func\ndef f(x):\n    return x**1.5\n",
    ],
)
def test_the_kernel_linter_sees_each_fault(fault, tmp_path):
    (tmp_path / "solvers").mkdir()
    (tmp_path / "solvers" / "faulty.py").write_text(fault, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "tools/checks/check_kernels.py", str(tmp_path)], cwd=ROOT, capture_output=True, check=False
    )
    assert done.returncode == 1 and b"faulty.py:" in done.stdout


@pytest.mark.parametrize("kind", component.KINDS)
def test_every_component_file_declares_the_class_of_its_name(kind):
    assert component.names(kind)
    for name in component.names(kind):
        declared = component.declaration(kind, name)
        assert declared.class_name == component.load(kind, name).__name__
        assert declared.summary, f"{kind}/{name}.py has no docstring"
        for parameter in declared.parameters:
            assert parameter.help or parameter.unit, f"{kind}/{name}.py: {parameter.name} is not described"


@pytest.mark.parametrize("kind", component.KINDS)
def test_every_file_of_a_component_folder_holds_one_class_marked_and_named_like_the_file(kind):
    files = sorted((component.PACKAGE_FOLDER / kind).glob("[!_]*.py"))
    assert component.names(kind) == [path.stem for path in files]
    for path in files:
        assert marked_classes(path) == [component.class_name_of(path.stem)]
        assert path.read_text(encoding="utf-8").count("\nclass ") == 1, f"{path} holds another class"


def test_every_folder_that_holds_a_component_is_a_kind():
    holding = {path.parent for path in component.PACKAGE_FOLDER.rglob("*.py") if marked_classes(path)}
    assert holding == {component.PACKAGE_FOLDER / kind for kind in component.KINDS}


def marked_classes(path):
    classes = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.ClassDef)]
    return [node.name for node in classes if "component" in map(ast.unparse, node.decorator_list)]


class Classes:
    """Every class of the package with its bases, by the modules that they are imported from."""

    def __init__(self):
        self.nodes, self.names, self.trees = {}, {}, {}
        for path in sorted((ROOT / "mpp_taichi").rglob("*.py")):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            tree = self.trees[module] = ast.parse(path.read_text(encoding="utf-8"))
            names = self.names[module] = {}
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom):
                    names |= {each.asname or each.name: f"{node.module}.{each.name}" for each in node.names}
                elif isinstance(node, ast.ClassDef):
                    names[node.name] = f"{module}.{node.name}"
                    self.nodes[names[node.name]] = node

    def name(self, module, node):
        """The full name of what a node of a module stands for, if it is a class of the package, else the text."""
        text = ast.unparse(node).split("[")[0]
        return self.names[module].get(text, text)

    def bases(self, name):
        return [self.name(name.rpartition(".")[0], base) for base in self.nodes[name].bases] if name in self.nodes else []

    def is_exception(self, name):
        found = getattr(builtins, name, None)
        return isinstance(found, type) and issubclass(found, BaseException) or any(map(self.is_exception, self.bases(name)))

    def is_abstract(self, name):
        family = name.split(".")[-2].startswith("_")  # a file that no scene can name: what its components have in common
        return family or bool(
            {"ABC", "Protocol", "abc.ABC", "typing.Protocol"} & {base.split(".")[-1] for base in self.bases(name)}
        )


def test_a_class_is_abstract_or_final():
    """A class with subclasses is an ABC, a Protocol or in a private file, and is nowhere instantiated."""
    classes = Classes()
    wrong = []
    for name in classes.nodes:
        for base in classes.bases(name):
            if base in classes.nodes and not classes.is_exception(base) and not classes.is_abstract(base):
                wrong.append(f"{name} is derived from the concrete class {base}")
    parents = {base for name in classes.nodes for base in classes.bases(name) if not classes.is_exception(base)}
    for module, tree in classes.trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and (made := classes.name(module, node.func)) in parents & classes.nodes.keys():
                wrong.append(f"{module}:{node.lineno} makes an instance of {made}, which has subclasses")
    assert not wrong


def test_a_name_stands_for_one_class():
    """Components are left out: the class of a component is named after its file, whatever its kind."""
    marked, seen, twice = set(), {}, []
    for kind in component.KINDS:
        marked |= {component.class_name_of(name) for name in component.names(kind)}
    for path in sorted((ROOT / "mpp_taichi").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and node.name not in marked and seen.setdefault(node.name, path) != path:
                twice.append(f"{node.name} in {path.relative_to(ROOT)} and in {seen[node.name].relative_to(ROOT)}")
    assert not twice


def test_super_is_called_in_exceptions_only():
    classes = Classes()
    for name, node in classes.nodes.items():
        called = [each for each in ast.walk(node) if isinstance(each, ast.Call) and ast.unparse(each.func) == "super"]
        assert not called or classes.is_exception(name), name


def test_no_module_is_too_long():
    long = {
        path.name: lines
        for folder in ("mpp_taichi", "opencl", "tools")
        for path in (ROOT / folder).rglob("*.py")
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > 400
    }
    assert not long


def test_at_most_ten_modules_lie_at_the_top_of_the_package():
    """Every other module has a room, a folder whose name says what it is for."""
    assert len(list((ROOT / "mpp_taichi").glob("*.py"))) <= 10


def test_no_unsafe_calls():
    """No shell, no eval, no pickles, no unsafe YAML anywhere in the package."""
    unsafe = ("yaml.load(", " eval(", "os.system", "shell=True", "allow_pickle=True", "pickle.load")
    for path in (ROOT / "mpp_taichi").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not [call for call in unsafe if call in text], path


# --- laws that stand in one file each -----------------------------------------------------------------------------------


def added_softening(node):
    """A sum with ε², as in |d|² + ε²."""
    terms = (node.left, node.right) if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add) else ()
    return any(ast.unparse(term).split(".")[-1] == "softening_squared" for term in terms)


def inverse_of_a_root(node):
    """1.0 / ti.sqrt(…)."""
    quotient = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div)
    return quotient and ast.unparse(node.left) in ("1", "1.0") and ast.unparse(node.right).startswith("ti.sqrt(")


def drift_or_kick(node):
    """A function of Taichi with x + h v or v + h a, of fields or of arguments with these names."""
    if not (isinstance(node, ast.FunctionDef) and any(ast.unparse(mark).startswith("ti.") for mark in node.decorator_list)):
        return False
    return any(grows_by_its_rate(part) for part in ast.walk(node))


def grows_by_its_rate(node):
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)):
        return False
    if not (isinstance(node.right, ast.BinOp) and isinstance(node.right.op, ast.Mult)):
        return False
    rates = {"position": "velocity", "velocity": "acceleration"}
    factors = {name_of(node.right.left), name_of(node.right.right)}
    return any(name_of(node.left).endswith(name) and any(f.endswith(rate) for f in factors) for name, rate in rates.items())


def name_of(node):
    """The last name of an expression without its subscripts: `position` of state.position[i][k]."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return ast.unparse(node).split(".")[-1]


def least_iterations_of_a_thread(node):
    """q % grain, as in a loop of few heavy iterations; or the number 512 given to such a constant."""
    remainder = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod)
    if remainder and (name_of(node.right).lower() in ("grain", "cpu_grain", "smallest_block") or name_of(node.right) == "512"):
        return True
    named = isinstance(node, ast.Assign) and name_of(node.value) == "512"
    return named and any(word in name_of(node.targets[0]).lower() for word in ("grain", "smallest_block"))


LAWS = {
    "arithmetic/inverse_distance.py": (added_softening, inverse_of_a_root),
    "arithmetic/particle_update.py": (drift_or_kick,),
    "device/heavy_loops.py": (least_iterations_of_a_thread,),
}


def places_of(law, folder):
    """The files below a folder in which a law is written out."""
    found = set()
    for path in folder.rglob("*.py"):
        if any(law(node) for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))):
            found.add(path.relative_to(folder).as_posix())
    return found


@pytest.mark.parametrize(("home", "law"), [(home, law) for home, laws in LAWS.items() for law in laws])
def test_a_law_is_written_in_one_file(home, law):
    """The softened distance, drift and kick, and the grain of heavy loops: a copy elsewhere would go its own way."""
    assert places_of(law, ROOT / "mpp_taichi") == {home}


@pytest.mark.parametrize(
    ("law", "copy"),
    [
        (added_softening, "inverse = rsqrt(squared + group.softening_squared)"),
        (inverse_of_a_root, "inverse = 1.0 / ti.sqrt(d.dot(d) + 0.01)"),
        (drift_or_kick, "@ti.func\ndef f(i):\n    state.position[i] = state.position[i] + h * state.velocity[i]"),
        (drift_or_kick, "@ti.kernel\ndef f(h: float):\n    v = self.velocity[i][k] + self.acceleration[i][k] * h"),
        (least_iterations_of_a_thread, "if q % self.grain == 0:\n    chunk = q // self.grain"),
        (least_iterations_of_a_thread, "SMALLEST_BLOCK = 512"),
    ],
)
def test_a_planted_copy_of_a_law_is_found(law, copy, tmp_path):
    (tmp_path / "copy.py").write_text(copy + "\n", encoding="utf-8")
    assert places_of(law, tmp_path) == {"copy.py"}
