"""A timeline: parameters change at exactly their time, and each phase is compiled as a scene of its own."""

import copy
import json
import logging
from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi import SceneError, Simulation, Snapshot
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._interactive import _Steered
from mpp_taichi.cli._signals import Interruption
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.recorders.watchdog import EnergyWatchdog
from mpp_taichi.report.summary import Stopwatch
from mpp_taichi.scene import timeline
from mpp_taichi.scene.load import load_scene
from scenes import everything

ROOT = Path(__file__).parents[2]


def thrown(*events):
    """A body of mass 2 in a field and in drag."""
    return {
        "particles": [{"body": {"mass": 2.0, "position": [0, 0, 0], "velocity": [3, 0, 1]}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1.5]}}, {"linear_drag": {"coefficient": 0.8}}],
        "integrator": {"rk4": {"dt": 0.01}},
        "run": {"duration": 3.0},
        "timeline": list(events),
    }


def oscillator(*events, dt=0.001, velocity=0.0):
    """A body of mass 2 at the end of a spring of stiffness 3, stretched by 0.5 along x."""
    return {
        "particles": [
            {"body": {"name": "wall", "mass": 1, "position": [0, 0, 0], "free": False}},
            {"body": {"name": "bob", "mass": 2.0, "position": [1.5, 0, 0], "velocity": [velocity, 0, 0]}},
        ],
        "springs": [{"link": {"between": ["wall", "bob"], "stiffness": 3.0, "rest_length": 1.0}}],
        "integrator": {"leapfrog": {"dt": dt}},
        "run": {"duration": 6.0},
        "timeline": list(events),
    }


class Notes:
    """A recorder that takes a sample after every step."""

    def __init__(self):
        self.seen = []

    def steps_until_due(self, simulation):
        return 0 if not self.seen or self.seen[-1] != self._now(simulation) else 1

    def record(self, simulation):
        self.seen.append(self._now(simulation))

    def restart(self):
        self.seen.clear()

    @staticmethod
    def _now(simulation):
        return simulation.time, simulation.step_count, simulation.phase_number


