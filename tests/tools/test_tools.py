"""Every tool starts, and finds the files beside it."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools"
PROGRAMS = sorted(path for path in TOOLS.rglob("*.py") if '__name__ == "__main__"' in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
@pytest.mark.sampled(3)
def test_a_tool_says_its_options(path):
    done = subprocess.run([sys.executable, str(path), "--help"], capture_output=True, text=True, cwd=path.parents[-2])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: ")


COMPILES = """
import sys
import tempfile

import numpy as np

sys.path.insert(0, sys.argv[2])
import importlib

with tempfile.TemporaryDirectory() as folder:
    library, line = importlib.import_module(sys.argv[1]).compile_reference(folder)
assert library is not None, line
# A library that gcc links with -ffast-math flushes them to zero in the whole process.
assert np.nextafter(0.0, 1.0) * np.float64(2.0) > 0.0, "subnormal numbers are zero"
"""


@pytest.mark.skipif(shutil.which("gcc") is None and shutil.which("cc") is None, reason="no C compiler here")
@pytest.mark.parametrize("name", ["benchmark_pairs", "spring_contenders"])
def test_the_reference_in_c_of_a_benchmark_compiles_and_leaves_subnormal_numbers_alone(name):
    """In a process of its own, since Taichi, too, flushes subnormal numbers to zero in the process that it starts in."""
    command = [sys.executable, "-c", COMPILES, name, str(TOOLS / "benchmarks")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
