"""The precisions f32, f32c, ds and f64: their errors, the effect of compilers, and refused methods."""

import json
import math

import numpy as np
import pytest
import taichi as ti

from mpp_taichi import Simulation
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.sample import Configuration
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.sweep import StepSweep
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.arithmetic import low_parts
from mpp_taichi.cli.main import main
from mpp_taichi.device import backends, update_probe
from mpp_taichi.device.backends import Probes
from mpp_taichi.device.fast_taichi import lane_arithmetic
from mpp_taichi.errors import BackendError, SceneError
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.report.expectations import holds
from mpp_taichi.scene.load import load_scene
from scenes import cluster, kepler

U = 2.0**-24  # unit round-off of f32
EXTENDED = ("f32c", "ds")
PERIOD = 6.3259139829262116775890


def figure_eight(steps, integrator="pefrl"):
    """Chenciner and Montgomery's choreography, `steps` to a period."""
    v, w = 0.3471168881189269382428, 0.5327249453880302292620
    places, speeds = [[-1, 0], [1, 0], [0, 0]], [[v, w], [v, w], [-2 * v, -2 * w]]
    return {
        "title": "Figure of eight",
        "dimensions": 2,
        "particles": [{"body": {"mass": 1, "position": x, "velocity": u}} for x, u in zip(places, speeds)],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {integrator: {"dt": PERIOD / steps}},
    }


def binary(offset, dt=2.0**-9, integrator="leapfrog"):
    """Two masses of ½ on a circle of diameter 1 around (offset, 0), in numbers that f32 has exactly."""
    bodies = [{"mass": 0.5, "position": [offset + side, 0], "velocity": [0, 2 * side * 0.5]} for side in (-0.5, 0.5)]
    return {
        "title": "Binary",
        "dimensions": 2,
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {integrator: {"dt": dt}},
    }


def swinging_sheet(integrator, damping=0.25):
    """Six masses on springs under gravity, one held; all constants are numbers that f32 has exactly."""
    places = [[0, 0, 0], [1, 0, 0], [2, 0.25, 0], [0, -1, 0.5], [1, -1.25, 0], [2, -1, 0]]
    bodies = [{"body": {"mass": 0.5, "position": place, "free": [k > 0] * 3}} for k, place in enumerate(places)]
    ends = [(0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5), (0, 4), (1, 5)]
    links = [{"between": list(pair), "stiffness": 64.0, "rest_length": 1.0, "damping": damping} for pair in ends]
    return {
        "title": "Sheet",
        "particles": bodies,
        "springs": [{"link": link} for link in links],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -8.0]}}],
        "integrator": {integrator: {"dt": 2.0**-11}},
    }


def end_of(scene, steps, **options):
    with Simulation(scene, **options) as simulation:
        return simulation.run(steps=steps).snapshot()


# --- the compiler -------------------------------------------------------------------------------------------------------


def test_the_probe_finds_low_parts_kept_on_the_cpu_and_lost_where_an_update_rounds(monkeypatch):
    assert backends.start("cpu", "f32").probes.low_parts
    assert update_probe.keeps_low_parts(ti, guards_rounding=True)

    @ti.func
    def rounding(state: ti.template(), high, low, addend):
        return high + (addend + low), 0.0 * low

    monkeypatch.setattr(low_parts, "added", rounding)
    assert not update_probe.keeps_low_parts(ti, guards_rounding=False)


def test_the_probe_does_not_depend_on_the_precision_that_it_runs_under():
    backends.start("cpu", "f64")
    assert update_probe.keeps_low_parts(ti, guards_rounding=False)


def test_software_vulkan_takes_low_parts_away_unless_they_are_guarded(software_vulkan):
    probes = backends.start("vulkan", "ds").probes
    assert probes.low_parts and not probes.compensation
    assert not update_probe.keeps_low_parts(ti, guards_rounding=False)
    assert update_probe.keeps_low_parts(ti, guards_rounding=True)


@pytest.mark.parametrize("precision", EXTENDED)
@pytest.mark.sampled(3)
def test_software_vulkan_moves_particles_as_the_cpu_does(precision, software_vulkan):
    # Both round their forces, by no more than 8 u of each (about ten operations), which over the time t leaves t² a 8 u at
    # most, with a = 1.25 at the start. Rounding of the places themselves, as in f32, is 300 times u/2 and more.
    scene, steps = figure_eight(2000), 300
    here = end_of(scene, steps, backend="cpu", precision=precision)
    there = end_of(scene, steps, backend="vulkan", precision=precision)
    assert np.abs(here.position - here.position.astype(np.float32)).max() > U / 16  # there is something in the low parts
    assert np.abs(here.position - there.position).max() <= (steps * PERIOD / 2000) ** 2 * 1.25 * 8 * U