def test_an_event_changes_the_motion_at_exactly_its_time():
    """Against the closed form: fall in drag until t = 1 + 1/3, then free flight, by another integrator."""
    last = {"forces.uniform_gravity.acceleration": [0, 0, 0], "forces.linear_drag.coefficient": 0}
    event = {"at": "1 + 1/3", "set": {**last, "integrator": {"leapfrog": {"dt": 0.03}}}}
    rate, field = 0.8 / 2.0, np.array([0, 0, -1.5])
    at, drift = 1.0 + 1.0 / 3.0, field / rate
    fade = np.exp(-rate * at)
    velocity = drift + (np.array([3.0, 0, 1]) - drift) * fade
    place = drift * at + (np.array([3.0, 0, 1]) - drift) * (1.0 - fade) / rate
    notes = Notes()
    with Simulation(thrown(event), backend="cpu") as simulation:
        simulation.run(recorders=[notes])
        end = simulation.snapshot()
        # rk4 errs by (0.4 · 0.01)⁴ / 120 of v per unit of time, 1e-11; free flight only rounds.
        np.testing.assert_allclose(end.velocity[0], velocity, rtol=0, atol=1e-10)
        np.testing.assert_allclose(end.position[0], place + velocity * (3.0 - at), rtol=0, atol=1e-10)
        # 133 whole steps and a third of one; then 55 of 0.03 and what is left. The event is seen from both sides.
        assert [look for look in notes.seen if look[0] == at] == [(at, 134, 0), (at, 134, 1)]
        assert notes.seen[-1] == (3.0, 134 + 56, 1)
        assert (simulation.integrator.order, simulation.dt) == (2, 0.03)
        # What is compiled after the release: no force at all, and so no mass on the device.
        assert simulation.total_force.forces == ()
        assert "mass" not in simulation.state.quantities
        spec = simulation.phases[0].spec
        assert timeline.step_count(spec, 3.0) == simulation.estimate.steps == 190
        assert timeline.time_after(spec, 134) == at and timeline.time_after(spec, 10, at) == pytest.approx(at + 0.3)

        # The same bits after a restart, in single steps (whose last is whole), and when the end of a run is the event itself.
        simulation.restart()
        assert simulation.phase_number == 0 and simulation.integrator.order == 4 and simulation.phase_work == []
        assert np.array_equal(simulation.run().snapshot().position, end.position)
        simulation.restart()
        for _ in range(134):
            simulation.run(steps=1)
        single = simulation.snapshot()
        assert simulation.time == at and simulation.phase_number == 1
        simulation.restart()
        assert np.array_equal(simulation.run(until=at).snapshot().position, single.position)
        assert (
            simulation.time == at and simulation.phase_number == 1 and simulation.phase_work == [pytest.approx(-3.0 * place[2])]
        )
        assert np.array_equal(simulation.run(until=3.0).snapshot().position, end.position)

        # A window whose frames are of 170 steps stops at the end, although the steps get longer on the way there.
        simulation.restart()
        steered = _Steered(simulation, spec, Goal(2.0, None, True), [], Interruption())
        while not steered.finished:
            steered.advance(170)
        assert simulation.time == 2.0 and simulation.step_count == timeline.step_count(spec, 2.0)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_phases_are_separate_runs_joined_by_a_snapshot(plan):
    """Bit for bit, with nearly everything changed at once: forces, springs, masses, held axes, integrator and step.

    The second method keeps the force from step to step; the one of the phase before is another one.
    """
    before = everything(dt=0.01)
    before["forces"] = before["forces"][2:]
    after = copy.deepcopy(before)
    after["particles"][2]["body"].update(mass=0.8, charge=-0.4, free=[True, False, True])
    after["springs"] = after["springs"][1:]
    after["springs"][0]["link"].update(stiffness=9.0)
    after["forces"] = [{"uniform_gravity": {"acceleration": [0.3, 0, 0]}}]
    after["integrator"] = {"velocity_verlet": {"dt": 0.02}}
    joined = copy.deepcopy(before)
    joined["timeline"] = [
        {
            "at": 0.333,
            "set": {
                **{f"particles[2].body.{key}": after["particles"][2]["body"][key] for key in ("mass", "charge", "free")},
                "springs": after["springs"],
                "forces": after["forces"],
                "integrator": after["integrator"],
            },
        }
    ]
    with Simulation(before, backend="cpu", plan=plan) as first:
        middle = first.run(until=0.333).snapshot()
    with Simulation(after, backend="cpu", plan=plan) as second:
        second.state.write(middle.position, middle.velocity * second.start.free)
        expected = second.run(steps=40).snapshot()
        energy = second.diagnostics()["total_energy"]
    with Simulation(joined, backend="cpu", plan=plan) as simulation:
        found = simulation.run(steps=34 + 40).snapshot()
        assert simulation.time == pytest.approx(0.333 + 0.8, abs=1e-15)
        assert simulation.diagnostics()["total_energy"] == energy
    assert np.array_equal(found.position, expected.position) and np.array_equal(found.velocity, expected.velocity)
    assert np.array_equal(found.mass, expected.mass) and len(found.springs) == len(expected.springs)
    assert found.velocity[2, 1] == 0.0 and found.position[2, 1] == middle.position[2, 1]


@pytest.mark.sampled(3)
def test_a_method_with_a_history_begins_anew_in_its_phase():
    """BDF2 after leapfrog: as from a snapshot, and so again after a restart, when its fields still hold a history."""
    bdf2 = {"integrator": {"bdf2": {"dt": 0.02}}}
    scene = oscillator({"at": 0.105, "set": {"springs.link.stiffness": 9, **bdf2}}, dt=0.01)
    with Simulation(scene, backend="cpu") as simulation:
        middle = simulation.run(until=0.105).snapshot()
        assert simulation.step_count == 11 and simulation.phase_number == 1
        found = simulation.run(steps=5).snapshot()
        assert (simulation.solver_report.steps, simulation.solver_report.unsolved) == (5, 0)
        simulation.restart()
        assert np.array_equal(simulation.run(steps=16).snapshot().position, found.position)
    alone = {**oscillator(), **bdf2}
    alone["springs"][0]["link"]["stiffness"] = 9
    with Simulation(alone, backend="cpu") as simulation:
        simulation.state.write(middle.position, middle.velocity)
        assert np.array_equal(simulation.run(steps=5).snapshot().position, found.position)


