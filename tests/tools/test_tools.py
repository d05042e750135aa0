"""Every tool starts, and finds the files beside it."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

TOOLS = Path(__file__).parents[2] / "tools"
PROGRAMS = sorted(path for path in TOOLS.rglob("*.py") if '__name__ == "__main__"' in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_tool_says_its_options(path):
    done = subprocess.run([sys.executable, str(path), "--help"], capture_output=True, text=True, cwd=path.parents[-2])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: ")


@pytest.mark.skipif(shutil.which("gcc") is None and shutil.which("cc") is None, reason="no C compiler here")
@pytest.mark.parametrize("name", ["benchmark_pairs", "spring_contenders"])
def test_the_reference_in_c_of_a_benchmark_compiles_and_leaves_subnormal_numbers_alone(name, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS / "benchmarks"))
    spec = importlib.util.spec_from_file_location(name, TOOLS / "benchmarks" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    library, line = module.compile_reference(tmp_path)
    assert library is not None, line
    # A library that gcc links with -ffast-math flushes them to zero in the whole process.
    assert np.nextafter(0.0, 1.0) * np.float64(2.0) > 0.0