@pytest.mark.parametrize(
    ("precision", "finding", "said"), [("ds", "low_parts", "loses what ds carries"), ("f64", "float64", "no true f64")]
)
def test_a_precision_that_its_probe_does_not_find_is_refused(precision, finding, said, monkeypatch):
    found = {"loop_limit": None, "float64": True, "compensation": True, "low_parts": True, "finds_nan": True}
    monkeypatch.setattr(backends, "_probe_here", lambda ti, backend: Probes(**found | {finding: False}))
    with pytest.raises(BackendError, match=said):
        backends.start("cpu", precision)
    assert BackendError.exit_code == 3


# --- what is kept -------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", PRECISIONS)
def test_free_flight_far_from_the_origin(precision):
    """A step of 2⁻⁹/3 is 10⁻² of the spacing of f32 at 10⁶: f32 does not move at all, all others are right."""
    scene = {
        "title": "Flight",
        "particles": [{"body": {"mass": 1, "position": [1e6, 0, 0], "velocity": [1 / 3, 0, 0]}}],
        "integrator": {"leapfrog": {"dt": 2.0**-9}},
    }
    way = end_of(scene, 3000, backend="cpu", precision=precision).position[0, 0] - 1e6
    if precision == "f32":
        assert way == 0.0
    else:
        # The sum of each of 2 × 3000 drifts is rounded at u of a spacing, 2⁻²⁴/16; the product at 2⁻³⁶.
        assert abs(way - 3000 * 2.0**-9 / 3) <= 6000 * U / 16 + 2.0**-36 * way


@pytest.mark.sampled(3)
def test_only_ds_and_f64_see_a_pair_far_from_the_origin_as_it_is():
    """At 2²⁰ two bodies a distance 1 apart are eight spacings of f32 from one another, but their separation is exact in ds."""
    errors = {}
    home = end_of(binary(0.0), 1000, backend="cpu", precision="f64").position[:, :2]
    for precision in PRECISIONS:
        far = end_of(binary(2.0**20), 1000, backend="cpu", precision=precision).position[:, :2]
        errors[precision] = np.abs(far - [2.0**20, 0.0] - home).max()
    # Over the time t = 2 the force is right to 8 u of its 2 × ½, and positions to 2⁻⁴⁸ of 2²⁰ a step.
    time = 1000 * 2.0**-9
    assert errors["ds"] <= time**2 * 8 * U + 2 * 1000 * 2.0**-28
    assert errors["f64"] <= errors["ds"]
    assert errors["f32"] > 0.05  # half a spacing of 2⁻³ is lost in every coordinate
    assert errors["f32c"] > 1e-3  # separations are those of rounded places


