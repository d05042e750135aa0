"""A moment of a run, packed and put into a new simulation: the rest of the run has the same bits."""

import json
import random

import numpy as np
import pytest
import yaml
from cut_runs import STEPS, bits, gas, orbits, same_after_a_cut
from PIL import Image

import mpp_taichi as mpp
from mpp_taichi import component
from mpp_taichi.archive.values import pack, unpack
from mpp_taichi.cli.main import main
from mpp_taichi.errors import ArgumentError, BackendError, StateError
from mpp_taichi.simulation.moment import go_to, moment_of
from mpp_taichi.simulation.run_archive import FoundRun, RunArchive, header_of
from mpp_taichi.simulation.simulation import Simulation

PRECISIONS = ("f64", "f32", "ds")
METHODS = [
    (name, precision, plan)
    for name in component.names("integrators")
    if not component.flag("integrators", name, "flies")
    for precision in PRECISIONS
    for plan in ("serial", "parallel")
]
SOLVERS = [(name, precision) for name in component.names("contacts") for precision in ("f64", "f32")]


def pytest_generate_tests(metafunc):
    """Of each method one precision and plan, others on another day; `--thorough` tries all."""
    if "integrator" in metafunc.fixturenames:
        by_name = {name: [case for case in METHODS if case[0] == name] for name, *_ in METHODS}
        draw = random.Random(metafunc.config.getoption("--seed"))
        drawn = METHODS if metafunc.config.getoption("--thorough") else [draw.choice(cases) for cases in by_name.values()]
        metafunc.parametrize(("integrator", "precision", "plan"), drawn)


@pytest.mark.sampled(3)
def test_every_method_goes_on_with_the_same_bits(integrator, precision, plan):
    cut = 1 + METHODS.index((integrator, precision, plan)) * 7 % (STEPS - 2)
    try:
        assert same_after_a_cut(orbits(integrator), cut, precision=precision, plan=plan)
    except BackendError as refused:
        pytest.skip(str(refused).splitlines()[0])


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("solver", "precision"), SOLVERS)
def test_every_contact_solver_goes_on_with_the_same_bits(solver, precision):
    cut = 5 + SOLVERS.index((solver, precision)) * 11 % (STEPS - 10)
    try:
        assert same_after_a_cut(gas(solver), cut, precision=precision)
    except BackendError as refused:
        pytest.skip(str(refused).splitlines()[0])


@pytest.mark.sampled(3)
def test_a_run_that_goes_on_within_a_phase_ends_it_with_the_same_bits():
    scene = orbits("pefrl") | {"timeline": [{"at": 0.3333333, "set": {"forces.newtonian_gravity.strength": 1.1}}]}
    wanted = None
    for cuts in ([], [0.1], [0.1, 0.27, 0.5], [0.3333333]):
        moment = None
        for until in (*cuts, 0.7777777):
            with Simulation(scene, backend="cpu") as simulation:
                if moment is not None:
                    go_to(simulation, unpack(moment))
                if until in cuts:
                    simulation.run(steps=int((until - simulation.time) / simulation.dt + 0.5) if until < 0.3 else 10)
                else:
                    simulation.run(until=until)
                moment, found = pack(moment_of(simulation)), bits(simulation)
        wanted = wanted or found
        assert found[0] == wanted[0]
        assert found[2:] == wanted[2:]


def test_a_moment_of_another_run_is_refused():
    with Simulation(orbits("leapfrog"), backend="cpu") as simulation:
        moment = moment_of(simulation)
        with pytest.raises(StateError, match="no such phase"):
            go_to(simulation, moment | {"phase": 3})
        with pytest.raises(StateError, match="other fields"):
            go_to(simulation, moment | {"fields": moment["fields"][:1]})
        with pytest.raises(StateError, match="other fields"):
            go_to(simulation, moment | {"fields": [each.astype(np.float32) for each in moment["fields"]]})
        with pytest.raises(StateError, match="damaged"):
            go_to(simulation, {})


@pytest.mark.sampled(3)
def test_resume_gives_any_moment_of_an_archive(tmp_path):
    path = tmp_path / "a.run"
    wanted = {}
    with Simulation(orbits("taylor"), backend="cpu", precision="f64") as simulation:
        archive = RunArchive(path, header_of(simulation), {})
        for _ in range(3):
            simulation.run(steps=10)
            archive.record(simulation)
            wanted[simulation.step_count] = bits(simulation)
        archive.close()
        simulation.run(steps=10)
        end = bits(simulation)
    found = FoundRun(path)
    assert found.times == pytest.approx([0.1, 0.2, 0.3])
    assert not found.has_ended
    found.close()
    with mpp.resume(path, at=0.2500001) as again:
        assert bits(again) == wanted[20]
        again.run(steps=10)
        assert bits(again) == wanted[30]
    with mpp.resume(path) as again:
        again.run(steps=10)
        assert bits(again) == end
    with mpp.resume(path, at=0.05) as again:  # before every record: from the start of the run
        assert again.step_count == 0
        again.run(steps=10)
        assert bits(again) == wanted[10]
    with pytest.raises(StateError, match="the run begins at t = 0, after -1"):
        mpp.resume(path, at=-1.0)


