"""Energy balance: its error has the order of every method; drives; numerical damping."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from compiled import random_snapshot
from scipy.integrate import quad
from test_integrators import KINDS_OF_STEP, SLOPE_TOLERANCE, declared, slope

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.energy.numerical_damping import OscillationCounter, numerical_damping
from mpp_taichi.recorders.table import TableRecorder

FORCE, FREQUENCY, PHASE = 0.4, 2.0, 0.3  # of the drive, along x
BOB = 12  # index of the oscillator's bob
STIFFNESS, SPRING_DAMPING, DRAG = 6.0, 0.3, 0.1
TAKE_FRICTION = [name for name in KINDS_OF_STEP if declared(name, "takes_velocity")]
PIECES = 8  # samples of the balance in one run


def damped_and_driven(integrator, damping="axial", dt=0.01):
    """A tilted sheet of 3 × 4, one edge held, and apart from it a bob on a spring along x; damped, dragged, driven along x."""
    start = random_snapshot(12, seed=5)
    place = np.array([[i, j, 0.3 * i] for j in range(4) for i in range(3)]) + 0.1 * start.position
    bodies = [
        {"mass": 1.0 + 0.2 * (k % 3), "position": p.tolist(), "velocity": (0.5 * v).tolist(), "free": [k % 3 > 0] * 3}
        for k, (p, v) in enumerate(zip(place, start.velocity))
    ]
    bodies.append({"mass": 2.0, "position": [9.0, 0, 0], "free": [True, False, False]})
    bodies.append({"mass": 1.0, "position": [8.0, 0, 0], "free": [False] * 3})
    links = [[3 * j + i, 3 * j + i + 1] for j in range(4) for i in range(2)]
    links += [[3 * j + i, 3 * j + i + 3] for j in range(3) for i in range(3)] + [[BOB, BOB + 1]]
    link = {"stiffness": STIFFNESS, "damping": SPRING_DAMPING, "rest_length": 1.0}
    drive = {"force": [FORCE, 0, 0], "angular_frequency": FREQUENCY, "phase": PHASE}
    return {
        "particles": [{"body": body} for body in bodies],
        "springs": [{"link": {"between": pair, **link}} for pair in links],
        "spring_damping": damping,
        "forces": [
            {"linear_drag": {"coefficient": DRAG}},
            {"uniform_gravity": {"acceleration": [0, 0.2, -0.3]}},
            {"harmonic_drive": drive},
        ],
        "integrator": {integrator: {"dt": dt}},
    }


def driven_oscillator(time, mass=2.0, stiffness=STIFFNESS, friction=SPRING_DAMPING + DRAG):
    """(x, v) of m x″ + c x′ + D x = F sin(ω t + φ) from rest, underdamped. Source: Landau & Lifshitz, Mechanics, §26."""
    gamma = 0.5 * friction / mass
    free = math.sqrt(stiffness / mass - gamma**2)
    # The steady state is the imaginary part of X e^{iωt}; the transient cancels it at 0.
    steady = FORCE / mass * np.exp(1j * PHASE) / (stiffness / mass - FREQUENCY**2 + 2j * gamma * FREQUENCY)
    position, velocity = steady.imag, (1j * FREQUENCY * steady).imag
    a, b = -position, (-velocity - gamma * position) / free
    decay, c, s = np.exp(-gamma * time), np.cos(free * time), np.sin(free * time)
    swing = steady * np.exp(1j * FREQUENCY * time)
    x = decay * (a * c + b * s) + swing.imag
    v = decay * ((-gamma * a + free * b) * c + (-gamma * b - free * a) * s) + (1j * FREQUENCY * swing).imag
    return x, v


def largest_errors(simulation, duration):
    """Of the balance and of the bob's way, over a run in pieces: at one time an error may happen to pass through zero."""
    residuals, ways = [], []
    for _ in range(PIECES):
        simulation.run(duration=duration / PIECES)
        residuals.append(abs(simulation.diagnostics()["energy_balance_residual"]))
        end = simulation.snapshot()
        exact = driven_oscillator(simulation.time)
        ways.append(math.hypot(end.position[BOB, 0] - 9.0 - exact[0], end.velocity[BOB, 0] - exact[1]))
    return max(residuals), max(ways)