@pytest.mark.sampled(3)
def test_replicas_go_through_the_phases_together():
    scene = oscillator({"at": 0.5, "set": {"springs[0].link.stiffness": 5, "particles.1.body.mass": 1}}, dt=0.01)
    with Simulation(scene, backend="cpu", plan="serial") as simulation:
        starts = [simulation.snapshot(), simulation.run(steps=20).snapshot()]
        alone = []
        for start in starts:
            simulation.restart()
            simulation.state.write(start.position, start.velocity)
            alone.append(simulation.run(until=1.0).snapshot())
    with Simulation(scene, backend="cpu", replica_starts=starts) as ensemble:
        ensemble.run(until=1.0)
        for k, expected in enumerate(alone):
            assert np.array_equal(ensemble.snapshot(k).position, expected.position)
            assert np.array_equal(ensemble.snapshot(k).velocity, expected.velocity)


@pytest.mark.sampled(3)
def test_a_jump_of_a_parameter_is_work_and_no_error(caplog):
    """Stiffness, then mass, then a held axis: each changes the energy by what the state says, and the watchdog is content."""
    events = [
        {"at": 1.0, "set": {"springs[0].link.stiffness": 12}},
        {"at": 2.0, "set": {"particles[1].body.mass": 5}},
        {"at": 3.0, "set": {"particles[1].body.free": [False, True, True]}},
    ]
    table = TableRecorder(10)
    watchdog = EnergyWatchdog(table)
    with Simulation(oscillator(*events), backend="cpu") as simulation, caplog.at_level(logging.INFO):
        work = []
        for change in (
            lambda s: 0.5 * (12.0 - 3.0) * (s.position[1, 0] - 1.0) ** 2,
            lambda s: 0.5 * (5.0 - 2.0) * s.velocity[1, 0] ** 2,
            lambda s: -0.5 * 5.0 * s.velocity[1, 0] ** 2,
        ):
            last = simulation.run(duration=0.999, recorders=[table, watchdog]).snapshot()
            simulation.run(steps=1, recorders=[table, watchdog])
            # Up to the change the state has moved by one step of 0.001: the leapfrog step is repeated here in NumPy.
            k, m = (3.0, 12.0, 12.0)[len(work)], (2.0, 2.0, 5.0)[len(work)]
            x, v = last.position[1, 0] - 1.0, last.velocity[1, 0]
            x += 0.0005 * v
            v -= 0.001 * k / m * x
            x += 0.0005 * v
            moved = last.moved(
                position=np.array([[0, 0, 0], [1.0 + x, 0, 0]]), velocity=np.array([[0, 0, 0], [v, 0, 0]]), time=0, step=0
            )
            work.append(change(moved))
        simulation.run(until=6.0, recorders=[table, watchdog])
        assert simulation.phase_work == pytest.approx(work, rel=1e-9)
        held = simulation.snapshot()
        assert held.velocity[1, 0] == 0.0 and simulation.diagnostics()["kinetic_energy"] == 0.0
    assert min(abs(each) for each in work) > 0.04
    energies = {row["time"]: row["total_energy"] for row in table.rows}
    assert energies[1.0] - energies[0.0] == pytest.approx(work[0], rel=1e-4)
    # Leapfrog keeps the energy to (ω dt)²/4 of itself, ω² at most 12/2: 1.5e-6. The jumps, of the order of 1, do not count.
    assert table.summary()["relative_energy_error_max"] == table.summary()["conserved_energy_error_max"] < 2e-6
    assert watchdog.broken_at is None
    told = [record.message for record in caplog.records if "springs[0].link.stiffness changed" in record.message]
    assert len(told) == 1 and "time 1:" in told[0]


