"""Pressure inside a closed skin: its force and energy, its balance with springs, what runs with it and what is refused."""

import math

import numpy as np
import pytest
from repeated_runs import run_with_a_way_back
from run_ends import end_of

from mpp_taichi import SceneError, Simulation
from mpp_taichi.errors import BackendError, MppError, PrecisionError, UnsupportedError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

PRESSURE, OUTSIDE = 1.7, 0.3


def skin(exponent, *, turn):
    """An irregular skin of seven corners without springs, which goes round one way or the other, between two bodies."""
    angle = "(tau * 6 / 7 * u)"
    size = f"(1 + 0.2 * cos(3 * {angle} + 0.4))"
    bent = [f"{size} * cos({angle}) - u", f"{turn} * {size} * sin({angle})", 0]
    lattice = {"name": "skin", "shape": [7], "lower": [0, 0, 0], "upper": [1, 0, 0], "mass": 0.7, "displacement": bent}
    return {
        "dimensions": 2,
        "particles": [
            {"body": {"mass": 1, "position": [5, 5, 0]}},
            {"lattice": lattice},
            {"body": {"mass": 2, "position": [6, 5, 0]}},
        ],
        "forces": [{"skin_pressure": {"of": "skin", "pressure": PRESSURE, "outside": OUTSIDE, "exponent": exponent}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }


def bubble(count=24, *, exponent=1.0, radius=0.9, method=None, stiffness=10.0, **more):
    """A regular skin on springs without a rest length, whose balance is at the radius 1."""
    pressure = 2.0 * stiffness * math.tan(math.pi / count) / radius ** (2.0 * exponent)
    link = {"stiffness": stiffness, "rest_length": 0}
    springs = [{"link": {"between": [f"skin[{i}]", f"skin[{(i + 1) % count}]"], **link}} for i in range(count)]
    return {
        "dimensions": 2,
        "particles": [{"polygon": {"name": "skin", "count": count, "circumradius": radius, "mass": 0.2, "radius": 0.02}}],
        "springs": springs,
        "forces": [{"skin_pressure": {"of": "skin", "pressure": pressure, "exponent": exponent}}],
        "integrator": method or {"leapfrog": {"dt": 0.01}},
    } | more


def area_of(place):
    x, y = place[:, :2].T
    return 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.0, 1.4])
@pytest.mark.parametrize("turn", [1, -1])
def test_the_force_is_the_slope_of_the_energy(exponent, turn):
    with Simulation(skin(exponent, turn=turn), backend="cpu", precision="f64") as simulation:
        start = simulation.snapshot()
        found = simulation.accelerations() * start.mass[:, None]
        inner = slice(1, len(start.mass) - 1)
        assert (area_of(start.position[inner]) > 0.0) == (turn > 0)
        area = abs(area_of(start.position[inner]))

        def energy(place):
            now = abs(area_of(place[inner]))
            share = now / area
            work = math.log(share) if exponent == 1.0 else (share ** (1.0 - exponent) - 1.0) / (1.0 - exponent)
            return OUTSIDE * (now - area) - PRESSURE * area * work

        step = 1e-4
        for i in range(len(start.mass)):
            for k in range(2):
                moved = np.zeros_like(start.position)
                moved[i, k] = step
                slope = (energy(start.position + moved) - energy(start.position - moved)) / (2.0 * step)
                assert found[i, k] == pytest.approx(-slope, abs=1e-7)
        # No force and no torque on the whole.
        assert np.abs(found.sum(axis=0)).max() < 1e-13
        assert abs(np.sum(start.position[:, 0] * found[:, 1] - start.position[:, 1] * found[:, 0])) < 1e-13
        simulation.run(steps=20)
        assert simulation.diagnostics()["potential_energy"] == pytest.approx(energy(simulation.snapshot().position), rel=1e-12)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_a_bubble_breathes_with_the_period_of_the_closed_form(exponent):
    count, stiffness, mass = 24, 10.0, 0.2
    period = 2.0 * math.pi / math.sqrt(8.0 * exponent * stiffness / mass) / math.sin(math.pi / count)
    swing = 0.004
    scene = bubble(count, exponent=exponent, radius=1.0 - swing, method={"leapfrog": {"dt": period / 400}})
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=400)
        end = simulation.snapshot()
    # After a period it is back where it began, but for the square of its swing and the step's (2 π/400)²/24 of a phase
    # of 2 π.
    assert np.abs(np.linalg.norm(end.position, axis=1) - (1.0 - swing)).max() < 10.0 * swing**2 * swing + 1e-6
    assert np.abs(end.velocity).max() < 0.02 * swing * 2.0 * math.pi / period


METHODS = {
    "velocity_verlet": ({"dt": 5e-3}, 1e-4),
    "yoshida6": ({"dt": 1e-2}, 1e-6),
    "rk4": ({"dt": 5e-3}, 1e-6),
    "dop853": ({"dt": 2e-2}, 1e-8),
    "ias15": ({"dt": 2e-2}, 1e-8),
    "adaptive_dop853": ({"dt": 2e-2}, 1e-6),
    "implicit_midpoint": ({"dt": 5e-3, "tolerance": 1e-12}, 1e-4),
}


