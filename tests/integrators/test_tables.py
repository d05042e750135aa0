"""Tables of integrators: order conditions, measured order, symmetry, energy and friction of each; refusals by name."""

import math

import numpy as np
import pytest
from order_conditions import density, elementary, node_count, splitting_defects, square, trees
from reference import accelerations
from scipy.integrate import solve_ivp
from test_integrators import ROUND_OFF, declared, kepler_reference, slope

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.accuracy.methods import methods
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.integrators._splitting_table import KICK_METHODS
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from scenes import INTEGRATORS, MORE_TABLES, everything, kepler, takes_friction

BASES = {name: component.declaration("integrators", name).base for name in INTEGRATORS}
SPLITTINGS = [name for name in INTEGRATORS if BASES[name] == "Splitting"]
RUNGE_KUTTA = [name for name in INTEGRATORS if BASES[name] == "RungeKutta"]
# Order of the general conditions where it is less than the method's own, which holds for kicks of places and times alone.
GENERAL_ORDER = {"mclachlan_atela4": 3, "srkn11b": 4, "srkn14a": 4, "rkn8": 4}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", SPLITTINGS)
def test_splittings_fulfil_the_conditions_of_their_order_and_not_of_the_next(name):
    method = component.build("integrators", name, {"dt": 1.0})
    # Each of up to 36 factors rounds coefficients of words that are about one in size, at random: six roundings, twice that.
    allowed = 12 * ROUND_OFF
    own = splitting_defects(method.entries, method.order + 1, kicks_of_place=not method.takes_velocity)
    assert max(own[:-1]) <= allowed < 1e-8 < own[-1]
    general = splitting_defects(method.entries, method.order, kicks_of_place=False)
    order = GENERAL_ORDER.get(name, method.order)
    assert max(general[:order]) <= allowed
    assert method.takes_velocity == (order == method.order)
    assert order == method.order or general[order] > 1e-6


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", RUNGE_KUTTA)
def test_runge_kutta_methods_fulfil_the_conditions_of_their_order_and_not_of_the_next(name):
    method = component.build("integrators", name, {"dt": 1.0})
    a, b = square(method.a, len(method.b)), np.array(method.b)
    # Up to eight factors, each a sum of coefficients whose moduli add up to 100 at most (dop853), each rounded.
    allowed = 8 * 100 * ROUND_OFF
    for order in range(1, method.order + 2):
        defects = [abs(b @ elementary(tree, a) - 1.0 / density(tree)) for tree in trees(order)]
        assert (max(defects) <= allowed) == (order <= method.order)


def extended(method):
    """The tableau with the slope of the end of the step and those of the dense output."""
    return square((*method.a, method.b, *method.dense_stages), len(method.b) + 1 + len(method.dense_stages))


@pytest.mark.parametrize(("name", "orders"), [("bogacki_shampine", (2,)), ("dop853", (5, 3))])
def test_error_weights_are_differences_to_methods_of_lower_order(name, orders):
    """Weights e of b − b̂ with b̂ of order q vanish on all trees up to q, and on some of q + 1 they do not."""
    method = component.build("integrators", name, {"dt": 1.0})
    stages = len(method.b) + 1
    a = extended(method)[:stages, :stages]
    for weights, order in zip(method.error_weights, orders, strict=True):
        e = np.array([*weights, *[0.0] * (stages - len(weights))])
        sums = {q: max(abs(e @ elementary(tree, a)) for tree in trees(q)) for q in range(1, order + 2)}
        assert max(sums[q] for q in range(1, order + 1)) <= 800 * ROUND_OFF
        assert sums[order + 1] > 1e-6


@pytest.mark.parametrize("name", ["bogacki_shampine", "dop853"])
def test_dense_output_is_of_its_order_all_along_the_step(name):
    """Σ b_k(θ) Φ_k = θ^q/γ for trees of q nodes up to its order; the values at θ = 1 are those of the step."""
    method = component.build("integrators", name, {"dt": 1.0})
    a = extended(method)
    rows = np.array([list(row) for row in method.dense_weights])
    for theta in (0.1, 0.37, 0.8, 1.0):
        b = rows @ theta ** np.arange(1, rows.shape[1] + 1)
        for order in range(1, method.dense_order + 1):
            for tree in trees(order):
                assert node_count(tree) == order
                # Weights are sums of coefficients up to 3000 (dop853) that cancel, on top of the factors above.
                assert b @ elementary(tree, a) == pytest.approx(theta**order / density(tree), abs=8 * 3000 * ROUND_OFF)
    np.testing.assert_allclose(b[: len(method.b)], method.b, rtol=0, atol=8 * 3000 * ROUND_OFF)


def test_kick_methods_are_of_their_order():
    """All conditions up to the fourth order; those of linear friction, b·Aᵏ⁻¹·1 = 1/k!, beyond."""
    for order, (rows, weights) in KICK_METHODS.items():
        a, b = square(rows, len(weights)), np.array(weights)
        for q in range(1, order + 1):
            linear = ()
            for _ in range(q - 1):
                linear = (linear,)
            for tree in trees(q) if order <= 4 else (linear,):
                assert b @ elementary(tree, a) == pytest.approx(1.0 / density(tree), abs=4 * ROUND_OFF)


