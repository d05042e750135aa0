"""Periods, turning points, ends and means of a coordinate, from samples of known motions."""

import math

import numpy as np
import pytest
from compiled import snapshot_of
from measured import MadeUpSample, measuring

from mpp_taichi import SceneError, Simulation
from mpp_taichi.quantities._base import NoResultError
from mpp_taichi.recorders.inspection import InspectionRecorder
from mpp_taichi.recorders.inspector import Inspector
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.scene.load import load_scene
from scenes import kepler

STEP = 1e-3


def watched(name, motion, duration, *, step=STEP, **parameters):
    """The result for x(t), v(t) on the second particle's z, from the fewest samples that the diagnostic allows; and their number."""
    diagnostic = measuring(name, of=(1, 1) if name == "position" else 1, axis="z", **parameters)
    time, looks, last = 0.0, 0, -1.0
    while last < duration:
        value, rate = motion(time)
        position, velocity = np.full((2, 3), 7.0), np.full((2, 3), 7.0)
        position[1, 2], velocity[1, 2] = value, rate
        diagnostic.observe(MadeUpSample(snapshot_of(position, velocity=velocity), time))
        looks, last = looks + 1, time
        time = min(duration, time + max(step, math.floor(min(diagnostic.interval, 1e3) / step) * step))
    return diagnostic.result(), looks


def swing(omega, level=0.0, amplitude=1.0, phase=0.0):
    return lambda t: (
        level + amplitude * math.cos(omega * t + phase),
        -amplitude * omega * math.sin(omega * t + phase),
    )


@pytest.mark.parametrize("omega, level, phase", [(1.0, 0.0, 0.0), (3.7, 0.0, 1.0), (20.0, 2.5, -0.4)])
def test_the_period_of_a_swing_is_found_with_few_looks(omega, level, phase):
    period, looks = watched("oscillation_period", swing(omega, level, 0.3, phase), 40.0 / omega, step=STEP / omega, about=level)
    # The cubic errs by (ω h)⁴/384 of the amplitude, ω h ≤ 0.1, at each end of some five periods.
    assert period == pytest.approx(2.0 * math.pi / omega, rel=1e-7)
    assert looks < 600, "some 63 samples in a period"


def test_a_motion_that_does_not_rise_twice_has_no_period():
    with pytest.raises(NoResultError, match="z of particle 1 rose through 0 1 time"):
        watched("oscillation_period", swing(1.0), 8.0)
    with pytest.raises(NoResultError, match="0 time"):
        watched("oscillation_period", swing(1.0, level=5.0), 30.0)


def test_the_lowest_turning_point_lies_between_looks():
    lowest, looks = watched("lowest_position", swing(2.0, 0.4, 0.3, 0.1), 10.0)
    assert lowest == pytest.approx(0.1, abs=1e-6) and looks < 400
    # A second swing goes deeper than the first: both are seen.
    sunk, _ = watched("lowest_position", lambda t: (math.cos(t) - 0.05 * t, -math.sin(t) - 0.05), 10.0)
    turn = 2.0 * math.pi + math.pi + math.asin(0.05)
    assert sunk == pytest.approx(math.cos(turn) - 0.05 * turn, abs=1e-6)
    # Without a turning point the lowest is where it ends, or began.
    assert watched("lowest_position", lambda t: (3.0 - t, -1.0), 1.0)[0] == pytest.approx(2.0, abs=1e-12)
    assert watched("lowest_position", lambda t: (3.0 + t, 1.0), 1.0)[0] == 3.0


def test_the_end_is_the_last_look():
    diagnostic = measuring("end_position", of=0, axis="y")
    with pytest.raises(NoResultError):
        diagnostic.result()
    for time in (0.0, 1.0, 2.0):
        diagnostic.observe(MadeUpSample(snapshot_of([[0.0, 5.0 - time, 0.0]]), time))
    assert diagnostic.result() == 3.0


def test_the_distance_of_two_on_an_ellipse_is_that_of_its_ends():
    e, found = 0.6, {}
    for when in ("smallest", "largest", "end"):
        diagnostic = measuring("distance", between=(0, 1), when=when)
        with pytest.raises(NoResultError):
            diagnostic.result()
        anomaly, looks, last = 1.0, 0, -1.0
        while last < 7.5:  # eccentric anomaly E; time is E − e sin E, the rate dE/dt = 1 / (1 − e cos E)
            rate = 1.0 / (1.0 - e * math.cos(anomaly))
            place = np.array([math.cos(anomaly) - e, 0.8 * math.sin(anomaly), 0.0])
            motion = rate * np.array([-math.sin(anomaly), 0.8 * math.cos(anomaly), 0.0])
            both = ([[5.0, 5.0, 5.0], 5.0 + place], [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0] + motion])
            diagnostic.observe(MadeUpSample(snapshot_of(both[0], velocity=both[1]), anomaly - e * math.sin(anomaly)))
            looks, last = looks + 1, anomaly
            anomaly = min(7.5, anomaly + max(STEP, min(diagnostic.interval, 1.0) * rate * 0.9))
        found[when] = diagnostic.result()
        assert looks < (120 if when != "end" else 20)
    # Looks are at most 0.1 of an angle apart, so that the cubic errs by some 0.1⁴/384 of the distance.
    assert found["smallest"] == pytest.approx(1.0 - e, rel=1e-6)
    assert found["largest"] == pytest.approx(1.0 + e, rel=1e-6)
    assert found["end"] == pytest.approx(1.0 - e * math.cos(7.5), rel=1e-14)


