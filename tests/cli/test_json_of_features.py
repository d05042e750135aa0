"""The keys that `--json` of `run` has besides for contacts, implicit methods, timelines, horizons, step control and failures.

The other keys are those of test_json_of_runs.py: a run may have no key that neither file names.
"""

import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from json_facts import Between, Matching, asked
from scipy.integrate import solve_ivp
from sprung_bodies import DT, PLACES, SCENE, STEPS, VELOCITIES, accelerations, flight

pytestmark = pytest.mark.skipif(bool(os.environ.get("MPP_TAICHI_FAST")), reason="parts that are off have keys of their own")
WHERE = ("--headless", "--backend", "cpu", "--precision", "f64", "--plan", "serial", "--quiet", "--no-archive")
OF_ANY_RUN = set(
    "scene title units backend device threads precision plan plan_reason integrator dt effects particle_count spring_count "
    "rod_count steps time wall_seconds setup_seconds compile_seconds step_seconds diagnostics_seconds encode_seconds "
    "steps_per_second steps_per_second_overall pair_interactions_per_second launches_per_step conserves_energy "
    "conserves_momentum conserves_angular_momentum phases total_energy_initial total_energy_final kinetic_energy_final "
    "potential_energy_final relative_energy_error_max momentum_error_max angular_momentum_error_max "
    "center_of_mass_error_max status findings expect files exit_code".split()
)
OF_SPRINGS = set(
    "zero_frequency_modes rigid_motions mechanism_modes second_order_modes unstable_modes vibrating_modes "
    "lowest_angular_frequencies highest_angular_frequency predicted_damping".split()
)


def ran(scene, capsys, *words, code=0):
    """The object of a run; `more` of it are the keys that not every run has."""
    Path("s.yaml").write_text(yaml.safe_dump(scene, sort_keys=False), encoding="utf-8")
    found = asked(capsys, "run", "s.yaml", *WHERE, *words, code=code)
    assert found.keys() >= OF_ANY_RUN
    springs = OF_SPRINGS if scene.get("springs") else set()
    return found, {key: value for key, value in found.items() if key not in OF_ANY_RUN | springs}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def body(name, place, speed=0.0, **more):
    return {"body": {"name": name, "position": [place, 0.5, 0], "velocity": [speed, 0, 0], "mass": 1.0, **more}}


@pytest.mark.sampled(3)
def test_the_contacts_of_a_run_are_those_of_a_collision_on_a_line(capsys):
    """A sphere of mass 1 hits a resting one of mass 3 at t = ½, with e = ½: the impulse is μ (1 + e) u = ¾ · 3/2.

    The heavy sphere leaves at 3/8, is at the wall after 2.75/(3/8) = 7.33, within the run, and is thrown back with 3 · 2 · 3/8.
    All numbers are sums of powers of ½, but for the times of contacts, whose rounding moves no count and no impulse.
    """
    mass = 1.0 * 3.0 / (1.0 + 3.0)
    wall = 3.0 * 2.0 * (mass * 1.5 / 3.0)
    scene = {
        "dimensions": 2,
        "particles": [body("a", 0.0, 1.0, radius=0.25), body("b", 1.0, mass=3.0, radius=0.25)],
        "contacts": {"hard_spheres": {"solver": "event_driven", "restitution": 0.5}},
        "walls": [{"box": {"lower": [-1, 0], "upper": [4, 1]}}],
        "integrator": {"event_driven": {"dt": 0.5}},
        "run": {"duration": 8.0},
    }
    found, more = ran(scene, capsys)
    names = {f"walls[0].box, {side} {axis}": 0.0 for axis in "xy" for side in ("lower", "upper")}
    assert more == {
        "contacts": {
            "solver": "event_driven",
            "pair_count": 1,
            "wall_count": 1,
            "elastic_count": 0,
            "collisions_per_particle_and_time": 2 * 1 / (2 * 8.0),
            "dissipated_energy": pytest.approx(0.5 * mass * (1.0 - 0.5**2), rel=1e-12),
            "largest_overlap": Between(0.0, 1e-14),
            "unresolved": 0,
            "wall_impulse": names | {"walls[0].box, upper x": pytest.approx(wall, rel=1e-12)},
        }
    }
    assert found["total_energy_final"] == pytest.approx(0.5 - 0.5 * mass * (1.0 - 0.5**2), rel=1e-12)
    assert (found["effects"], found["steps"], found["status"]) == (["hard_spheres", "box"], 16, "ok")


