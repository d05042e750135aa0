"""The precision df64: forces, constants and sums in double-single arithmetic, on the CPU and on Vulkan."""

import math
from pathlib import Path

import numpy as np
import pytest
import taichi as ti
from test_precision import figure_eight, swinging_sheet

from mpp_taichi import Simulation
from mpp_taichi.arithmetic import double_single
from mpp_taichi.arithmetic.force_numbers import root
from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.device import backends, double_single_probe
from mpp_taichi.device.backends import Probes
from mpp_taichi.errors import BackendError, PrecisionError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.state.two_part_field import TwoPartField
from scenes import cluster, everything, kepler

SQUARE = 2.0**-48  # u², u the unit round-off of f32
TARGET = 1e-12  # of the size of the system
OUTER = Path(__file__).parents[2] / "scenes" / "outer_solar_system.yaml"
RUNS = {
    "kepler": (kepler(0.3, dt=2 * math.pi / 200, integrator="pefrl"), 100),
    "figure eight": (figure_eight(200), 100),
    "outer solar system": (load_scene(OUTER, overrides=["integrator={pefrl: {dt: 50}}"]), 100),
    "damped springs": (swinging_sheet("leapfrog"), 200),
    "cluster": (cluster(40), 50),
    "all forces, a held axis": (everything(), 100),
    "Runge-Kutta": (kepler(0.3, dt=0.02, integrator="rk4"), 100),
    "force gradient": (kepler(0.3, dt=0.02, integrator="chin4a"), 100),
}
WHERE = [(name, *where) for name in RUNS for where in (("cpu", "serial"), ("vulkan", "parallel"))]
WHERE += [("cluster", "cpu", "parallel")]  # of all forces at once both plans have the same bits, see below


def end_of(scene, steps, **options):
    with Simulation(scene, **options) as simulation:
        end = simulation.run(steps=steps).snapshot()
        return end.position, end.velocity


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("name", "backend", "plan"), WHERE)
def test_motions_are_those_of_f64_to_1e_12(name, backend, plan, request):
    """In some hundred steps f64 is off by 10⁻¹⁵ and single-precision forces are by 10⁻⁸."""
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    scene, steps = RUNS[name]
    truth, _ = end_of(scene, steps, backend="cpu", precision="f64")
    found, _ = end_of(scene, steps, backend=backend, plan=plan, precision="df64")
    assert np.abs(found - truth).max() <= TARGET * math.sqrt(np.mean(np.sum(truth**2, axis=1)))


@pytest.mark.parametrize(("method", "steps"), [("kahan_li8", 400), ("rk4", 4000), ("chin4a", 4000)])
@pytest.mark.sampled(3)
def test_thousands_of_updates_on_an_orbit_leave_1e_12(method, steps):
    """One revolution with e = 0.6. Each update rounds x to 48 bits; added up, that would be some 10⁻¹¹ of the axis."""
    scene = kepler(0.6, dt=2 * math.pi / steps, integrator=method)
    truth, _ = end_of(scene, steps, backend="cpu", precision="f64")
    found, _ = end_of(scene, steps, backend="cpu", precision="df64")
    assert np.abs(found - truth).max() <= TARGET


@pytest.mark.sampled(3)
def test_a_period_of_the_figure_of_eight_leaves_1e_12_on_vulkan(software_vulkan):
    truth, _ = end_of(figure_eight(400, "kahan_li8"), 400, backend="cpu", precision="f64")
    found, _ = end_of(figure_eight(400, "kahan_li8"), 400, backend="vulkan", precision="df64")
    assert np.abs(found - truth).max() <= TARGET


def test_a_start_keeps_every_bit_of_f64():
    with Simulation(cluster(40), backend="cpu", precision="df64") as simulation:
        found, start = simulation.snapshot(), simulation.start
    assert np.array_equal(found.position, start.position) and np.array_equal(found.velocity, start.velocity)


