"""Sliders: a parameter that moves during a run acts on the next step, without compilation, and the log repeats the run."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import mpp_taichi as mpp
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.log import write_log
from mpp_taichi.simulation.history import History

FIELD = "forces.uniform_gravity.acceleration[2]"
STRENGTH = "forces.newtonian_gravity.strength"


def stone(*events, **more):
    """A stone of mass 1 in a field; all numbers are binary fractions, so that a leapfrog is exact."""
    return {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 2], "velocity": [1, 0, 0]}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -2]}}, {"linear_drag": {"coefficient": 0}}],
        "integrator": {"leapfrog": {"dt": 0.125}},
        "run": {"duration": 8},
        "timeline": list(events),
        "sliders": [{"set": FIELD, "from": -4, "to": 4}, {"set": "integrator.leapfrog.dt", "from": 0.0625, "to": 0.25}],
        **more,
    }


@pytest.fixture
def falling():
    """The stone, on the CPU."""
    with mpp.Simulation(stone(), backend="cpu", precision="f64") as simulation:
        yield simulation


def place(simulation):
    """Height and vertical velocity of the stone."""
    snapshot = simulation.snapshot()
    return snapshot.position[0, 2], snapshot.velocity[0, 2]


# --- what a move does -----------------------------------------------------------------------------------------------------


def test_the_next_step_is_with_what_was_moved(falling):
    falling.run(until=1.0)  # z = 2 − t², v_z = −2 t
    falling.set(FIELD, 3.0)
    assert falling.phase_work == [-(3.0 + 2.0) * 1.0]  # −m Δg z: the field rose while the stone was at z = 1
    falling.run(steps=1)
    assert place(falling) == (1.0 - 2.0 * 0.125 + 1.5 * 0.125**2, -2.0 + 3.0 * 0.125)
    falling.set("integrator.leapfrog.dt", 0.25)
    falling.run(steps=1)
    assert falling.time == 1.375 and place(falling)[1] == -2.0 + 3.0 * 0.375


@pytest.mark.sampled(3)
def test_moves_are_events_that_later_ones_and_restarts_respect():
    release = {"at": 3.0, "set": {"forces.uniform_gravity.acceleration": [0, 0, 0]}}
    with mpp.Simulation(stone(release), backend="cpu", precision="f64") as simulation:
        simulation.set(FIELD, -1)  # before the first step: the stone stays where it is
        simulation.run(until=2.0)
        simulation.set(FIELD, 1)
        simulation.set(FIELD, 0.5)  # of the same time: one event
        assert [(event.at, event.live) for event in simulation.scene.timeline] == [(0, True), (2.0, True), (3.0, False)]
        simulation.run(until=4.0)  # v_z: −2 at t = 2, −1.5 at t = 3, and no force after that
        assert place(simulation) == (2.0 - 2.0 - 2.0 + 0.25 - 1.5, -1.5)
        seen = simulation.snapshot()
        simulation.restart()
        assert np.array_equal(simulation.run(until=4.0).snapshot().position, seen.position)
        with mpp.Simulation(simulation.scene, backend="cpu", precision="f64") as again:
            assert np.array_equal(again.run(until=4.0).snapshot().position, seen.position)
            again.run(steps=1).set(FIELD, 2)
            again.restart(
                as_written=True
            )  # sliders stay, the way to them is forgotten: what remains is the scene's own, as it was read
            assert again.time == 0.0 and again.spec.forces[0].parameters["acceleration"][2] == 2.0


def test_going_back_is_exact_and_takes_the_parameters_along(falling):
    history = History(falling, moments_allowed=4)
    seen = [place(falling)]
    for number in range(6):
        if number == 3:
            falling.set(FIELD, 1.0)
            history.keep()
        falling.run(steps=1)
        history.keep()
        seen.append(place(falling))
    for expected in (seen[5], seen[4], seen[3]):
        assert history.back() and place(falling) == expected
    assert not history.back() and place(falling) == seen[3], "four moments are kept"
    assert [event.changes for event in falling.scene.timeline] == [{FIELD: 1.0}], "it was moved before that step"
    falling.run(steps=2)
    assert place(falling) == seen[5] and falling.phase_work == [-3.0 * seen[3][0]]


def test_steps_that_depend_on_time_are_the_same_in_launches_of_any_size():
    scene = {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}],
        "forces": [{"harmonic_drive": {"force": [1, 0, 0], "angular_frequency": 1700}}],  # an ulp of time is 6e-12 of phase
        "integrator": {"leapfrog": {"dt": 0.1}},
        "run": {"duration": 20},
    }
    with mpp.Simulation(scene, backend="cpu", precision="f64") as simulation:
        for steps in (1, 2, 3, 5, 8, 13, 21, 34, 55, 58):
            simulation.run(steps=steps)
        parts = simulation.snapshot()
        simulation.restart()
        simulation._launches.steps_of_next = 200
        simulation.run(steps=200)
        assert np.array_equal(simulation.snapshot().position, parts.position)


# --- repeated from the log ------------------------------------------------------------------------------------------------

BODIES = """\
particles:
  - body: {name: sun, mass: 1, position: [0, 0, 0]}
  - body: {name: earth, mass: 0.1, position: [1, 0, 0], velocity: [0, 1, 0.1]}
  - body: {name: mars, mass: 0.2, position: [0, 2, 0.3], velocity: [-0.7, 0, 0]}
