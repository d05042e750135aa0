"""The integrator and the step that are chosen in a window: which are offered, and a run that begins anew with them."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi import Simulation, component
from mpp_taichi.cli._file_scene import FileScene
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._methods import about, refusal, with_method
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._start_simulation import start_another
from mpp_taichi.cli._window_desk import SessionDesk, save_log
from mpp_taichi.scene.load import load_scene
from mpp_taichi.views.method_box import MESSAGE_LINES, MethodBox, Methods

SCENE = {
    "title": "Thrown",
    "particles": [{"body": {"mass": 1, "position": [0, 0, 0], "velocity": [1, 2, 0]}}],
    "forces": [{"uniform_gravity": {"acceleration": [0, -1, 0]}}, {"linear_drag": {"coefficient": 0.25}}],
    "sliders": [{"set": "forces.uniform_gravity.acceleration[1]", "from": -5, "to": 0}, {"set": "integrator.rk4.dt"}],
    "integrator": {"rk4": {"dt": 0.125}},
    "run": {"duration": 2},
}


class Hand:
    """A stand-in for GGUI's panel that clicks the button whose text has these words."""

    def __init__(self, words=None):
        self.words, self.buttons, self.lines = words, [], []

    def button(self, text):
        self.buttons.append(text)
        return self.words is not None and self.words in text

    def text(self, text):
        self.lines.append(text)


def box(**more):
    known = {"names": ["a", "b", "c"], "present": "b", "dt": lambda: 0.003, "about": lambda name: f"about {name}"}
    known |= {"refusal": lambda name, dt: "c knows no springs" if name == "c" else "", "choose": lambda name, dt: ""}
    return MethodBox(Methods(**known | more))


def test_an_integrator_and_a_step_are_chosen_by_arrows_and_enter():
    shown = box()
    assert not shown.press("Down"), "keys are the window's while nothing is shown"
    shown.toggle()
    assert shown.told() == "b, dt = 0.003"
    for key in ("Left", "Left", "Right", "Right", "Right", "Up", "Return"):
        assert shown.press(key)
    assert shown.take() == ("a", 0.006) and shown.take() is None
    assert shown.press("Escape") and not shown.shown
    shown.toggle()
    assert shown.rows.marked == 1 and shown.dt == 0.003, "as it runs"


def test_an_integrator_and_a_step_are_chosen_by_clicks():
    shown = box()
    shown.toggle()
    for words in ("  c", "twice the step: dt = 0.006", "begin anew with c, dt = 0.006"):
        shown.draw(Hand(words), 720)
    assert shown.take() == ("c", 0.006)
    shown.draw(Hand("half the step: dt = 0.003"), 720)
    assert shown.dt == 0.003 and shown.take() is None
    left, top, width, height = shown.box((640, 360))
    assert left > 0.0 and top > 0.0 and left + width < 1.0 and top + height < 1.0, "all in the window"


def test_an_integrator_that_cannot_run_the_scene_is_told_with_the_reason():
    asked = []
    shown = box(refusal=lambda name, dt: asked.append((name, dt)) or ("c knows no springs " * 50 if name == "c" else ""))
    shown.look()
    assert not asked, "nothing is found out while the box is hidden"
    shown.toggle()
    for _ in range(5):
        shown.look()
    assert asked == [("b", 0.003), ("a", 0.003), ("c", 0.003)], "one in a frame, the marked one first"
    shown.press("Down")
    shown.draw(hand := Hand(), 720)
    assert hand.buttons[:3] == ["  a", "  b  (runs)", "> c  (cannot run this scene)"]
    assert hand.lines[2].startswith("c knows no springs") and len(hand.lines) == 2 + MESSAGE_LINES


def test_a_window_without_a_choice_has_no_box():
    shown = MethodBox(None)
    shown.toggle()
    shown.look()
    assert not shown.shown and shown.told() == "" and shown.take() is None


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("scene", "refused"),
    [
        ("kepler", {"event_driven": "needs contacts"}),
        ("oscillator", {"wisdom_holman": "not springs", "adaptive_leapfrog": "not springs"}),
        ("cluster", {"wisdom_holman": "softening is"}),
        ("rod_pendulum", {"rk4": "does not keep the lengths of rods"}),
        ("figure_eight", {"wisdom_holman": "must outweigh all others together"}),
        ("maxwell_boltzmann", {"leapfrog": "solver"}),
    ],
)
def test_the_integrators_offered_are_those_that_can_run_the_scene(scene, refused):
    written = load_scene(scene)
    dt = written.integrator.parameters["dt"]
    assert refusal(written, written.integrator.name, dt) == "" and about(written.integrator.name)
    for name, reason in refused.items():
        assert reason in refusal(written, name, dt)


