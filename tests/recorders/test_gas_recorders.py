"""Recorders of gases: the histogram of speeds and the log of collisions, in every format."""

import csv
import math
from types import SimpleNamespace

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.errors import OutputError
from mpp_taichi.recorders.event_log import EventLogRecorder
from mpp_taichi.recorders.speed_histogram import BINS, SpeedHistogram
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

GAS = {"count": 4000, "lower": [0, 0], "upper": [9, 9], "radius": 0.0, "mass": 2}


def histogram(velocity=None, particles=None, dimensions=2, **options):
    """A recorder that has seen the start of a scene, or these velocities at it."""
    spec = load_scene(
        {
            "title": "Made up",
            "dimensions": dimensions,
            "particles": particles or [{"gas": {**GAS, "temperature": 1.5}}],
            "integrator": {"leapfrog": {"dt": 1}},
        }
    )
    start = assemble(spec)
    recorder = SpeedHistogram(SimpleNamespace(spec=spec, start=start), **options)
    recorder.add(start.velocity[start.free.all(axis=1)] if velocity is None else velocity)
    return recorder


def test_the_histogram_of_an_equilibrium_is_the_curve():
    """4000 speeds in 30 bins: χ² of some 20 bins with 10 particles expected and more stays below 46, one in a thousand."""
    recorder = histogram()
    found = recorder.columns()
    width = np.diff(found["edge"])
    assert np.sum(found["density"] * width) == pytest.approx(1.0, rel=1e-12)
    expected = 4000 * found["theory"] * width
    known = expected >= 10
    assert 10 < np.sum(known) <= 22
    assert np.sum((4000 * found["density"] * width - expected)[known] ** 2 / expected[known]) < 46
    assert recorder.temperature == pytest.approx(1.5, rel=1e-12)
    assert recorder.distance < 1.95 / math.sqrt(4000)
    assert recorder.theory(np.array([1.1])) == pytest.approx(2 * 1.1 / 1.5 * math.exp(-1.21 / 1.5))  # b² = 2 k T / m = 1.5


def test_unlike_masses_have_the_mean_of_their_curves():
    light, heavy = {**GAS, "mass": 1, "temperature": 1.5}, {**GAS, "mass": 8, "count": 2000, "temperature": 1.5}
    recorder = histogram(particles=[{"gas": light}, {"gas": heavy}])
    fine = np.linspace(0, 20, 20_001)
    assert np.sum(recorder.theory(fine)) * 1e-3 == pytest.approx(1.0, rel=1e-5)
    assert recorder.theory(np.array([0.5]))[0] == pytest.approx(
        2 / 3 * (2 * 0.5 / 3) * math.exp(-0.25 / 3) + 1 / 3 * (2 * 0.5 * 8 / 3) * math.exp(-0.25 * 8 / 3)
    )
    assert recorder.distance < 1.95 / math.sqrt(6000)


def test_samples_of_a_run_from_a_time_on_are_taken_together():
    """Free flight: four samples from 0.6 on of a run of 1.0 in steps of 0.1, every second one."""
    described = {
        "dimensions": 2,
        "particles": [{"gas": {**GAS, "count": 50, "speed": 2}}],
        "integrator": {"leapfrog": {"dt": 0.1}},
    }
    with Simulation(described, backend="cpu", precision="f64") as simulation:
        recorder, last = SpeedHistogram(simulation, after=0.35, every=2), SpeedHistogram(simulation)
        simulation.run(steps=10, recorders=[recorder, last])
        for each in (recorder, last):
            each.finish(simulation)
            each.finish(simulation)
    assert recorder.label == "50 particles, 4 samples"  # at 0.4, 0.6, 0.8 and 1
    assert last.label == "50 particles at time 1"
    assert last.temperature == pytest.approx(2 * 4 / 2)