def sprung(times, dt, stiffness, friction):
    """Length and speed of a spring between two masses of 1 after each step of the implicit midpoint rule, a linear equation."""
    state, found = np.array([0.0, 0.5]), []
    for time in times:
        matrix = np.array([[0.0, 1.0], [-2.0 * stiffness(time), -2.0 * friction]])
        state = np.linalg.solve(np.eye(2) - 0.5 * dt * matrix, (np.eye(2) + 0.5 * dt * matrix) @ state)
        found.append(state)
    return found


@pytest.mark.sampled(3)
def test_the_balance_of_an_implicit_run_with_a_timeline_is_that_of_a_linear_oscillator(capsys):
    """The extension u of the spring obeys u″ = −2 (D u + c u′); at t = 1 the stiffness D is doubled, which adds ½ ΔD u².

    The energy lost to friction follows from the energies at the ends, and the program sums it by itself. The error of the
    balance is the difference of the two, divided by the largest kinetic energy of the motion.
    """
    dt, steps, friction = 0.125, 16, 0.1
    link = {"between": ["a", "b"], "stiffness": 2.0, "rest_length": 1.0, "damping": friction}
    scene = {
        "particles": [body("a", 0.0), body("b", 1.0, 0.5)],
        "springs": [{"link": link}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -2]}}],
        "integrator": {"implicit_midpoint": {"dt": dt}},
        "timeline": [{"at": 1.0, "set": {"springs[0].link.stiffness": 4.0}}],
        "run": {"duration": dt * steps},
    }
    found, more = ran(scene, capsys, "--energy-balance", "--every", "1")
    states = sprung(dt * np.arange(steps), dt, lambda time: 2.0 if time < 1.0 else 4.0, friction)
    change = 0.5 * 2.0 * states[7][0] ** 2
    end = 0.5 * 0.5 * states[-1][1] ** 2 + 0.5 * 4.0 * states[-1][0] ** 2  # of the spring, μ = ½
    lost = 0.5 * 0.5 * 0.5**2 + change - end
    rounding = pytest.approx(0.0, abs=1e-9)  # of the equations, which are solved to ten digits and more
    assert [found["phases"][0]["work"] - change, found["work"] - change] == [rounding, rounding]
    assert found["phases"] == [
        {
            "at": 1.0,
            "changes": {"springs[0].link.stiffness": 4.0},
            "effects": ["uniform_gravity", "spring"],
            "integrator": "implicit_midpoint",
            "work": found["work"],
        }
    ]
    residual = found["energy_balance_error_max"] * found["kinetic_energy_final"]
    assert found["numerical_damping"]["energy_lost"] == pytest.approx(lost - found["dissipated_energy"], abs=1e-9)
    assert abs(lost - found["dissipated_energy"]) <= residual < 0.05 * lost
    assert more == {
        "linear_solver": Matching(r"\w+"),
        "newton_iterations_per_step": Between(1.0, more["newton_iterations_most"]),
        "newton_iterations_most": Between(1, 10),
        "linear_iterations_per_step": Between(1.0),
        "cut_steps": 0,
        "gaining_pieces": 0,
        "unsolved_steps": 0,
        "dissipated_energy": more["dissipated_energy"],
        "work": more["work"],
        "energy_balance_error_max": Between(0.0, 1e-3),
        "numerical_damping": {
            "energy_lost": more["numerical_damping"]["energy_lost"],
            "per_time": pytest.approx(more["numerical_damping"]["energy_lost"] / (dt * steps), rel=1e-12),
            "oscillations": None,
            "per_oscillation": None,
            "share_per_oscillation": None,
            "problem": "less than one oscillation was seen",
        },
    }