def test_only_phases_that_conserve_energy_are_asked_to():
    scene = oscillator({"at": 3.0, "set": {"forces.linear_drag.coefficient": 0}}, velocity=1.0)
    scene["forces"] = [{"linear_drag": {"coefficient": 0.5}}]
    table = TableRecorder(10)
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(recorders=[table])
        assert simulation.phase.conserves_energy and [each.effects for each in simulation.phases] == [
            ["linear_drag", "spring"],
            ["spring"],
        ]
    found = table.summary()
    assert found["relative_energy_error_max"] > 0.5 and found["conserved_energy_error_max"] < 1e-6


class Pictures:
    """A view that keeps what it is asked to draw."""

    def __init__(self):
        self.frames = []

    def draw(self, frame):
        self.frames.append(frame)
        return np.zeros((1, 1, 3), np.uint8)


def test_a_film_goes_on_across_phases():
    """Every frame at its time and within ½ a δ² of the motion, though the step before the event is long and cut short."""
    event = {
        "at": 1.09,
        "set": {"integrator.leapfrog.dt": 0.01, "springs[0].link.stiffness": 0, "particles[1].body.color": [1, 0, 0]},
    }
    view = Pictures()
    film = FilmRecorder(view, [], 61, 6.0, stopwatch=Stopwatch())
    with Simulation(oscillator(event, dt=0.03), backend="cpu") as simulation:
        simulation.run(recorders=[film])
        film.finish(simulation)
    times = np.linspace(0.0, 6.0, 61)
    np.testing.assert_allclose([frame.time for frame in view.frames], times, rtol=0, atol=1e-12)
    w = np.sqrt(1.5)
    late = 1.0 + 0.5 * np.cos(w * 1.09) - 0.5 * w * np.sin(w * 1.09) * (times - 1.09)
    expected = np.where(times < 1.09, 1.0 + 0.5 * np.cos(w * times), late)
    # ½ a δ² with a = 0.75 and δ < 0.03 is 3.4e-4 before the event, leapfrog's own error (ω dt)²/24 of ωt/2 makes 1e-4 at most,
    # and of the speed as much, times the five units of free flight.
    error = np.abs([frame.position[1, 0] for frame in view.frames] - expected)
    assert error[times < 1.09].max() < 4.5e-4 and error.max() < 6e-4
    red = np.array([tuple(frame.color[1]) == (1.0, 0.0, 0.0) for frame in view.frames])
    assert np.array_equal(red, times > 1.09)


# --- what a timeline may say -------------------------------------------------------------------------------------------------

