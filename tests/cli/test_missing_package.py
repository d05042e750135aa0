"""A Python that lacks a package gets one line with the package, the Python and the remedy, and exit code 2."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mpp_taichi.missing_package import PACKAGES, PROGRAM_INSIDE, missing_line

ROOT = Path(__file__).parents[2]
HIDING = """
import importlib.abc
import sys


class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in {hidden!r}:
            raise ModuleNotFoundError("No module named " + repr(name), name=name)


sys.meta_path.insert(0, Hidden())
"""


def run_without(hidden, folder, *words):
    """The command line in a Python in which modules cannot be found."""
    (folder / "sitecustomize.py").write_text(HIDING.format(hidden=hidden), encoding="utf-8")
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(folder), str(ROOT)]))
    command = [sys.executable, "-m", "mpp_taichi", *map(str, words)]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=100, check=False)


@pytest.mark.parametrize("module", ["PIL", "taichi", "yaml", "pydantic", "numpy", "pydantic_core"])
@pytest.mark.sampled(3)
def test_a_missing_package_is_one_line_and_code_2(module, tmp_path):
    done = run_without([module], tmp_path, "run", ROOT / "scenes/kepler.yaml", "--steps", 2, "--video", "k.mp4", "--json")
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"this Python, {sys.executable}, does not have the package {PACKAGES.get(module, module)}; activate")
    found = json.loads(done.stdout)
    assert (found["status"], found["error"], found["exit_code"]) == ("failed", line, 2)


@pytest.mark.skipif(shutil.which("ffmpeg") is not None, reason="an ffmpeg of the machine encodes without the package")
def test_a_missing_encoder_names_its_package_and_is_code_5(tmp_path):
    done = run_without(["imageio_ffmpeg"], tmp_path, "run", ROOT / "scenes/kepler.yaml", "--steps", 2, "--video", "k.mp4")
    (line,) = done.stderr.splitlines()
    assert done.returncode == 5 and f"this Python, {sys.executable}, does not have the package imageio-ffmpeg;" in line


def test_without_any_package_all_are_named(tmp_path):
    python = [sys.executable, "-S", "-E", "-m", "mpp_taichi", "scenes/kepler.yaml"]
    done = subprocess.run(python, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and "report it" not in done.stderr
    assert all(package in done.stderr.partition(";")[0] for package in PACKAGES.values()), done.stderr


def test_the_environment_beside_is_named(tmp_path):
    python = tmp_path.joinpath(".venv", *PROGRAM_INSIDE)
    python.parent.mkdir(parents=True)
    python.touch()
    done = run_without(["numpy"], tmp_path, "scenes/kepler.yaml")
    expected = f"activate the environment, or run: {python.relative_to(tmp_path)} -m mpp_taichi …"
    assert done.returncode == 2 and done.stderr.rstrip().endswith(expected), done.stderr


def test_without_an_environment_pip_is_named(tmp_path):
    assert missing_line("numpy", [tmp_path]).endswith(f"or run: {sys.executable} -m pip install {ROOT}")


def test_a_missing_module_of_the_program_is_still_an_internal_error(tmp_path):
    done = run_without(["mpp_taichi.scene.load"], tmp_path, "run", ROOT / "scenes/kepler.yaml", "--dry-run")
    assert done.returncode == 1 and "this Python" not in done.stderr


def test_the_packages_are_those_of_the_project():
    listed = re.search(r"^dependencies = \[(.*?)\]", (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.M | re.S)
    assert re.findall(r'"([\w-]+)', listed[1]) == list(PACKAGES.values())