"""
GRAVITY = """\
forces: [{newtonian_gravity: {strength: 1}}]
integrator: {leapfrog: {dt: 0.01}}
sliders:
  - {set: forces.newtonian_gravity.strength, from: 0.1, to: 10, scale: log}
  - {set: integrator.leapfrog.dt}
"""
SPRINGS = """\
springs:
  - link: {between: [0, 1], type: soft}
  - link: {between: [1, 2], type: soft, stiffness: 3}
spring_types: {soft: {stiffness: 2, prestretch: 1.1}}
forces: [{newtonian_gravity: {}}, {uniform_gravity: {acceleration: [0, 0, -1]}}, {linear_drag: {coefficient: 0}}]
integrator: {velocity_verlet: {dt: 0.01}}
sliders:
  - {set: forces.linear_drag.coefficient}
  - {set: 'forces.uniform_gravity.acceleration[2]', from: -3, to: 3}
  - {set: 'springs[1].link.stiffness', from: 1, to: 9}
  - {set: spring_types.soft.stiffness}
  - {set: 'springs[0].link.damping'}
"""
MOVES = {
    GRAVITY: [{STRENGTH: 1.7}, {STRENGTH: 0.3, "integrator.leapfrog.dt": 0.013}, {STRENGTH: 4}],
    SPRINGS: [
        {"forces.linear_drag.coefficient": 0.7, "springs[0].link.damping": 0.4},
        {"springs[1].link.stiffness": 7.5, "spring_types.soft.stiffness": 0.3},
        {FIELD: 2.1},
    ],
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("system", "precision"), [(GRAVITY, "f64"), (GRAVITY, "f32"), (SPRINGS, "f64"), (SPRINGS, "f32")])
def test_moves_compile_nothing_and_their_log_repeats_every_bit(system, precision, tmp_path, compilations):
    scene = tmp_path / "scene.yaml"
    scene.write_text(f"run: {{duration: 3}}\n{BODIES}{system}", encoding="utf-8")
    with mpp.Simulation(scene, backend="cpu", precision=precision) as simulation:
        simulation.run(steps=3).diagnostics()
        before = simulation.snapshot()
        compiled = len(compilations)
        assert compiled > 0
        for number, changes in enumerate(MOVES[system]):
            simulation.set(changes)
            simulation.run(steps=7 * number + 1)
        unmoved = simulation.bookmark()
        simulation.run(until=2.0)
        assert compilations[compiled:] == []
        end = simulation.snapshot()
        assert not np.array_equal(before.position, end.position)
        write_log(tmp_path / "log.yaml", simulation.scene, simulation.time, "of a test")
        simulation.go_back(unmoved)
        assert np.array_equal(simulation.run(until=2.0).snapshot().position, end.position)
    with mpp.Simulation(tmp_path / "log.yaml", backend="cpu", precision=precision) as again:
        found = again.run().snapshot()
        assert (found.time, found.step) == (end.time, end.step)
        assert np.array_equal(found.position, end.position) and np.array_equal(found.velocity, end.velocity)
        assert len(again._runner.compiled) == 1, "all phases by the same kernels"


def networks(*, soft=2.0, stiff=9.0, damped=0.1, prestretch=1.2):
    """Three nets and a link between them: two entries have the type's stiffness, two their own, in a mixed order."""
    nets = [
        {"lattice": {"name": name, "shape": [3, 2, 1], "lower": [x, 0, 0], "upper": [x + 2, 1, 0], "mass": 0.1}}
        for name, x in (("a", 0.0), ("b", 3.0), ("c", 6.0))
    ]
    return {
        "particles": nets,
        "springs": [
            {"lattice_links": {"of": "a", "type": "soft", "damping": damped}},
            {"lattice_links": {"of": "b", "stiffness": stiff, "prestretch": prestretch}},
            {"link": {"between": ["a[2]", "b[0]"], "type": "soft"}},
            {"lattice_links": {"of": "c", "type": "soft", "stiffness": 4}},
        ],
        "spring_types": {"soft": {"stiffness": soft, "prestretch": 1.1}},
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}],
        "integrator": {"velocity_verlet": {"dt": 0.01}},
        "sliders": [
            {"set": path}
            for path in (
                "spring_types.soft.stiffness",
                "springs[1].lattice_links.stiffness",
                "springs[0].lattice_links.damping",
                "springs[1].lattice_links.prestretch",
            )
        ],
    }


