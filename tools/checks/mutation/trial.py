"""A copy of the source tree in which mutants are tried, one at a time."""

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from mutation.source import Mutant

HERE = Path(__file__).parent
LEFT_OUT = (".git", ".venv", "out", "dist", "__pycache__", ".*_cache", ".hypothesis")
SLACK = 90.0  # seconds that the tests may take beyond their time: starting, and the test that is running then


@dataclass
class Verdict:
    """What the tests made of one mutant."""

    outcome: str  # killed, survived, unfinished (none failed of the tests that had time to run) or timeout
    test: str = ""
    reason: str = ""
    passed: int = 0


class Tree:
    """A copy of the source tree. The copy is first on the path of every Python that a trial starts."""

    def __init__(self, root: Path, folder: Path) -> None:
        """Copy the tree `root` into `folder`."""
        self.root, self.folder = folder.resolve() / "tree", folder
        shutil.copytree(root, self.root, ignore=shutil.ignore_patterns(*LEFT_OUT), symlinks=True)
        self.durations: dict[str, float] = {}
        self._sound: dict[str, bool] = {}

    def judge(self, mutant: Mutant, tests: list[Path], seconds: float) -> Verdict:
        """Run the tests with the mutant in place until the first fails, or until the time is up.

        A test that fails counts if it passes without the mutant; else the others go on without it.
        """
        left_out: list[str] = []
        while True:
            with self._mutated(mutant):
                found = self._run(mutant.path.parts[0], [str(path) for path in tests], seconds, left_out)
            if found is None:
                return Verdict("timeout")
            if found["failed"] is None and found["passed"] == 0:
                raise SystemExit(f"{mutant.path}: no test ran of {', '.join(map(str, tests)) or 'no file'}\n{found['said']}")
            if found["failed"] is None:
                return Verdict("survived" if found["finished"] else "unfinished", passed=found["passed"])
            if self.is_sound(mutant.path.parts[0], found["failed"], seconds):
                return Verdict("killed", found["failed"], found["reason"], found["passed"])
            left_out.append(found["failed"])

    def is_sound(self, package: str, test: str, seconds: float) -> bool:
        """Whether a test, or a file of tests, passes without any mutant."""
        if test not in self._sound:
            found = self._run(package, [test], seconds)
            self._sound[test] = found is not None and found["failed"] is None
        return self._sound[test]

    def _mutated(self, mutant: Mutant):
        return _Replaced(self.root / mutant.path, mutant)

    def _run(self, package: str, tests: list[str], seconds: float, left_out: list[str] | None = None) -> dict | None:
        """What the plugin wrote; None where the run had to be ended from outside."""
        record = self.folder / "trial.json"
        order = {"root": str(self.root), "package": package, "seconds": seconds, "durations": self.durations}
        record.write_text(json.dumps(order), encoding="utf-8")
        words = [sys.executable, "-m", "pytest", "-p", "trial_plugin", "-p", "no:cacheprovider", "-x", "-q", "--durations=0"]
        words += ["-n", "0"] if importlib.util.find_spec("xdist") else []
        words += [word for test in left_out or () for word in ("--deselect", test)]
        path = os.pathsep.join([str(self.root), str(HERE)])
        environment = os.environ | {"PYTHONPATH": path, "MUTATION_TRIAL": str(record), "PYTHONHASHSEED": "0"}
        begun = subprocess.Popen(
            [*words, *tests],
            cwd=self.root,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            said, _ = begun.communicate(timeout=seconds + SLACK)
        except subprocess.TimeoutExpired:
            os.killpg(begun.pid, signal.SIGKILL)
            begun.communicate()
            return None
        found = json.loads(record.read_text(encoding="utf-8"))
        if "finished" not in found:  # pytest ended before its plugin could write: a crash, or a tree that cannot be tested
            if begun.returncode >= 0:
                raise SystemExit(f"the tests did not run:\n{said[-2000:]}")
            return {"failed": tests[0], "reason": f"ended by signal {-begun.returncode}", "passed": 0, "finished": True}
        self.durations |= found["durations"]
        return found | {"said": said[-2000:]}


class _Replaced:
    """The text of a module with the mutant while it is open, and as it was after it."""

    def __init__(self, path: Path, mutant: Mutant) -> None:
        self.path, self.mutant = path, mutant

    def __enter__(self) -> None:
        self.text = self.path.read_text(encoding="utf-8")
        self._write(self.mutant.apply(self.text))

    def __exit__(self, *_) -> None:
        self._write(self.text)

    def _write(self, text: str) -> None:
        self.path.write_text(text, encoding="utf-8")
        # Python takes compiled modules for current by whole seconds and length.
        for compiled in (self.path.parent / "__pycache__").glob(f"{self.path.stem}.*.pyc"):
            compiled.unlink()