GOOD = """\
constants: {k: 50, size: 1}
particles:
  - lattice: {name: sheet, shape: [4, 4], lower: [-1, -1, 0], upper: [1, 1, 0], fixed: rim, displacement: [0, 0, size * u]}
springs:
  - lattice_links: {of: sheet, stiffness: k}
forces:
  - uniform_gravity: {acceleration: [0, 0, -1]}
  - linear_drag: {coefficient: 2}
integrator: {leapfrog: {dt: 1e-2}}
run: {duration: 50}
timeline:
  - at: 2 * 10
    set: {forces.linear_drag.coefficient: 0}
  - at: 30
    set:
      springs[0].lattice_links.stiffness: 20
"""
STIFFNESS = "springs[0].lattice_links.stiffness: 20"
CHANGES = [
    ("at: 30", "at: 20", "14:9: timeline[1].at: 20 is not after timeline[0].at = 20"),
    ("at: 30", "at: 50", "14:9: timeline[1].at: 50 is never reached, must be below run.duration = 50"),
    ("at: 30", "at: 0", "14:9: timeline[1].at: 0 is not allowed, must be above 0"),
    ("at: 30", "at: .inf", "14:9: timeline[1].at: inf is not a finite number"),
    ("at: 30", "at: later", "14:9: timeline[1].at: unknown name 'later'"),
    ("at: 30", "att: 30", "14:5: timeline[1].att: unknown key 'att', did you mean 'at'?"),
    ("  - at: 30\n    set:", "  - set:", "timeline[1]: missing key 'at'"),
    ("duration: 50", "steps: 3000", "14:9: timeline[1].at: 30 is never reached, must be earlier: 3000 steps lead to it"),
    (
        "set: {forces.linear_drag.coefficient: 0}",
        "set: {}",
        "13:10: timeline[0].set: must be a mapping of paths to values, not nothing",
    ),
    ("set: {forces.linear_drag.coefficient: 0}", "set: 5", "timeline[0].set: must be a mapping of paths to values, not 5"),
    (
        "set: {forces.linear",
        "set: {forces[1].linear",
        "13:17: not valid YAML: a comma is missing before here, in the { of line 13, column 10; a path",
    ),
    (
        "drag.coefficient: 0",
        "drag.coeficient: 0",
        "13:42: forces[1].linear_drag.coeficient: unknown key 'coeficient', did you mean",
    ),
    (
        "drag.coefficient: 0",
        "drag.coefficient: -1",
        "13:43: forces[1].linear_drag.coefficient: -1 is not allowed, must be at least 0 (from timeline[0] on)",
    ),
    (
        "forces.linear_drag.",
        "forces.linear_drga.",
        "13:43: forces has no entry 'linear_drga', did you mean 'linear_drag'? allowed: 0 to 1",
    ),
    (
        "forces.linear_drag.",
        "forses.linear_drag.",
        "13:11: timeline[0].set.forses.linear_drag.coefficient: 'forses' stays as it is, did you mean 'forces'?",
    ),
    (STIFFNESS, "springs[1].lattice_links.stiffness: 20", "16:43: springs has no entry '1', allowed: 0 to 0"),
    (STIFFNESS, "springs[0].lattice_links.of: net", "of: no lattice is called 'net', allowed: sheet (from timeline[1] on)"),
    (STIFFNESS, "integrator: {rk5: {dt: 1}}", "unknown integrator 'rk5', did you mean 'rk4'?"),
    (STIFFNESS, "integrator.rk4.dt: 1", "unknown key 'rk4' in integrator, +integrator.rk4.dt=… adds it, allowed: leapfrog"),
    (
        STIFFNESS,
        "constants.k: -5",
        "5:43: springs[0].lattice_links.stiffness: -5 is not allowed, must be at least 0 (from timeline[1] on)",
    ),
    (
        STIFFNESS,
        "constants.size: 5",
        "timeline[1].set: changes particles[0].lattice.displacement, but particles stay where the motion",
    ),
    (
        STIFFNESS,
        "particles[0].lattice.shape: [5, 4]",
        "16:7: timeline[1].set.particles[0].lattice.shape: changes particles[0].lattice.shape",
    ),
    (
        STIFFNESS,
        "springs: []\n      particles[0]: {body: {mass: 1, position: [0, 0, 0]}}",
        "makes of particles[0] another kind of entry",
    ),
    (STIFFNESS, "+particles[1]: {body: {mass: 1, position: [0, 0, 0]}}", "adds or removes particles"),
    (STIFFNESS, "particles[0].lattice.mass: 0", "has no mass but a spring"),
    *(
        (
            STIFFNESS,
            f"{key}: 1",
            f"timeline[1].set.{key}: '{key.split('.')[0]}' stays as it is, allowed: constants, contacts, forces, integrator",
        )
        for key in (
            "seed",
            "dimensions",
            "run.duration",
            "units.mass",
            "title",
            "timeline",
            "record.fps",
            "move_to_center_of_mass",
        )
    ),
    (STIFFNESS, "'': 1", "16:7: a key must be a word"),
    (STIFFNESS, "'+': 1", "'+' is no path"),
    (STIFFNESS, "a b..c: 1", "'a b..c' is no path, allowed: names with dots and [index]"),
    (
        GOOD[GOOD.index("  - at: 2 *") :],
        "".join(f"  - {{at: 0.5 + {k}/2, set: {{constants.k: 1}}}}\n" for k in range(51)),
        "51 events are too many",
    ),
]