def test_a_histogram_is_written_in_every_format(tmp_path):
    recorder = histogram()
    for suffix in (".csv", ".npz", ".png"):
        recorder.save(tmp_path / "deep" / f"speeds{suffix}")
    rows = list(csv.reader(open(tmp_path / "deep" / "speeds.csv", encoding="utf-8")))
    assert rows[0] == ["from", "to", "density", "standard_error", "theory"] and len(rows) == 1 + BINS
    with np.load(tmp_path / "deep" / "speeds.npz") as found:
        assert [float(row[2]) for row in rows[1:]] == found["density"].tolist()
        assert found["distance"] == recorder.distance
    assert (tmp_path / "deep" / "speeds.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in (tmp_path / "deep").iterdir()) == ["speeds.csv", "speeds.npz", "speeds.png"]
    with pytest.raises(OutputError, match=r"'.txt' is none of .png"):
        recorder.save(tmp_path / "speeds.txt")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write the histogram"):
        recorder.save(tmp_path / "file" / "speeds.csv")


def test_the_drawing_says_what_it_shows():
    from mpp_taichi.recorders._speed_plot import figure_of

    axes = figure_of(histogram()).axes[0]
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "4,000 particles at time 0" in labels and "Maxwell–Boltzmann, k T = 1.5" in labels
    assert axes.get_title().startswith("Made up: Kolmogorov–Smirnov distance 0.0")


def test_a_gas_at_rest_has_a_histogram_and_no_curve():
    recorder = histogram(velocity=np.zeros((4000, 3)))
    found = recorder.columns()
    assert np.isfinite(found["density"]).all() and not found["theory"].any() and recorder.distance == 1.0


def test_without_free_particles_there_is_nothing_to_draw():
    held = {"body": {"mass": 1, "position": [0, 0], "free": False}}
    with pytest.raises(OutputError, match="no free particles"):
        histogram(particles=[held])


# --- the log of collisions ------------------------------------------------------------------------------------------------


def a_log():
    log = EventLogRecorder(("floor", "lid"))
    log.append([0.1, 0.25], [3, 1], [7, -1], [0.5, 1.0])
    log.append([], [], [], [])
    log.append([1 / 3], [2], [-2], [1e-300])
    return log


def test_collisions_come_in_batches_and_stay_in_order(tmp_path):
    log = a_log()
    assert len(log) == 3
    assert log.columns()["j"].tolist() == [7, -1, -2]
    log.save(tmp_path / "events.csv")
    rows = list(csv.reader(open(tmp_path / "events.csv", encoding="utf-8")))
    assert rows[0] == ["time", "i", "j", "surface", "impulse"]
    assert rows[1:] == [
        ["0.1", "3", "7", "", "0.5"],
        ["0.25", "1", "", "floor", "1.0"],
        [repr(1 / 3), "2", "", "lid", "1e-300"],
    ]
    log.save(tmp_path / "events.npz")
    with np.load(tmp_path / "events.npz") as found:
        assert found["time"].tolist() == [0.1, 0.25, 1 / 3] and found["surface"].tolist() == ["floor", "lid"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["events.csv", "events.npz"]


def test_a_log_that_cannot_be_written_says_so(tmp_path):
    with pytest.raises(OutputError, match=r"'.json' is none of .csv, .npz"):
        a_log().save(tmp_path / "events.json")
    (tmp_path / "events.csv").mkdir()
    with pytest.raises(OutputError, match="cannot write the event log"):
        a_log().save(tmp_path / "events.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["events.csv"]
    with pytest.raises(ValueError, match="different shapes"):
        a_log().append([1.0], [1, 2], [3], [4.0])
    assert len(EventLogRecorder().columns()["time"]) == 0


@pytest.mark.sampled(3)
def test_the_log_of_an_event_driven_run_is_its_count():
    """Two balls and a wall: 0.8 apart at speed 1, the one that was hit meets the wall 0.9 further on and comes back."""
    balls = [{"body": {"mass": 2, "radius": 0.1, "position": [x, 0], "velocity": [v, 0]}} for x, v in ((0, 1), (1, 0))]
    described = {
        "dimensions": 2,
        "particles": balls,
        "contacts": {"hard_spheres": {"solver": "event_driven"}},
        "walls": [{"plane": {"point": [2, 0], "normal": [-1, 0]}}],
        "run": {"duration": 4, "every": 3},
    }
    with Simulation(described, backend="cpu", precision="f64", event_log=True) as simulation:
        log = EventLogRecorder([surface.label for surface in simulation.contacts.setup.enclosure.surfaces])
        simulation.run(recorders=[log])
        log.finish(simulation)
    found = log.columns()
    assert found["time"] == pytest.approx([0.8, 1.7, 2.6], rel=1e-12)
    assert [set(pair) for pair in zip(found["i"].tolist(), found["j"].tolist())] == [{0, 1}, {1, -1}, {0, 1}]
    assert found["impulse"] == pytest.approx([2.0, 4.0, 2.0], rel=1e-12)
    assert log.surfaces == ("walls[0].plane",)