@pytest.mark.sampled(5)
@pytest.mark.parametrize(
    ("name", "damping"), [*((name, "axial") for name in TAKE_FRICTION), ("leapfrog", "full"), ("rk4", "full")]
)
def test_the_balance_closes_to_the_order_of_the_method(name, damping):
    """And so does the bob's way against the closed form, which needs the drive at the right time of every stage."""
    finest = {1: 2048, 2: 1024, 4: 256}[declared(name, "order")] // (
        4 if (declared(name, "launchers").parallel == "parallel_implicit") else 1
    )
    dts, residuals, ways = [], [], []
    with Simulation(damped_and_driven(name, damping), backend="cpu", precision="f64") as simulation:
        simulation.keep_energy_balance()
        for count in (finest // 8, finest // 4, finest // 2, finest):
            simulation.dt = 1.0 / count
            simulation.restart()
            residual, way = largest_errors(simulation, 2.0)
            residuals.append(residual)
            ways.append(way)
            dts.append(simulation.dt)
        end = simulation.diagnostics()
    assert end["dissipated_energy"] > 0.3 and abs(end["work"]) > 0.1, "too little happens for the balance to mean anything"
    assert residuals[-1] > 1e-13, "the ladder reaches round-off and shows nothing"
    assert slope(dts, residuals) == pytest.approx(declared(name, "order"), abs=SLOPE_TOLERANCE)
    assert slope(dts, ways) == pytest.approx(declared(name, "order"), abs=SLOPE_TOLERANCE)


def lone_bob(dt=0.01, integrator="rk4", **drive):
    """The bob alone, driven, with drag."""
    scene = damped_and_driven(integrator, dt=dt)
    bob, anchor = scene["particles"][BOB:]
    bob["body"]["name"] = "bob"
    link = {"between": [0, 1], "stiffness": STIFFNESS, "damping": SPRING_DAMPING, "rest_length": 1.0}
    forces = [scene["forces"][0], {"harmonic_drive": scene["forces"][2]["harmonic_drive"] | drive}]
    return scene | {"particles": [bob, anchor], "springs": [{"link": link}], "forces": forces}


@pytest.mark.sampled(3)
def test_work_and_dissipation_are_those_of_the_closed_form():
    """In pieces of 10/3 steps, so that every fourth step is a short one."""
    with Simulation(lone_bob(dt=0.03), backend="cpu", precision="f64") as simulation:
        simulation.keep_energy_balance()
        for _ in range(100):
            simulation.run(duration=0.1)
        found = simulation.diagnostics()

    def power_of_drive(t):
        return FORCE * math.sin(FREQUENCY * t + PHASE) * driven_oscillator(t)[1]

    def power_of_friction(t):
        return (SPRING_DAMPING + DRAG) * driven_oscillator(t)[1] ** 2

    # (2ω h)⁴ = 2e-4 for powers that swing at twice ω, times the error constant 19/720 of the rule, and rk4's own smaller error.
    allowed = 19 / 720 * (2 * FREQUENCY * 0.03) ** 4 * found["energy_turnover"]
    for power, name in ((power_of_drive, "work"), (power_of_friction, "dissipated_energy")):
        exact = quad(power, 0.0, 10.0, epsabs=1e-12, limit=500)[0]
        assert abs(exact) > 100 * allowed
        assert found[name] == pytest.approx(exact, abs=allowed)


@pytest.mark.sampled(3)
def test_resonance_curve():
    """Steady amplitudes F / (m √((ω₀² − ω²)² + γ² ω²)) of five oscillators on one drive, work and dissipation in balance."""
    stiffness = [1.0, 2.5, 4.0, 6.0, 9.0]  # ω₀² around ω² = 4; γ = 1
    bodies = [{"body": {"mass": 1.0, "position": [0, k, 0], "free": [True, False, False]}} for k in range(5)]
    bodies += [{"body": {"mass": 1.0, "position": [-3, k, 0], "free": [False] * 3}} for k in range(5)]
    links = [{"link": {"between": [k, k + 5], "stiffness": d, "damping": 1.0}} for k, d in enumerate(stiffness)]
    drive = {"force": [0.5, 0, 0], "angular_frequency": 2.0, "phase": 0.0}
    scene = {"particles": bodies, "springs": links, "forces": [{"harmonic_drive": drive}], "integrator": {"rk4": {"dt": 0.02}}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(until=60.0)  # the transient falls as exp(−t/2): 1e-13
        end = simulation.snapshot()
    steady = 0.5 / (np.array(stiffness) - 4.0 + 2.0j) * np.exp(2.0j * end.time)
    # rk4 errs by some (ω₀ h)⁴/120 in phase per unit of ω₀ t within the memory of 1/γ: (3 · 0.02)⁴ · 3/120 = 3e-7.
    np.testing.assert_allclose(end.position[:5, 0], steady.imag, rtol=0, atol=1e-6)
    np.testing.assert_allclose(end.velocity[:5, 0], (2.0j * steady).imag, rtol=0, atol=2e-6)


@pytest.mark.sampled(3)
def test_a_run_in_pieces_and_a_restart_give_the_same_balance():
    with Simulation(damped_and_driven("leapfrog"), backend="cpu", precision="f64") as simulation:
        simulation.keep_energy_balance()
        simulation.run(steps=300)
        whole = simulation.diagnostics()
        simulation.restart()
        begun = simulation.diagnostics()
        assert (begun["dissipated_energy"], begun["work"], begun["energy_balance_residual"]) == (0.0, 0.0, 0.0)
        for steps in (1, 36, 3, 260):
            simulation.run(steps=steps)
            simulation.diagnostics()
        pieces = simulation.diagnostics()
    for name in ("dissipated_energy", "work", "total_energy"):
        assert pieces[name] == pytest.approx(whole[name], rel=1e-14)  # times of samples may differ in their last bit


@pytest.mark.sampled(3)
def test_plans_agree_on_the_balance():
    """Sampled inside a launch under the serial plan, and between launches under the parallel one."""
    found = []
    for plan in ("serial", "parallel"):
        with Simulation(damped_and_driven("rk4", dt=0.05), backend="cpu", precision="f64", plan=plan) as simulation:
            simulation.keep_energy_balance()
            found.append(simulation.run(steps=40).diagnostics())
    for name in ("dissipated_energy", "work", "energy_turnover"):
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-13)


@pytest.mark.sampled(3)
def test_axial_damping_takes_nothing_from_a_rigid_rotation_and_full_damping_its_share():
    """Two masses 1 at ±½ d on a spring that holds them, D (d − L) = ω² d / 2; full damping takes c (ω d)² per unit time."""
    d, spin, stiffness = 1.0, 1.5, 50.0
    rest = d - spin**2 * d / (2 * stiffness)
    taken = {}
    for damping in ("axial", "full"):
        bodies = [{"body": {"mass": 1.0, "position": [s * d / 2, 0, 0], "velocity": [0, s * spin * d / 2, 0]}} for s in (-1, 1)]
        link = {"between": [0, 1], "stiffness": stiffness, "damping": 0.1, "rest_length": rest}
        scene = {
            "particles": bodies,
            "springs": [{"link": link}],
            "spring_damping": damping,
            "integrator": {"rk4": {"dt": 1e-3}},
        }
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.keep_energy_balance()
            taken[damping] = simulation.run(duration=0.01).diagnostics()["dissipated_energy"]
    # rk4 leaves the circle by (ω_max h)⁵ = 1e-10 a step at most: of speed along the axis, whose square is taken.
    assert 0.0 <= taken["axial"] < 1e-20
    # Speeds fall as exp(−2 c t / m): the power by 4 · 0.1 · 0.01 = 0.4 % until the end, half of it in the mean.
    assert taken["full"] == pytest.approx(0.1 * (spin * d) ** 2 * 0.01, rel=0.005)


def test_a_change_of_parameters_is_booked_as_work():
    with Simulation(lone_bob(dt=0.02), backend="cpu", precision="f64") as simulation:
        simulation.keep_energy_balance()
        simulation.run(duration=1.0)
        before = simulation.diagnostics()
        with simulation.parameter_change():
            simulation.state.spring_stiffness.fill(2.0 * STIFFNESS)
            simulation.state.spring_damping.fill(3.0 * SPRING_DAMPING)
        after = simulation.diagnostics()
        end = simulation.run(duration=1.0).diagnostics()
    assert after["work"] - before["work"] == pytest.approx(before["potential_energy"], rel=1e-12)
    # As in the closed form above; a power taken for a continuous one would leave about h · its jump, 1e-3 of the turnover.
    assert abs(end["energy_balance_residual"]) < 19 / 720 * (2 * 2.5 * 0.02) ** 4 * end["energy_turnover"]


@pytest.mark.sampled(3)
def test_a_phase_without_a_force_keeps_its_kinetic_energy():
    """Where no force acts the step needs no masses, and the balance reads them elsewhere."""
    body = {"body": {"mass": 2.0, "position": [1, 0, 0], "velocity": [0, 1, 0]}}
    scene = {
        "particles": [body],
        "forces": [{"harmonic_trap": {"frequencies": [1, 1, 1]}}],
        "integrator": {"velocity_verlet": {"dt": 0.01}},
        "timeline": [{"at": 2.0, "set": {"forces": []}}],
    }
    with Simulation(scene, backend="cpu") as simulation:
        simulation.keep_energy_balance()
        found = simulation.run(steps=400).diagnostics()
    # The orbit is the circle of radius 1: the trap's potential energy, m/2 ω² r² = 1, goes with it, to order (ω dt)².
    assert found["work"] == pytest.approx(-1.0, abs=1e-4)
    assert abs(found["energy_balance_residual"]) < 1e-4 * found["energy_turnover"]


def test_single_precision_closes_to_its_rounding():
    """Every step rounds velocities to 2⁻²⁴ of their size, which walks at random: (few) · 2⁻²⁴ √steps of the turnover."""
    with Simulation(damped_and_driven("rk4"), backend="cpu", precision="f32") as simulation:
        simulation.keep_energy_balance()
        end = simulation.run(steps=400).diagnostics()
    assert 0.0 < abs(end["energy_balance_residual"]) < 10 * 2.0**-24 * 400**0.5 * end["energy_turnover"]


# --- numerical damping ---------------------------------------------------------------------------------------------------


def oscillator(name, dt, second=None):
    """A mass on a spring of length 0 with ω = 1, and beside it, where wanted, one of frequency `second`."""
    bodies = [{"body": {"mass": 1.0, "position": [0, 0, 0], "free": [False] * 3}}]
    links = []
    for k, frequency in enumerate([1.0] + ([second] if second else [])):
        bodies.append({"body": {"mass": 1.0, "position": [1.0, 0, 0]}})
        links.append({"link": {"between": [0, k + 1], "stiffness": frequency**2, "rest_length": 0.0}})
    return {"particles": bodies, "springs": links, "integrator": {name: {"dt": dt}}}


def measured(scene, duration, settle=0.0):
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=round(settle / simulation.dt))
        balance = simulation.keep_energy_balance()
        table = TableRecorder(20)
        simulation.run(steps=round(duration / simulation.dt), recorders=[table])
        table.finish(simulation)
    rows = table.rows
    losses = [-row["energy_balance_residual"] for row in rows]
    return numerical_damping([row["time"] for row in rows], losses, balance.oscillations)


