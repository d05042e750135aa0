"""The scene of any file: of scenes, of files of other programs, and of saved states with the scene that they are of."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi import Simulation
from mpp_taichi.cli._file_scene import scene_in
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._start_simulation import start_another
from mpp_taichi.cli._window_desk import save_log
from mpp_taichi.cli.main import main
from mpp_taichi.errors import OutputError, SceneError
from mpp_taichi.importers.catalogue import import_scene
from mpp_taichi.scene.load import load_scene

SCENE = {
    "title": "Falling",
    "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}, {"body": {"mass": 2, "position": [1, 0, 0]}}],
    "forces": [{"uniform_gravity": {"acceleration": [0, -1, 0]}}],
    "sliders": [{"set": "forces.uniform_gravity.acceleration[1]", "from": -5, "to": 0}],
    "integrator": {"leapfrog": {"dt": 0.125}},
    "run": {"duration": 2},
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working folder with the scene."""
    monkeypatch.chdir(tmp_path)
    Path("falling.yaml").write_text(yaml.safe_dump(SCENE, sort_keys=False), encoding="utf-8")
    Path("out").mkdir()
    return tmp_path


def test_files_of_other_programs_are_scenes_with_the_name_of_their_file(capsys):
    Path("two.plist").write_text("pos 0 0 0 0 1 0 0.1 1 1 1\npos 1 1 0 0 2 0 0.1 1 1 1\n", encoding="utf-8")
    Path("sun.txt").write_text("1\n10\n0 0 0 0 5 sun.gif\n", encoding="utf-8")
    body = "<Body Name='Sun' Mass='2e30' Radius='7e8'/>"
    Path("system.xml").write_text(f"<SolarSystem>{body}</SolarSystem>", encoding="utf-8")
    assert main(["convert", "falling.yaml", "falling.tipsy"]) == 0
    for name in ("two.plist", "sun.txt", "system.xml", "falling.tipsy"):
        found = scene_in(Path(name))
        assert found.spec.source == name and found.state is None
        assert found.spec.resolved == load_scene(import_scene(Path(name))[1]).resolved


def test_a_fault_in_a_file_of_another_program_has_its_place():
    Path("wrong.txt").write_text("1\n10\n0 0 zero 0 5 sun.gif\n", encoding="utf-8")
    with pytest.raises(SceneError, match=r"^wrong\.txt:3:5: "):
        scene_in(Path("wrong.txt"))
    Path("wrong.npz").write_bytes(b"PK")
    with pytest.raises(OutputError, match=r"^wrong\.npz: not a snapshot"):
        scene_in(Path("wrong.npz"))


def test_a_trajectory_is_no_state():
    assert main(["run", "falling.yaml", "--headless", "--quiet", "--backend", "cpu", "--trajectory", "out/way.npz"]) == 0
    with pytest.raises(SceneError, match="is a trajectory, of which no state can be made"):
        scene_in(Path("out/way.npz"))


@pytest.mark.parametrize("name", ["falling_0000.npz", "falling.interrupted.npz", "falling.npz", "other.npz"])
@pytest.mark.sampled(3)
def test_a_state_goes_on_in_the_scene_that_runs_or_in_the_scene_of_its_name(name, capsys):
    with Simulation("falling.yaml", backend="cpu", precision="f64") as simulation:
        simulation.run(until=1.0)
        simulation.checkpoint(Path("out", name))
    present = load_scene("falling.yaml")
    found = scene_in(Path("out", name), present)
    assert found.spec is present and found.state.time == 1.0
    found = scene_in(Path("out", name), load_scene("kepler"))
    if name != "other.npz":
        assert found.spec.source.endswith("falling.yaml") and found.state.step == 8
        return
    assert found.state is None and found.spec.title == "other.npz: particles without forces"
    assert "no scene of this state was found" in capsys.readouterr().err
    with Simulation(found.spec, backend="cpu", precision="f64") as alone:
        np.testing.assert_array_equal(alone.snapshot().position, np.array([[0, -0.5, 0], [1, -0.5, 0]]))
        assert alone.dt == 0.125, "the step of the run"


@pytest.mark.sampled(3)
def test_an_opened_state_goes_on_bit_for_bit_and_so_does_its_log(capsys):
    """A slider was moved before the state was saved, and another move after it is of another future."""
    with Simulation("falling.yaml", backend="cpu", precision="f64") as simulation:
        simulation.run(until=0.5)
        simulation.set("forces.uniform_gravity.acceleration[1]", -3.0)
        simulation.run(until=1.0)
        simulation.checkpoint("out/falling_0000.npz")
        expected = simulation.bookmark()
        simulation.run(until=1.5)
        wanted = simulation.snapshot().position
        simulation.go_back(expected)
        simulation.run(until=1.25)
        simulation.set("forces.uniform_gravity.acceleration[1]", -1.0)
        written = load_scene("falling.yaml")
        request = Request(backend="cpu", window=True, quiet=True)
        found = scene_in(Path("out/falling_0000.npz"), simulation.scene, written)
        started = start_another(found, device=simulation.device, request=request)
    with started.simulation as opened:
        assert (opened.time, opened.step_count) == (1.0, 8) and started.rewound.endswith("as the scene says")
        goal = started.goal
        assert goal == Goal(2.0, None, False, 1.0, "out/falling_0000.npz")
        opened.run(until=1.5)
        np.testing.assert_array_equal(opened.snapshot().position, wanted)
        save_log(Path("log.yaml"), opened, goal)
    assert "add --rewind out/falling_0000.npz to the command" in Path("log.yaml").read_text(encoding="utf-8")
    command = ["run", "log.yaml", "--backend", "cpu", "--precision", "f64", "--plan", "serial", "--headless", "--quiet"]
    assert main([*command, "--rewind", "out/falling_0000.npz", "--snapshot", "again.npz"]) == 0
    np.testing.assert_array_equal(np.load("again.npz")["position"], wanted)


def test_a_state_at_the_end_of_its_run_goes_on_without_an_end(capsys):
    with Simulation("falling.yaml", backend="cpu", precision="f64") as simulation:
        simulation.run(until=2.0)
        simulation.checkpoint("out/falling_0000.npz")
        request = Request(backend="cpu", window=True, quiet=True)
        found = scene_in(Path("out/falling_0000.npz"), simulation.scene)
        started = start_another(found, device=simulation.device, request=request)
    with started.simulation:
        assert started.goal.endless and started.rewind is not None
