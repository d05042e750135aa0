"""A rocket that is steered by keys: what a held key does, and that the log repeats the flight bit for bit."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi import Simulation
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._window_desk import SessionDesk, save_log
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.views.slider_panel import Knob
from mpp_taichi.views.steering import Steering

SLIDERS = [
    {"set": "forces.uniform_gravity.acceleration[0]", "from": -1, "to": 2, "keys": ["b", "m"]},
    {"set": "forces.uniform_gravity.acceleration[1]", "from": -3, "to": 0, "keys": ["j", "u"]},
    {"set": "forces.linear_drag.coefficient"},
]
SCENE = {
    "title": "Steered",
    "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}],
    "forces": [{"uniform_gravity": {"acceleration": [0.5, 0, 0]}}, {"linear_drag": {"coefficient": 0.125}}],
    "sliders": SLIDERS,
    "integrator": {"leapfrog": {"dt": 0.125}},
    "run": {"duration": 4},
}


def steering(**values):
    return Steering([Knob(path, path, -1.0, 2.0, False, lambda v=value: v, ("b", "m")) for path, value in values.items()])


def test_a_held_key_moves_to_an_end_and_a_released_key_moves_back():
    held = steering(push=0.5)
    for keys, moved in (
        ("", {}),
        ("m", {"push": 2.0}),
        ("m", {}),
        ("bm", {"push": 0.5}),
        ("b", {"push": -1.0}),
        ("bx", {}),
        ("", {"push": 0.5}),
        ("", {}),
    ):
        assert held.moves(set(keys)) == moved
    assert held.keys == ("b", "m")
    without = Steering([Knob("push", "push", -1.0, 2.0, False, lambda: 0.5)])
    assert without.keys == () and without.moves({"b"}) == {}


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        (["b"], "must be a list of 2 letters"),
        (["b", 4], "sliders[0].keys"),
        (["b", "q"], "sliders[0].keys"),
        (["b", "b"], "has the key b twice, must be two keys"),
        (["b", "u"], "another slider has the key u"),
    ],
)
def test_keys_are_two_letters_that_no_other_slider_has(keys, fault):
    with pytest.raises(SceneError) as caught:
        load_scene(SCENE | {"sliders": [SLIDERS[0] | {"keys": keys}, SLIDERS[1]]})
    assert fault in str(caught.value)


def test_the_log_of_a_flight_repeats_it_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("steered.yaml").write_text(yaml.safe_dump(SCENE, sort_keys=False), encoding="utf-8")
    with Simulation("steered.yaml", backend="cpu", precision="f64") as simulation:
        desk = SessionDesk(simulation, Goal(4.0, None, True), [])
        knobs = desk.desk().knobs
        assert [knob.keys for knob in knobs] == [("b", "m"), ("j", "u"), ()] and "(B, M)" in knobs[0].text
        held = Steering(knobs)
        for keys, steps in (("m", 3), ("mj", 2), ("mj", 2), ("", 4), ("b", 1), ("", 5)):
            if moved := held.moves(set(keys)):
                assert desk.move(moved) == ""
            simulation.run(steps=steps)
        assert len(simulation.scene.timeline) == 5, "a key that stays held is no move; the first is at time 0"
        flown = simulation.snapshot()
        save_log(Path("log.yaml"), simulation, desk.goal)
    with Simulation("log.yaml", backend="cpu", precision="f64") as again:
        again.run(until=flown.time)
        np.testing.assert_array_equal(again.snapshot().position, flown.position)
        np.testing.assert_array_equal(again.snapshot().velocity, flown.velocity)
    with Simulation("steered.yaml", backend="cpu", precision="f64") as straight:
        straight.run(until=flown.time)
        assert np.abs(straight.snapshot().position - flown.position).max() > 0.1, "the keys mattered"