# --- in motion ----------------------------------------------------------------------------------------------------------

# Eccentricity and steps per unit of time on an orbit, steps per unit of time of the bob below: from where the error follows
# its leading term to where it is some times round-off. On orbits dop853's error of eighth order is so small that those of
# ninth and tenth hide it down to round-off; there it is only asked to be above seven.
LADDERS = {
    "ruth3": (0.3, (256, 512, 1024), (64, 96, 128)),
    "pefrl": (0.6, (96, 128, 192, 256), (16, 24, 32)),
    "mclachlan_atela4": (0.6, (64, 96, 128), (32, 48, 64)),
    "srkn6b": (0.6, (96, 128, 192, 256), (24, 32, 48)),
    "srkn11b": (0.6, (20, 24, 32, 40), (4, 5, 6, 8)),
    "srkn14a": (0.6, (20, 24, 32), (6, 8, 10)),
    "rkn8": (0.6, (14, 16, 20, 24), (4, 5, 6, 8)),
    "yoshida6": (0.6, (32, 48, 64), (16, 24, 32)),
    "yoshida8": (0.6, (32, 40, 48), (10, 12, 16)),
    "kahan_li6": (0.6, (24, 32, 48), (16, 24, 32)),
    "kahan_li8": (0.6, (14, 16, 20, 24), (4, 5, 6, 8)),
    "bogacki_shampine": (0.3, (128, 192, 256), (64, 96, 128)),
    "dop853": (0.3, (12, 14, 16), (4, 5, 6, 7, 8)),
}


