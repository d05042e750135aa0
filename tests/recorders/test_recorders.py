"""Recorders: they record the state at the right times, and a reader gets back exact numbers."""

import csv
import math
import subprocess
import sys
import time as clock
from pathlib import Path

import numpy as np
import pytest
from measured import MadeUpSample, measuring

from mpp_taichi import OutputError, Simulation, Snapshot
from mpp_taichi.atomic_file import whole_file
from mpp_taichi.diagnostics.orbital_period import OrbitalPeriod
from mpp_taichi.quantities._base import NoResultError
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.recorders.progress import ProgressRecorder
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.recorders.trajectory import TrajectoryRecorder
from mpp_taichi.recorders.watchdog import EnergyWatchdog
from mpp_taichi.report.summary import Stopwatch
from mpp_taichi.simulation.verdict import ENERGY_LIMIT
from scenes import kepler


def falling(dt=0.1):
    return {
        "particles": [{"body": {"name": "stone one", "mass": 2.0, "position": [0, 0, 10], "velocity": [1, 0, 0]}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}],
        "integrator": {"leapfrog": {"dt": dt}},
    }


def snapshot_at(position, velocity, mass=None):
    count = len(position)
    return Snapshot(
        position=np.asarray(position, float),
        velocity=np.asarray(velocity, float),
        mass=np.ones(count) if mass is None else np.asarray(mass, float),
        radius=np.zeros(count),
        charge=np.zeros(count),
        color=np.ones((count, 3)),
        free=np.ones((count, 3), bool),
        name=("",) * count,
    )


def run_with_table(scene, every, steps):
    table = TableRecorder(every)
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(steps=steps, recorders=[table])
        table.finish(simulation)
    return table


def test_table_samples_at_start_every_and_end():
    table = run_with_table(falling(), 4, 10)
    assert [row["step"] for row in table.rows] == [0, 4, 8, 10]
    assert [row["time"] for row in table.rows] == [0.0, 0.4, 0.8, 1.0]


def test_samples_are_about_two_hundred_and_sparse_where_they_cost():
    assert [TableRecorder.every_for(steps) for steps in (0, 10, 200, 5000, None)] == [1, 1, 1, 25, 100]
    assert [TableRecorder.every_for(steps, sparse=True) for steps in (10, 5000, 10**6)] == [20, 25, 5000]


def test_table_knows_free_fall_exactly():
    table = run_with_table(falling(), 5, 10)
    last = table.columns()
    # E = m v²/2 + m g z = 1 + 20; leapfrog is exact in a uniform field, so only rounding is left.
    assert last["total_energy"][0] == pytest.approx(21.0, rel=1e-15)
    assert table.summary()["relative_energy_error_max"] < 1e-15
    np.testing.assert_allclose(last["momentum"][-1], [2.0, 0.0, -2.0], atol=1e-14)
    # The centre of mass leaves its straight line by g t²/2; a single body is measured by its own way.
    way = math.hypot(1.0, 0.5)
    assert table.summary()["center_of_mass_error_max"] == pytest.approx(0.5 / way, rel=1e-12)


def test_an_energy_of_zero_is_measured_by_its_parts():
    scene = kepler(eccentricity=0.0, dt=0.01)
    for entry in scene["particles"]:
        entry["body"]["mass"] = 1.0
    # Two masses of 1 at distance 1 with a relative speed of 2: K = 1, V = −1, E = 0 exactly.
    scene["particles"][1]["body"].update(position=[1, 0, 0], velocity=[0, 2.0, 0])
    scene["integrator"] = {"euler": {"dt": 0.05}}
    table = run_with_table(scene, 1, 5)
    rows = table.columns()
    assert abs(rows["total_energy"][0]) < 1e-15
    scale = np.max(rows["kinetic_energy"] + np.abs(rows["potential_energy"]))
    assert table.summary()["relative_energy_error_max"] == pytest.approx(np.abs(rows["total_energy"]).max() / scale, rel=0.05)
    assert table.summary()["relative_energy_error_max"] > 1e-4  # Euler does lose energy


