"""Components of one's own: folders, functions and classes, in this process, in others, and their faults."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi import component

TWO = [
    {"body": {"position": [1, 0, 0], "velocity": [0, 0.4, 0], "mass": 1}},
    {"body": {"position": [0, 0, 0], "mass": 2}},
]
SCENE = {"particles": TWO, "integrator": {"leapfrog": {"dt": 0.01}}, "run": {"duration": 1.0}}
HARMONIC = '''"""A spring between all pairs."""
import taichi as ti
from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.component import component, param
from mpp_taichi.forces._base import PairForce


@component
class Harmonic(PairForce):
    """V = k r²/2."""

    stiffness: float = param(1.0, strength=True, slider=True, unit="force length⁻¹", help="k")
    needs = frozenset({"mass"})

    @ti.func
    def response(self, state: ti.template(), i):
        """k / m."""
        return parameter(state, self.stiffness) / state.mass[i]

    @ti.func
    def source(self, state: ti.template(), j):
        """1."""
        return parameter(state, 1.0)

    @ti.func
    def shape(self, inverse_distance):
        """1."""
        return inverse_distance / inverse_distance

    @ti.func
    def potential(self, state: ti.template(), i, j, inverse_distance):
        """k r²/2."""
        return 0.5 * wide_number(state, parameter(state, self.stiffness)) / (inverse_distance * inverse_distance)
'''


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder for components, which is forgotten afterwards."""
    monkeypatch.setattr(component, "extra_folders", [])
    monkeypatch.setenv(component.FOLDERS_VARIABLE, "")
    (tmp_path / "own" / "forces").mkdir(parents=True)
    yield tmp_path / "own"
    for kind in component.KINDS:
        for name in [name for name in sys.modules if name.startswith(f"mpp_taichi_extra.{kind}")]:
            del sys.modules[name]
    component.forget(tmp_path)


def end_of(force):
    with mpp.Simulation({**SCENE, "forces": [force]}, backend="cpu", precision="f64") as simulation:
        simulation.run()
        return simulation.snapshot().position


def expected():
    return end_of({"pair": {"potential": "0.7*r^2/2"}})


def test_a_folder_of_files(own):
    (own / "forces" / "harmonic.py").write_text(HARMONIC)
    mpp.add_components(own)
    np.testing.assert_allclose(end_of({"harmonic": {"stiffness": 0.7}}), expected(), rtol=0, atol=1e-13)
    assert os.environ[component.FOLDERS_VARIABLE] == str(own)


@mpp.force
def spring(r, k=0.5):
    """A spring."""
    return k * r**2 / 2


@mpp.force
def hill(x, y, z, h=1.0):
    return h * math.exp(-(x**2) - y**2)  # noqa: F821


def test_a_function_is_a_formula():
    assert spring(k=0.7) == {"pair": {"name": "spring", "potential": "k * r ** 2 / 2", "parameters": {"k": 0.7}}}
    np.testing.assert_array_equal(end_of(spring(k=0.7)), end_of({"pair": {"potential": "k*r^2/2", "parameters": {"k": 0.7}}}))
    assert hill()["external"]["potential"] == "h * exp(-x ** 2 - y ** 2)"
    assert np.isfinite(end_of(hill())).all()
    with pytest.raises(mpp.ComponentError, match="spring has no parameter s, it has k"):
        spring(s=1)


def test_a_function_of_several_lines_is_no_formula():
    def long(r):
        s = r**2
        return s / 2

    with pytest.raises(mpp.ComponentError, match="long: a function that is a force has one line, return"):
        mpp.force(long)