# Little damping, and much; two states in one, and derivatives. Of every method test_integrators knows the matrix to be right.
@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["rk4", "implicit_euler", "bdf2", "hermite4"])
def test_measured_numerical_damping_is_that_of_the_amplification_matrix(name):
    method = component.build("integrators", name, {"dt": 1.0})
    dt = {1: 0.02, 2: 0.1, 4: 0.2, 6: 0.4}[method.order]
    eigenvalues = np.linalg.eigvals(method.amplification(dt))
    principal = eigenvalues[np.abs(eigenvalues).argmax()]
    steps = 2.0 * math.pi / abs(np.angle(principal))
    share = 1.0 - abs(principal) ** (2.0 * steps)
    # A method of several steps starts with another one, also where a step is shortened; here none is.
    found = measured(oscillator(name, dt), 10 * 2.0 * math.pi, settle=2.0 * math.pi)
    if abs(share) < 1e-9:  # as good as none: it must not be made out of rounding
        assert found["share_per_oscillation"] is None or abs(found["share_per_oscillation"]) < 1e-9
    else:
        assert found["problem"] == ""
        assert found["oscillations"] == pytest.approx(10.0, rel=dt**2 + dt / (20 * math.pi))
        # The mean of 1 − e^δ over an oscillation against δ: δ/2 of it; maxima half an oscillation short of the run: 1/20.
        assert found["share_per_oscillation"] == pytest.approx(share, rel=abs(share) / 2 + 1 / 20)
        assert found["per_time"] * 2.0 * math.pi == pytest.approx(found["per_oscillation"], rel=dt**2)