@pytest.mark.sampled(3)
def test_the_step_control_of_a_run_counts_its_steps(capsys):
    """No second computation counts steps, so that the counts are bounded by each other."""
    found, more = ran({**SCENE, "integrator": {"ias15": {}}}, capsys)
    control = more["step_control"]
    assert more == {
        "conserved_energy_error_max": found["relative_energy_error_max"],
        "step_control": {
            "steps": Between(1, 1000),
            "refused": Between(0, control["steps"]),
            "force_evaluations": Between(7 * control["steps"]),  # seven nodes of a step
            "last_step": Between(1e-3, 2.0),
            "replicas": 1,
        },
    }


def falls(steps, dt):
    """Energies after each step of leapfrog of two masses that fall into each other on a line."""
    place, speed, found = np.array([0.0, 1.0]), np.array([1.0, -1.0]), []
    for _ in range(steps):
        place = place + 0.5 * dt * speed
        apart = place[1] - place[0]
        speed = speed + dt * np.array([1.0, -1.0]) * apart / abs(apart) ** 3
        place = place + 0.5 * dt * speed
        found.append((0.5 * float(speed @ speed), -1.0 / abs(place[1] - place[0])))
    return found


def test_a_run_that_blows_up_says_where(capsys):
    """Two bodies meet head on; the step in which they pass throws them apart, as it does in NumPy."""
    dt = 0.01
    scene = {
        "particles": [body("a", 0.0, 1.0), body("b", 1.0, -1.0)],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {"leapfrog": {"dt": dt}},
        "run": {"duration": 2.0},
    }
    found, more = ran(scene, capsys, "--every", "1", code=4)
    energies = falls(50, dt)
    step = 1 + next(k for k, (kinetic, _) in enumerate(energies) if kinetic > 1e3)
    assert more == {
        "conserved_energy_error_max": found["relative_energy_error_max"],
        "error": Matching(rf"step {step}, time {step * dt:g}: .+ try dt = 0\.005, or a softening"),
        "broke_at": {"step": step, "time": pytest.approx(step * dt, rel=1e-12), "particle": Between(0, 1)},
    }
    assert found["kinetic_energy_final"] == pytest.approx(energies[step - 1][0], rel=1e-6)
    assert (found["status"], found["exit_code"], found["files"]) == ("failed", 4, [str(Path("out", "s.crash.npz"))])
    assert all(each.keys() == {"kind", "message", "time", "particle"} for each in found["findings"])
    assert found["steps"] == step - 1  # the state that is left is the last good one, and the energies are of the broken one


def test_the_horizon_of_a_run_is_between_the_steps_where_its_error_passes_the_limit(capsys):
    """The error is that of leapfrog in NumPy against a solution by SciPy, over the root mean square size of the run."""

    def rates(_, state):
        places, velocities = state.reshape(2, 2, 3)
        return np.concatenate([velocities.ravel(), accelerations(places).ravel()])

    start, times = np.concatenate([PLACES.ravel(), VELOCITIES.ravel()]), DT * np.arange(STEPS + 1)
    exact = solve_ivp(rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-13).y.T[:, :6].reshape(-1, 2, 3)
    size = np.sqrt(np.mean(np.sum((exact - exact.mean(axis=(0, 1))) ** 2, axis=-1)))
    errors = [np.linalg.norm(places - there, axis=1).max() / size for (places, _), there in zip(flight(), exact)]
    _, more = ran({**SCENE, "horizon": True}, capsys)
    found = more["horizon"]
    after = next(k for k, error in enumerate(errors) if error > found["limit"])
    assert more == {
        "conserved_energy_error_max": more["conserved_energy_error_max"],
        "horizon_seconds": Between(0.0),
        "horizon": {
            "found": "before_end",
            "end": DT * STEPS,
            "time": Between(times[after - 1], times[after]),
            "by": "step",
            "error": pytest.approx(1e-3),
            "part": 1.0,
            "share": Between(0.0),
            "reason": "",
            "limit": 1e-3,
            "sentence": f"positions are valid until t ≈ {found['time']:.3g}; then the error by the step exceeds 0.001 of the "
            "system's size",
        },
    }
