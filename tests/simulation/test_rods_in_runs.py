"""Rods in all that a run can do: replicas, timelines, archives, states, frames, exports, and what refuses them in words."""

import numpy as np
import pytest
from cut_runs import same_after_a_cut

from mpp_taichi import SceneError, Simulation
from mpp_taichi.cli.main import main
from mpp_taichi.errors import StateError
from mpp_taichi.scene.view_spec import ColorScaleSpec, SpringColorBySpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame
from mpp_taichi.views.coloring import Coloring

SCENE = {
    "title": "Three balls on rods, the last on a spring",
    "particles": [
        {"body": {"mass": 1, "position": [0, 0, 0], "free": False}},
        {"body": {"mass": 1, "position": [0.6, 0, -0.8]}},
        {"body": {"mass": 2, "position": [1.6, 0, -0.8]}},
        {"body": {"mass": 1, "position": [1.6, 0.5, -0.8]}},
    ],
    "springs": [
        {"rod": {"between": [0, 1], "color": [1, 0, 0]}},
        {"link": {"between": [2, 3], "stiffness": 50}},
        {"rod": {"between": [1, 2]}},
    ],
    "forces": [{"uniform_gravity": {"acceleration": [0, 0, -9.81]}}],
    "integrator": {"leapfrog": {"dt": 0.01}},
    "run": {"duration": 1},
}


def written(tmp_path, **more):
    import yaml

    path = tmp_path / "rods.yaml"
    path.write_text(yaml.safe_dump({**SCENE, **more}))
    return str(path)


@pytest.mark.sampled(3)
def test_replicas_with_starts_of_their_own_move_as_single_runs():
    starts, ends = [], []
    for speed in (0.0, 1.0):
        particles = [*SCENE["particles"][:3], {"body": {"mass": 1, "position": [1.6, 0.5, -0.8], "velocity": [0, speed, 0]}}]
        with Simulation({**SCENE, "particles": particles}, backend="cpu") as s:
            starts.append(s.snapshot())
            s.run(steps=50)
            ends.append(s.snapshot())
    with Simulation(SCENE, backend="cpu", replica_starts=starts) as s:
        s.run(steps=50)
        for replica, end in enumerate(ends):
            # The same operations in another kernel, whose products may be fused in another way.
            assert np.abs(s.snapshot(replica).position - end.position).max() < 1e-12
    assert np.abs(ends[0].position - ends[1].position).max() > 1e-2


@pytest.mark.sampled(3)
def test_a_timeline_may_cut_a_rod_and_add_none():
    cut = [{"at": 0.5, "set": {"springs": SCENE["springs"][:2]}}]
    with Simulation({**SCENE, "timeline": cut}, backend="cpu") as s:
        s.run(duration=0.5)
        lengths = [np.linalg.norm(np.diff(s.snapshot().position[:3], axis=0), axis=1)]
        s.run(duration=0.5)
        lengths.append(np.linalg.norm(np.diff(s.snapshot().position[:3], axis=0), axis=1))
    assert np.allclose(lengths[0], 1.0, rtol=1e-14, atol=0.0)
    assert abs(lengths[1][0] - 1.0) < 1e-14 and lengths[1][1] > 1.1
    added = [{"at": 0.5, "set": {"springs": [*SCENE["springs"], {"rod": {"between": [0, 3]}}]}}]
    with pytest.raises(SceneError, match="adds a rod between particle 0 and particle 3"):
        Simulation({**SCENE, "timeline": added}, backend="cpu")


@pytest.mark.sampled(3)
def test_a_run_with_rods_that_is_cut_off_goes_on_with_the_same_bits():
    assert same_after_a_cut(SCENE, 31, "table", precision="f64", plan="serial")


def test_a_state_keeps_its_rods_and_fits_no_other_scene(tmp_path):
    with Simulation(SCENE, backend="cpu") as s:
        s.run(steps=20)
        s.snapshot().save(tmp_path / "state.npz")
    state = Snapshot.load(tmp_path / "state.npz")
    assert state.rods.between.tolist() == [[0, 1], [1, 2]] and np.allclose(state.rods.length, 1.0)
    with pytest.raises(StateError, match="2 rods of the state are not the 1 of the scene"):
        Simulation({**SCENE, "springs": SCENE["springs"][:2]}, backend="cpu", start=state)


def test_rods_are_drawn_in_their_own_colours():
    with Simulation(SCENE, backend="cpu") as s:
        frame = Frame.of(s.snapshot())
    assert frame.between.tolist() == [[2, 3], [0, 1], [1, 2]]
    colors = Coloring(None, SpringColorBySpec(tension=ColorScaleSpec())).spring_colors(frame)
    assert colors[1].tolist() == [1, 0, 0] and np.isfinite(colors).all()


@pytest.mark.parametrize(
    "words, message",
    [
        (["compare"], "keeps the lengths of rods: there is nothing to compare"),
        (["run", "--headless", "--no-archive", "--precision", "df64"], "the solver of rods does not carry low parts"),
        (["run", "--headless", "--no-archive", "--set", "modes={}"], "modes of springs beside rods"),
    ],
)
@pytest.mark.sampled(3)
def test_what_knows_no_rods_says_so(words, message, tmp_path, capfd):
    assert main([words[0], written(tmp_path), *words[1:]]) != 0
    assert message in capfd.readouterr().err


def test_h5md_holds_the_ends_of_the_rods(tmp_path):
    h5py = pytest.importorskip("h5py")
    assert main(["convert", written(tmp_path), str(tmp_path / "rods.h5md"), "--quiet"]) == 0
    with h5py.File(tmp_path / "rods.h5md") as file:
        assert file["connectivity/rods"][:].tolist() == [[0, 1], [1, 2]]


def test_a_particle_list_knows_no_rods(tmp_path, capfd):
    assert main(["convert", written(tmp_path), str(tmp_path / "rods.plist")]) != 0
    assert "a particle list has springs, and no rods" in capfd.readouterr().err
