"""Refinement of a grid: the members at boundaries are run, and few others."""

import json

import numpy as np
import pytest

from mpp_taichi import open_sweep
from mpp_taichi.cli.main import main
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.sweep.refinement import GridRefinement, ranges_of

TOGETHER = """
dimensions: 2
constants: {vx: 0.1, vy: 0.1}
particles:
  - body: {name: ball, mass: 1, position: [0, 0], velocity: [vx, vy]}
forces: [{uniform_gravity: {acceleration: [0, -1]}}]
integrator: {leapfrog: {dt: 0.125}}
run: {duration: 1}
sweep:
  vary:
    constants.vx: {from: -1, to: 1, count: 41}
    constants.vy: {from: -1, to: 1, count: 35}
  measure: [{position: {of: ball, axis: x, when: largest}}]
  refine: 0.3
  stop: [{speed: {of: ball, below: 1.42}}]
"""


def refined(shape, ordered, share, status, values=None):
    """Which members are run, and in how many rounds, where all have this status and these values."""
    refinement = GridRefinement(shape, ordered, share)
    known, rounds = np.zeros(status.size, bool), 1
    values = np.zeros((status.size, 1)) if values is None else values.reshape(status.size, -1)
    known[refinement.first()] = True
    while len(found := refinement.next(known, np.where(known, status.ravel(), 99), np.where(known[:, None], values, np.nan))):
        assert not known[found].any() and len(set(found.tolist())) == len(found)
        known[found] = True
        rounds += 1
    assert refinement.is_over
    return known.reshape(shape), rounds


def at_boundary(status):
    """Whether a member differs from a member beside it."""
    found = np.zeros(status.shape, bool)
    for axis in range(status.ndim):
        differs = np.diff(status, axis=axis) != 0
        pad = [(0, 0)] * status.ndim
        found |= np.pad(differs, [(0, 1) if k == axis else each for k, each in enumerate(pad)])
        found |= np.pad(differs, [(1, 0) if k == axis else each for k, each in enumerate(pad)])
    return found


@pytest.mark.parametrize("shape", [(129, 129), (200, 100), (97, 250), (40, 33, 50), (1000,)])
def test_a_boundary_is_followed_at_the_full_resolution(shape):
    places = np.stack(np.meshgrid(*(np.linspace(-1, 1, size) for size in shape), indexing="ij"))
    status = ((places**2).sum(axis=0) < 0.5).astype(int)
    known, _ = refined(shape, [True] * len(shape), 0.05, status)
    assert known[at_boundary(status)].all()
    assert known.mean() < {1: 0.05, 2: 0.35, 3: 0.75}[len(shape)]


def test_a_thin_stripe_that_is_met_once_is_followed_to_its_end():
    x, y = np.meshgrid(np.arange(257), np.arange(257), indexing="ij")
    status = (np.abs(x - 128 - y // 3) <= 0).astype(int)  # one member wide; it meets the coarse grid at a few members only
    known, rounds = refined(status.shape, (True, True), 0.05, status)
    assert known[status == 1].all() and known.mean() < 0.2 and rounds > 4


def test_numbers_are_refined_until_neighbours_differ_by_less_than_the_share():
    x = np.linspace(0, 1, 257)
    values = np.tanh(20 * (x - 0.37))
    known, _ = refined((257,), (True,), 0.1, np.zeros(257, int), values)
    steps = np.abs(np.diff(values[known]))
    gaps = np.diff(np.flatnonzero(known))
    least = 0.1 * ranges_of(values[known][:, None])[0]
    assert (steps[gaps > 1] <= least).all() and known.sum() < 60
    assert (steps <= 3 * least).all() is np.bool_(True)


def test_what_does_not_differ_is_run_on_the_coarse_grid_alone():
    known, rounds = refined((200, 100), (True, True), 0.05, np.zeros((200, 100), int))
    assert rounds == 1 and known.sum() == 26 * 14  # every eighth, and the last


def test_numbers_beside_no_numbers_differ():
    values = np.where(np.arange(129) < 50, 1.0, np.nan)
    known, _ = refined((129,), (True,), 0.05, np.zeros(129, int), values)
    assert known[49:51].all() and known.sum() < 30


def test_words_have_no_middle():
    status = np.zeros((5, 129), int)
    status[2] = 1  # another word, another status: no reason to refine between words
    known, rounds = refined(status.shape, (False, True), 0.05, status)
    assert rounds == 1 and known[:, ::8].all() and known.sum() == 5 * 17


@pytest.mark.sampled(3)
def test_the_command_runs_rounds_and_goes_on_with_them(tmp_path, capsys):
    scene, folder = tmp_path / "ball.yaml", tmp_path / "ball.sweep"
    scene.write_text(TOGETHER, encoding="utf-8")
    words = ["sweep", str(scene), "--out", str(folder), "--chunk", "50", "--json", "--quiet"]
    assert main([*words, "--workers", "2"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["status"], told["exit_code"]) == ("ok", 0)
    assert set(told["statuses"]) == {"ok", "stopped", "skipped"} and told["statuses"]["skipped"] > 500
    table, results = (folder / "members.csv").read_bytes(), open_sweep(folder)
    assert results.is_complete and results.counts() == told["statuses"]
    whole = tmp_path / "whole.sweep"
    plain = scene.with_name("plain.yaml")
    plain.write_text(TOGETHER.replace("  refine: 0.3\n", ""), encoding="utf-8")
    assert main(["sweep", str(plain), "--out", str(whole), "--json", "--quiet", "--workers", "1"]) == 0
    every = open_sweep(whole)
    ran = results["status"] != "skipped"
    np.testing.assert_array_equal(results["position"][ran], every["position"][ran])
    assert ran[at_boundary((every["status"] == "ok").astype(int))].all()
    # A chunk of the first round is lost: the later rounds follow from the same rows again.
    sorted((folder / "chunks").iterdir(), key=lambda path: path.stat().st_mtime_ns)[0].unlink()
    capsys.readouterr()
    assert main([*words, "--workers", "1"]) == 0
    assert json.loads(capsys.readouterr().out)["ran"] == 50
    assert (folder / "members.csv").read_bytes() == table
    # Parts wait for each other at the end of each round.
    parts = [*words[:3], str(tmp_path / "parts.sweep"), *words[4:], "--workers", "1"]
    for _ in range(12):
        for k in (1, 2):
            assert main([*parts, "--part", f"{k}/2"]) == 0
    assert (tmp_path / "parts.sweep" / "members.csv").read_bytes() == table


def test_only_a_grid_is_refined(tmp_path, capsys):
    zipped = TOGETHER.replace("count: 35", "count: 41").replace("sweep:\n", "sweep:\n  combine: zipped\n")
    with pytest.raises(SceneError, match="sweep.refine: refines a grid, in which every value meets every value"):
        load_scene(zipped_scene(tmp_path, zipped))
    scene = zipped_scene(tmp_path, TOGETHER)
    assert main(["sweep", str(scene), "--slurm", "4"]) == 2
    assert "the rounds of a refinement wait for each other" in capsys.readouterr().err
    assert main(["sweep", str(scene), "--refine", "2"]) == 2
    assert "'2' must be a number from 0 to 1" in capsys.readouterr().err


def zipped_scene(folder, text):
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return path
