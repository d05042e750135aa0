"""A scene imports, allocates and compiles only its own components, and a component is one file."""

import json
import subprocess
import sys

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation, component
from scenes import cluster, everything


def run_python(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_the_package_starts_no_device_and_imports_no_taichi():
    loaded = run_python("import sys, json, mpp_taichi; print(json.dumps(sorted(sys.modules)))")
    assert "taichi" not in json.loads(loaded)
    assert "numpy" not in json.loads(loaded)


def test_reading_a_scene_imports_no_taichi():
    loaded = run_python(
        "import sys; from mpp_taichi.scene.load import load_scene; from mpp_taichi.start.assemble import assemble\n"
        "assemble(load_scene('scenes/sun_earth.yaml')); print('taichi' in sys.modules)"
    )
    assert loaded.strip() == "False"


@pytest.mark.sampled(3)
def test_a_gravity_scene_imports_and_allocates_gravity_only():
    code = (
        "import sys, json; from mpp_taichi import Simulation\n"
        "s = Simulation('scenes/sun_earth.yaml', backend='cpu'); s.run(steps=2)\n"
        "print(json.dumps([sorted(m for m in sys.modules if m.startswith('mpp_taichi')), sorted(s.state.field_sizes())]))"
    )
    modules, fields = json.loads(run_python(code))
    assert "mpp_taichi.forces.newtonian_gravity" in modules
    for absent in (
        "forces.coulomb",
        "forces.spring",
        "forces.uniform_gravity",
        "forces.linear_drag",
        "integrators.rk4",
        "views",
        "notebook",
        "result",
    ):
        assert not any(module.startswith(f"mpp_taichi.{absent}") for module in modules), absent
    assert set(fields) <= {"position", "velocity", "acceleration", "mass", "free"}
    assert "charge" not in fields and "radius" not in fields


@pytest.mark.sampled(3)
def test_only_the_quantities_that_a_panel_a_column_or_an_expectation_names_are_imported():
    code = (
        "import sys, json; from mpp_taichi import Simulation\n"
        "from mpp_taichi.recorders.inspection import InspectionRecorder; from mpp_taichi.recorders.inspector import Inspector\n"
        "from mpp_taichi.recorders.table import TableRecorder, asked_columns\n"
        "from mpp_taichi.report.expectations import Watcher\n"
        "scene = {'particles': [{'body': {'mass': 1, 'position': [0, 0, 0]}}], 'forces': [{'uniform_gravity': {}}],\n"
        "  'integrator': {'leapfrog': {'dt': 0.1}}, 'inspect': [{'y': {'speed': {'of': 0}}}], 'run': {'steps': 2},\n"
        "  'record': {'table': {'columns': ['total_energy']}},\n"
        "  'expect': {'mass': {'above': 0}, 'lowest_position': {'of': 0, 'below': 9}}}\n"
        "with Simulation(scene, backend='cpu') as s:\n"
        "    watcher, table = Watcher(s.spec.expect, 1), TableRecorder(1, asked_columns(s))\n"
        "    s.run(recorders=[watcher, table, InspectionRecorder(Inspector(s), 1)])\n"
        "    watcher.finish(s)\n"
        "found = [m.split('.')[1:] for m in sys.modules if m.startswith('mpp_taichi.')]\n"
        "found = [each for each in found if each[0] in ('quantities', 'diagnostics') and len(each) == 2]\n"
        "print(json.dumps(sorted('/'.join(each) for each in found if each[1][0] != '_')))"
    )
    named = ["diagnostics/lowest_position"]
    named += [f"quantities/{name}" for name in ("mass", "position", "speed", "time", "total_energy")]
    assert json.loads(run_python(code)) == named


@pytest.mark.sampled(3)
def test_a_scene_without_pairs_imports_no_pair_loop():
    code = (
        "import sys; from mpp_taichi import Simulation\n"
        "s = Simulation({'particles': [{'body': {'mass': 1, 'position': [0, 0, 0]}}], 'forces': [{'uniform_gravity': {}}],\n"
        "                'integrator': {'leapfrog': {'dt': 0.1}}}, backend='cpu')\n"
        "s.run(steps=2); print('mpp_taichi.neighbors.all_pairs' in sys.modules)"
    )
    assert run_python(code).strip() == "False"


def test_a_scene_without_formulas_imports_no_symbolic_algebra():
    code = (
        "import sys; from mpp_taichi import Simulation\n"
        "ball = {'body': {'mass': 1, 'position': [0, 0, 0], 'radius': 0.1}}\n"
        "peg = {'body': {'mass': 1, 'position': [0, 0, 1], 'radius': 0.1, 'free': False}}\n"
        "s = Simulation({'particles': [ball, peg], 'springs': [{'link': {'between': [0, 1], 'stiffness': 1}}],\n"
        "                'walls': [{'box': {'lower': [-2, -2, -2], 'upper': [2, 2, 2]}}],\n"
        "                'contacts': {'hard_spheres': {'solver': 'swept'}}, 'forces': [{'uniform_gravity': {}}],\n"
        "                'integrator': {'leapfrog': {'dt': 0.1}}}, backend='cpu')\n"
        "s.run(steps=2); print('sympy' in sys.modules)"
    )
    assert run_python(code).strip() == "False"


@pytest.mark.sampled(3)
def test_fields_are_those_that_the_effects_need():
    with Simulation(everything(), backend="cpu") as simulation:
        assert {"charge", "spring_damping", "free", "scratch_0"} <= set(simulation.state.field_sizes())
    with Simulation(everything(damping=0.0, drag=0.0), backend="cpu") as simulation:
        assert not {"spring_damping", "scratch_0", "radius"} & set(simulation.state.field_sizes())


NOTHING = (
    {"uniform_gravity": {"acceleration": [0, 0, 0]}},
    {"coulomb": {"coulomb_constant": 0}},
    {"linear_drag": {"coefficient": 0}},
    {"harmonic_drive": {"force": [0, 0, 0], "angular_frequency": 1}},
)


@pytest.mark.sampled(3)
def test_an_effect_of_zero_changes_no_bit_and_is_not_compiled():
    """With enough bodies, the loop over pairs is another where a second force acts, and rounds otherwise."""
    ends = []
    for forces in ((), NOTHING):
        scene = cluster(40)
        with Simulation(scene | {"forces": [*scene["forces"], *forces]}, backend="cpu", precision="f64") as simulation:
            ends.append(simulation.run(steps=50).snapshot())
            assert [force.name for force in simulation.spec.forces] == ["newtonian_gravity"]
    assert np.array_equal(ends[0].position, ends[1].position) and np.array_equal(ends[0].velocity, ends[1].velocity)


FORCE = '''"""A spring to the origin."""
import taichi as ti
from mpp_taichi.component import component, param
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.types import Template

@component
class Anchor(ExternalForce):
    """F = -k x."""

    stiffness: float = param(1.0, minimum=0.0, unit="force length⁻¹", help="k")
    needs = frozenset({"mass"})

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """-k x / m."""
        return -(self.stiffness / state.mass[i]) * state.position[i]

    @ti.func
    def potential(self, state: Template, i, time):
        """k x² / 2."""
        x = ti.cast(state.position[i], state.wide)
        return 0.5 * self.stiffness * x.dot(x)
'''
INTEGRATOR = '''"""McLachlan's second-order method with two kicks."""
from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

@component
class Mclachlan2(Splitting):
    """Second order, two kicks, small error. Source: McLachlan, SIAM J. Sci. Comput. 16 (1995) 151."""

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 2
    drifts, kicks = (0.1931833275037836, 0.6136333449924328, 0.1931833275037836), (0.5, 0.5)
'''
GENERATOR = '''"""Particles along a line."""
import numpy as np
from mpp_taichi.component import component, param
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group

@component
class Row(Generator):
    """`count` particles of unit spacing along x."""

    count: int = param(minimum=1, help="how many")
    mass: float = param(1.0, minimum=0.0, help="of each")

    def particle_count(self) -> int:
        """As many as asked for."""
        return self.count

    def generate(self, context: GeneratorContext) -> Group:
        """One after the other."""
        return make_group(self.count, position=np.outer(np.arange(self.count), [1.0, 0, 0]), mass=self.mass)
'''


@pytest.fixture
def own_folder(tmp_path):
    component.extra_folders.append(tmp_path)
    yield tmp_path
    component.extra_folders.remove(tmp_path)


@pytest.mark.sampled(3)
def test_a_force_an_integrator_and_a_generator_are_one_file_each(own_folder):
    for place, text in (("forces/anchor", FORCE), ("integrators/mclachlan2", INTEGRATOR), ("generators/row", GENERATOR)):
        path = own_folder / f"{place}.py"
        path.parent.mkdir()
        path.write_text(text, encoding="utf-8")
    scene = {
        "particles": [{"row": {"count": 3, "mass": 2.0}}],
        "forces": [{"anchor": {"stiffness": 8.0}}],
        "integrator": {"mclachlan2": {"dt": 0.001}},
    }
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(duration=1.0)
        x = simulation.snapshot().position[:, 0]
    # ω = √(k/m) = 2, amplitudes 0, 1 and 2; second order with (ω dt)² = 4e-6 and an error constant below 1/24.
    np.testing.assert_allclose(x, np.arange(3) * np.cos(2.0), atol=1e-6)
    assert "anchor" in component.names("forces")
    with pytest.raises(SceneError, match="must|minimum|least"):
        Simulation(scene | {"particles": [{"row": {"count": 0}}]}, backend="cpu")
