"""Closed skins in space: the geodesic sphere, springs along its edges, the pressure inside, and what is refused."""

import math

import numpy as np
import pytest
from measured import MadeUpSample
from repeated_runs import run_with_a_way_back
from run_ends import end_of

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.arithmetic import closed_skin
from mpp_taichi.errors import BackendError, PrecisionError
from mpp_taichi.quantities._base import NoResultError, Setting
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

PRESSURE, OUTSIDE, MASS, STIFFNESS = 1.7, 0.3, 0.2, 10.0


def balloon(divisions=1, *, exponent=1.0, outside=0.0, scale=1.0, method=None, **more):
    """A shell on springs without a rest length, whose balance is near the radius 1, larger or smaller by a factor."""
    corners = closed_skin.directions(divisions)
    ends = closed_skin.edges(len(corners))
    squares = float(np.sum((corners[ends[:, 0]] - corners[ends[:, 1]]) ** 2))
    volume = closed_skin.enclosed_volume(corners)
    balance = outside + STIFFNESS * squares / (3.0 * volume)
    grown = [f"{scale - 1}*{axis}" for axis in "XYZ"]
    return {
        "particles": [
            {"body": {"mass": 1.0, "position": [9, 9, 9]}},
            {"shell": {"name": "skin", "divisions": divisions, "mass": MASS, "radius": 0.02, "displacement": grown}},
        ],
        "springs": [{"shell_links": {"of": "skin", "stiffness": STIFFNESS, "rest_length": 0}}],
        "forces": [
            {
                "shell_pressure": {
                    **{"of": "skin", "pressure": balance / scale ** (3.0 * exponent), "exponent": exponent},
                    **({"outside": outside} if outside else {}),
                }
            }
        ],
        "integrator": method or {"leapfrog": {"dt": 0.01}},
    } | more


def test_a_shell_lies_about_its_centre_and_its_formulas_point_outwards():
    places = []
    for grown in (0.0, 0.2):
        shell = {"name": "skin", "divisions": 2, "mass": 0.7, "center": [3, -2, 1]}
        shell["displacement"] = [f"{grown}*{axis}" for axis in "XYZ"]
        places.append(
            assemble(load_scene({"particles": [{"shell": shell}], "integrator": {"leapfrog": {"dt": 0.01}}})).position
        )
    away = [np.linalg.norm(each - [3, -2, 1], axis=1) for each in places]
    # A shell of 42 places is symmetric about its centre; places and lengths near 4 are rounded a few times.
    assert np.abs(places[0].mean(axis=0) - [3, -2, 1]).max() < 1e-14
    np.testing.assert_allclose(away[1], away[0] + 0.2, rtol=1e-14)