@pytest.mark.parametrize("method", METHODS)
def test_methods_of_every_kind_agree(method):
    given, bound = METHODS[method]
    wanted = end_of(bubble(method={"dop853": {"dt": 1e-2}}))
    found = end_of(bubble(method={method: given}))
    assert np.abs(found.position - wanted.position).max() < bound


@pytest.mark.parametrize(("backend", "precision"), [("cpu", "f32"), ("vulkan", "f32"), ("vulkan", "f64"), ("cpu", "ds")])
def test_every_device_and_precision_agrees(backend, precision):
    wanted = end_of(bubble())
    found = end_of(bubble(), backend=backend, precision=precision)
    # 100 steps, in each of which places of 1 are rounded; in ds the sums of the pressure are those of f32.
    assert np.abs(found.position - wanted.position).max() < (1e-12 if precision == "f64" else 1e-5)


@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_the_bits_depend_neither_on_threads_nor_on_cuts(plan):
    scene = bubble()
    with Simulation(scene, backend="cpu", precision="f64", plan=plan) as simulation:
        simulation.run(steps=60)
        whole = simulation.snapshot()
    with Simulation(scene, backend="cpu", precision="f64", plan=plan, threads=1) as simulation:
        cut = run_with_a_way_back(simulation, 25, 20, 35)
    assert np.array_equal(whole.position, cut.position) and np.array_equal(whole.velocity, cut.velocity)


@pytest.mark.parametrize("forces", [[], [{"coulomb": {"coulomb_constant": 1e-12, "softening": 0.1}}]], ids=["alone", "pairs"])
def test_a_balloon_bounces_off_a_floor_and_keeps_its_energy(forces):
    changes = []
    for dt in (2e-3, 5e-4):
        scene = bubble(radius=1.0, stiffness=40.0, method={"leapfrog": {"dt": dt}})
        scene["forces"] += [{"uniform_gravity": {"acceleration": [0, -2.0, 0]}}, *forces]
        scene["walls"] = [{"plane": {"point": [0, -1.2, 0], "normal": [0, 1, 0]}}]
        scene["contacts"] = {"hard_spheres": {"solver": "swept"}}
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            before = simulation.diagnostics()["total_energy"]
            simulation.run(duration=1.5)
            after = simulation.diagnostics()
            assert simulation.contact_report.wall_count > 10
            assert simulation.snapshot().position[:, 1].min() > -1.2
            changes.append(abs(after["total_energy"] - before) / after["kinetic_energy"])
    # A bounce within a step makes an error of first order in the step, as the force on both sides of it differs.
    assert changes[1] < 1e-3 and changes[1] < changes[0] / 2.0


def test_the_area_is_a_quantity():
    from measured import MadeUpSample

    from mpp_taichi import component
    from mpp_taichi.quantities._base import Setting

    spec = load_scene(bubble(radius=1.0))
    start = assemble(spec)
    quantity = component.build("quantities", "enclosed_area", {"of": (0, 24)})
    quantity.begin(Setting(spec, start))
    assert quantity.measure(MadeUpSample(start)) == pytest.approx(12.0 * math.sin(2.0 * math.pi / 24), rel=1e-14)
    assert quantity.label(Setting(spec, start)) == "area inside skin"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dimensions": 3}, "must be in a scene with dimensions: 2"),
        ({"forces": [{"skin_pressure": {"of": "skin[0:2]", "pressure": 1}}]}, "has 2 particles, must have three or more"),
        ({"integrator": {"hermite4": {"dt": 0.01}}}, "needs the derivative of every force, which skin_pressure lacks"),
    ],
)
def test_what_is_no_skin_is_refused(change, message):
    with pytest.raises(SceneError, match=message):
        end_of(bubble() | change)


def test_what_other_parts_cannot_do_is_refused():
    with pytest.raises(PrecisionError, match="the force skin_pressure does not carry low parts"):
        end_of(bubble(), precision="df64")
    with pytest.raises(PrecisionError, match="calls pow, which vulkan has only in f32"):
        end_of(bubble(exponent=2.0), backend="vulkan", precision="f64")
    with pytest.raises(UnsupportedError, match="the force skin_pressure does not have"):
        end_of(bubble() | {"record": {"table": {"columns": ["lyapunov"]}}})
    with pytest.raises(BackendError, match="reads all particles has no plan replicas"):
        end_of(bubble(), replica_starts=[assemble(load_scene(bubble()))] * 2)
    line = bubble()
    line["particles"][0] = {"lattice": {"name": "skin", "shape": [24], "lower": [0, 0, 0], "upper": [1, 0, 0]}}
    with pytest.raises(MppError, match="its corners enclose no area at the start"):
        end_of(line)
