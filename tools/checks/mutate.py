"""Do the tests notice a small error in the code? Mutants of a random sample are planted one at a time, and the tests are run.

    python tools/checks/mutate.py [--package mpp_taichi/recorders] [--count 20] [--seed N] [--share 1/2] [--seconds 60]
                                  [--operators own] [--tests FILE …] [--root DIR] [--json FILE] [--list]

A mutant is one change of some characters: another operator, comparison, number or truth value (the operators of cosmic-ray:
`pip install "mpp-taichi[mutation]"`), or a factor 2, a sign, two arguments or columns that have changed places, the field or
index beside the right one, a loop or slice that ends too early, a keyword or a statement that is forgotten (this tool's own,
`--operators own`). None is drawn in docstrings, annotations, imports, refusals, texts of messages and calls of the log, and
none that Python cannot compile. A module is drawn by its length, then a line, an operator, and a mutant.

The tests run in a copy of the source tree, which is first on the path of every Python that they start; a run in which another
package would be imported ends at once. Which tests run, in this order, until the first fails or `--seconds` are over:

1. test files that import the module, and for a component the test of the schema, which is made of its declaration;
2. files that name the component, or a class or function of the module, first those of the room of the tests that has the name
   of the module's package;
3. the other files of this room, then files that import another module of the same package.

`killed`: a test failed that passes without the mutant. `survived`: all these tests passed. `unfinished`: those passed that had
time to run. `timeout`: the tests did not end. So a survivor survived these tests; another test may catch it. Mutants that
change nothing are listed in tools/checks/mutation/equivalent_mutants.yaml by file, line and reason, and are not run.

The exit code is 1 where a mutant survived.
"""

import argparse
import difflib
import json
import platform
import sys
import tempfile
import time
from collections import Counter
from datetime import date
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from mutation.chosen_tests import chosen_tests  # noqa: E402
from mutation.drawing import draw  # noqa: E402
from mutation.equivalent import Equivalents  # noqa: E402
from mutation.source import Mutant, Source  # noqa: E402
from mutation.trial import Tree, Verdict  # noqa: E402

ROOT = Path(__file__).parents[2]
OUTCOMES = ("killed", "timeout", "survived", "unfinished", "equivalent")


def modules(root: Path, package: Path) -> list[Path]:
    """The modules of a package, or the one module, below the root of the source tree."""
    found = [root / package] if package.suffix == ".py" else sorted((root / package).rglob("*.py"))
    return [path.relative_to(root) for path in found if path.name != "__init__.py"]


def difference(source: Source, mutant: Mutant) -> str:
    """The change as a diff without context."""
    before, after = source.text.splitlines(), mutant.apply(source.text).splitlines()
    lines = list(difflib.unified_diff(before, after, lineterm="", n=0))[3:]
    return "\n".join(f"    {line}" for line in lines)


def parse(arguments):
    """The options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--package", action="append", type=Path, help="a folder or a module, as often as wanted; absent: all")
    parser.add_argument("--count", type=int, default=20, help="mutants that are drawn of each package")
    parser.add_argument("--seed", type=int, default=date.today().toordinal(), help="absent: the number of the day")
    parser.add_argument("--share", default="1/1", help="k/n: of n equal shares of the sample, only the k-th")
    parser.add_argument("--seconds", type=float, default=60.0, help="for the tests of one mutant")
    parser.add_argument("--operators", choices=("all", "own"), default="all")
    parser.add_argument("--tests", nargs="+", type=Path, help="these test files instead of those of the module")
    parser.add_argument("--root", type=Path, default=ROOT, help="the source tree; absent: this one")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--list", action="store_true", help="print the mutants and run nothing")
    found = parser.parse_args(arguments)
    if found.operators == "all":
        try:
            import cosmic_ray  # noqa: F401
        except ModuleNotFoundError:
            parser.error('cosmic-ray is not installed: pip install "mpp-taichi[mutation]", or take --operators own')
    return found


def sample(asked, root: Path) -> list[tuple[str, Mutant]]:
    """The mutants of the tree `root` that are asked for, each with the package from which it was drawn."""
    library = asked.operators == "all"
    found = []
    for package in asked.package or [Path("mpp_taichi")]:
        drawn = draw(root, modules(root, package), asked.count, asked.seed, library=library)
        found += [(package.as_posix(), mutant) for mutant in drawn]
    part, parts = map(int, asked.share.split("/"))
    return found[part - 1 :: parts]


def main(arguments=None) -> int:
    """Draw, try and tell."""
    asked = parse(arguments)
    rows: list[dict] = []
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        tree = Tree(asked.root.resolve(), Path(folder))
        root = tree.root  # all is read from the copy: the tree itself may change meanwhile
        listed = root / "tools" / "checks" / "mutation" / "equivalent_mutants.yaml"
        equivalents = Equivalents(listed) if listed.exists() else None
        for part, mutant in sample(asked, root):
            source = Source(root, mutant.path)
            reason = equivalents.reason(source, mutant) if equivalents else None
            begin = time.monotonic()
            if asked.list:
                verdict = Verdict("listed")
            elif reason is not None:
                verdict = Verdict("equivalent", reason=reason)
            else:
                verdict = tree.judge(mutant, asked.tests or chosen_tests(root, mutant.path), asked.seconds)
            row = {"package": part, "file": mutant.path.as_posix(), "line": mutant.line, "operator": mutant.operator}
            row |= vars(verdict) | {"seconds": round(time.monotonic() - begin, 1), "diff": difference(source, mutant)}
            rows.append(row)
            tell(row)
            if asked.json:
                asked.json.write_text(json.dumps(report(asked, rows), indent=1), encoding="utf-8")
    if not asked.list:
        print("\n" + "\n".join(table(rows)))
    return int(any(row["outcome"] in ("survived", "unfinished") for row in rows))


def tell(row) -> None:
    """One mutant on the screen; with its diff where no test caught it."""
    by = f"  {row['test']}" if row["test"] else ""
    print(f"{row['outcome']:10} {row['file']}:{row['line']}  {row['operator']}  {row['seconds']} s{by}", flush=True)
    if row["outcome"] not in ("killed", "equivalent"):
        print(row["diff"], flush=True)


def report(asked, rows) -> dict:
    """All rows, and what is needed to draw them again."""
    machine = {"system": platform.platform(), "python": platform.python_version(), "day": date.today().isoformat()}
    return {"machine": machine, "seed": asked.seed, "count": asked.count, "share": asked.share, "mutants": rows}


def table(rows) -> list[str]:
    """How many mutants of each package had each outcome."""
    packages = dict.fromkeys(row["package"] for row in rows)
    lines = ["| package | " + " | ".join(OUTCOMES) + " |", "|---" * (len(OUTCOMES) + 1) + "|"]
    for package in packages:
        counts = Counter(row["outcome"] for row in rows if row["package"] == package)
        lines.append(f"| {package} | " + " | ".join(str(counts[outcome]) for outcome in OUTCOMES) + " |")
    return lines


if __name__ == "__main__":
    sys.exit(main())