def bent(exponent, *, swapped=False):
    """An irregular shell between two bodies, without springs; swapped: turned inside out."""
    place = ["0.2*X + 0.1*Y*Z", "0.15*X*Z - 0.1", "-0.3*Z + 0.1*X"]
    if swapped:
        place[0] = "-2*X + 0.1*Y*Z"
    return {
        "particles": [
            {"body": {"mass": 1.0, "position": [5, 5, 5]}},
            {"shell": {"name": "skin", "divisions": 2, "mass": 0.7, "center": [3, -2, 1], "displacement": place}},
            {"body": {"mass": 2.0, "position": [6, 5, 5]}},
        ],
        "forces": [{"shell_pressure": {"of": "skin", "pressure": PRESSURE, "outside": OUTSIDE, "exponent": exponent}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }


def volume_of(place):
    """By the divergence theorem over the triangles, about the origin."""
    one, two, three = (place[closed_skin.triangles(len(place))[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", one, np.cross(two, three))) / 6.0


@pytest.mark.parametrize("divisions", [1, 2, 3, 7])
def test_a_geodesic_sphere_is_a_closed_surface_of_neighbours(divisions):
    corners, count = closed_skin.directions(divisions), 10 * divisions**2 + 2
    found, ends = closed_skin.triangles(count), closed_skin.edges(count)
    assert closed_skin.divisions_of(count) == divisions and closed_skin.divisions_of(count + 1) is None
    assert (len(corners), len(ends), len(found)) == (count, 30 * divisions**2, 20 * divisions**2)
    assert count - len(ends) + len(found) == 2  # Euler's formula
    assert np.allclose(np.linalg.norm(corners, axis=1), 1.0, rtol=1e-15)
    normal = np.cross(corners[found[:, 1]] - corners[found[:, 0]], corners[found[:, 2]] - corners[found[:, 0]])
    assert np.all(np.sum(normal * corners[found].mean(axis=1), axis=1) > 0.0)
    directed = {tuple(pair) for triangle in found.tolist() for pair in zip(triangle, [*triangle[1:], triangle[0]])}
    assert len(directed) == 60 * divisions**2 and all((b, a) in directed for a, b in directed)
    assert sorted(np.bincount(ends.ravel()).tolist()) == [5] * 12 + [6] * (count - 12)
    lengths = np.linalg.norm(corners[ends[:, 0]] - corners[ends[:, 1]], axis=1)
    assert lengths.max() < 1.4 * lengths.min()


def test_the_icosahedron_and_the_tetrahedron_have_their_volumes():
    edge = 4.0 / math.sqrt(10.0 + 2.0 * math.sqrt(5.0))
    found = closed_skin.enclosed_volume(closed_skin.directions(1))
    assert found == pytest.approx(5.0 / 12.0 * (3.0 + math.sqrt(5.0)) * edge**3, rel=1e-14)
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    assert closed_skin.enclosed_volume(corners + 1e6) == pytest.approx(8.0 / 3.0, rel=1e-9)
    errors = [4.0 * math.pi / 3.0 - closed_skin.enclosed_volume(closed_skin.directions(n)) for n in (8, 16)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 5.0 / 3.0])
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.sampled(3)
def test_the_force_is_the_slope_of_the_energy(exponent, swapped):
    with Simulation(bent(exponent, swapped=swapped), backend="cpu", precision="f64") as simulation:
        start = simulation.snapshot()
        found = simulation.accelerations() * start.mass[:, None]
        inner = slice(1, len(start.mass) - 1)
        assert (volume_of(start.position[inner]) < 0.0) == swapped
        volume = abs(volume_of(start.position[inner]))

        def energy(place):
            now = abs(volume_of(place[inner]))
            share = now / volume
            work = math.log(share) if exponent == 1.0 else (share ** (1.0 - exponent) - 1.0) / (1.0 - exponent)
            return OUTSIDE * (now - volume) - PRESSURE * volume * work

        step = 1e-4
        for i in range(0, len(start.mass), 3):
            for k in range(3):
                moved = np.zeros_like(start.position)
                moved[i, k] = step
                slope = (energy(start.position + moved) - energy(start.position - moved)) / (2.0 * step)
                assert found[i, k] == pytest.approx(-slope, abs=1e-7)
        assert np.abs(found).max() > 0.1
        # No force and no torque on the whole.
        assert np.abs(found.sum(axis=0)).max() < 1e-13
        assert np.abs(np.cross(start.position, found).sum(axis=0)).max() < 1e-12
        simulation.run(steps=20)
        assert simulation.diagnostics()["potential_energy"] == pytest.approx(energy(simulation.snapshot().position), rel=1e-11)


@pytest.mark.parametrize(("exponent", "outside"), [(1.0, 0.0), (5.0 / 3.0, 0.0), (1.0, 7.0)])
def test_an_icosahedron_breathes_with_the_period_of_the_closed_form(exponent, outside):
    """E = D S R²/2 + ∫ (p_out − p) dV, V = V₁ R³: E″ = D S + 6 p_out V₁ − 3 p V₁ (2 − 3 γ) at R = 1, and 12 m is the mass."""
    corners = closed_skin.directions(1)
    ends, volume = closed_skin.edges(12), closed_skin.enclosed_volume(corners)
    pull = STIFFNESS * float(np.sum((corners[ends[:, 0]] - corners[ends[:, 1]]) ** 2))
    inside = outside * volume + pull / 3.0
    period = 2.0 * math.pi * math.sqrt(12.0 * MASS / (pull + 6.0 * outside * volume - 3.0 * inside * (2.0 - 3.0 * exponent)))
    swing = 0.004
    scene = balloon(exponent=exponent, outside=outside, scale=1.0 - swing, method={"leapfrog": {"dt": period / 400}})
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=200)
        half = simulation.snapshot()
        simulation.run(steps=200)
        end = simulation.snapshot()
    # After a period it is back where it began, but for the square of its swing and the step's (2 π/400)²/24 of a phase of 2 π.
    assert np.abs(np.linalg.norm(end.position[1:], axis=1) - (1.0 - swing)).max() < 10.0 * swing**2 * swing + 1e-6
    assert np.abs(np.linalg.norm(half.position[1:], axis=1) - (1.0 + swing)).max() < 10.0 * swing**2
    assert np.abs(end.velocity).max() < 0.02 * swing * 2.0 * math.pi / period


def test_a_skin_at_rest_obeys_the_virial_theorem():
    """Σ x·F = 0: D Σ l² = 3 (p − p_out) V, whatever the shape is, after friction has brought it to rest."""
    scene = balloon(3, outside=5.0, scale=0.8)
    scene["forces"].append({"linear_drag": {"coefficient": 1.0}})
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(duration=60.0, judge="off")
        end = simulation.snapshot()
    place = end.position[1:]
    ends = closed_skin.edges(len(place))
    pull = STIFFNESS * float(np.sum((place[ends[:, 0]] - place[ends[:, 1]]) ** 2))
    start = assemble(load_scene(scene)).position[1:]
    given = scene["forces"][0]["shell_pressure"]
    pressed = 3.0 * (given["pressure"] * volume_of(start) - given["outside"] * volume_of(place))
    assert pull == pytest.approx(pressed, rel=1e-9) and np.abs(end.velocity[1:]).max() < 1e-9


METHODS = {
    "velocity_verlet": ({"dt": 5e-3}, 2e-3),
    "yoshida6": ({"dt": 1e-2}, 1e-6),
    "rk4": ({"dt": 5e-3}, 1e-6),
    "ias15": ({"dt": 2e-2}, 1e-8),
    "implicit_midpoint": ({"dt": 5e-3, "tolerance": 1e-12}, 2e-3),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.sampled(3)
def test_methods_of_every_kind_agree(method):
    given, bound = METHODS[method]
    wanted = end_of(balloon(scale=0.9, method={"dop853": {"dt": 1e-2}}))
    found = end_of(balloon(scale=0.9, method={method: given}))
    assert np.abs(found.position - wanted.position).max() < bound


@pytest.mark.parametrize(("backend", "precision"), [("cpu", "f32"), ("vulkan", "f32"), ("vulkan", "f64"), ("cpu", "ds")])
@pytest.mark.sampled(3)
def test_every_device_and_precision_agrees(backend, precision):
    wanted = end_of(balloon(2, scale=0.95))
    found = end_of(balloon(2, scale=0.95), backend=backend, precision=precision)
    # 100 steps, in each of which places of 1 are rounded; in ds the sums of the pressure are those of f32.
    assert np.abs(found.position - wanted.position).max() < (1e-12 if precision == "f64" else 1e-5)


@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_the_bits_depend_neither_on_threads_nor_on_cuts(plan):
    scene = balloon(3, scale=0.9)
    with Simulation(scene, backend="cpu", precision="f64", plan=plan) as simulation:
        simulation.run(steps=60)
        whole = simulation.snapshot()
    with Simulation(scene, backend="cpu", precision="f64", plan=plan, threads=1) as simulation:
        cut = run_with_a_way_back(simulation, 25, 20, 35)
    assert np.array_equal(whole.position, cut.position) and np.array_equal(whole.velocity, cut.velocity)


def test_a_balloon_bounces_off_a_floor_and_keeps_its_energy():
    scene = balloon(2, scale=1.0, outside=30.0, method={"leapfrog": {"dt": 5e-4}})
    scene["particles"].pop(0)
    scene["forces"].append({"uniform_gravity": {"acceleration": [0, 0, -2.0]}})
    scene["walls"] = [{"plane": {"point": [0, 0, -1.2], "normal": [0, 0, 1]}}]
    scene["contacts"] = {"hard_spheres": {"solver": "swept"}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.diagnostics()["total_energy"]
        simulation.run(duration=1.0)
        after = simulation.diagnostics()
        assert simulation.contact_report.wall_count > 3 and simulation.snapshot().position[:, 2].min() > -1.2
        assert abs(after["total_energy"] - before) < 1e-2 * after["kinetic_energy"]


def test_springs_of_a_shell_take_types_and_break():
    scene = balloon(2, outside=0.0)
    scene["springs"] = [{"shell_links": {"of": "skin", "type": "rubber"}}]
    scene["spring_types"] = {"rubber": {"stiffness": 5.0, "breaks_at": 0.1}}
    scene["forces"][0]["shell_pressure"]["pressure"] = 60.0
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert len(simulation.start.springs) == 120
        simulation.run(duration=1.0, judge="off")
        assert np.isfinite(simulation.snapshot().springs.broke_at).any()


def test_four_particles_are_a_skin_and_the_volume_is_a_quantity():
    corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    scene = {
        "particles": [{"lattice": {"name": "four", "shape": [4], "lower": [0, 0, 0], "upper": [3, 0, 0], "mass": 1.0}}],
        "springs": [{"shell_links": {"of": "four", "stiffness": 1.0}}],
        "forces": [{"shell_pressure": {"of": "four", "pressure": 1.0}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }
    with pytest.raises(SceneError, match="its corners enclose no volume at the start"):
        assemble(load_scene(scene))
    columns = [[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]
    formulas = [" + ".join(f"({c})*max(0, 1 - abs(3*u - {k}))" for k, c in enumerate(column)) for column in columns]
    scene["particles"][0]["lattice"]["displacement"] = [f"{f} - 3*u" if k == 0 else f for k, f in enumerate(formulas)]
    assert len(assemble(load_scene(scene)).springs) == 6
    scene["springs"] = []
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start, force = simulation.snapshot(), simulation.accelerations()
    # ∂V/∂x of a corner is a third of the area of the opposite face, 2 √3, along the line from this face to the corner.
    assert np.allclose(start.position, corners) and np.allclose(force, np.array(corners) * 2.0 / 3.0)
    quantity = component.build("quantities", "enclosed_volume", {"of": (0, 4)})
    assert quantity.measure(MadeUpSample(start)) == pytest.approx(8.0 / 3.0, rel=1e-14)
    setting = Setting(load_scene(scene), start)
    assert quantity.label(setting) == "volume inside four"
    with pytest.raises(NoResultError, match="3 particles are the corners of no closed skin"):
        component.build("quantities", "enclosed_volume", {"of": (0, 3)}).begin(setting)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"forces": [{"shell_pressure": {"of": "skin[0:5]", "pressure": 1}}]}, "has 5 particles, must be a shell, of 10 ν"),
        ({"springs": [{"shell_links": {"of": "skin[0:5]", "stiffness": 1}}]}, "has 5 particles, must be a shell, of 10 ν"),
        ({"springs": [{"shell_links": {"of": "skn", "stiffness": 1}}]}, "did you mean 'skin'"),
        ({"integrator": {"hermite4": {"dt": 0.01}}}, "needs the derivative of every force, which shell_pressure lacks"),
        (
            {"dimensions": 2, "particles": [{"shell": {"name": "skin", "divisions": 1}}], "forces": [], "springs": []},
            "a shell is in space, must be in a scene with three dimensions",
        ),
        (
            {"dimensions": 2, "particles": [{"lattice": {"name": "skin", "shape": [4], "lower": [0, 0], "upper": [1, 0]}}]},
            "a closed skin of triangles is in space, must be in a scene with three dimensions",
        ),
    ],
)
def test_what_is_no_shell_is_refused(change, message):
    with pytest.raises(SceneError, match=message):
        end_of(balloon() | change)


def test_what_other_parts_cannot_do_is_refused():
    with pytest.raises(PrecisionError, match="the force shell_pressure does not carry low parts"):
        end_of(balloon(), precision="df64")
    with pytest.raises(PrecisionError, match="calls pow, which vulkan has only in f32"):
        end_of(balloon(exponent=5.0 / 3.0), backend="vulkan", precision="f64")
    with pytest.raises(BackendError, match="reads all particles has no plan replicas"):
        end_of(balloon(), replica_starts=[assemble(load_scene(balloon()))] * 2)