def test_a_distance_is_watched_until_the_time_that_is_asked_for():
    found, looks = {}, {}
    for when in ("end", "largest"):
        diagnostic = measuring("distance", between=(0, 1), when=when, until=0.5)
        time = looks[when] = 0
        while time < 2.0:
            apart, speed = 1.0 + time, 1.0
            both = snapshot_of([[0.0, 0, 0], [apart, 0, 0]], velocity=[[0.0, 0, 0], [speed, 0, 0]])
            diagnostic.observe(MadeUpSample(both, time))
            if time < 0.5:
                with pytest.raises(NoResultError, match="before time 0.5"):
                    diagnostic.result()
            looks[when] += 1
            time = time + min(diagnostic.interval, 2.0)
        found[when] = diagnostic.result()
    assert found == {"end": 1.5, "largest": pytest.approx(1.5, rel=1e-15)}
    assert looks["end"] == 2 and looks["largest"] < 10


def test_a_position_at_a_time_lies_on_the_cubic_between_the_looks_around_it():
    omega = 3.0
    for at in (0.0, 0.5, 0.50037, 1.2):
        # Looks are one step apart there, and the cubic errs by (ω h)⁴/384 = 2e-13; a straight line, by (ω h)²/8 = 1e-6.
        found, looks = watched("position", swing(omega, 0.4), 2.0, at=at)
        assert found == pytest.approx(0.4 + math.cos(omega * at), abs=1e-12)
        assert looks <= 5, "the start, the last step before the time, the next, the end"


def test_a_position_at_a_time_that_the_run_does_not_see_is_none():
    with pytest.raises(NoResultError, match=r"at times 0 and 2, not at 2\.001"):
        watched("position", swing(1.0), 2.0, at=2.001)
    late = measuring("position", of=(0, 1), axis="x", at=0.5)
    with pytest.raises(NoResultError, match="never"):
        late.result()
    late.observe(MadeUpSample(snapshot_of([[0.0, 0.0, 0.0]]), 1.0))
    with pytest.raises(NoResultError, match=r"at times 1 and 1, not at 0\.5"):
        late.result()
    # Steps of 0.1 do not add up to 1 in the last bit: the end of a run is reached all the same.
    end = measuring("position", of=(0, 1), axis="x", at=1.0)
    for step in range(11):
        end.observe(MadeUpSample(snapshot_of([[float(step), 0.0, 0.0]]), min(step * 0.1, math.nextafter(1.0, 0.0))))
    assert end.result() == 10.0


def test_the_mean_and_the_largest_of_a_part_of_a_run_take_only_its_samples():
    """A speed of 1 + t: on average 2.5 over 1 … 2, largest, 3, in the first sample from 2 on."""
    found = {}
    for when, part in {
        "mean": {"after": 1.0, "until": 2.0},
        "largest": {"until": 2.0},
        "smallest": {"after": 1.0},
        "end": {"until": 1.5},
    }.items():
        diagnostic, time = measuring("speed", of=(0, 1), when=when, **part), 0.0
        while time < 4.0:
            diagnostic.observe(MadeUpSample(snapshot_of([[0.0, 0, 0]], velocity=[[0.0, 1.0 + time, 0]]), time))
            time += min(diagnostic.interval, 0.4)
        found[when] = diagnostic.result()
    # Samples meet the ends of the part, so that the trapezoidal rule is exact for a straight line.
    assert found == {"mean": pytest.approx(2.5), "largest": pytest.approx(3.0), "smallest": 2.0, "end": pytest.approx(2.5)}


def test_a_quantity_without_a_rate_is_taken_of_the_first_sample_from_a_time_on():
    diagnostic = measuring("resting_speed", at=1.1)
    for time in (0.0, 1.0, 2.0, 3.0):
        diagnostic.observe(MadeUpSample(snapshot_of([[0.0, 0, 0]], velocity=[[time, 0, 0]]), time))
    assert diagnostic.result() == 2.0


def test_every_quantity_is_a_key_of_expect_and_is_measured_as_its_panel_measures_it():
    scene = {
        **kepler(0.3),
        "run": {"steps": 50},
        "inspect": [{"y": [{"angular_momentum": {"of": 1, "axis": "z"}}, "potential_energy"]}],
        "expect": {
            "angular_momentum": {"of": 1, "axis": "z", "above": -9},
            "potential_energy": [{"when": "smallest", "above": -9}, {"at": 0.2, "above": -9}],
        },
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        watcher, inspector = Watcher(simulation.spec.expect, every=1), Inspector(simulation)
        recorder = InspectionRecorder(inspector, every=1)
        simulation.run(recorders=[watcher, recorder])
        watcher.finish(simulation)
        recorder.finish(simulation)
        values = [verdict.value for verdict in watcher.verdicts({}, "f64")]
        time, turning, potential = (inspector.samples.column(k) for k in range(3))
    assert values == [turning[-1], potential.min(), potential[np.searchsorted(time, 0.2)]]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("when: mean, at: 1", r":5:18: expect.speed.when: cannot be beside at:"),
        ("after: 1", r":5:18: expect.speed.after: belongs to when: largest, smallest or mean"),
        ("when: mean, after: 2, until: 1", r":5:40: expect.speed.until: must be later than after:, 2"),
        ("when: last", r"expect.speed.when: 'last' is unknown.* allowed: end, largest, mean, smallest"),
    ],
)
def test_keys_that_exclude_each_other_are_refused_at_their_place(tmp_path, keys, message):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "particles: [{body: {mass: 1, position: [0, 0, 0]}}]\nintegrator: {leapfrog: {dt: 1}}\nrun: {steps: 3}\nexpect:\n"
        f"  speed: {{of: 0, {keys}, below: 1}}\n"
    )
    with pytest.raises(SceneError, match=message):
        load_scene(path)