def test_table_files_hold_the_same_numbers(tmp_path):
    table = run_with_table(kepler(), 3, 10)
    table.save(tmp_path / "a.csv")
    table.save(tmp_path / "b.npz")
    with open(tmp_path / "a.csv", newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    columns = dict(zip(header, np.array(rows, float).T, strict=True))
    with np.load(tmp_path / "b.npz") as data:
        assert columns["total_energy"].tolist() == data["total_energy"].tolist()
        assert columns["angular_momentum_z"].tolist() == data["angular_momentum"][:, 2].tolist()
        assert data["step"].tolist() == [0, 3, 6, 9, 10]
    with pytest.raises(OutputError, match="none of .csv, .npz"):
        table.save(tmp_path / "c.txt")


@pytest.mark.parametrize(("integrator", "dt", "broken"), [("euler", 0.2, True), ("leapfrog", 0.01, False)])
def test_watchdog_finds_lost_energy_and_only_that(integrator, dt, broken, caplog):
    table = TableRecorder(1)
    watchdog = EnergyWatchdog(table)
    with Simulation(kepler(eccentricity=0.5, dt=dt, integrator=integrator), backend="cpu") as simulation:
        simulation.run(steps=40, recorders=[table, watchdog])
    errors = table.columns()["relative_energy_error"]
    first = next((row["time"] for row in table.rows if row["relative_energy_error"] > ENERGY_LIMIT), None)
    assert (watchdog.broken_at is not None) == broken == (errors.max() > ENERGY_LIMIT)
    assert watchdog.broken_at == first
    assert len([record for record in caplog.records if "not accurate" in record.message]) == int(broken)


def test_watchdog_leaves_damped_scenes_alone():
    scene = kepler(dt=0.05, forces=[{"linear_drag": {"coefficient": 5e-4}}])
    table = TableRecorder(1)
    watchdog = EnergyWatchdog(table)
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(steps=20, recorders=[table, watchdog])
    assert table.summary()["relative_energy_error_max"] > ENERGY_LIMIT and watchdog.broken_at is None


@pytest.mark.parametrize("suffix", [".npz", ".xyz"])
@pytest.mark.sampled(3)
def test_trajectory_keeps_every_frame_exactly(tmp_path, suffix):
    path = tmp_path / f"t{suffix}"
    expected = []
    with Simulation(kepler(), backend="cpu") as simulation, TrajectoryRecorder(path) as trajectory:
        trajectory.every = 4
        expected.append(simulation.snapshot())
        simulation.run(steps=10, recorders=[trajectory])
        trajectory.finish(simulation)
        expected.append(simulation.snapshot())
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]  # no parts, no locks
    if suffix == ".npz":
        with np.load(path, allow_pickle=False) as data:
            assert data["step"].tolist() == [0, 4, 8, 10]
            assert data["position"].shape == (4, 2, 3)
            np.testing.assert_array_equal(data["position"][0], expected[0].position)
            np.testing.assert_array_equal(data["velocity"][-1], expected[1].velocity)
            assert data["name"].tolist() == ["sun", "planet"]
        return
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 4 * 4 and lines[0] == "2" and "Step=10" in lines[13]
    species, *numbers, name = lines[15].split()
    assert (species, name) == ("X", "planet")
    assert [float(number) for number in numbers[:3]] == expected[1].position[1].tolist()


def test_a_name_with_a_blank_is_one_word(tmp_path):
    with Simulation(falling(), backend="cpu") as simulation, TrajectoryRecorder(tmp_path / "t.extxyz") as trajectory:
        simulation.run(steps=1, recorders=[trajectory])
    assert (tmp_path / "t.extxyz").read_text(encoding="utf-8").splitlines()[2].split()[-1] == "stone_one"