def rms_energy_error(precision, steps, rotations=6):
    """Root mean square, over a choreography turned in its plane, of the largest relative energy error in a period."""
    with Simulation(figure_eight(steps), backend="cpu", precision=precision) as simulation:
        start, found = simulation.start, []
        for k in range(rotations):
            c, s = math.cos(0.3 + 0.37 * k), math.sin(0.3 + 0.37 * k)
            turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
            simulation.restart()
            simulation.state.write(start.position @ turn, start.velocity @ turn)
            first, errors = simulation.diagnostics()["total_energy"], []
            for _ in range(8):
                simulation.run(steps=steps // 8)
                errors.append(abs(simulation.diagnostics()["total_energy"] / first - 1))
            found.append(max(errors))
    return float(np.sqrt(np.mean(np.square(found))))


@pytest.mark.sampled(3)
def test_energy_floor_is_a_thousand_times_lower_with_low_parts():
    """At h = T/65,536 the error of the method, (h ω)⁴, is 10⁻¹⁶, and all that is left is rounding.

    f32 rounds each of 6 coordinates 5 times a step by ±u 2^e, 2^e ≤ |x| ≤ 1.1 on the mean 0.4: rms 0.4 u/√3, an energy of
    a = 1.2 times that, |E| = 1.29, so √(6 · 5 · 65,536) 0.4 u/√3 = 324 u, 1.9e-5. With low parts forces alone are rounded, by
    about 2 u of each of 6 components in 4 kicks of h/2 on the mean, an energy of h/2 · 2 u · a v, v = 0.7: 0.07 u, 4e-9.
    Both are random walks whose ends scatter by a factor of 2; the ratio of what the two leave is near 1/(4 h ω) = 2600.
    """
    floor = {precision: rms_energy_error(precision, 65_536) for precision in ("f32", *EXTENDED)}
    assert 1.9e-5 / 4 < floor["f32"] < 1.9e-5 * 4
    for precision in EXTENDED:
        assert floor[precision] < floor["f32"] / 1000


@pytest.mark.sampled(2)
@pytest.mark.parametrize("integrator", ["yoshida4", "rk4"])
def test_springs_friction_and_runge_kutta_methods_carry_low_parts(integrator):
    """Places agree with f64 to the rounding of the forces; f32 loses u/2 of x in every step besides.

    A spring of stiffness 64 makes of u of its length 1.1 an acceleration of 64 · 1.1 u/½, four of them act on a mass. Moving it
    with ω = √(4 · 64/½) = 23, one of n random ones, each for h, leaves a place of a/ω² · h ω · √n; 4 for chance.
    """
    scene, steps, dt, omega = swinging_sheet(integrator), 1000, 2.0**-11, 23.0
    end = {each: end_of(scene, steps, backend="cpu", precision=each).position for each in ("f64", "ds", "f32")}
    error = {each: np.abs(end[each] - end["f64"]).max() for each in ("ds", "f32")}
    allowed = 4 * (4 * 64 * 1.1 / 0.5 * U / omega**2) * omega * dt * math.sqrt(steps)
    assert error["ds"] <= allowed < error["f32"] / 2


@pytest.mark.sampled(3)
def test_every_plan_gives_the_same_bits_in_ds_wherever_it_does_in_f64(monkeypatch):
    """The pair sum visits bodies in one order in both plans, and so do low parts; its products are rounded alike here."""
    monkeypatch.setattr(lane_arithmetic, "in_hardware", lambda *_, **__: False)
    scene = cluster(40, softening=0.125)
    ends = [end_of(scene, 50, backend="cpu", precision="ds", plan=plan).position for plan in ("serial", "parallel")]
    assert np.array_equal(ends[0], ends[1])


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
@pytest.mark.sampled(3)
def test_sums_over_many_bodies_lose_nothing_in_ds(backend, request):
    """A sum of n rounded terms in f32 is off by √n u/3 of itself or so: 7 u for 500. In ds only its terms and its end are.

    From 512 bodies on f32 is summed in lanes and chunks on a CPU (symmetric_pairs.py), on a GPU in blocks of 256, and off by
    less: √256 u/3 of half of the sum.
    """
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    scene = cluster(500, softening=0.125, integrator="velocity_verlet")
    for body in scene["particles"]:
        body["body"]["mass"] = 2.0**-10  # a number that f32 has
    force = {}
    for where, precision in (("cpu", "f64"), (backend, "f32"), (backend, "ds")):
        with Simulation(scene, backend=where, precision=precision, plan="parallel") as simulation:
            simulation.launcher.prepare(0.0, simulation.dt)
            force[precision] = simulation.state.acceleration.to_numpy().astype(np.float64)
    size = np.sqrt(np.mean(force["f64"] ** 2))
    error = {name: np.sqrt(np.mean((force[name] - force["f64"]) ** 2)) / size for name in ("f32", "ds")}
    assert error["ds"] < 2 * U < error["f32"]


def test_energies_are_those_of_the_masses_that_forces_have():
    """f32 makes 1.0000000475e-3 of a mass of 10⁻³. Kinetic energy, which changes by E/2 or so, must not be of another one."""
    scene = kepler(0.3, dt=2 * math.pi / 2**15, integrator="pefrl")
    with Simulation(scene, backend="cpu", precision="ds") as simulation:
        first, errors = simulation.diagnostics()["total_energy"], []
        for _ in range(4):
            simulation.run(steps=2**13)
            errors.append(abs(simulation.diagnostics()["total_energy"] / first - 1))
    assert max(errors) < 4.75e-8 / 2 / 3  # rounding of forces leaves 0.1 u, as for the figure of eight


# --- snapshots and rewinds ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", ["leapfrog", "rk4", "chin4a"])
@pytest.mark.sampled(3)
def test_low_parts_are_saved_restored_and_taken_over_bit_for_bit(integrator):
    with Simulation(figure_eight(2000, integrator), backend="cpu", precision="ds") as simulation:
        simulation.run(steps=100)
        mark, middle = simulation.mark(), simulation.state.save()
        end = simulation.run(steps=100).state.save()
        assert all(np.abs(low).max() > 0.0 for low in end[2:])
        simulation.return_to(mark)
        assert all(np.array_equal(a, b) for a, b in zip(middle, simulation.state.save(), strict=True))
        simulation.run(steps=100)
        assert all(np.array_equal(a, b) for a, b in zip(end, simulation.state.save(), strict=True))
        with Simulation(figure_eight(2000, integrator), backend="cpu", precision="ds") as other:
            other.state.take_over(simulation.state, simulation.start.free)
            assert all(np.array_equal(a, b) for a, b in zip(end, other.state.save(), strict=True))


@pytest.mark.parametrize("precision", EXTENDED)
def test_snapshots_go_through_high_and_low_parts_bit_for_bit(precision):
    """Numbers of 48 bits come back as they were; others lose 2⁻⁴⁹ once, and then no more."""
    random = np.random.default_rng(3)
    high = random.uniform(1, 100, (3, 3)).astype(np.float32).astype(np.float64)
    exact = high + random.integers(-(2**10), 2**10, (3, 3)) * 2.0**-42
    with Simulation(figure_eight(100), backend="cpu", precision=precision) as simulation:
        for given in (exact, high * (1.0 + random.uniform(-1, 1, (3, 3)) * 2.0**-24)):
            simulation.state.write(given, given)
            position, velocity = simulation.state.read()
            assert np.abs(position / given - 1)[:, :2].max() <= 2.0**-49
            assert (position != position.astype(np.float32))[:, :2].all()
            simulation.state.write(position, velocity)
            assert np.array_equal(simulation.state.read(), (position, velocity))
        simulation.state.write(exact, exact)
        assert np.array_equal(simulation.state.read()[0][:, :2], exact[:, :2])


@pytest.mark.sampled(3)
def test_low_parts_take_memory_only_where_the_precision_asks_for_them():
    sizes = {}
    for precision in PRECISIONS:
        with Simulation(figure_eight(100), backend="cpu", precision=precision) as simulation:
            sizes[precision] = simulation.state.field_sizes()
    assert not any("low" in name or "parts" in name for name in (*sizes["f32"], *sizes["f64"]))
    assert sizes["ds"]["position_low"] == sizes["ds"]["position"] == sizes["f32c"]["velocity_low"]


# --- what is refused, and where precisions are named --------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("integrator", ["adaptive_leapfrog", "implicit_midpoint", "ias15"])
@pytest.mark.parametrize("precision", EXTENDED)
def test_methods_that_carry_no_low_parts_are_refused_by_name(integrator, precision):
    with pytest.raises(
        BackendError, match=f"the method {integrator} does not carry low parts, so it cannot run in {precision}"
    ):
        Simulation(figure_eight(100, integrator), backend="cpu", precision=precision)


def test_a_sweep_over_precisions_notes_what_one_of_them_refuses(tmp_path):
    problem = pose(load_scene(figure_eight(100) | {"run": {"duration": 0.1}}))
    with Workbench(problem, backend="cpu", precision="ds") as bench:
        store = Store(tmp_path, {})
        sweep = StepSweep(bench, store, Budget(60.0), {}, lambda sample: 0.0)
        refused = sweep.measure(Configuration("ias15", 16, "ds", "cpu"))
        assert refused.status == "refused" and "does not carry low parts" in refused.reason
        assert sweep.measure(Configuration("leapfrog", 16, "ds", "cpu")).status == "ok"


def test_contacts_are_refused_by_name():
    scene = {
        "title": "Spheres",
        "particles": [{"body": {"mass": 1, "radius": 0.1, "position": [x, 0, 0]}} for x in (0, 1)],
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "integrator": {"leapfrog": {"dt": 0.01}},
    }
    with pytest.raises(BackendError, match="the contact solver swept does not carry low parts"):
        Simulation(scene, backend="cpu", precision="ds")


@pytest.mark.parametrize("precision", EXTENDED)
def test_the_command_line_takes_every_precision(precision, tmp_path, capsys):
    path = tmp_path / "eight.yaml"
    path.write_text(json.dumps(figure_eight(200)), encoding="utf-8")  # JSON is YAML
    assert main(["run", str(path), "--precision", precision, "--backend", "cpu", "--steps", "10", "--headless", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["precision"] == precision


def test_expected_bounds_hold_for_every_precision():
    scene = figure_eight(100) | {"run": {"steps": 1}}

    def expectation(bound):
        return load_scene(scene | {"expect": {"relative_energy_error_max": {"below": bound}}}).expect[0]

    assert all(holds(expectation(1e-3), 1e-4, precision) for precision in PRECISIONS)
    both = expectation({"f64": 1e-9, "f32": 1e-3})
    assert [holds(both, 1e-4, precision) for precision in PRECISIONS] == [True, True, True, True, False]
    own = expectation({"f64": 1e-9, "f32": 1e-3, "ds": 1e-6})
    assert [holds(own, 1e-4, precision) for precision in PRECISIONS] == [True, True, False, True, False]
    with pytest.raises(SceneError, match="f32c and ds where they differ"):
        expectation({"f64": 1e-9, "ds": 1e-3})
