"""Runs that blow up are stopped at the step where the blow-up begins, and can continue; stable runs raise no alarm."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi import Simulation, Snapshot, StabilityError, component
from mpp_taichi.cli.main import main
from mpp_taichi.recorders import blow_up
from mpp_taichi.recorders.blow_up import ONSET, BlowUpWatch
from mpp_taichi.recorders.table import TableRecorder
from scenes import everything

ROOT = Path(__file__).parents[2]
PENDULUM = str(ROOT / "scenes/double_pendulum.yaml")


def watched(simulation, every, **length):
    """Run under watch; the error that stopped it, or None."""
    table = TableRecorder(every)
    watch = BlowUpWatch(table)
    try:
        simulation.run(**length, recorders=[table, watch])
        table.finish(simulation)
        watch.record(simulation)
    except StabilityError as error:
        return watch.explain(error, simulation)
    return None


@pytest.mark.parametrize(("name", "holds", "breaks"), [("leapfrog", 0.028, 0.0285), ("rk4", 0.040, 0.042)])
@pytest.mark.sampled(3)
def test_the_double_pendulum_breaks_where_it_is_known_to(name, holds, breaks, monkeypatch):
    """Leapfrog multiplies the stiff swing by λ = 1.29 a step of 0.0285, ω dt = 2.0163: cosh(ln λ) = (ω dt)²/2 − 1.

    Its energy of about g²/2ω² = 3e-4 must grow 1e6-fold for the alarm, in ln 1e6/(2 ln λ) = 27 steps, t = 0.77, and is past all
    doubt before 0.91.
    """
    monkeypatch.setattr(blow_up, "LOOKS", 64)  # so that a stride is several steps
    overrides = [f"integrator={{{name}: {{dt: {breaks}}}}}"]
    with Simulation(PENDULUM, backend="cpu", precision="f64", overrides=overrides, force=True) as simulation:
        seen = []
        for every in (1, 10, 100):
            simulation.restart()
            error = watched(simulation, every, duration=20.0)
            seen.append((error.step, error.particle))
            assert "particle 0 (pivot) and particle 1 (upper), D = 5000" in str(error) and "yaml:17:" in str(error)
            assert error.time < 0.5 and error.time == pytest.approx(error.step * breaks)
            assert simulation.step_count == error.step - 1
            # What is left has gained less than the share called sound of what was turned over, 0.5 at most till then.
            gained = simulation.diagnostics()["total_energy"] - 0.9431883
            assert gained < ONSET * 0.5
        assert len(set(seen)) == 1 and seen[0][1] == 1  # the same whenever it was looked at
        simulation.restart()
        table = TableRecorder(1)
        with pytest.raises(StabilityError):
            simulation.run(duration=20.0, recorders=[table, BlowUpWatch(table)])
        assert 0.4 < table.rows[-1]["time"] < 0.95
        simulation.restart()
        simulation.dt = holds
        assert watched(simulation, 10, duration=20.0) is None


def test_a_run_that_ends_in_nan_is_led_back_to_where_it_began():
    with Simulation(
        PENDULUM, backend="cpu", precision="f64", overrides={"integrator.leapfrog.dt": 1.0}, force=True
    ) as simulation:
        error = watched(simulation, 10_000, steps=10_000)
        assert error.step <= 2 and simulation.step_count == error.step - 1
        assert "blows up" in str(error) and np.isfinite(simulation.snapshot().position).all()


def springs_at_rest(displacement, dt, **more):
    bodies = [{"body": {"mass": 1, "position": [float(k), 0, 0], "free": 0 < k}} for k in range(3)]
    bodies[2]["body"]["position"][0] += displacement
    links = [{"link": {"between": [k, k + 1], "stiffness": 100, "rest_length": 1, **more}} for k in range(2)]
    return {"particles": bodies, "springs": links, "integrator": {"leapfrog": {"dt": dt}}}


@pytest.mark.sampled(3)
def test_a_start_without_energy_is_no_false_alarm_and_no_blind_spot():
    """E₀ = 0 in a scene at rest; with a displacement of 1e-9, E₀ = 5e-17, and growth from there is a blow-up like any other."""
    scene = springs_at_rest(0.0, 0.1)
    for k, entry in enumerate(scene["particles"]):
        entry["body"]["position"] = [1e3 + 0.7 * k, 0.3 * k, 0.1]  # rounded, by 3e-5: they twitch, with energies from nowhere
    for entry in scene["springs"]:
        entry["link"]["rest_length"] = math.hypot(0.7, 0.3)
    with Simulation(scene, backend="cpu", precision="f32") as simulation:
        assert watched(simulation, 500, steps=100_000) is None
    with Simulation(springs_at_rest(1e-9, 0.2), backend="cpu", force=True) as simulation:
        error = watched(simulation, 5, steps=200)
        assert error is not None and simulation.diagnostics()["total_energy"] < 1e-15
        simulation.restart()
        simulation.dt = 0.1
        assert watched(simulation, 5, steps=2000) is None


def test_springs_that_are_pulled_a_hundredfold_are_let_go():
    with Simulation(springs_at_rest(200.0, 1e-3), backend="cpu") as simulation:
        assert watched(simulation, 20, steps=4000) is None


ROUNDED = ("ring", "figure_eight", "membrane", "cloth", "pile", "piston")  # scenes whose round-off in f32 differs in kind


@pytest.mark.sampled(3)
@pytest.mark.parametrize("scene", ROUNDED)
def test_round_off_of_single_precision_raises_no_alarm(scene):
    """In f64 every bundled scene runs under this watch in tests/scenes/test_bundled_scenes.py."""
    with Simulation(ROOT / "scenes" / f"{scene}.yaml", backend="cpu", precision="f32") as simulation:
        many = simulation.state.particle_count > 1000
        whole = round(simulation.spec.run.duration / simulation.dt)  # a piston must not go on to the floor
        assert watched(simulation, 5, steps=10 if many else min(2000, whole)) is None


@pytest.mark.sampled(3)
def test_a_sphere_that_rises_when_its_load_is_removed_raises_no_alarm():
    """Contacts give back ½ c F², which is no part of the energy that is watched, to a sphere that has none to turn over."""
    scene = {
        "dimensions": 2,
        "particles": [{"body": {"mass": 1, "radius": 0.5, "position": [0, 0.5, 0]}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, -1, 0]}}],
        "contacts": {"hard_spheres": {"solver": "resting", "restitution": 0, "compliance": 0.01}},
        "walls": [{"plane": {"point": [0, 0, 0], "normal": [0, 1, 0], "restitution": 0}}],
        "integrator": {"symplectic_euler": {"dt": 0.1}},
        "timeline": [{"at": 15, "set": {"forces.uniform_gravity.acceleration": [0, -0.5, 0]}}],
        "run": {"duration": 30},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(until=15)
        assert simulation.snapshot().position[0, 1] == pytest.approx(0.5 - 0.01, abs=1e-9)
        assert watched(simulation, 10, until=30) is None
        assert simulation.snapshot().position[0, 1] == pytest.approx(0.5 - 0.005, abs=1e-9)


@pytest.mark.parametrize("integrator", ["leapfrog", "rk4"])
@pytest.mark.sampled(3)
def test_friction_raises_no_alarm(integrator):
    with Simulation(everything(integrator=integrator, dt=0.01), backend="cpu") as simulation:
        assert watched(simulation, 7, steps=700) is None


@pytest.mark.parametrize("integrator", ["rk4", "implicit_midpoint"])
def test_a_formula_that_gives_energy_raises_no_alarm(integrator):
    """Van der Pol's oscillator: from nearly nothing to its limit cycle, whose amplitude is near 2."""
    scene = {
        "particles": [{"body": {"mass": 1, "position": [1e-6, 0, 0]}}],
        "forces": [{"external": {"acceleration": ["(1 - x^2)*vx - x", "0", "0"]}}],
        "integrator": {integrator: {"dt": 0.01}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert not simulation.phase.gains_no_energy
        assert watched(simulation, 10, duration=60.0) is None
        found = simulation.snapshot()
    assert 1.0 < math.hypot(found.position[0, 0], found.velocity[0, 0]) < 3.0


def test_a_fall_far_from_the_origin_raises_no_alarm_in_single_precision():
    """m g z = 1e7 is rounded by 0.6 while the first steps release 5e-5 of energy."""
    fall = {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 1e6]}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -10]}}],
        "integrator": {"leapfrog": {"dt": 1e-3}},
    }
    with Simulation(fall, backend="cpu", precision="f32") as simulation:
        assert watched(simulation, 1, steps=300) is None


