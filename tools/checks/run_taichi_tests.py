"""Do Taichi's own tests pass beside this package as they do with Taichi alone?

    python tools/checks/run_taichi_tests.py FOLDER [test_return.py …] [--json FILE]

FOLDER is a source tree of Taichi 1.7.4, with tests/python in it. Each file runs twice on the CPU, in processes of its own: with
Taichi alone, and after a Simulation of this package has run and was closed. Without names: the tests of kernels, classes,
returned values and derivatives. Prints each test whose outcome differs; 1 where there is one.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = (
    *(
        "test_return",
        "test_matrix_return",
        "test_oop",
        "test_classfunc",
        "test_kernel_templates",
        "test_argument",
        "test_arg_*",
    ),
    *("test_argpack", "test_function*", "test_ad_*", "test_customized_grad", "test_ndarray", "test_numpy", "test_print"),
    *("test_mesh", "test_sparse_matrix", "test_struct", "test_matrix_arg", "test_native_functions", "test_exception"),
)
MOST_SECONDS = 600  # of one file; a file that takes longer is compared as "not ended"
PLUGIN = """
import os, sys, types
try:
    import pytest_rerunfailures
except ImportError:  # Taichi's conftest imports it, and does not need it to run a test once
    sys.modules["pytest_rerunfailures"] = types.ModuleType("pytest_rerunfailures")
if os.environ["RUN_BESIDE"]:
    sys.path.insert(0, os.environ["RUN_BESIDE"])
    from mpp_taichi import Simulation
    body = {"mass": 1.0, "position": [0, 0, 0]}
    scene = {"particles": [{"body": body}], "integrator": {"leapfrog": {"dt": 0.1}}}
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(steps=3)
"""
OUTCOME = re.compile(r"^(PASSED|FAILED|ERROR|XFAIL|XPASS) (\S+)", re.MULTILINE)


def outcomes(folder, file, plugins, *, beside):
    """The outcome of each test of a file, and the exit status of its process under the name `process`."""
    environment = os.environ | {
        "TI_WANTED_ARCHS": "cpu",
        "RUN_BESIDE": str(ROOT) if beside else "",
        "PYTHONPATH": os.pathsep.join([plugins, str(folder)]),
    }
    words = ["-p", "taichi_alone_or_beside", "-p", "no:cacheprovider", "-q", "-rA", "--tb=no", str(file)]
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=MOST_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return {f"{file.name}: exit status": "not ended"}
    return {test: outcome for outcome, test in OUTCOME.findall(done.stdout)} | {f"{file.name}: exit status": done.returncode}


def main():
    """Run each file twice; 1 where an outcome differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("files", nargs="*", help="of tests/python")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    tests = options.folder.resolve() / "tests" / "python"
    patterns = options.files or [f"{name}.py" for name in FILES]
    differ, passed = {}, 0
    with tempfile.TemporaryDirectory() as plugins:
        Path(plugins, "taichi_alone_or_beside.py").write_text(PLUGIN, encoding="utf-8")
        for file in dict.fromkeys(each for pattern in patterns for each in sorted(tests.glob(pattern))):
            alone, beside = (outcomes(options.folder.resolve(), file, plugins, beside=each) for each in (False, True))
            passed += sum(outcome == "PASSED" for outcome in beside.values())
            for test in alone.keys() | beside.keys():
                if alone.get(test) != beside.get(test):
                    differ[test] = (alone.get(test), beside.get(test))
                    print(f"{test}: {alone.get(test)} alone, {beside.get(test)} beside", flush=True)
    print(f"{passed} tests passed beside this package; {len(differ)} differ from Taichi alone")
    if options.json:
        options.json.write_text(json.dumps({"passed": passed, "differ": differ}, indent=1), encoding="utf-8")
    return 1 if differ else 0


if __name__ == "__main__":
    raise SystemExit(main())