def test_a_class_of_a_script_is_found_in_other_processes(own, tmp_path):
    text = HARMONIC.replace("@component", "@mpp.force").replace("from mpp_taichi.component import component, param", "")
    script = tmp_path / "script.py"
    script.write_text(
        text.replace(
            "import taichi as ti", "import taichi as ti\nimport mpp_taichi as mpp\nfrom mpp_taichi.component import param"
        )
        + f"""
import sys, subprocess
scene = {SCENE!r} | {{"forces": [{{"harmonic": {{"stiffness": 0.7}}}}]}}
if __name__ == "__main__":
    with mpp.Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run()
        print(simulation.snapshot().position.tolist())
    other = "from mpp_taichi import component; print(component.find_file('forces', 'harmonic') is not None)"
    print(subprocess.run([sys.executable, "-c", other], capture_output=True, text=True).stdout.strip())
"""
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    place, other = done.stdout.strip().splitlines()[-2:]  # behind what Taichi says of itself
    np.testing.assert_allclose(json.loads(place), expected(), rtol=0, atol=1e-13)
    assert other == "True"


def test_a_class_that_is_no_force_is_refused():
    class Nothing:
        pass

    with pytest.raises(mpp.ComponentError, match="Nothing is no force, must be made of PairForce or ExternalForce"):
        mpp.force(Nothing)


DRAG = """
import sys

import taichi as ti

import mpp_taichi as mpp
from mpp_taichi.arithmetic import force_numbers as numbers
from mpp_taichi.arithmetic.force_numbers import root as square_root
from mpp_taichi.component import param
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.types import Template

SHARE = 0.5


@mpp.force
class Roughness(ExternalForce):
    coefficient: float = param(1.0, strength=True, unit="mass length⁻¹", help="c")
    needs = frozenset({"mass"})
    conserves_energy = False
    depends_on_velocity = True

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        speed = square_root(velocity.dot(velocity))
        return -(SHARE * numbers.parameter(state, self.coefficient) * speed / state.mass[i]) * velocity

    @ti.func
    def potential(self, state: Template, i, time):
        return ti.cast(0.0, state.wide)


body = {"body": {"mass": 1, "position": [0, 0, 0], "velocity": [2, 0, 0]}}
scene = {"particles": [body], "forces": ["roughness"], "integrator": {"rk4": {"dt": 0.01}}}
with mpp.Simulation(scene, backend="cpu", precision="f64") as simulation:
    simulation.run(duration=3.0)
    print(simulation.snapshot().velocity[0, 0])
"""


def test_a_class_of_a_script_knows_what_the_script_imports_and_its_numbers(own, tmp_path):
    """The law v' = −c v²/2 gives v = v₀/(1 + c v₀ t/2) = 2/(1 + 3); rk4 errs by some dt⁴ = 1e-8."""
    script = tmp_path / "drag.py"
    script.write_text(DRAG)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.strip().splitlines()[-1]) == pytest.approx(0.5, abs=1e-8)


def run_command(*words):
    command = [sys.executable, "-m", "mpp_taichi", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def test_the_option_of_every_verb(own, tmp_path):
    (own / "forces" / "harmonic.py").write_text(HARMONIC)
    scene = tmp_path / "scene.yaml"
    scene.write_text(json.dumps({**SCENE, "forces": [{"harmonic": {"stiffness": 0.7}}]}))
    without = run_command("run", scene, "--headless", "--dry-run")
    assert without.returncode == 2 and "unknown force 'harmonic'" in without.stderr
    done = run_command("run", scene, "--headless", "--components", own)
    assert done.returncode == 0, done.stderr
    schema = run_command("schema", "--components", own)
    assert "harmonic" in schema.stdout


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (HARMONIC.replace("class Harmonic", "class Harmony"), "no class Harmonic marked @component"),
        (HARMONIC.replace("@component", ""), "no class Harmonic marked @component"),
        (HARMONIC.replace("class Harmonic(PairForce):", "class Harmonic(PairForce)"), "harmonic.py:9: expected ':'"),
        (HARMONIC.replace("stiffness: float", "stiffness: real"), r"line \d+: parameter stiffness: type real is none of float"),
        (
            HARMONIC.replace("slider=", "slyder="),
            r"line \d+: parameter stiffness: param knows no slyder, but unit, help, minimum",
        ),
        (HARMONIC.replace("param(1.0", "param(2**3"), r"line \d+: 2 \*\* 3 must be written out, as a number, a text or None"),
        (HARMONIC.replace("import taichi as ti", "import taichi as ti\nimport nowhere"), "harmonic.py:3: ModuleNotFoundError"),
        (HARMONIC.replace("return inverse_distance /", "return nonsense /"), r"harmonic.py:\d+: .*nonsense"),
    ],
)
def test_faults_of_a_file_are_one_line(own, tmp_path, text, told):
    import re

    (own / "forces" / "harmonic.py").write_text(text)
    scene = tmp_path / "scene.yaml"
    scene.write_text(json.dumps({**SCENE, "forces": [{"harmonic": {}}]}))
    done = run_command("run", scene, "--headless", "--components", own)
    assert done.returncode == 2 and "Traceback" not in done.stderr, done.stderr
    assert any(re.search(told, line) for line in done.stderr.splitlines()), done.stderr


def test_a_folder_without_components_is_refused(own, tmp_path):
    for folder, told in [(tmp_path / "nowhere", "no folder"), (own, "no components, must have files in generators/")]:
        with pytest.raises(mpp.ComponentError, match=told):
            mpp.add_components(folder)


def test_a_name_of_the_program_is_refused(own):
    (own / "forces" / "coulomb.py").write_text(HARMONIC)
    with pytest.raises(mpp.ComponentError, match="coulomb is in forces/ of the program already, choose another name"):
        mpp.add_components(own)