@pytest.mark.parametrize(("old", "new", "expected"), CHANGES, ids=[str(k) for k in range(len(CHANGES))])
def test_a_bad_timeline_is_refused_at_its_place_before_anything_runs(old, new, expected, tmp_path):
    assert GOOD.count(old) == 1
    path = tmp_path / "bad.yaml"
    path.write_text(GOOD.replace(old, new), encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        from mpp_taichi.simulation.course import phases_of

        phases_of(load_scene(path))
    assert expected in str(caught.value)
    assert all(fault.startswith(f"{path}:") for fault in caught.value.faults)


def test_a_timeline_is_read_from_files_mappings_and_specs_alike(tmp_path):
    path = tmp_path / "good.yaml"
    path.write_text(GOOD, encoding="utf-8")
    for source in (path, yaml.safe_load(GOOD), load_scene(path)):
        spec = load_scene(source, overrides={"timeline[1].at": 40, "constants.k": 70})
        first, second = spec.timeline
        assert (first.at, second.at) == (20.0, 40.0)
        assert [entry.name for entry in first.scene.forces] == ["uniform_gravity"]
        assert [each.springs[0].parameters["stiffness"] for each in (spec, first.scene, second.scene)] == [70.0, 70.0, 20.0]
        assert second.changes == {"springs[0].lattice_links.stiffness": 20} and second.scene.timeline == ()
        assert load_scene(second.scene.resolved).springs[0].parameters["stiffness"] == 20.0


def test_what_may_change_of_particles_keeps_their_places():
    scene = yaml.safe_load(GOOD)
    scene["timeline"] = [
        {"at": 1, "set": {"particles[0].lattice.fixed": "none", "particles[0].lattice.mass": "size + 2", "forces": []}}
    ]
    from mpp_taichi.simulation.course import phases_of

    first, second = phases_of(load_scene(scene))
    assert np.array_equal(first.particles.position, second.particles.position)
    assert not first.particles.free.all() and second.particles.free.all() and (second.particles.mass == 3.0).all()
    assert second.effects == ["spring"]


# --- the command line -------------------------------------------------------------------------------------------------------


def test_the_command_line_tells_of_phases(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scene = oscillator({"at": 0.5, "set": {"springs.link.stiffness": 5, "integrator.leapfrog.dt": 0.02}}, dt=0.03)
    scene["run"]["duration"] = 1.0
    Path("s.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    words = [
        "s.yaml",
        "--headless",
        "--quiet",
        "--every",
        "5",
        "--trajectory",
        "t.npz",
        "--snapshot",
        "s.npz",
        "--diagnostics",
        "d.csv",
    ]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["steps"], found["time"]) == (17 + 25, 1.0)
    (phase,) = found["phases"]
    assert phase["at"] == 0.5 and phase["changes"] == {"springs.link.stiffness": 5, "integrator.leapfrog.dt": 0.02}
    assert phase["effects"] == ["spring"] and phase["work"] > 0.0
    assert Snapshot.load("s.npz").time == 1.0 and (Snapshot.load("s.npz").springs.stiffness == 5).all()
    with np.load("t.npz") as data:
        assert data["step"].tolist() == [*range(0, 41, 5), 42] and data["time"][4] == 0.5 + 3 * 0.02
    assert main(["s.yaml", "--dry-run", "--json"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert planned["steps"] == 42 and planned["timeline"][0]["dt"] == 0.02
    assert main(["s.yaml", "--headless", "--until", "0.3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["phases"] == []


def test_a_step_too_large_for_a_later_phase_is_told_before_the_first(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    # ω dt = √(2e6/2) · 0.03 = 30 from t = 0.5 on: leapfrog multiplies the error by 900 a step, past 1e308 near t = 3.6.
    scene = oscillator({"at": 0.5, "set": {"springs[0].link.stiffness": 2e6}}, dt=0.03)
    Path("s.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    for options in (["--headless"], ["--dry-run"]):
        assert main(["s.yaml", *options]) == 4
        assert "from t = 0.5 on: integrator.leapfrog.dt = 0.03 is beyond" in capsys.readouterr().err
    assert not Path("out").exists()
    assert main(["s.yaml", "--headless", "--until", "0.5"]) == 0, "a phase that is not reached does not matter"
    capsys.readouterr()
    assert main(["s.yaml", "--headless", "--force"]) == 4
    told = capsys.readouterr().err
    assert told.index("from t = 0.5 on: integrator.leapfrog.dt = 0.03 is") < told.index("error: step")
    crash = Snapshot.load("out/s.crash.npz")
    assert 0.5 <= crash.time < 6.0 and np.isfinite(crash.position).all() and (crash.springs.stiffness == 2e6).all()


@pytest.mark.sampled(3)
def test_a_run_goes_on_from_a_state_in_a_later_phase(tmp_path, monkeypatch, capsys):
    """The mass of the second phase is the state's, so the state fits that phase and not the first."""
    monkeypatch.chdir(tmp_path)
    changes = {"springs[0].link.stiffness": 5.0, "particles[1].body.mass": 1.5}
    events = ({"at": 1.0, "set": changes}, {"at": 3.0, "set": {"springs[0].link.stiffness": 2.0}})
    Path("s.yaml").write_text(yaml.safe_dump(oscillator(*events, dt=0.01)), encoding="utf-8")
    assert main(["s.yaml", "--headless", "-q", "--until", "2", "--snapshot", "half.npz"]) == 0
    assert main(["s.yaml", "--headless", "-q", "--snapshot", "whole.npz"]) == 0
    capsys.readouterr()
    assert main(["s.yaml", "--headless", "-q", "--rewind", "half.npz", "--snapshot", "joined.npz", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [phase["at"] for phase in found["phases"]] == [3.0] and found["steps"] == 600 and found["time"] == 6.0
    joined, whole = Snapshot.load("joined.npz"), Snapshot.load("whole.npz")
    # Leapfrog keeps no history; the clock of the joined run counts from 2 instead of 1, which forces here do not ask for.
    assert np.array_equal(joined.position, whole.position) and np.array_equal(joined.velocity, whole.velocity)


# --- membrane: gravity and friction, then release ----------------------------------------------------------------------------


def test_the_membrane_sags_to_its_static_shape_and_swings_without_loss():
    """S08: against Newton's method on the forces of all springs, written down here."""
    optimize = pytest.importorskip("scipy.optimize")
    axis = np.linspace(-1.0, 1.0, 8)
    rest = np.array([[x, y, 0.0] for y in axis for x in axis])
    index = np.arange(64).reshape(8, 8)
    links = np.array([*zip(index[:, :-1].ravel(), index[:, 1:].ravel()), *zip(index[:-1].ravel(), index[1:].ravel())])
    inner = index[1:-1, 1:-1].ravel()

    def net_force(inner_position):
        position = rest.copy()
        position[inner] = inner_position.reshape(-1, 3)
        along = position[links[:, 1]] - position[links[:, 0]]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        pull = 50.0 * (length - 2.0 / 7.0 / 1.5) * along / length
        force = np.zeros_like(rest)
        np.add.at(force, links[:, 0], pull)
        np.add.at(force, links[:, 1], -pull)
        force[:, 2] -= 1.0
        return force[inner].ravel()

    static = optimize.root(net_force, rest[inner].ravel(), tol=1e-13).x.reshape(-1, 3)
    assert np.abs(net_force(static)).max() < 1e-10
    table = TableRecorder(30)
    with Simulation(ROOT / "scenes" / "membrane_release.yaml", backend="cpu") as simulation:
        simulation.run(until=10.0, recorders=[table])
        assert np.abs(simulation.snapshot().position[inner] - static).max() < 1e-6 * 2.0
        # Taking away m g z of every particle is the work of the release.
        assert simulation.phase_work == [pytest.approx(-static[:, 2].sum(), rel=1e-6)]
        assert [each.effects for each in simulation.phases] == [["uniform_gravity", "linear_drag", "spring"], ["spring"]]
        simulation.run(recorders=[table], until=30.0)
        assert simulation.snapshot().position[inner, 2].max() < 0.21
    assert table.summary()["conserved_energy_error_max"] < 1e-5
    late = [row["relative_energy_error"] for row in table.rows if row["time"] > 20]
    early = [row["relative_energy_error"] for row in table.rows if 10 < row["time"] <= 20]
    assert max(late) < 1.5 * max(early), "the error must not grow"