@pytest.mark.sampled(3)
def test_what_is_no_single_oscillation_is_not_given_a_share():
    assert "no single oscillation" in measured(oscillator("rk4", 0.2, second=1.618), 80.0)["problem"]
    assert "less than one" in measured(oscillator("rk4", 0.2), 3.0)["problem"]
    assert "fewer than" in measured(oscillator("rk4", 1.0), 40.0)["problem"]


def test_an_oscillating_energy_error_is_not_reported_as_damping():
    """Leapfrog's energy swings with the motion and comes back."""
    found = measured(oscillator("leapfrog", 0.1), 100.0)
    assert found["per_time"] is None and "swings" in found["problem"]


def test_an_oscillation_is_counted_until_it_has_faded():
    counter = OscillationCounter()
    times = np.linspace(0.0, 40.0, 2001)
    for time, kinetic in zip(times, np.exp(-0.8 * times) * np.sin(math.pi * times) ** 2):
        counter.add(time, kinetic)
    assert counter.problem == ""
    assert counter.period == pytest.approx(2.0, rel=1e-4)
    # Heights fall to 1e-6 at t = ln(1e6)/0.8 = 17.3: the last maximum that counts is that at 16.5 or 17.5.
    assert counter.count_until(40.0) == pytest.approx(8.7, abs=0.5)


