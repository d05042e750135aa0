"""Functions through points: the curve against SciPy's, its values in kernels, and formulas that call it in every place.

A cubic is its own spline ("not-a-knot"), so a scene with the points of a cubic and a scene with its formula agree to rounding.
"""

from pathlib import Path

import numpy as np
import pytest
import taichi as ti
from scipy.interpolate import CubicSpline

from mpp_taichi import Simulation, resume
from mpp_taichi.arithmetic.elementary_functions import at_points
from mpp_taichi.arithmetic.point_function import PointFunction, _cubic
from mpp_taichi.arithmetic.point_lookup import provide
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.device import backends
from mpp_taichi.errors import StabilityError
from mpp_taichi.scene.formulas.rounding_steps import Rounded, RoundingArithmetic
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.sweep.replicas import Bench, MemberDevice
from mpp_taichi.sweep.runner import run_members
from mpp_taichi.sweep.store import SweepStore
from mpp_taichi.sweep.structure import key_of

SEED = 11
UNEVEN = np.cumsum(np.random.default_rng(SEED).uniform(0.1, 2.0, 23)) - 7.0
EVEN = np.linspace(-3.0, 5.0, 17)


def heights(x, *, repeats=False, seed=SEED):
    y = np.random.default_rng(seed).normal(size=len(x))
    y[-1] = y[0] if repeats else y[-1]
    return y


@pytest.mark.parametrize("count", [2, 3, 4, 5, 8, 60])
@pytest.mark.parametrize("repeats", [False, True])
def test_the_curve_is_the_cubic_spline_of_scipy(count, repeats):
    """The rounding errors of a spline grow with the ratio of neighbouring distances, at most 20 here, and with its slopes."""
    x = np.cumsum(np.random.default_rng(SEED).uniform(0.1, 2.0, count))
    y = heights(x, repeats=repeats)
    curve, other = PointFunction("f", x, y, repeats=repeats), CubicSpline(x, y, bc_type="periodic" if repeats else "not-a-knot")
    at = np.linspace(x[0], x[-1], 301)
    for derivative in range(3):
        expected = other(at, derivative)
        scale = max(np.abs(expected).max(), np.abs(y).max() / np.diff(x).min() ** derivative)
        assert np.abs(curve.at(at, derivative) - expected).max() <= 1e3 * np.finfo(float).eps * scale


def test_the_error_of_the_curve_is_of_fourth_order():
    errors = []
    for count in (21, 41, 81):
        x = np.linspace(0.0, 5.0, count)
        at = np.linspace(0.0, 5.0, 2001)
        errors.append(np.abs(PointFunction("f", x, np.sin(x)).at(at) - np.sin(at)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4.0) < 0.3)  # of the next order is a term of h/5


@ti.data_oriented
class Lookup:
    """A kernel that evaluates a curve with its derivatives."""

    def __init__(self, curve, given, found):
        self.curve, self.given, self.found = curve, given, found

    @ti.kernel
    def evaluate(self):
        for i in self.given:
            for derivative in ti.static(range(4)):
                self.found[i][derivative] = self.value(derivative, self.given[i])

    @traced
    def value(self, derivative, x):
        return at_points(self.curve, derivative, x)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
@pytest.mark.parametrize("kind", ["uneven", "even", "two", "repeats", "even and repeats"])
@pytest.mark.sampled(3)
def test_kernels_find_the_same_values(backend, precision, kind):
    """Within the bound of the rounding errors, at random places and at the points; beyond the points there is no number."""
    x = {"two": np.array([0.5, 2.0])}.get(kind, EVEN if "even" in kind.split() else UNEVEN)
    curve = PointFunction("f", x, heights(x, repeats="repeats" in kind), repeats="repeats" in kind)
    span = curve.span if curve.repeats else 0.0
    inside = np.concatenate(
        [
            np.random.default_rng(SEED).uniform(x[0] - 3 * span, x[-1] + 3 * span, 500),
            x,
            np.nextafter(x, 9.0),
            np.nextafter(x, -9),
        ]
    )
    at = np.clip(inside, x[0], x[-1]) if not curve.repeats else inside
    outside = np.array([x[0] - 1.0, x[-1] + 1.0, 1e30, -1e30, np.nan])
    places = np.concatenate([at, outside])
    backends.start(backend, precision)
    provide([curve])
    given, found = ti.field(float, len(places)), ti.Vector.field(4, float, len(places))
    kind_of = np.float32 if precision == "f32" else np.float64
    given.from_numpy(places.astype(kind_of))
    lookup = Lookup(curve, given, found)
    lookup.evaluate()
    values = found.to_numpy()
    for derivative in range(3):  # the third jumps at each point
        bound = RoundingArithmetic.through_points(Rounded(at, 3.0 * (np.abs(at) + 4.0 * span)), curve, derivative).error
        unit = np.finfo(kind_of).eps
        assert np.all(np.abs(values[: len(at), derivative] - curve.at(at, derivative)) <= unit * bound)
    if not curve.repeats:
        assert np.isnan(values[len(at) :]).all()