PUSH = '''"""A push that works."""
import taichi as ti
from mpp_taichi.component import component, param
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.types import Template

@component
class Push(ExternalForce):
    """a cos(w t) along x."""
    strength: float = param(1.0, help="a")
    frequency: float = param(1.0, help="w")
    conserves_energy = False

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """a cos(w t)."""
        result = ti.Vector.zero(float, state.dimensions)
        result[0] = ti.cast(self.strength, float) * ti.cos(ti.cast(self.frequency, float) * time)
        return result

    @ti.func
    def potential(self, state: Template, i, time):
        """None."""
        return ti.cast(0.0, state.wide)
'''


def test_a_drive_raises_no_alarm_and_hides_no_blow_up(tmp_path, monkeypatch):
    """At resonance the energy grows from 0 as t²: no alarm; a step beyond the limit makes the springs longer than reason."""
    (tmp_path / "forces").mkdir()
    (tmp_path / "forces" / "push.py").write_text(PUSH, encoding="utf-8")
    monkeypatch.setattr(component, "extra_folders", [tmp_path])
    scene = {**springs_at_rest(0.0, 0.01), "forces": [{"push": {"strength": 0.1, "frequency": 10 * (5**0.5 - 1) / 2}}]}
    with Simulation(scene, backend="cpu", force=True) as simulation:
        table = TableRecorder(1)
        simulation.run(steps=1, recorders=[table])
        assert watched(simulation, 10, steps=3000) is None
        assert simulation.diagnostics()["total_energy"] > 1000 * table.rows[-1]["total_energy"]
        simulation.restart()
        simulation.dt = 0.2
        error = watched(simulation, 10, steps=3000)
        assert error is not None and "springs grow beyond reason" in str(error)