def test_every_further_table_has_its_ladder():
    assert list(LADDERS) == MORE_TABLES


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", MORE_TABLES)
def test_order_reversibility_and_energy_on_an_orbit(name):
    eccentricity, counts, _ = LADDERS[name]
    order, reversible, symplectic = (declared(name, each) for each in ("order", "time_reversible", "symplectic"))
    with Simulation(kepler(eccentricity, integrator=name), backend="cpu", precision="f64") as simulation:
        errors = []
        for count in counts:
            simulation.dt = 1.0 / count
            simulation.restart()
            error = 0.0
            for _ in range(10):
                simulation.run(steps=count // 2)
                error = max(error, np.abs(simulation.snapshot().position - kepler_reference(simulation)).max())
            errors.append(error)
        # Positions of size 2 and 5·count steps: the error of the phase grows as the 3/2 power, see test_integrators.
        assert errors[-1] > 5 * (5 * counts[-1]) ** 1.5 * ROUND_OFF / 10, "the ladder reaches round-off and shows nothing"
        found = slope(1.0 / np.array(counts), errors)
        assert found == pytest.approx(order, abs=0.1) or name == "dop853" and found > 7.0, errors

        simulation.dt = 0.1
        simulation.restart()
        energy = simulation.diagnostics()["total_energy"]
        largest = []
        for _ in range(10):
            seen = []
            for _ in range(20):
                simulation.run(steps=max(1, round(1.55 / simulation.dt / 4)))
                seen.append(abs(simulation.diagnostics()["total_energy"] / energy - 1.0))
            largest.append(max(seen))
        if symplectic:  # bounded: the largest error of the later turns is that of the first ones
            assert max(largest[5:]) < 1.5 * max(largest[:5]) + 1e-13
        else:
            assert largest[-1] > 2.0 * largest[0]

        steps = simulation.step_count
        simulation.dt = -simulation.dt
        simulation.run(steps=steps)
        back = np.abs(simulation.snapshot().position - simulation.start.position).max()
    # See test_integrators; an orbit of e = 0.6 has three times the shear of one of 0.3, and a step up to 18 drifts.
    limit = 30 * (2 * steps) ** 1.5 * ROUND_OFF * 18**0.5
    assert (back <= limit) == reversible, f"{back:g} against {limit:g}"


DRIVE, FREQUENCY, PHASE, SPRING = 0.3, 1.7, 0.4, 4.0


def swinging_bob(name):
    """A bob between two springs across which it is driven, with drag where the method takes it; apart, an oscillator.

    Springs are damped for one method alone: in a kick of high order they take many seconds to compile.
    """
    drag = 0.3 if takes_friction(name) else 0.0
    friction = 0.3 if name == "kahan_li6" else 0.0
    bodies = [
        {"body": {"mass": 1.0, "position": [-1, 0, 0], "free": [False] * 3}},
        {"body": {"mass": 1.0, "position": [1, 0, 0.5], "free": [False] * 3}},
        {"body": {"mass": 1.3, "position": [0.1, 0.7, 0], "velocity": [0.5, 0.2, -0.6]}},
        {"body": {"mass": 1.0, "position": [0, 5, 0], "free": [False] * 3}},
        {"body": {"mass": 1.0, "position": [0.8, 5, 0], "velocity": [-0.5, 0, 0]}},
    ]
    links = [([0, 2], 2.0, 0.8, friction), ([1, 2], 3.0, 0.9, 2 * friction), ([3, 4], SPRING, 0.0, friction)]
    return {
        "particles": [*bodies],
        "springs": [
            {"link": {"between": pair, "stiffness": stiffness, "rest_length": length, "damping": damping}}
            for pair, stiffness, length, damping in links
        ],
        "forces": [
            {"harmonic_drive": {"force": [0, DRIVE, DRIVE], "angular_frequency": FREQUENCY, "phase": PHASE, "of": 2}},
            *([{"linear_drag": {"coefficient": drag}}] if drag else []),
        ],
        "integrator": {name: {"dt": 0.1}},
    }


def bob_reference(simulation, drag):
    """The bob by SciPy's DOP853 with steps so short that round-off is all its error, from the textbook formulas."""
    start, springs = simulation.start, simulation.start.springs

    def slopes(time, y):
        x, v = start.position.copy(), np.zeros((5, 3))
        x[2], v[2] = y[:3], y[3:]
        a = accelerations.springs(x, v, start.mass, springs.between[:2], *(each[:2] for each in spring_arrays))[2]
        drive = DRIVE * math.sin(FREQUENCY * time + PHASE) * np.array([0.0, 1.0, 1.0])
        return np.concatenate([v[2], a + (drive - drag * v[2]) / start.mass[2]])

    spring_arrays = (springs.stiffness, springs.damping, springs.rest_length)
    y = np.concatenate([start.position[2], start.velocity[2]])
    return solve_ivp(slopes, (0.0, simulation.time), y, method="DOP853", rtol=1e-13, atol=1e-15, max_step=0.02).y[:3, -1]


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", MORE_TABLES)
def test_order_with_drive_and_friction_and_the_amplification_matrix(name):
    method = component.build("integrators", name, {"dt": 1.0})
    scene = swinging_bob(name)
    drag = 0.3 if takes_friction(name) else 0.0
    errors, (_, _, counts) = [], LADDERS[name]
    duration = 4 if name == "dop853" else 2  # elsewhere its terms of eighth and ninth order happen to cancel in part
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for count in counts:
            simulation.dt = 1.0 / count
            simulation.restart()
            simulation.run(steps=duration * count)
            if not errors:
                expected = bob_reference(simulation, drag)
            errors.append(np.abs(simulation.snapshot().position[2] - expected).max())
        simulation.dt = 0.3
        simulation.restart()
        before = simulation.snapshot()
        simulation.run(steps=4)
        after = simulation.snapshot()
    assert slope(1.0 / np.array(counts), errors) == pytest.approx(method.order, abs=0.1), errors
    step = method.amplification(math.sqrt(SPRING) * 0.3, 0.3 * (drag + (0.3 if name == "kahan_li6" else 0.0)))
    ends = [[each.position[4, 0], 0.3 * each.velocity[4, 0]] for each in (before, after)]
    np.testing.assert_allclose(ends[1], np.linalg.matrix_power(step, 4) @ ends[0], rtol=1e-12, atol=1e-14)


# --- what they do not take ----------------------------------------------------------------------------------------------

REFUSING = [name for name in INTEGRATORS if not takes_friction(name)]


def test_those_that_refuse_friction_say_so_as_classes_and_to_the_scene():
    assert REFUSING == ["chin4a", "hermite4", "hermite6", "janus", "mclachlan_atela4", "rkn8", "srkn11b", "srkn14a"]
    assert all(declared(name, "takes_velocity") == takes_friction(name) for name in INTEGRATORS)
    assert all(takes_friction(name) for name in component.proposed("integrators", "friction"))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", REFUSING)
def test_forces_that_depend_on_velocity_are_refused_by_name(name):
    scene = everything(integrator=name)
    assemble(load_scene(scene))
    drag = scene | {"forces": [*scene["forces"], {"linear_drag": {"coefficient": 0.1}}]}
    damped = scene | {"springs": [{"link": scene["springs"][0]["link"] | {"damping": 0.2}}]}
    for wrong, force in ((drag, "linear_drag"), (damped, "damped springs")):
        with pytest.raises(SceneError) as caught:
            assemble(load_scene(wrong))
        (line,) = caught.value.faults
        assert f"integrator.{name}: would lose its order beside {force}" in line and "allowed: pefrl, srkn6b" in line


def test_friction_that_an_event_brings_is_refused_as_well():
    scene = everything(integrator="srkn14a") | {"run": {"duration": 1.0}}
    scene["timeline"] = [{"at": 0.5, "set": {"springs[0].link.damping": 0.1}}]
    with pytest.raises(SceneError, match=r"integrator.srkn14a: would lose its order beside damped springs"):
        Simulation(scene, backend="cpu")


def test_a_comparison_leaves_out_what_the_scene_would_be_refused_with():
    scene = everything() | {"run": {"duration": 0.1}}
    still = everything(damping=0.0, drag=0.0) | {"run": {"duration": 0.1}}
    compared, without = (set(methods(pose(load_scene(each)))) for each in (scene, still))
    assert without - compared == set(REFUSING) and {"kahan_li8", "dop853"} <= compared