@pytest.mark.sampled(3)
def test_a_start_from_a_file_that_has_changed_is_refused(tmp_path):
    path, table, scene = tmp_path / "a.run", tmp_path / "bodies.csv", tmp_path / "s.yaml"
    table.write_text(
        "mass,position_x,position_y,position_z,velocity_x,velocity_y,velocity_z\n1,0,0,0,0,0,0\n0.001,1,0,0,0,1,0\n"
    )
    scene.write_text(yaml.safe_dump(orbits("leapfrog") | {"particles": [{"file": {"path": table.name}}]}))
    with Simulation(str(scene), backend="cpu") as simulation:
        simulation.run(steps=10)
        simulation.checkpoint(path, every=1e-9)
    mpp.resume(path, at=0.0).close()
    table.write_text(table.read_text().replace("0.001,1", "0.001,2"))
    with pytest.raises(StateError, match="reads a file that has changed"):
        mpp.resume(path, at=0.0)


@pytest.mark.sampled(3)
def test_checkpoints_are_written_while_a_simulation_runs_and_when_it_is_closed(tmp_path):
    path = tmp_path / "new" / "a.run"
    with Simulation(orbits("leapfrog"), backend="cpu") as simulation:
        for wrong in (0.0, -1.0, float("nan"), float("inf")):
            with pytest.raises(ArgumentError, match="every must be a positive number of seconds"):
                simulation.checkpoint(path, every=wrong)
        simulation.checkpoint(path, every=1e-9)
        for _ in range(3):
            simulation.run(steps=10)
        assert not path.with_name("a.run.part").exists()
        first = times_in(path)
        assert first[0] == 0.0
        simulation.run(steps=7)
        end = bits(simulation)
    assert times_in(path)[-1] == end[0]
    with mpp.resume(path) as again:
        assert bits(again) == end
        again.checkpoint(path, every=100.0)  # of the same run, which goes on: records are appended
        again.run(steps=5)
        later = again.time
    assert times_in(path) == pytest.approx([*first, end[0], later])
    with mpp.resume(path, at=first[0]) as again:
        again.checkpoint(path, every=100.0)  # from an earlier moment on: another course, and a new archive
        again.run(steps=1)
        assert times_in(path)[-1] == later, "the old one stays until the first record"
        last = again.time
    assert times_in(path) == [last]


@pytest.mark.sampled(3)
def test_replay_gives_any_moment(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with Simulation(orbits("leapfrog"), backend="cpu", precision="f64") as simulation:
        archive = RunArchive(tmp_path / "a.run", header_of(simulation), {})
        for _ in range(3):
            simulation.run(steps=10)
            archive.record(simulation)
    with Simulation(orbits("leapfrog"), backend="cpu", precision="f64") as simulation:
        simulation.run(steps=25)
        wanted = bits(simulation)
    words = ["replay", "a.run", "--at", "0.25", "--snapshot", "s.npz", "--still", "s.png", "--size", "64x48", "--json"]
    assert main(words) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["step"], found["record_step"], found["files"]) == (25, 20, ["s.npz", "s.png"])
    state = mpp.Snapshot.load("s.npz")
    assert (state.position.tobytes(), state.velocity.tobytes()) == wanted[2:4]
    with Image.open("s.png") as picture:
        assert picture.size == (64, 48) and np.asarray(picture).max() > 100
    assert main(["replay", "a.run"]) == 0
    assert "t = 0.3, step 30; from the record of t = 0.3" in capsys.readouterr().out
    (tmp_path / "no.run").write_text("no archive")
    for words, code, said in (
        (["no.run"], 2, "no.run: is no archive of a run"),
        (["none.run"], 5, "none.run: the archive cannot be read: No such file"),
        (["a.run", "--at", "nan"], 2, "--at"),
        (["a.run", "--at", "-1"], 2, "the run begins at t = 0, after -1"),
        (["a.run", "--still", "s.jpg"], 2, "--still"),
    ):
        assert main(["replay", *words]) == code
        told = capsys.readouterr().err
        assert said in told and "Traceback" not in told


def times_in(path):
    found = FoundRun(path, to_append=False)
    try:
        return found.times
    finally:
        found.close()