def test_every_integrator_is_described_in_a_line_and_has_a_step():
    for name in component.names("integrators"):
        assert "\n" not in about(name) and "dt: time" in about(name), name


def test_a_chosen_method_keeps_all_else_and_its_own_parameters(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("kept.yaml").write_text(
        yaml.safe_dump(SCENE | {"integrator": {"implicit_midpoint": {"dt": 0.1, "tolerance": 1e-9}}, "sliders": []})
    )
    written = load_scene("kept.yaml")
    chosen = with_method(written, written, "implicit_midpoint", 0.05)
    assert chosen.integrator.parameters["dt"] == 0.05 and chosen.integrator.parameters["tolerance"] == 1e-9
    other = with_method(written, written, "leapfrog", 0.05)
    changed = {key for key in written.resolved if written.resolved[key] != other.resolved[key]}
    assert changed == {"integrator"} and other.resolved["integrator"] == {"leapfrog": {"dt": 0.05}}


@pytest.mark.sampled(3)
def test_a_run_begins_anew_with_the_chosen_method_and_its_log_repeats_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("thrown.yaml").write_text(yaml.safe_dump(SCENE, sort_keys=False), encoding="utf-8")
    request = Request(backend="cpu", window=True, quiet=True)
    with Simulation("thrown.yaml", backend="cpu", precision="f64") as simulation:
        goal = Goal(1.5, None, False)
        desk = SessionDesk(
            simulation, goal, [], lambda found, goal: start_another(found, device=simulation.device, request=request, goal=goal)
        )
        simulation.run(until=0.5)
        simulation.set("forces.uniform_gravity.acceleration[1]", -3.0)
        methods = desk.desk().methods
        assert methods.present == "rk4" and methods.choose("hermite4", 0.0625).startswith("thrown.yaml:")
        assert desk.opened is None and "hermite4" in capsys.readouterr().err, "the terminal is told as well"
        assert methods.choose("yoshida4", 0.0625) == ""
        started = desk.opened
    with started.simulation as anew:
        assert anew.step_count == 0 and anew.dt == 0.0625 and started.goal is goal
        assert [slider.path for slider in anew.scene.sliders] == ["forces.uniform_gravity.acceleration[1]"]
        assert anew.spec.forces[0].parameters["acceleration"][1] == -3.0, "sliders stay where they are"
        anew.run(until=1.0)
        middle = anew.snapshot().position
        anew.set("forces.uniform_gravity.acceleration[1]", -1.0)
        anew.run(until=1.5)
        wanted = anew.snapshot().position
        save_log(Path("log.yaml"), anew, goal)
    with Simulation("log.yaml", backend="cpu", precision="f64") as again:
        assert again.scene.integrator.name == "yoshida4"
        again.run(until=1.5)
        np.testing.assert_array_equal(again.snapshot().position, wanted)
    overrides = ["integrator={yoshida4: {dt: 0.0625}}", "forces.uniform_gravity.acceleration[1]=-3.0", "sliders=[]"]
    with Simulation("thrown.yaml", backend="cpu", precision="f64", overrides=overrides) as by_hand:
        by_hand.run(until=1.0)
        np.testing.assert_array_equal(by_hand.snapshot().position, middle, "as --set would begin it")


def test_a_run_that_began_from_a_state_begins_there_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("thrown.yaml").write_text(yaml.safe_dump(SCENE, sort_keys=False), encoding="utf-8")
    with Simulation("thrown.yaml", backend="cpu", precision="f64") as simulation:
        simulation.run(until=0.5)
        simulation.checkpoint("thrown_0000.npz")
        state, device = simulation.snapshot(), simulation.device
        found = FileScene(with_method(simulation.scene, simulation.scene, "leapfrog", 0.1), state, Path("thrown_0000.npz"))
        started = start_another(found, device=device, request=Request(backend="cpu", window=True, quiet=True))
    with started.simulation as anew:
        assert (anew.time, anew.dt, started.goal.state) == (0.5, 0.1, "thrown_0000.npz")
        np.testing.assert_array_equal(anew.snapshot().position, state.position)