# --- how it is asked for -------------------------------------------------------------------------------------------------


def run_cli(tmp_path, scene, *options):
    import yaml

    path = tmp_path / "scene.yaml"
    path.write_text(yaml.safe_dump(scene), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "mpp_taichi", "run", str(path), "--headless", "--json", "--backend", "cpu", *options],
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, json.loads(done.stdout), done.stderr


@pytest.mark.sampled(3)
def test_the_command_line_tells_the_balance_and_what_the_method_lost(tmp_path):
    scene = lone_bob(dt=0.02, of="bob") | {"run": {"duration": 20.0}}
    table = tmp_path / "table.csv"
    code, found, said = run_cli(tmp_path, scene, "--energy-balance", "--diagnostics", str(table))
    assert code == 0
    assert found["energy_balance_error_max"] < 1e-7
    assert found["dissipated_energy"] > 0.1 and found["work"] > 0.1
    assert set(found["numerical_damping"]) >= {"energy_lost", "per_time", "per_oscillation", "share_per_oscillation", "problem"}
    assert "\n  balance dissipated" in said and "\n  damping " in said
    rows = np.genfromtxt(table, delimiter=",", names=True)
    assert rows["dissipated_energy"][-1] == found["dissipated_energy"]
    assert rows["energy_balance_error"].max() == found["energy_balance_error_max"]


@pytest.mark.sampled(3)
def test_an_expectation_asks_for_the_balance_and_judges_it(tmp_path):
    scene = lone_bob(dt=0.1, integrator="euler") | {"run": {"duration": 5.0}}
    code, found, _ = run_cli(tmp_path, scene | {"expect": {"energy_balance_error_max": {"below": 1e-6}}})
    assert code == 4 and found["expect"][0]["value"] > 1e-3
    assert "dissipated_energy" in found and found["status"] == "failed"


@pytest.mark.sampled(3)
def test_a_run_without_energy_balance_does_not_import_its_module():
    code = (
        "import sys\nfrom mpp_taichi import Simulation\n"
        f"simulation = Simulation({lone_bob()!r}, backend='cpu', precision='f64')\n"
        "found = simulation.run(steps=3).diagnostics()\n"
        "print('dissipated_energy' in found, 'mpp_taichi.energy.energy_balance' in sys.modules, simulation.energy_balance)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False False None"


def test_a_drive_of_an_unknown_particle_is_refused_at_its_key():
    with pytest.raises(SceneError, match=r"forces\[1\].harmonic_drive.of: no particle is called 'bop', did you mean 'bob'"):
        Simulation(lone_bob(of="bop"), backend="cpu")


@pytest.mark.sampled(3)
def test_a_drive_of_a_group_moves_its_particles_only():
    sheet = {"name": "sheet", "shape": [2, 2, 1], "lower": [0, 0, 0], "upper": [1, 1, 0], "mass": 1.0}
    scene = {
        "particles": [{"body": {"mass": 1.0, "position": [5, 0, 0]}}, {"lattice": sheet}],
        "forces": [{"harmonic_drive": {"force": [0, 0, 1], "angular_frequency": 1.0, "of": "sheet"}}],
        "integrator": {"rk4": {"dt": 0.01}},
    }
    for reference, moved in (("sheet", [1, 2, 3, 4]), ("sheet[2]", [3]), (0, [0])):
        scene["forces"][0]["harmonic_drive"]["of"] = reference
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            end = simulation.run(duration=1.0).snapshot()
        # From rest, z″ = sin t: z = t − sin t.
        expected = np.zeros(5)
        expected[moved] = 1.0 - math.sin(1.0)
        np.testing.assert_allclose(end.position[:, 2], expected, atol=1e-9)


LOSSY = [{"linear_drag": {"coefficient": 0.1}}, {"harmonic_drive": {"of": 0, "force": [1, 0, 0], "angular_frequency": 1}}]


@pytest.mark.parametrize("lossy", LOSSY, ids=["drag", "drive"])
def test_a_scene_keeps_its_energy_only_if_every_force_does(lossy):
    field, body = {"uniform_gravity": {"acceleration": [0, -1, 0]}}, {"body": {"mass": 1, "position": [0, 0, 0]}}
    kept = []
    for forces in ([field], [lossy], [field, lossy], [lossy, field]):
        scene = {"particles": [body], "forces": forces, "integrator": {"leapfrog": {"dt": 0.1}}}
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            kept.append(simulation.phase.conserves_energy)
    assert kept == [True, False, False, False]