def test_two_trajectories_of_one_name_are_refused(tmp_path):
    with TrajectoryRecorder(tmp_path / "t.npz"):
        with pytest.raises(OutputError, match="is writing it"):
            TrajectoryRecorder(tmp_path / "t.npz")
    assert list(tmp_path.iterdir()) == []  # not one frame, so no file


class Sketch:
    """A view that notes what it is shown."""

    def __init__(self):
        self.frames = []

    def draw(self, frame):
        self.frames.append(frame)
        return np.zeros((2, 2, 3), np.uint8)

    def close(self):
        """Nothing to close."""


class Pile:
    def __init__(self):
        self.pictures = []

    def write(self, picture):
        self.pictures.append(picture)


def film(scene, frame_count, span, **length):
    view, pile = Sketch(), Pile()
    recorder = FilmRecorder(view, [pile], frame_count, span, stopwatch=Stopwatch())
    with Simulation(scene, backend="cpu") as simulation:
        simulation.run(**length, recorders=[recorder])
        recorder.finish(simulation)
        end = simulation.snapshot()
    assert len(pile.pictures) == frame_count
    return view.frames, end


@pytest.mark.sampled(2)
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="a system that does not tell the states of its processes")
def test_a_killed_writer_whose_parent_has_not_asked_for_it_holds_no_output(tmp_path):
    take = "from mpp_taichi.recorders._lock import OutputLock; OutputLock(pathlib.Path(sys.argv[1]))"
    command = f"import os, pathlib, sys; {take}; os.abort()"
    writer = subprocess.Popen([sys.executable, "-c", command, str(tmp_path / "a.csv")], stderr=subprocess.DEVNULL)
    try:
        deadline = clock.monotonic() + 60.0
        while Path(f"/proc/{writer.pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
            assert clock.monotonic() < deadline
            clock.sleep(0.01)
        assert (tmp_path / ".a.csv.lock").read_text() == str(writer.pid)
        OutputLock(tmp_path / "a.csv").release()
    finally:
        writer.wait()


@pytest.mark.parametrize("frame_count", [1, 2, 7, 60])
def test_film_frames_are_evenly_spaced_whatever_the_step(frame_count):
    # dt does not divide the span, and for 60 frames several lie within one step.
    frames, _ = film(falling(dt=0.3), frame_count, 2.0, until=2.0)
    expected = [2.0 * k / max(1, frame_count - 1) for k in range(frame_count)]
    assert [frame.time for frame in frames] == pytest.approx(expected, abs=1e-12)


def test_film_positions_between_steps_are_first_order():
    coarse, end = film(falling(dt=0.3), 41, 2.0, until=2.0)
    assert coarse[0].position[0].tolist() == [0.0, 0.0, 10.0]
    np.testing.assert_array_equal(coarse[-1].position, end.position)  # the last frame is the end itself
    for frame in coarse:
        assert frame.position[0, 0] == pytest.approx(frame.time, abs=1e-12)  # uniform motion is exact
        fall = 10.0 - 0.5 * frame.time**2
        assert 0.0 <= frame.position[0, 2] - fall + 1e-12 <= 0.5 * 0.3**2 + 1e-9  # x + v δ misses g δ²/2 at most


def test_film_of_a_number_of_steps_ends_at_the_last():
    frames, end = film(falling(dt=0.1), 5, 0.1 * 30, steps=30)
    np.testing.assert_array_equal(frames[-1].position, end.position)


def test_progress_lines_are_few_and_plain(capsys):
    with Simulation(falling(dt=0.001), backend="cpu") as simulation:
        progress = ProgressRecorder(100, lambda: 1e-9, bar=False)
        with progress:
            for _ in range(50):
                progress._looked = -1e9
                simulation.run(steps=2, recorders=[progress])
            progress.record(simulation)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 10 and lines[-1].startswith("100 %") and "\x1b" not in "".join(lines)


def test_progress_bar_shows_speed_and_energy(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "120")
    with Simulation(falling(dt=0.001), backend="cpu") as simulation:
        with ProgressRecorder(100, lambda: 1e-9, bar=True) as progress:
            simulation.run(steps=50)
            progress.record(simulation)
            text = str(progress._bar.tasks[0].fields["state"])
    assert "steps/s" in text and "ΔE/E 1.0e-09" in text and progress._bar.tasks[0].completed == 50


@pytest.mark.sampled(2)
@pytest.mark.parametrize("eccentricity", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_orbital_period_of_kepler_orbits(eccentricity, direction):
    """Fed with exact orbits at the times it asks for: a = 1, GM = 1, so T = 2π."""
    diagnostic = OrbitalPeriod(of=1, around=0)
    time, looks = 0.0, 0
    while time < 7.0:
        position, velocity = kepler_state(eccentricity, time)
        turn = np.array([1.0, direction, direction])
        center = np.array([3.0 + time, 0.0, 0.0])  # the centre may move
        seen = snapshot_at([center, center + position * turn], [[1, 0, 0], np.array([1, 0, 0]) + velocity * turn])
        diagnostic.observe(MadeUpSample(seen, time))
        time += min(diagnostic.interval, 0.5)
        looks += 1
    assert diagnostic.result() == pytest.approx(2.0 * math.pi, rel=1e-8)
    assert looks < 600


def kepler_state(eccentricity, time):
    """Position and velocity by Kepler's equation, Newton's method in f64, from pericentre."""
    anomaly = time if eccentricity < 0.8 else math.pi
    for _ in range(100):
        anomaly -= (anomaly - eccentricity * math.sin(anomaly) - time) / (1.0 - eccentricity * math.cos(anomaly))
    root = math.sqrt(1.0 - eccentricity**2)
    rate = 1.0 / (1.0 - eccentricity * math.cos(anomaly))
    return (
        np.array([math.cos(anomaly) - eccentricity, root * math.sin(anomaly), 0.0]),
        np.array([-math.sin(anomaly) * rate, root * math.cos(anomaly) * rate, 0.0]),
    )


def test_half_an_orbit_has_no_period():
    diagnostic = OrbitalPeriod(of=1, around=0)
    for time in np.linspace(0.0, math.pi, 40):
        position, velocity = kepler_state(0.0, time)
        diagnostic.observe(MadeUpSample(snapshot_at([[0, 0, 0], position], [[0, 0, 0], velocity]), time))
    with pytest.raises(NoResultError, match="did not complete a turn.*180.0 degrees"):
        diagnostic.result()


def test_motion_along_a_line_is_no_orbit():
    with pytest.raises(NoResultError, match="along one line"):
        OrbitalPeriod(of=1, around=0).observe(MadeUpSample(snapshot_at([[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [-1, 0, 0]])))


def test_return_error_is_the_largest_distance_at_the_end():
    diagnostic = measuring("return_error")
    for shift in (0.0, 5.0, 0.25):
        diagnostic.observe(MadeUpSample(snapshot_at([[0, 0, 0], [1 + shift, 0, 0]], np.zeros((2, 3))), shift))
    assert diagnostic.result() == 0.25


def test_a_file_is_whole_or_not_there_and_a_folder_that_is_a_file_is_told_in_one_line(tmp_path):
    target = tmp_path / "made" / "f.txt"
    with whole_file(target, "the text") as temporary:
        temporary.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new" and list(target.parent.iterdir()) == [target]
    with pytest.raises(OutputError, match=r"f\.txt: cannot write the text: "), whole_file(target, "the text") as temporary:
        temporary.write_text("half")
        raise OSError(28, "No space left on device")
    assert target.read_text() == "new" and list(target.parent.iterdir()) == [target]
    with Simulation(kepler(), backend="cpu") as simulation:
        for save in (simulation.snapshot().save, TableRecorder(1).save):
            with pytest.raises(OutputError, match="cannot write the"):
                save(target / "below.npz")
