"""What a verb imports before it has an answer: help, and the faults of a scene, come without the packages of a run."""

import subprocess
import sys

import pytest

PACKAGES = {"numpy", "pydantic", "yaml", "taichi", "PIL"}


def imported(words, names, cwd):
    """Which of these modules a command of the program has imported by its end."""
    asked = f"from mpp_taichi.cli.main import main; main({words!r}); import sys; sys.stderr.write(repr(sorted(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, timeout=120, cwd=cwd)
    assert found.returncode == 0, found.stderr
    modules = set(eval(found.stderr[found.stderr.rindex("[") :]))
    return {name for name in modules if name in names or name.split(".")[0] in names}


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["check", "--help"], ["sweep", "--help"]])
def test_help_needs_no_package(words, tmp_path):
    assert imported(words, PACKAGES, tmp_path) == set()


@pytest.mark.parametrize("verb", [["check"], ["run", "--headless"], ["explain"]])
def test_a_faulty_scene_waits_for_no_device_and_no_recorder(verb, tmp_path):
    (tmp_path / "faulty.yaml").write_text("particles:\n  - body: {mas: 1}\n", encoding="utf-8")
    late = {"taichi", "PIL", "mpp_taichi.cli._session", "mpp_taichi.simulation.simulation", "mpp_taichi.recorders.film"}
    assert imported([*verb, "faulty.yaml"], late, tmp_path) == set()


def test_a_run_without_files_imports_no_recorder_of_pictures(tmp_path):
    scene = "particles: [{body: {mass: 1, position: [0, 0, 0]}}]\nintegrator: {leapfrog: {dt: 0.1}}\nrun: {steps: 2}\n"
    (tmp_path / "one.yaml").write_text(scene, encoding="utf-8")
    pictures = {"PIL", "mpp_taichi.recorders.film", "mpp_taichi.recorders.html", "mpp_taichi.recorders.inspection"}
    assert imported(["run", "one.yaml", "--headless", "--quiet"], pictures, tmp_path) == set()