@pytest.mark.parametrize("repeats", [False, True])
def test_the_bound_of_a_number_beside_a_point_holds_for_both_cubics(repeats):
    """Rounding decides on which side of a point a number is; the second derivatives of both sides differ by rounding errors."""
    for seed in range(200):
        curve = PointFunction("f", EVEN, heights(EVEN, repeats=repeats, seed=seed), repeats=repeats)
        points = EVEN[1:-1]
        before, after = curve.coefficients[:-1], curve.coefficients[1:]
        for derivative in range(4):
            bound = RoundingArithmetic.through_points(Rounded(points, 0.0), curve, derivative).error * np.finfo(float).eps
            jump = np.abs(_cubic(np.diff(EVEN)[:-1], before, derivative) - _cubic(0.0 * points, after, derivative))
            assert np.all(jump <= bound)
            middle = 0.5 * (EVEN[1:] + EVEN[:-1])  # no point is near, so nothing jumps
            assert np.all(RoundingArithmetic.through_points(Rounded(middle, 0.0), curve, derivative).error < 1e6)


def test_a_function_that_repeats_has_a_value_at_each_number():
    """Rounding takes a number of many periods out of all points by more than the points are continued."""
    curve = PointFunction("f", UNEVEN, heights(UNEVEN, repeats=True), repeats=True)
    at = np.random.default_rng(SEED).uniform(-1e14, 1e14, 100_000)
    assert np.isfinite(curve.at(at)).all()


CUBIC = {"x": [0.01, 0.5, 0.9, 1.6, 2.5, 4.0, 9.0], "of": lambda x: (x - 1.0) ** 2 + 0.1 * (x - 1.0) ** 3}
POINTS = [[x, CUBIC["of"](x)] for x in CUBIC["x"]]


def points_between(low, high):
    return [[float(x), CUBIC["of"](float(x))] for x in np.linspace(low, high, 9)]