@pytest.mark.sampled(2)
@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_a_slider_moves_the_springs_of_its_own_network_alone(plan):
    """A start with moved sliders has the bits of the scene that is written with those numbers, for each slider by itself."""
    moves = [{"soft": 3.0}, {"stiff": 5.0}, {"damped": 0.2}, {"prestretch": 1.4}]
    how = {"backend": "cpu", "precision": "f64", "plan": plan}
    with mpp.Simulation(networks(), **how) as simulation:
        paths = [slider["set"] for slider in networks()["sliders"]]
        unmoved = [2.0, 9.0, 0.1, 1.2]
        for path, value, move in zip(paths, unmoved, moves, strict=True):
            simulation.run(steps=3)
            simulation.set(path, *move.values())
            simulation.restart(as_written=True)  # sliders stay where they are
            moved = simulation.run(steps=40).snapshot()
            with mpp.Simulation(networks(**move), **how) as written:
                found = written.run(steps=40).snapshot()
            assert np.array_equal(moved.position, found.position) and np.array_equal(moved.velocity, found.velocity), path
            simulation.set(path, value)


@pytest.mark.sampled(3)
def test_a_number_that_is_loaded_gives_the_bits_of_one_that_is_compiled(tmp_path):
    events = "".join(f"  - {{at: {at}, set: {{{STRENGTH}: {value}}}}}\n" for at, value in ((0.5, 1.7), (0.9, 0.3), (1.3, 4)))
    text = f"run: {{duration: 2}}\n{BODIES}{GRAVITY}timeline:\n{events}"
    (tmp_path / "live.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "compiled.yaml").write_text(text[: text.index("sliders")] + text[text.index("timeline") :], encoding="utf-8")
    ends = []
    for name, kinds in (("live", 1), ("compiled", 4)):
        with mpp.Simulation(tmp_path / f"{name}.yaml", backend="cpu", precision="f32") as simulation:
            ends.append(simulation.run().snapshot().position)
            assert len(simulation._runner.compiled) == kinds
    assert np.array_equal(*ends)


def test_a_log_is_a_scene_wherever_it_stands(tmp_path, monkeypatch, capsys):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "elsewhere").mkdir()
    scene = tmp_path / "scenes" / "fall.yaml"
    text = {**stone(), "expect": {"relative_energy_error_max": {"below": 1e-12}}}
    scene.write_text(yaml.safe_dump(text), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    command = ["run", "scenes/fall.yaml", "--headless", "-q", "--backend", "cpu", "--set", "particles[0].body.mass=3"]
    assert main([*command, "--until", "1", "--log", "log.yaml"]) == 0
    log = yaml.safe_load((tmp_path / "log.yaml").read_text(encoding="utf-8"))
    assert log["extends"] == "scenes/fall.yaml" and log["run"] == {"duration": 1.0} and log["expect"] is None
    assert log["particles"][0]["body"]["mass"] == 3 and set(log) == {"extends", "particles", "expect", "run"}
    read = load_scene("log.yaml")
    assert not read.expect and read.sliders and read.particles[0].parameters["mass"] == 3.0
    write_log(tmp_path / "elsewhere" / "log.yaml", read, 2.0, "")
    whole = yaml.safe_load((tmp_path / "elsewhere" / "log.yaml").read_text(encoding="utf-8"))
    assert "extends" not in whole and "expect" not in whole
    assert load_scene(tmp_path / "elsewhere" / "log.yaml").run.duration == 2.0
    assert main([*command, "--log", "log.csv"]) == 2
    assert "--log log.csv: the suffix must be one of .yaml, .yml" in capsys.readouterr().err


# --- what may be said -------------------------------------------------------------------------------------------------------

GOOD = f"run: {{duration: 3}}\nconstants: {{k: 1}}\n{BODIES}{SPRINGS}"
FIRST = "set: forces.linear_drag.coefficient"
FAULTS = [
    (FIRST, "set: forces.newtonian_gravity.softening", "cannot be moved while the scene runs"),
    (FIRST, "set: constants.k", "allowed: forces.newtonian_gravity.strength, forces.uniform_gravity.acceleration[0], "),
    (FIRST, "set: integrator.velocity_verlt.dt", "unknown key 'velocity_verlt' in integrator"),
    (FIRST, "set: forces.linear_drg.coefficient", "did you mean 'linear_drag'?"),
    (FIRST, "set: 'springs[0].link.stiffness.x'", "unknown key 'stiffness' in springs[0].link"),
    (FIRST, "set: 'springs[0].link.rest_length'", "has no value in the scene to begin with"),
    (FIRST, f"{FIRST}, from: -1", "-1 is not allowed, must be at least 0 (where sliders[0] may be moved to)"),
    (FIRST, f"{FIRST}, from: 2, to: 1", "from 2 to 1 is no range"),
    (FIRST, f"{FIRST}, from: 0, to: 1, scale: log", "has no beginning, must be above 0"),
    (FIRST, f"{FIRST}, scale: logarithmic", "'logarithmic' is unknown, allowed: linear, log"),
    (FIRST, f"{FIRST}, start: 1", "unknown key 'start'"),
    ("set: spring_types.soft.stiffness", "set: 'forces[2].linear_drag.coefficient'", "has a slider already"),
    ("set: 'springs[0].link.damping'", "label: damping", "missing key 'set'"),
]


@pytest.mark.parametrize(("old", "new", "expected"), FAULTS)
def test_what_cannot_be_a_slider_is_named_at_its_place(old, new, expected, tmp_path):
    path = tmp_path / "scene.yaml"
    assert GOOD.count(old) == 1
    path.write_text(GOOD.replace(old, new), encoding="utf-8")
    with pytest.raises(mpp.SceneError) as caught:
        load_scene(path)
    line = GOOD[: GOOD.index(old)].count("\n") + 1
    assert expected in str(caught.value) and str(caught.value).startswith(f"{path}:{line}:")


def test_ranges_that_go_without_saying():
    scene = stone(sliders=[{"set": FIELD}, {"set": "integrator.leapfrog.dt"}, {"set": "forces.linear_drag.coefficient"}])
    found = [(each.low, each.high, each.logarithmic, each.label) for each in load_scene(scene).sliders]
    assert found == [
        (-4.0, 0.0, False, "uniform_gravity.acceleration[2]"),
        (0.0125, 0.25, False, "leapfrog.dt"),
        (0.0, 1.0, False, "linear_drag.coefficient"),
    ]
    wide = stone(sliders=[{"set": FIELD, "from": 1, "to": 2}])  # the scene's own value is within any range
    assert load_scene(wide).sliders[0].low == -2.0


def test_methods_that_keep_numbers_of_forces_have_no_sliders_for_them():
    scene = load_scene(Path(__file__).parents[2] / "scenes" / "outer_solar_system.yaml").resolved
    planets = {**scene, "integrator": {"wisdom_holman": {"dt": 100}}, "sliders": [{"set": STRENGTH}]}
    with pytest.raises(mpp.SceneError, match=r"cannot be moved .* allowed: integrator\.wisdom_holman\.dt$"):
        load_scene(planets)