@pytest.mark.sampled(3)
def test_both_plans_give_the_same_bits():
    ends = [end_of(everything(), 30, backend="cpu", plan=plan, precision="df64") for plan in ("serial", "parallel")]
    assert np.array_equal(ends[0], ends[1])


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
def test_operations_are_right_to_the_bounds_that_they_state(backend, request):
    """Bounds of Joldes, Muller and Popescu in u²; also where a difference nearly cancels, and at sizes 10⁻⁶ … 10⁶."""
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    device, count = backends.start(backend, "df64"), 2000

    class Guards:
        guards_rounding = not device.probes.compensation

    state = Guards()
    state.nothing = ti.field(ti.i32, ())
    fields = [TwoPartField(state, ti.field(ti.f32, count), ti.field(ti.f32, count)) for _ in range(8)]
    a, b, *results = fields

    @ti.kernel
    def operate():
        for i in range(count):
            results[0][i] = a[i] + b[i]
            results[1][i] = a[i] - b[i]
            results[2][i] = a[i] * b[i]
            results[3][i] = a[i] / b[i]
            results[4][i] = root(b[i])
            results[5][i] = inverse_root(b[i])

    random = np.random.default_rng(5)
    x = random.uniform(-1, 1, count) * 10.0 ** random.uniform(-6, 6, count)
    y = np.abs(x) * np.where(np.arange(count) % 2, 1.0 + 1e-6 * random.uniform(-1, 1, count), random.uniform(0.01, 100, count))
    for field, values in ((a, x), (b, y)):
        field.from_numpy(values)
    operate()
    x, y = a.to_numpy(), b.to_numpy()  # as kept: f64 has them exactly, and its own rounding is u²/32
    exact = [x + y, x - y, x * y, x / y, np.sqrt(y), 1.0 / np.sqrt(y)]
    for found, truth, bound in zip(results, exact, (3, 3, 7, 10, 4, 4), strict=True):
        assert np.abs(found.to_numpy() - truth).max() > 0.0 or found is results[1]
        assert (np.abs(found.to_numpy() - truth) <= (bound * SQUARE + 2.0**-52) * np.abs(truth)).all()


@pytest.mark.parametrize("precision", ["ds", "df64"])
@pytest.mark.sampled(3)
def test_friction_slows_by_both_parts_of_a_velocity(precision):
    """v = v₀ exp(−c t) in f64 by the same method: df64 is off by roundings of 48 bits, ds by those of its force.

    c = 1/8 and 1 have no low part. Each of 4 slopes of a kick is rounded at u of h c v, and n of them add up at random.
    """
    steps, dt, c, start = 4000, 2.0**-9, 0.125, 1000.0 + 1 / 3
    drag = [{"linear_drag": {"coefficient": c}}]
    body = {"body": {"mass": 1, "position": [start, 0, 0], "velocity": [1 / 3, 0, 0]}}
    scene = {"title": "Brake", "particles": [body], "forces": drag, "integrator": {"yoshida4": {"dt": dt}}}
    (truth, _), (found, _) = (end_of(scene, steps, backend="cpu", precision=each) for each in ("f64", precision))
    rounding = 16 * steps * 2.0**-47 * start  # four drifts and kicks a step, each to 2⁻⁴⁷ at most, and f64 as well
    of_forces = 4 * 2.0**-24 * dt * c / 3 * math.sqrt(4 * 3 * steps) * steps * dt if precision == "ds" else 0.0
    assert abs(found - truth)[0, 0] <= rounding + of_forces


@pytest.mark.sampled(3)
def test_live_parameters_have_low_parts():
    """A slider's drag of 1/7 is not the 1/7 of f32, which would move a stone by 10⁻⁹."""
    stone = {"body": {"mass": 0.1, "position": [1 / 3, 0, 0]}}
    scene = {
        "title": "Stone",
        "particles": [stone],
        "forces": [{"uniform_gravity": {"acceleration": [1 / 3, -0.1, 0]}}, {"linear_drag": {"coefficient": 1 / 7}}],
        "integrator": {"yoshida4": {"dt": 2.0**-6}},
        "sliders": [{"set": "forces.linear_drag.coefficient"}],
    }
    (truth, _), (found, _) = (end_of(scene, 200, backend="cpu", precision=each) for each in ("f64", "df64"))
    assert np.abs(found - truth).max() <= 200 * 16 * 2.0**-47


