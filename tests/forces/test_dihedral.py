"""Torsion of four particles in a row: angle, force and energy against closed forms, what runs with it and what is refused."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from measured import MadeUpSample
from repeated_runs import run_with_a_way_back
from run_ends import end_of

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.errors import PrecisionError, UnsupportedError
from mpp_taichi.quantities._base import NoResultError, Setting
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

MASSES = (0.5, 2.0, 1.5, 0.7)
HARMONIC = {"dihedral": {"stiffness": 1.7, "angle": 0.4}}
PERIODIC = {"periodic_dihedral": {"amplitude": 1.3, "multiplicity": 3, "phase": 0.6}}
SWEPT, MERGING = ({"contacts": {"hard_spheres": {"solver": solver}}} for solver in ("swept", "merging"))
SWEPT, MERGING = ({"contacts": {"hard_spheres": {"solver": solver}}} for solver in ("swept", "merging"))
REPEATING = {"walls": [{"periodic_box": {"lower": [-9] * 3, "upper": [9] * 3}}]}
LAWS = {"harmonic": HARMONIC, "periodic": PERIODIC}


def slope_and_energy(law, angle):
    """V′ and V of one of both laws at an angle."""
    if "dihedral" in law:
        off = math.remainder(angle - law["dihedral"]["angle"], math.tau)
        return law["dihedral"]["stiffness"] * off, 0.5 * law["dihedral"]["stiffness"] * off**2
    amplitude, n, phase = law["periodic_dihedral"].values()
    return -n * amplitude * math.sin(n * angle - phase), amplitude * (1.0 + math.cos(n * angle - phase))


def four(angle, law=HARMONIC, *, arms=(1.1, 0.8), slopes=(0.3, -0.2), length=1.4, method=None, turned=True):
    """Four bodies with a dihedral angle; outer arms have these distances from the axis, and lean along it by these slopes."""
    places = np.array(
        [
            [slopes[0], arms[0], 0.0],
            [0.0, 0.0, 0.0],
            [length, 0.0, 0.0],
            [length + slopes[1], arms[1] * math.cos(angle), arms[1] * math.sin(angle)],
        ]
    )
    if turned:
        frame, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
        places = places @ (frame * np.sign(np.linalg.det(frame))) + np.array([0.3, -0.2, 0.1])
    ((name, given),) = law.items()
    return {
        "particles": [
            {"body": {"name": each, "mass": mass, "position": place.tolist()}}
            for each, mass, place in zip("abcd", MASSES, places)
        ],
        "forces": [{name: {"of": list("abcd")} | given}],
        "integrator": method or {"leapfrog": {"dt": 0.01}},
    }


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [0.0, 0.3, -0.5, 1.6, 2.9, 3.5, -2.8])
def test_the_force_on_the_outer_particles_is_the_torque_over_the_arm(law, angle):
    """V′/ρ along the circle about the axis on which the angle grows; the torque about the axis is V′ on both sides."""
    slope, energy = slope_and_energy(LAWS[law], angle)
    with Simulation(four(angle, LAWS[law], turned=False), backend="cpu", precision="f64") as simulation:
        force = simulation.accelerations() * np.array(MASSES)[:, None]
        assert simulation.diagnostics()["potential_energy"] == pytest.approx(energy, rel=1e-13, abs=1e-15)
        place = simulation.snapshot().position
    forward = [0.0, -math.sin(angle), math.cos(angle)]
    np.testing.assert_allclose(force[3], -slope / 0.8 * np.array(forward), atol=1e-14 * max(1.0, abs(slope)))
    np.testing.assert_allclose(force[0], [0.0, 0.0, slope / 1.1], atol=1e-14 * max(1.0, abs(slope)))
    torque = np.cross(place, force)
    for total in (force.sum(axis=0), torque.sum(axis=0)):
        assert np.abs(total).max() <= 40 * 2.0**-53 * max(np.abs(force).sum(), np.abs(torque).sum())


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, 2.9, -2.8, 3.14159])
def test_the_force_is_the_slope_of_the_energy(law, angle):
    scene = four(angle, LAWS[law])
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        force = simulation.accelerations() * np.array(MASSES)[:, None]
        start = simulation.snapshot().position
    step, found = 1e-5, np.zeros((4, 3))
    setting = load_scene(scene)
    quantity = component.build("quantities", "dihedral_angle", {"of": tuple((k, 1) for k in range(4)), "zero": 0.0})
    snapshot = assemble(setting)
    for i, k in itertools.product(range(4), range(3)):
        sides = []
        for sign in (1.0, -1.0):
            moved = start.copy()
            moved[i, k] += sign * step
            measured = quantity.measure(MadeUpSample(replace(snapshot, position=moved)))
            sides.append(slope_and_energy(LAWS[law], measured)[1])
        found[i, k] = (sides[0] - sides[1]) / (2.0 * step)
    # A difference quotient: the third derivative, below 1e3, times 1e-10/6, and roundings of V over the step.
    np.testing.assert_allclose(force, -found, atol=1e-6)


def test_a_chain_is_all_fours_of_it_in_a_row():
    random = np.random.default_rng(4)
    bodies = [{"body": {"name": f"b{k}", "mass": 1.0, "position": random.normal(size=3).tolist()}} for k in range(6)]
    lattice = {"name": "chain", "shape": [6], "lower": [0, 0, 0], "upper": [1, 0, 0]}
    bent = ["sin(9*u) - u", "cos(7*u)", "u*cos(20*u)"]
    chain = [bodies[0], {"lattice": lattice | {"displacement": bent}}]
    method = {"integrator": {"leapfrog": {"dt": 0.01}}}
    rows = [["chain[0:3]", "chain[1:4]", "chain[2:5]", "chain[3:6]"]]
    singles = [[f"chain[{k + place}]" for place in range(4)] for k in range(3)]
    found = []
    for choice in (["chain"], rows, singles):
        forces = [{"dihedral": {"of": of, "name": f"d{k}"} | HARMONIC["dihedral"]} for k, of in enumerate(choice)]
        with Simulation({"particles": chain, "forces": forces} | method, backend="cpu", precision="f64") as simulation:
            found.append((simulation.accelerations(), simulation.diagnostics()["potential_energy"]))
    assert np.array_equal(found[0][0], found[1][0]) and np.abs(found[0][0][1:]).min() > 0.0
    np.testing.assert_allclose(found[2][0], found[0][0], rtol=0.0, atol=1e-14 * np.abs(found[0][0]).max())
    assert not found[0][0][0].any()
    assert found[0][1] == found[1][1] == pytest.approx(found[2][1], rel=1e-14)


def test_rotors_about_an_axis_swing_with_their_reduced_inertia():
    """1/I = 1/(m₁ρ₁²) + 1/(m₄ρ₄²), ω² = k/I whatever the amplitude is, across the angle π where φ jumps."""
    scene = rotors(math.pi - 0.5, HARMONIC | {"dihedral": {"stiffness": 1.7, "angle": math.pi}})
    inverse = 1.0 / (MASSES[0] * 1.1**2) + 1.0 / (MASSES[3] * 0.8**2)
    period = math.tau / math.sqrt(1.7 * inverse)
    scene["integrator"] = {"leapfrog": {"dt": period / 4000}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for part, expected in ((0.25, 0.0), (0.5, 0.5), (1.0, -0.5), (1.25, 0.0)):
            simulation.run(steps=round(4000 * part) - simulation.step_count)
            place = simulation.snapshot().position
            turn = [math.atan2(place[k, 2], place[k, 1]) for k in (0, 3)]
            # The phase of leapfrog is off by (2 π/4000)²/24 of itself, 8e-7, and the angle by half of it.
            assert math.remainder(turn[1] - turn[0] - math.pi, math.tau) == pytest.approx(expected, abs=2e-6)


def rotors(angle, law):
    """Two particles that turn on circles about a fixed axis, by rods to its ends."""
    scene = four(angle, law, slopes=(0.0, 0.0), turned=False)
    for k, free in enumerate(([False, True, True], False, False, [False, True, True])):
        scene["particles"][k]["body"]["free"] = free
    return scene | {"springs": [{"rod": {"between": ["a", "b"]}}, {"rod": {"between": ["c", "d"]}}]}


def molecule(method=None, *, law=None, angle=math.pi - 0.6):
    """A chain of four on springs and hinges of springs, of which every particle moves."""
    scene = four(angle, law or {"dihedral": {"stiffness": 1.7, "angle": math.pi}}, method=method)
    links = [("a", "b"), ("b", "c"), ("c", "d"), ("a", "c"), ("b", "d")]
    return scene | {"springs": [{"link": {"between": list(ends), "stiffness": 60}} for ends in links]}


METHODS = {
    "velocity_verlet": ({"dt": 2e-3}, 1e-4),
    "yoshida6": ({"dt": 1e-2}, 1e-6),
    "rk4": ({"dt": 5e-3}, 1e-6),
    "dop853": ({"dt": 2e-2}, 1e-8),
    "ias15": ({"dt": 2e-2}, 1e-8),
    "adaptive_dop853": ({"dt": 2e-2}, 1e-6),
    "implicit_midpoint": ({"dt": 2e-3, "tolerance": 1e-12}, 1e-4),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.sampled(3)
def test_methods_of_every_kind_agree(method):
    given, bound = METHODS[method]
    wanted, found = end_of(molecule({"dop853": {"dt": 5e-3}})), end_of(molecule({method: given}))
    assert np.abs(found.position - wanted.position).max() < bound


def test_energy_momentum_and_angular_momentum_are_kept():
    scene = molecule({"leapfrog": {"dt": 2e-3}}, law=PERIODIC)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.diagnostics()
        simulation.run(steps=3000)
        after, end = simulation.diagnostics(), simulation.snapshot()
    assert after["kinetic_energy"] > 0.1
    # ω dt = 0.034 of the stiffest link: an error of the square of it over 8.
    assert abs(after["total_energy"] - before["total_energy"]) < 1e-3
    momentum = end.mass[:, None] * end.velocity
    # 3000 steps round momenta of 1 by 2⁻⁵³ each.
    assert np.abs(momentum.sum(axis=0)).max() < 3000 * 2.0**-53
    assert np.abs(np.cross(end.position, momentum).sum(axis=0)).max() < 3000 * 2.0**-50


@pytest.mark.parametrize(
    ("backend", "precision", "law"),
    [
        *((*device, law) for device in (("cpu", "f32"), ("cpu", "ds"), ("vulkan", "f32")) for law in LAWS),
        ("vulkan", "f64", "periodic"),
    ],
)
@pytest.mark.sampled(3)
def test_every_device_and_precision_agrees(backend, precision, law):
    wanted = end_of(molecule(law=LAWS[law]))
    found = end_of(molecule(law=LAWS[law]), backend=backend, precision=precision)
    # 100 steps round places of 1 in f32; arc tangents of Vulkan are good to 4096 units of the last place.
    assert np.abs(found.position - wanted.position).max() < (1e-12 if precision == "f64" else 1e-4)


@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_the_bits_depend_neither_on_threads_nor_on_cuts(plan):
    with Simulation(molecule(), backend="cpu", precision="f64", plan=plan) as simulation:
        simulation.run(steps=60)
        whole = simulation.snapshot()
    with Simulation(molecule(), backend="cpu", precision="f64", plan=plan, threads=1) as simulation:
        cut = run_with_a_way_back(simulation, 25, 20, 35)
    assert np.array_equal(whole.position, cut.position) and np.array_equal(whole.velocity, cut.velocity)


def test_copies_have_the_bits_of_runs_alone():
    starts = [assemble(load_scene(molecule(angle=angle))) for angle in (2.0, 2.6, 3.0)]
    with Simulation(molecule(angle=2.0), backend="cpu", precision="f64", replica_starts=starts) as simulation:
        simulation.run(steps=50)
        together = [simulation.snapshot(copy).position for copy in range(3)]
    for start, found in zip((2.0, 2.6, 3.0), together):
        assert np.array_equal(end_of(molecule(angle=start), 0.5).position, found)


def test_copies_may_have_stiffnesses_of_their_own():
    """The members of a sweep run side by side, and load the stiffness from a field."""
    from mpp_taichi.sweep.structure import own_of, why_alone

    specs = [load_scene(molecule(law={"dihedral": {"stiffness": k, "angle": 3.0}})) for k in (1.0, 2.5)]
    assert why_alone(specs[0]) == "" and own_of(specs) == {("dihedral", "stiffness")}


def test_a_chain_bounces_off_a_floor():
    """Contacts beside torsion: the energy is kept as well as without."""
    scene = molecule({"leapfrog": {"dt": 1e-3}})
    for each in scene["particles"]:
        each["body"] |= {"radius": 0.05, "velocity": [0, 0, -1]}
    scene |= {"walls": [{"plane": {"point": [0, 0, -1.5], "normal": [0, 0, 1]}}]} | SWEPT
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.diagnostics()["total_energy"]
        simulation.run(steps=2000)
        assert simulation.contact_report.wall_count > 1
        # A bounce within a step makes an error of first order in it, v F dt of some forces of 1 to 10.
        assert abs(simulation.diagnostics()["total_energy"] - before) < 0.02


def test_on_a_line_there_is_no_force_and_no_nan():
    """A chain that is not on a line at the start may come onto it."""
    from compiled import CompiledForces, build_force, snapshot_of

    from mpp_taichi.device import backends

    backends.start("cpu", "f64")
    for name in ("dihedral", "periodic_dihedral"):
        line = snapshot_of([[0, 0, 0], [1, 0, 0], [3, 1, 1], [2, 0, 0], [4, 2, 1]])
        compiled = CompiledForces([build_force(name)], line)
        found = compiled.acceleration(line.position, line.velocity)
        assert np.all(np.isfinite(found)) and np.isfinite(compiled.potential(line.position, line.velocity))


@pytest.mark.parametrize("angle", [0.0, 0.3, -0.5, 1.6, 2.9, -2.8])
def test_the_quantity_is_the_angle(angle):
    spec = load_scene(four(angle))
    setting, start = Setting(spec, assemble(spec)), assemble(spec)
    quantity = component.build("quantities", "dihedral_angle", {"of": tuple((k, 1) for k in range(4)), "zero": 0.0})
    quantity.begin(setting)
    assert quantity.measure(MadeUpSample(start)) == pytest.approx(angle, abs=1e-15 * 8)
    assert quantity.label(setting) == "dihedral of a, b, c, d"
    shifted = component.build("quantities", "dihedral_angle", {"of": tuple((k, 1) for k in range(4)), "zero": 2.0})
    assert shifted.measure(MadeUpSample(start)) == pytest.approx(math.remainder(angle - 2.0, math.tau), abs=1e-14)
    line = replace(start, position=start.position * np.array([1.0, 0.0, 0.0]))
    with pytest.raises(NoResultError, match="on a line"):
        quantity.measure(MadeUpSample(line))


@pytest.mark.parametrize(
    ("of", "message"),
    [
        (["a", "b", "c"], "must be a list of 4 particles or groups"),
        (["a", "b", "c", "a"], "one particle is twice among the four, must be four different particles"),
        (["a", "b", "c", "e"], "no particle is called 'e'"),
        ("a", "is one particle, must be a chain of four or more, or a list of four"),
        (7, "particle 7"),
    ],
)
def test_what_is_no_four_is_refused(of, message):
    scene = four(0.3)
    scene["forces"][0]["dihedral"]["of"] = of
    with pytest.raises(SceneError, match=message):
        load_scene(scene)


def test_the_angle_of_a_long_chain_is_refused():
    spec = load_scene(four(0.3))
    quantity = component.build("quantities", "dihedral_angle", {"of": ((0, 2), (1, 2), (2, 2), (3, 2)), "zero": 0.0})
    with pytest.raises(NoResultError, match="the four groups share particles, must be four particles or groups apart"):
        quantity.begin(Setting(spec, assemble(spec)))


def test_groups_of_different_sizes_are_refused():
    scene = four(0.3)
    scene["particles"].append({"lattice": {"name": "row", "shape": [3], "lower": [0, 5, 0], "upper": [1, 5, 0]}})
    scene["forces"][0]["dihedral"]["of"] = ["a", "b", "row[0:2]", "row[1:3]"]
    with pytest.raises(SceneError, match="the four have 1, 1, 2, 2 particles, must have equally many"):
        load_scene(scene)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dimensions": 2}, "a chain in the plane has no torsion, must be in a scene with dimensions: 3"),
        ({"integrator": {"hermite4": {"dt": 0.01}}}, "needs the derivative of every force, which dihedral lacks"),
        (REPEATING | SWEPT, "cannot be in a box that repeats: a chain would be cut at its faces"),
        (MERGING, "cannot be where spheres merge: the chain would lose a particle"),
    ],
)
def test_where_torsion_has_no_meaning_it_is_refused(change, message):
    scene = four(0.0, turned=False)
    if "contacts" in change:
        for each in scene["particles"]:
            each["body"]["radius"] = 0.01
    with pytest.raises(SceneError, match=message):
        end_of(scene | change)


@pytest.mark.parametrize(("lean", "names"), [(0, r"\(a\), .* \(b\), .* \(c\)"), (1, r"\(b\), .* \(c\), .* \(d\)")])
def test_three_on_a_line_at_the_start_are_refused(lean, names):
    arms, slopes = [1.0, 1.0], [-0.5, 0.5]
    arms[lean] = 1e-8
    with pytest.raises(SceneError, match=f"{names} are on a line at the start, about which the chain has no dihedral angle"):
        end_of(four(0.3, arms=arms, slopes=slopes))


def test_what_other_parts_cannot_do_is_refused():
    with pytest.raises(PrecisionError, match="the force dihedral does not carry low parts"):
        end_of(molecule(), precision="df64")
    with pytest.raises(PrecisionError, match="calls atan, which vulkan has only in f32"):
        end_of(molecule(), backend="vulkan", precision="f64")
    with pytest.raises(UnsupportedError, match="the force dihedral does not have"):
        end_of(molecule() | {"record": {"table": {"columns": ["lyapunov"]}}})