# --- rewinding ---------------------------------------------------------------------------------------------------------------


@pytest.fixture
def pendulum(tmp_path, monkeypatch):
    """The double pendulum for five seconds, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    content = yaml.safe_load(Path(PENDULUM).read_text(encoding="utf-8"))
    for number in (0, 1):
        content["springs"][number]["link"]["stiffness"] = (5000, 5)[number]
    content |= {"run": {"duration": 5}, "integrator": {"leapfrog": {"dt": 0.0285}}}
    Path("pendulum.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return "pendulum.yaml"


def run_json(capsys, *words):
    code = main(["run", *words, "--headless", "--json"])
    captured = capsys.readouterr()
    return code, json.loads(captured.out), captured.err


@pytest.mark.sampled(3)
def test_a_run_that_blew_up_goes_on_with_a_step_that_holds(pendulum, capsys):
    code, found, err = run_json(capsys, pendulum, "--force")
    state = Snapshot.load("out/pendulum.crash.npz")
    assert code == 4 and found["files"] == [str(Path("out/pendulum.crash.npz"))] and "0.025 holds" in err
    assert found["broke_at"] == {"step": state.step + 1, "time": pytest.approx(state.time + 0.0285), "particle": 1}
    assert state.dt == 0.0285 and 0.0 < state.time < 0.5
    for extra in ([], ["--set", "integrator.leapfrog.dt=0.0285"]):  # the same again is no choice
        code, found, err = run_json(capsys, pendulum, "--rewind", *extra)
        assert code == 0 and found["status"] == "ok" and found["dt"] == 0.025
        assert found["time"] == 5.0 and found["steps"] == state.step + math.ceil((5.0 - state.time) / 0.025)
        assert "on with dt 0.025" in found["rewound"] and "0.028256" in found["rewound"] and found["rewound"] in err
        # The energy of leapfrog at ω dt = 1.77 wobbles by the stiff spring's own, 1e-3, times 1/(1 − (ω dt/2)²) = 4.6.
        assert found["relative_energy_error_max"] < 0.02
    code, found, _ = run_json(capsys, pendulum, "--rewind", "out/pendulum.crash.npz", "--set", "integrator.leapfrog.dt=0.01")
    assert code == 0 and found["dt"] == 0.01 and "as --set says" in found["rewound"]


def test_a_step_that_broke_within_the_limit_is_halved_unless_the_scene_has_a_smaller_one(pendulum, capsys):
    small = ["--until", "0.1", "--set"]
    with Simulation(pendulum, backend="cpu", force=True) as simulation:
        replace(simulation.start, dt=0.01).save("out/pendulum.crash.npz")
    text = Path(pendulum).read_text(encoding="utf-8")
    for dt, expected, words in ((0.01, 0.005, "half of 0.01"), (0.008, 0.008, "as the scene says")):
        Path(pendulum).write_text(text.replace("0.0285", str(dt)), encoding="utf-8")
        code, found, _ = run_json(capsys, pendulum, "--rewind", *small, "title=again")
        assert code == 0 and found["dt"] == expected and words in found["rewound"]


def test_an_interrupted_run_ends_as_if_it_had_not_been(pendulum, capsys):
    """Leapfrog keeps nothing between two steps, so the same steps give the same bits."""
    small = ["--set", "integrator.leapfrog.dt=0.001"]
    with Simulation(pendulum, backend="cpu", overrides=small[1:]) as simulation:
        Path("out").mkdir()
        simulation.run(steps=1234)
        replace(simulation.snapshot(), dt=0.001).save("out/pendulum.interrupted.npz")
        whole = simulation.run(until=5.0).snapshot()
    code, found, _ = run_json(capsys, pendulum, "--rewind", *small, "--snapshot", "end.npz")
    end = Snapshot.load("end.npz")
    assert code == 0 and found["dt"] == 0.001 and (end.step, end.time) == (5000, 5.0)
    np.testing.assert_array_equal(end.position, whole.position)
    code, found, _ = run_json(capsys, pendulum, "--rewind", *small, "--steps", "10")
    assert code == 0 and found["steps"] == 1244


def test_what_cannot_be_rewound_is_said_in_one_line(pendulum, capsys):
    small = ["--set", "integrator.leapfrog.dt=0.001"]
    assert main(["run", pendulum, "--headless", "--rewind"]) == 2
    assert "nothing to go on from" in capsys.readouterr().err
    assert main(["run", pendulum, "--headless", "--rewind", "none.npz"]) == 2
    assert "no such file" in capsys.readouterr().err
    Path("torn.npz").write_bytes(b"PK\x03\x04 torn")
    assert main(["run", pendulum, "--headless", "--rewind", "torn.npz"]) == 5
    assert "not a snapshot" in capsys.readouterr().err
    with Simulation(pendulum, backend="cpu", overrides=small[1:]) as simulation:
        start = simulation.start
    start.save("sound.npz")
    with np.load("sound.npz") as data:
        arrays = dict(data)
    assert Snapshot.load("sound.npz").particle_count == 3
    Path("spoilt.npz").write_bytes(b"")
    assert main(["run", pendulum, "--headless", "--rewind", "spoilt.npz"]) == 5
    capsys.readouterr()
    meta = json.loads(str(arrays["meta"]))
    for spoilt in (
        {"position": arrays["position"][:1]},
        {"position": np.array(["a"])},
        {"mass": arrays["mass"][:, None]},
        {"name": arrays["name"][:1]},
        {"meta": np.array(json.dumps({**meta, "format": 99}))},
        {"meta": np.array(json.dumps({**meta, "time": math.nan}))},
        {"meta": np.array(json.dumps({**meta, "step": None}))},
        {"meta": np.array(json.dumps({**meta, "dt": -1.0}))},
        {"meta": np.array("5")},
    ):
        np.savez("spoilt.npz", **{**arrays, **spoilt})
        assert main(["run", pendulum, "--headless", "--rewind", "spoilt.npz", *small]) == 5, spoilt
        assert "not a snapshot" in (said := capsys.readouterr().err) and said.count("\n") == 1
    replace(start, time=5.0, step=5000).save("ended.npz")
    assert main(["run", pendulum, "--headless", "--rewind", "ended.npz", *small]) == 2
    assert "not before the end" in capsys.readouterr().err
    springs = replace(start.springs, between=start.springs.between[::-1])
    replace(start, springs=springs).save("other.npz")
    assert main(["run", pendulum, "--headless", "--rewind", "other.npz", *small]) == 2
    assert "of another scene" in capsys.readouterr().err
    fewer = {
        key: getattr(start, key)[:2] for key in ("position", "velocity", "mass", "radius", "charge", "color", "free", "name")
    }
    replace(start, **fewer).save("fewer.npz")
    assert main(["run", pendulum, "--headless", "--rewind", "fewer.npz", *small]) == 2
    assert "2 particles, the scene 3" in capsys.readouterr().err
    assert "Traceback" not in capsys.readouterr().err