@pytest.mark.sampled(3)
def test_energies_and_accelerations_are_those_of_f64():
    """Masses, charges and parameters such as 0.7 are not rounded to f32, which would change energies by 10⁻⁸."""
    found = {}
    for precision in ("f64", "df64"):
        with Simulation(everything(), backend="cpu", precision=precision) as simulation:
            simulation.run(steps=5)
            snapshot, energies = simulation.snapshot(), simulation.mechanics()
            found[precision] = energies, simulation.accelerations(snapshot)
    for name in ("kinetic_energy", "potential_energy", "total_energy"):
        assert found["df64"][0][name] == pytest.approx(found["f64"][0][name], rel=1e-12)
    assert np.abs(found["df64"][1] - found["f64"][1]).max() <= 1e-12 * np.abs(found["f64"][1]).max()


def test_restarts_and_marks_keep_every_bit():
    with Simulation(figure_eight(400), backend="cpu", precision="df64") as simulation:
        mark = simulation.mark()
        first = simulation.run(steps=50).state.read()
        simulation.return_to(mark)
        again = simulation.run(steps=50).state.read()
        simulation.restart()
        anew = simulation.run(steps=50).state.read()
    assert np.array_equal(first, again) and np.array_equal(first, anew)


@pytest.mark.sampled(3)
def test_forces_have_low_parts_only_where_the_precision_asks_for_them():
    sizes = {}
    for precision in ("f32", "f32c", "ds", "df64", "f64"):
        with Simulation(figure_eight(100), backend="cpu", precision=precision) as simulation:
            sizes[precision] = simulation.state.field_sizes()
    assert sizes["df64"]["mass_low"] == sizes["df64"]["mass"] == sizes["f32"]["mass"]
    assert not any(name in sizes[each] for each in ("f32", "f32c", "ds", "f64") for name in ("mass_low", "acceleration_low"))


# --- what is refused ----------------------------------------------------------------------------------------------------


def test_the_probe_fails_where_products_are_rounded(monkeypatch):
    backends.start("cpu", "f32")
    assert double_single_probe.is_double_single_right(ti, guards_rounding=False)

    @ti.func
    def rounding(state: ti.template(), a, b):
        return a * b, 0.0 * a

    monkeypatch.setattr(double_single, "two_product", rounding)
    assert not double_single_probe.is_double_single_right(ti, guards_rounding=False)


def test_software_vulkan_needs_the_guards_of_products(software_vulkan):
    backends.start("vulkan", "f32")
    assert not double_single_probe.is_double_single_right(ti, guards_rounding=False)
    assert double_single_probe.is_double_single_right(ti, guards_rounding=True)


def test_a_device_whose_products_are_rounded_is_refused_in_one_line(monkeypatch):
    found = {"loop_limit": None, "float64": True, "compensation": True, "low_parts": True, "finds_nan": True}
    monkeypatch.setattr(backends, "_probe_here", lambda ti, backend: Probes(**found, double_single=False))
    with pytest.raises(BackendError, match="rounds the double-single forces of df64; use --precision ds") as caught:
        backends.start("cpu", "df64")
    assert "\n" not in str(caught.value) and caught.value.exit_code == 3
    assert backends.start("cpu", "ds").precision == "ds"


def test_a_force_that_is_single_is_refused_by_name():
    drive = {"harmonic_drive": {"force": [1, 0, 0], "angular_frequency": 1}}
    scene = {"title": "Drive", "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "forces": [drive]}
    with pytest.raises(PrecisionError, match="the force harmonic_drive does not carry low parts, so it cannot run in df64"):
        Simulation({**scene, "integrator": {"leapfrog": {"dt": 0.1}}}, backend="cpu", precision="df64")


@pytest.mark.parametrize(("stretch", "mass", "said"), [(1e8, 1.0, "larger unit of length"), (1.0, 1e-30, "unit of mass")])
def test_numbers_whose_low_parts_underflow_are_refused(stretch, mass, said):
    bodies = [{"body": {"mass": mass, "position": [stretch * x, 0, 0]}} for x in (0, 1)]
    scene = {"title": "Far", "particles": bodies, "forces": [{"newtonian_gravity": {"strength": 1.0}}]}
    with pytest.raises(PrecisionError, match=said):
        Simulation({**scene, "integrator": {"leapfrog": {"dt": 0.1}}}, backend="cpu", precision="df64")
