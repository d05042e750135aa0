"""The tool that plants mutants: which it draws, and that it tells killed mutants from survivors."""

import ast
import json
import subprocess
import sys

import pytest
from conftest import ROOT

sys.path[:0] = [str(ROOT / "tools" / "checks")]

from mutation.chosen_tests import chosen_tests  # noqa: E402
from mutation.drawing import candidates, draw  # noqa: E402
from mutation.equivalent import Equivalents, changed_line  # noqa: E402
from mutation.source import Mutant, Source  # noqa: E402

MODULE = '''"""A module with 2 texts: 1.5 * 3."""

import math

__all__ = ["mean_square"]
LIMIT: "float * 2.5" = 0.5  # 3 * 4


def mean_square(first: "int - 1", second) -> "1 + 1":
    """Mean of the squares, (a² + b²) / 2 ∈ ℝ."""
    if second < 0.0:
        raise ValueError(f"{second + 1} is below 0 by {0 - second}")
    log.warning("%s", first - second)
    é = (first * first + second * second) / 2
    return é


def cached(state):
    """A field of the state, renewed."""
    state.total = 3.0
    state.total = state.rows[0] + state.rows[-1]
    return math.hypot(state.total, state.rows[1])
'''
OPEN_LINES = {"LIMIT", "if second", "é =", "state.total = 3.0", "state.total = state", "return math"}


@pytest.fixture
def tree(tmp_path):
    """A source tree of one package with a test that is good and a test that is bad."""
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tests" / "tiny").mkdir(parents=True)
    (tmp_path / "tiny" / "__init__.py").write_text("")
    (tmp_path / "tiny" / "squares.py").write_text(
        MODULE.replace('    log.warning("%s", first - second)\n', ""), encoding="utf-8"
    )
    given = "from tiny.squares import mean_square\n\n\ndef test_it():\n    assert mean_square"
    (tmp_path / "tests" / "tiny" / "test_good.py").write_text(f"{given}(3.0, 1.0) == 5.0 and mean_square(0, 0) == 0\n")
    (tmp_path / "tests" / "tiny" / "test_bad.py").write_text(f"{given}(0.0, 0.0) == 0.0\n")
    return tmp_path


def source_of(folder, text):
    (folder / "module.py").write_text(text, encoding="utf-8")
    return Source(folder, folder / "module.py")


def every_mutant(source, *, library):
    makers = [
        make for by_operator in candidates(source, library=library).values() for row in by_operator.values() for make in row
    ]
    return [mutant for mutant in (make() for make in makers) if mutant is not None]


@pytest.mark.parametrize("library", [False, True], ids=["own", "with the library"])
def test_no_mutant_is_in_texts_annotations_refusals_or_the_log(tmp_path, library):
    if library:
        pytest.importorskip("cosmic_ray", reason="cosmic-ray is not installed")
    source = source_of(tmp_path, MODULE)
    found = every_mutant(source, library=library)
    lines = {source.lines[mutant.line - 1].strip() for mutant in found}
    begun = {begin for begin in OPEN_LINES if any(line.startswith(begin) for line in lines)}
    assert begun == (OPEN_LINES if library else OPEN_LINES - {"if second"})  # comparisons are the library's
    assert all(line.startswith(tuple(OPEN_LINES)) for line in lines)
    for mutant in found:
        first, last = source.lines[mutant.line - 1], mutant.apply(source.text).splitlines(keepends=True)[mutant.line - 1]
        assert first != last and "float * 2.5" in mutant.apply(source.text) and "# 3 * 4" in mutant.apply(source.text)


def test_each_kind_of_error_is_made(tmp_path):
    """One line for each, with what may become of it; the letters before it take more than a byte each."""
    text = (
        "é = [a * b for a in range(n)]\né = f(x, y) + rows[i] - rows[j]\né = [h.position, h.charge][-1]\nh.total += 1\n"
        'é = row["momentum"] + row["mass"]\né = np.std(x, ddof=1) if a and b else rows[2:n]\nabs(é)\né = 0.5\n'
    )
    source = source_of(tmp_path, text)
    made = {mutant.apply(text).splitlines()[mutant.line - 1] for mutant in every_mutant(source, library=False)}
    for expected in (
        "é = [(2 * (a * b)) for a in range(n)]",
        "é = [(-(a * b)) for a in range(n)]",
        "é = [a * b for a in range((n) - 1)]",
        "é = [a * b for a in range(1, n)]",
        "é = f(y, x) + rows[i] - rows[j]",
        "é = f(x, y) + rows[j] - rows[j]",
        "é = [h.charge, h.position][-1]",
        "é = [h.position, h.mass][-1]",
        "é = [h.position, h.charge][0]",
        "pass",
        "é = row['mass'] + row[\"mass\"]",
        "é = np.std(x) if a and b else rows[2:n]",
        "é = np.var(x, ddof=1) if a and b else rows[2:n]",
        "é = np.std(x, ddof=1) if a else rows[2:n]",
        "é = np.std(x, ddof=1) if a and b else rows[2:(n) + 1]",
        "(é)",
        "é = (1.1 * 0.5)",
    ):
        assert expected in made


