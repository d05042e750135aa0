"""A new component is one new file: scenes are checked by its flags, without a change of other files."""

import math

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

YUKAWA = '''"""A screened attraction."""
import taichi as ti
from mpp_taichi.component import component, param
from mpp_taichi.forces._base import PairForce

@component
class Screened(PairForce):
    """Pair force that is infinite at distance 0."""

    coupling: float = param(1.0, strength=True, unit="force length²", help="g")
    needs = frozenset({"mass"})
    FLAG
'''
SINGULAR = "singular_at_zero_distance = True"
TWO_HALVES = '''"""Two leapfrogs of half a step."""
from mpp_taichi.component import component, param
from mpp_taichi.integrators._splitting import Splitting

@component
class TwoHalves(Splitting):
    """Drift–kick–drift–kick–drift."""

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 2
    drifts, kicks = (0.25, 0.5, 0.25), (0.5, 0.5)
    FLAG
'''
FORWARD = "moves_forward_alone = True"
TOUCH = '''"""A contact solver that does nothing."""
from mpp_taichi.component import component, param
from mpp_taichi.contacts._base import ContactSolver

@component
class Touch(ContactSolver):
    """Spheres pass through each other."""

    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="e")
    FLAG
'''


@pytest.fixture
def add(tmp_path):
    """Write the file of a component, with a flag or without it, into a folder that is searched for components."""
    component.extra_folders.append(tmp_path)

    def write(place, text, flag):
        path = tmp_path / f"{place}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text.replace("FLAG", flag), encoding="utf-8")

    yield write
    component.extra_folders.remove(tmp_path)


def two_bodies(distance=0.0, **changes):
    bodies = [{"body": {"mass": 1, "position": [x, 0, 0], "velocity": [0, 0, 0], "radius": 0.1}} for x in (0.0, distance)]
    return {"particles": bodies, "integrator": {"leapfrog": {"dt": 0.01}}, **changes}


def test_bodies_at_one_place_are_refused_for_a_new_singular_force(add):
    add("forces/screened", YUKAWA, SINGULAR)
    with pytest.raises(SceneError, match="is where particle 0 .body. is, must be elsewhere: screened is infinite there"):
        assemble(load_scene(two_bodies(forces=[{"screened": {}}])))
    assemble(load_scene(two_bodies(1.0, forces=[{"screened": {}}])))
    assemble(load_scene(two_bodies(forces=[{"screened": {"coupling": 0.0}}])))


def test_bodies_at_one_place_may_feel_a_new_force_that_stays_finite(add):
    add("forces/screened", YUKAWA, "")
    assemble(load_scene(two_bodies(forces=[{"screened": {}}])))


def test_a_new_splitting_resolves_contacts_where_it_says_that_its_drifts_lead_forward(add):
    add("integrators/two_halves", TWO_HALVES, FORWARD)
    scene = two_bodies(1.0, integrator={"two_halves": {"dt": 0.01}}, contacts={"hard_spheres": {"solver": "pairwise"}})
    scene["particles"][0]["body"]["velocity"] = [1, 0, 0]
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(duration=2.0)
        velocity = simulation.snapshot().velocity
    # Equal masses exchange their velocities in an elastic head-on impact, whatever the error in its time.
    np.testing.assert_allclose(velocity, [[0, 0, 0], [1, 0, 0]], atol=4 * math.ulp(1.0))


def test_a_new_splitting_without_the_flag_is_refused_beside_contacts(add):
    add("integrators/two_halves", TWO_HALVES, "")
    scene = two_bodies(1.0, integrator={"two_halves": {"dt": 0.01}}, contacts={"hard_spheres": {"solver": "pairwise"}})
    with pytest.raises(SceneError, match="goes with the integrators .*, not two_halves"):
        load_scene(scene)


def test_a_new_splitting_may_sum_gravity_by_a_tree(add):
    add("integrators/two_halves", TWO_HALVES, "")
    gravity = [{"newtonian_gravity": {"solver": "tree"}}]
    load_scene(two_bodies(1.0, integrator={"two_halves": {"dt": 0.01}}, forces=gravity))


@pytest.mark.parametrize(
    ("flag", "integrator", "refused"),
    [
        ("drifts = True", "leapfrog", ""),
        ("drifts = True", "rk4", "goes with the integrators langevin, leapfrog, symplectic_euler, velocity_verlet, not rk4"),
        ("leads = True", "ias15", ""),
        (
            "leads = True",
            "leapfrog",
            "touch cuts the steps of a method that chooses them at contacts",
        ),
        ("flies = True", "leapfrog", "touch needs no integrator, or integrator: touch, not leapfrog"),
    ],
)
def test_a_new_contact_solver_goes_with_the_integrators_that_its_flag_asks_for(add, flag, integrator, refused):
    add("contacts/touch", TOUCH, flag)
    parameters = {"dt": 0.01}
    scene = two_bodies(1.0, integrator={integrator: parameters}, contacts={"hard_spheres": {"solver": "touch"}})
    if not refused:
        assert load_scene(scene).contacts.solver.name == "touch"
        return
    with pytest.raises(SceneError, match=refused):
        load_scene(scene)


@pytest.mark.parametrize("merges", [False, True])
def test_springs_are_refused_beside_a_new_contact_solver_that_merges(add, merges):
    add("contacts/touch", TOUCH, f"drifts = True\n    merges = {merges}")
    springs = [{"link": {"between": [0, 1], "stiffness": 1}}]
    scene = two_bodies(1.0, contacts={"hard_spheres": {"solver": "touch"}}, springs=springs)
    if not merges:
        assert len(load_scene(scene).springs) == 1
        return
    with pytest.raises(SceneError, match="cannot be where spheres merge: a spring would lose its end"):
        load_scene(scene)