def cluster(force, integrator="leapfrog", **more):
    """Twelve masses of a bent ladder, with springs along it."""
    places = [[0.9 * (i // 2) + 0.05 * (i % 3), 0.8 * (i % 2) + 0.02 * i, 0.03 * i] for i in range(12)]
    bodies = [{"body": {"position": place, "mass": 1.0 + 0.1 * i}} for i, place in enumerate(places)]
    links = [{"link": {"between": [i, i + 2], "stiffness": 2.0}} for i in range(10)]
    return {
        "functions": {"u": {"points": POINTS}, "w": {"points": points_between(-30.0, 30.0)}},
        "particles": bodies,
        "springs": links,
        "forces": [force],
        "integrator": {integrator: {"dt": 0.01}},
        "run": {"steps": 30},
        **more,
    }


FORMULA = "({0} - 1)^2 + 0.1*({0} - 1)^3"
PLACES = {
    "pair": ({"potential": "u(r)"}, {"potential": FORMULA.format("r")}),
    "bond": ({"potential": "u(l)"}, {"potential": FORMULA.format("l")}),
    "potential": (
        {"potential": "w(x) - w(-y)/2"},
        {"potential": f"{FORMULA.format('x')} - ({FORMULA.format('(-y)')})/2"},
    ),
    "acceleration": (
        {"acceleration": ["w(t)", "0", "w(2*t)*sin(x)"]},
        {"acceleration": [FORMULA.format("t"), "0", f"({FORMULA.format('(2*t)')})*sin(x)"]},
    ),
}
"""In each, the same law by its points and by its formula."""


def forces_of(place):
    name = place if place in ("pair", "bond") else "external"
    return [{name: parameters} for parameters in PLACES[place]]


def run(scene, **device):
    with Simulation(scene, **device) as simulation:
        simulation.run(judge="off")
        return simulation.snapshot()


@pytest.mark.parametrize("integrator", ["leapfrog", "hermite4", "implicit_midpoint", "ias15", "rk4"])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.sampled(3)
def test_the_points_of_a_cubic_act_as_its_formula_does(place, integrator):
    """Coefficients are rounded differently; 30 steps of at most 15 evaluations each add such errors, which grow little."""
    ends = [run(cluster(force, integrator), backend="cpu", precision="f64") for force in forces_of(place)]
    assert np.abs(ends[0].position - ends[1].position).max() < 30 * 15 * 30 * np.finfo(float).eps
    assert np.abs(ends[0].position - assemble(load_scene(cluster(forces_of(place)[0]))).position).max() > 1e-3


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.sampled(3)
def test_the_points_of_a_cubic_act_as_its_formula_does_in_single_precision(place, backend):
    ends = [run(cluster(force), backend=backend, precision="f32") for force in forces_of(place)]
    assert np.abs(ends[0].position - ends[1].position).max() < 30 * 30 * np.finfo(np.float32).eps


def test_a_tangent_takes_the_derivative_of_the_curve():
    ends = []
    for force in forces_of("potential"):
        scene = cluster(force, expect={"lyapunov": {"above": -1e9}})
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.run(judge="off")
            ends.append(np.concatenate(simulation.phase.tangent.read_deviation()))
    assert np.abs(ends[0] - ends[1]).max() < 30 * 100 * np.finfo(float).eps * np.abs(ends[1]).max()


def hand(points, **more):
    return {
        "functions": {"height": {"points": points, **more}},
        "particles": [
            {"body": {"name": "hand", "mass": 1.0, "path": ["0", "0.1*height(2*t)", "height(t)"]}},
            {"body": {"name": "ball", "mass": 1.0, "position": [0, 0, -1]}},
        ],
        "springs": [{"link": {"between": ["hand", "ball"], "stiffness": 20.0}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 4.0},
    }


def test_a_body_moves_on_a_curve_through_points_and_a_run_goes_on_with_the_same_bits(tmp_path):
    t = np.linspace(0.0, 10.0, 41)
    scene = hand([[float(each), float(np.sin(each) ** 2)] for each in t])
    spline = CubicSpline(t, np.sin(t) ** 2)

    def curve(at, derivative=0):
        return float(spline(at, derivative))

    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.checkpoint(tmp_path / "run.archive", every=1000.0)
        simulation.run(steps=150)
        simulation.checkpoint(tmp_path / "run.archive")
        whole = simulation.run(steps=250).snapshot()
    with resume(tmp_path / "run.archive") as simulation:
        again = simulation.run(steps=400 - simulation.step_count).snapshot()
    assert np.array_equal(whole.position, again.position) and np.array_equal(whole.velocity, again.velocity)
    assert whole.position[0] == pytest.approx([0.0, 0.1 * curve(8.0), curve(4.0)], abs=1e-14)
    assert whole.velocity[0] == pytest.approx([0.0, 0.2 * curve(8.0, 1), curve(4.0, 1)], abs=1e-13)


def test_members_of_a_sweep_with_other_points_have_a_step_of_their_own():
    specs = [load_scene(hand([[0, 0], [1, end], [9, 0]])) for end in (0.5, 0.5, 0.6)]
    one, same, other = (key_of(spec, assemble(spec)) for spec in specs)
    assert one == same != other


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
def test_a_particle_that_leaves_the_points_is_told_of_with_their_ends(backend):
    scene = {
        "functions": {"slope": {"points": [[-1, 0], [0, 0.2], [1, 0.5], [2, 1]]}},
        "particles": [{"body": {"mass": 1.0, "position": [0, 0, 0], "velocity": [-1, 0, 0]}}],
        "forces": [{"external": {"potential": "slope(x)"}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 10.0},
    }
    with Simulation(scene, backend=backend) as simulation, pytest.raises(StabilityError) as caught:
        simulation.run()
    assert "the points of slope reach from -1 to 2, beyond which a formula is no number" in str(caught.value)
    assert "particle 0" in str(caught.value) and caught.value.time == pytest.approx(simulation.time + 0.01)


def crystal(side, points, integrator="leapfrog", **more):
    """Particles of a lattice, in 3-D, that the curve makes attract and repel each other."""
    lattice = {
        "shape": [side] * 3,
        "lower": [0, 0, 0],
        "upper": [1.1 * (side - 1)] * 3,
        "mass": 2.0,
        "scatter": [0.1, 0.1, 0.1],
    }
    return {
        "functions": {"u": {"points": points}},
        "particles": [{"lattice": lattice}],
        "forces": [{"pair": {"potential": "k*u(r)", "parameters": {"k": 1.5}}}],
        "integrator": {integrator: {"dt": 0.001}},
        "run": {"steps": 20},
        **more,
    }


def points_of_a_well(places):
    return [[float(r), float(np.exp(-2.0 * (r - 1.0)) - 2.0 * np.exp(1.0 - r))] for r in places]


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.parametrize("side", [2, 3, 6])
@pytest.mark.parametrize("spacing", [np.linspace, np.geomspace])
@pytest.mark.sampled(3)
def test_sums_over_pairs_take_curves_in_every_plan(side, plan, precision, spacing):
    """Beside a sum by NumPy; loops over many pairs are compiled in explicit vectors, which read fields in their own way."""
    points = points_of_a_well(spacing(0.3, 14.0, 200))
    curve = PointFunction("u", *np.array(points).T)
    with Simulation(crystal(side, points), backend="cpu", precision=precision, plan=plan) as simulation:
        found, energy = simulation.accelerations(), simulation.diagnostics()["potential_energy"]
        start = simulation.snapshot().position
    away = start[None] - start[:, None]
    distance = np.linalg.norm(away, axis=2) + np.eye(len(start))
    slope = curve.at(distance, 1) * (1.0 - np.eye(len(start)))
    expected = 1.5 * ((slope / distance)[..., None] * away).sum(axis=1) / 2.0
    # Of each pair: the distance with 3 roundings, times the slope of the force, and the cubic of 8 roundings.
    slack = 3.0 * distance * np.abs(curve.at(distance, 2)) + 8.0 * curve.magnitude_at(distance, 1) + 6.0 * np.abs(slope)
    unit = np.finfo(np.float32 if precision == "f32" else np.float64).eps
    assert np.abs(found - expected).max() <= 1.5 * unit * (
        slack.sum(axis=1).max() + len(start) * np.abs(slope).sum(axis=1).max()
    )
    total = 1.5 * np.triu(curve.at(distance), 1).sum()
    assert abs(energy - total) <= 1.5 * unit * 30.0 * np.triu(curve.magnitude_at(distance) + np.abs(slope) * distance, 1).sum()


@pytest.mark.parametrize("integrator", ["hermite4", "ias15", "implicit_midpoint"])
@pytest.mark.sampled(3)
def test_many_particles_on_a_curve_move_as_on_its_formula(integrator):
    """The points of a cubic, of 64 particles; derivatives of the force are summed in loops of their own."""
    points = points_between(0.1, 9.0)
    by_points = crystal(4, points, integrator)
    by_formula = {**by_points, "forces": [{"pair": {"potential": f"1.5*({FORMULA.format('r')})"}}]}
    ends = [run(scene, backend="cpu", precision="f64").position for scene in (by_points, by_formula)]
    assert np.abs(ends[0] - ends[1]).max() < 20 * 15 * 64 * np.finfo(float).eps


def test_members_of_a_sweep_side_by_side_move_as_alone(tmp_path):
    """Copies side by side are lanes of a vector, each of which looks its own place up."""
    points = points_of_a_well(np.linspace(0.3, 14.0, 200))
    scene = crystal(2, points)
    vary = {"forces.pair.parameters.k": [1.0, 1.5, 2.0], "particles[0].lattice.mass": [2.0, 3.0]}
    scene["sweep"] = {"vary": vary, "measure": ["kinetic_energy"]}
    store = SweepStore(Path("unused"), load_scene(scene).resolved, "scene", {"backend": "cpu", "precision": "f64"}, 4)
    numbers = list(range(store.plan.count))
    values, bench = store.plan.values(numbers), Bench(MemberDevice("cpu", "f64", 1))
    rows = run_members(numbers, values, store.resolved, store.source, bench, store.own)
    assert [row.status for row in rows] == ["ok"] * 6 and len({row.values[0] for row in rows}) == 6
    for row, given in zip(rows, values, strict=True):
        alone = load_scene({key: value for key, value in scene.items() if key != "sweep"}, overrides=dict(given))
        with Simulation(alone, backend="cpu", precision="f64") as simulation:
            energy = simulation.run(judge="off").diagnostics()["kinetic_energy"]
        assert row.values[0] == pytest.approx(energy, rel=20 * 30 * np.finfo(float).eps)


@pytest.mark.parametrize("solver", ["swept", "pairwise"])
@pytest.mark.parametrize("wall", ["motion", "turning"])
def test_walls_move_and_turn_by_curves(wall, solver):
    """The cubic 0.1 t³ − 0.2 t² by its points and as a formula; after some bounces both balls are at the same place."""
    points = [[float(t), float(0.1 * t**3 - 0.2 * t**2)] for t in np.linspace(-0.5, 4.0, 7)]
    ends = []
    for law in ("f(t)", "0.1*t^3 - 0.2*t^2"):
        moved = {"motion": ["0", law]} if wall == "motion" else {"turning": {"angle": law, "about": [0, 0]}}
        scene = {
            "dimensions": 2,
            "functions": {"f": {"points": points}},
            "particles": [{"body": {"mass": 1.0, "position": [0.3, 0.5], "radius": 0.05}}],
            "forces": [{"uniform_gravity": {"acceleration": [0, -2]}}],
            "walls": [{"plane": {"point": [0, 0], "normal": [0, 1], **moved}}],
            "contacts": {"hard_spheres": {"solver": solver, **({"restitution": 0.9} if solver == "swept" else {})}},
            "integrator": {"velocity_verlet": {"dt": 1e-3}},
            "run": {"duration": 2.5},
        }
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            ends.append(simulation.run(judge="off").snapshot())
            assert simulation.contact_report.wall_count > 1
    assert np.abs(ends[0].position - ends[1].position).max() < 1e-10  # 2,500 steps, and bounces that enlarge an error fourfold