def test_a_seed_draws_the_same_mutants_again_and_each_once(tree):
    paths = [(tree / "tiny" / "squares.py").relative_to(tree)]
    first = draw(tree, paths, 12, 5, library=False)
    assert first == draw(tree, paths, 12, 5, library=False) != draw(tree, paths, 12, 6, library=False)
    assert len({(mutant.start, mutant.end, mutant.replacement) for mutant in first}) == 12
    for mutant in first:
        ast.parse(mutant.apply(Source(tree, mutant.path).text))
    assert len(draw(tree, paths, 10_000, 5, library=False)) < 200  # it ends where there are no more


@pytest.mark.parametrize("tests, outcomes", [("test_good.py", {"killed"}), ("test_bad.py", {"survived"})])
@pytest.mark.sampled(3)
def test_killed_and_survived_are_told_rightly(tree, tests, outcomes):
    """The possible mutants are a factor and a sign of the mean square: the good test sees both, the bad test neither."""
    (tree / "tiny" / "squares.py").write_text('"""One."""\n\n\ndef mean_square(a, b):\n    return (a * a + b * b) / 2\n')
    found = tree / "found.json"
    words = ["--root", tree, "--package", "tiny", "--count", "1", "--operators", "own", "--tests", f"tests/tiny/{tests}"]
    command = [sys.executable, ROOT / "tools" / "checks" / "mutate.py", *words, "--json", found, "--seed", "1"]
    before = (tree / "tiny" / "squares.py").read_text()
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    rows = json.loads(found.read_text())["mutants"]
    assert len(rows) == 1 and {row["outcome"] for row in rows} == outcomes, done.stdout + done.stderr
    assert done.returncode == ("survived" in outcomes)
    assert ("+    return" in done.stdout) == ("survived" in outcomes)  # the diff of a survivor is printed
    assert (tree / "tiny" / "squares.py").read_text() == before


def test_tests_that_import_a_module_come_before_those_of_its_room(tree):
    (tree / "tests" / "tiny" / "test_another.py").write_text("x = 1\n")
    (tree / "tests" / "test_elsewhere.py").write_text("from support import mean_square\n")
    (tree / "tests" / "test_nothing.py").write_text("x = 1\n")
    module = (tree / "tiny" / "squares.py").relative_to(tree)
    assert [path.name for path in chosen_tests(tree, module)] == [
        "test_bad.py",
        "test_good.py",
        "test_elsewhere.py",
        "test_another.py",
    ]


def test_an_equivalent_mutant_is_known_by_its_line_and_judged_anew_when_the_line_changes(tree):
    source = Source(tree, (tree / "tiny" / "squares.py").relative_to(tree))
    start = source.text.index("0.5")
    mutant = Mutant(source.path, source.line_of(start), "number", start, start + 3, "0.75")
    line, becomes = changed_line(source, mutant)
    assert becomes.startswith('LIMIT: "float * 2.5" = 0.75')
    listed = tree / "equivalent.yaml"
    entry = {"file": "tiny/squares.py", "line": line, "becomes": becomes, "reason": "nothing reads it"}
    listed.write_text(json.dumps([entry]), encoding="utf-8")
    assert Equivalents(listed).reason(source, mutant) == "nothing reads it"
    listed.write_text(json.dumps([entry | {"line": line + " "}]), encoding="utf-8")
    assert Equivalents(listed).reason(source, mutant) is None
    assert Equivalents(listed).stale(tree)


def test_every_listed_mutant_has_its_line_still():
    assert Equivalents(ROOT / "tools" / "checks" / "mutation" / "equivalent_mutants.yaml").stale(ROOT) == []
