"""The verdict of a run: nothing is silently wrong, in Python as on the command line."""

import json
import warnings

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.cli.main import main
from mpp_taichi.errors import AccuracyWarning, ArgumentError, StabilityError
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.simulation.verdict import ENERGY_LIMIT, OVERLAP_LIMIT

STAR = {"mass": 1.0, "position": [0, 0, 0]}


def orbit(*, mass=0.0, speed=0.2, dt=0.1, duration=100.0, integrator="leapfrog"):
    """A planet that falls past a star; with these numbers a leapfrog throws it hundreds of lengths away."""
    return {
        "particles": [{"body": STAR}, {"body": {"mass": mass, "position": [1, 0, 0], "velocity": [0, speed, 0]}}],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {integrator: {"dt": dt}},
        "run": {"duration": duration},
    }


def fall():
    """Two bodies that fall at each other, head on."""
    bodies = [{"body": {"mass": 1.0, "position": [x, 0, 0]}} for x in (-1.0, 1.0)]
    return orbit() | {"particles": bodies, "integrator": {"leapfrog": {"dt": 0.01}}, "run": {"duration": 5.0}}


def flight(position=(0, 0, 0), velocity=(1, 0, 0), dt=0.01, **body):
    return {
        "particles": [{"body": {"mass": 1.0, "position": list(position), "velocity": list(velocity), **body}}],
        "integrator": {"symplectic_euler": {"dt": dt}},
        "run": {"steps": 10},
    }


def closing_wall(solver, dt):
    """An elastic sphere between a wall at rest and a wall that comes: u L of the sphere and the closing gap is conserved."""
    sphere = {"mass": 1.0, "position": [0.5, 0, 0], "velocity": [1, 0, 0], "radius": 0.05}
    walls = [{"point": [0, 0, 0], "normal": [1, 0, 0]}, {"point": [1, 0, 0], "normal": [-1, 0, 0], "velocity": [-0.1, 0, 0]}]
    return {
        "particles": [{"body": sphere}],
        "walls": [{"plane": wall} for wall in walls],
        "contacts": {"hard_spheres": {"solver": solver}},
        "integrator": {"leapfrog": {"dt": dt}},
        "run": {"duration": 8.5},
    }


def deep_overlap():
    """A small sphere shot into a large one, so fast that a step ends 200 of its radii inside."""
    bodies = [
        {"mass": 1.0, "position": [0, 0, 0], "radius": 1.0},
        {"mass": 1.0, "position": [3, 0, 0], "velocity": [-2.2, 0, 0], "radius": 0.001},
    ]
    return {
        "particles": [{"body": body} for body in bodies],
        "contacts": {"hard_spheres": {"solver": "pairwise"}},
        "integrator": {"leapfrog": {"dt": 1.0}},
        "run": {"steps": 2},
    }


WRONG = {
    "massless": orbit(),
    "energy": fall(),
    "overlap": deep_overlap(),
    "bounces": closing_wall("resting", 0.01),
    "rounding": flight(position=(1e12, 0, 0), velocity=(1e-3, 0, 0)),
}


def warned(scene, *, kinds=(), precision="f64", **run):
    """The kinds of the findings of a run, each of which was told by one warning."""
    with warnings.catch_warnings(record=True) as seen, mpp.Simulation(scene, backend="cpu", precision=precision) as simulation:
        warnings.simplefilter("always")
        simulation.run(**run)
        found = simulation.verdict.findings
    told = [str(each.message) for each in seen if each.category is AccuracyWarning]
    assert told == [each.message for each in found]
    assert all("\n" not in text for text in told)
    return [each.kind for each in found]


def test_a_planet_too_light_for_the_total_energy_is_watched_as_a_massless_one_is():
    """Beside a binary of 1 + 1 a planet of 1e-9 could leave with any energy, and the total would not change by a millionth."""
    scene = orbit(mass=1e-9)
    for x, v in ((50.0, -0.5), (52.0, 0.5)):
        scene["particles"].append({"body": {"mass": 1.0, "position": [x, 0, 0], "velocity": [0, v, 0]}})
    kinds = warned(scene, duration=20.0)
    assert "massless" in kinds and "energy" not in kinds


@pytest.mark.parametrize("kind", WRONG)
@pytest.mark.sampled(3)
def test_each_kind_of_wrong_result_is_warned_of_once(kind):
    assert kind in warned(WRONG[kind])


@pytest.mark.parametrize("kind", WRONG)
@pytest.mark.sampled(3)
def test_the_command_line_and_python_have_the_same_verdict(kind, tmp_path, capsys):
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(WRONG[kind]), encoding="utf-8")
    code = main(["run", str(path), "--headless", "--json", "--quiet", "--backend", "cpu"])
    told = json.loads(capsys.readouterr().out)
    # A massless body that is thrown away stops the command at the step before, as a run that blows up does.
    assert code == StabilityError.exit_code
    if kind == "massless":
        assert told["status"] == "failed" and "massless" in told["error"]
        return
    assert told["status"] == "inaccurate" and kind in [each["kind"] for each in told["findings"]]
    with mpp.run(WRONG[kind], backend="cpu") as result:
        assert result.summary["status"] == "inaccurate"
        assert kind in [each["kind"] for each in result.summary["findings"]]


@pytest.mark.parametrize("kind", ["massless", "energy", "rounding"])
def test_a_finding_is_an_error_where_this_is_asked_for(kind):
    with mpp.Simulation(WRONG[kind], backend="cpu") as simulation, pytest.raises(StabilityError) as caught:
        simulation.run(judge="raise")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["energy", "rounding"])
def test_nothing_is_looked_at_or_told_where_this_is_asked_for(kind):
    with warnings.catch_warnings(), mpp.Simulation(WRONG[kind], backend="cpu") as simulation:
        warnings.simplefilter("error")
        simulation.run(judge="off")
        assert simulation.verdict.status == "ok"


def test_a_way_of_judging_that_does_not_exist_is_refused():
    with mpp.Simulation(flight(), backend="cpu") as simulation, pytest.raises(ArgumentError, match="warn, raise or off"):
        simulation.run(judge="loud")


@pytest.mark.parametrize(
    "scene",
    [
        orbit(speed=1.0, dt=0.01, duration=10.0),
        orbit(mass=1e-9, speed=1.0, dt=0.01, duration=10.0),
        flight(),
        flight(position=(1e12, 0, 0), velocity=(0, 0, 0)),
        flight(position=(1e12, 0, 0), free=False),
        flight(position=(1e12, 0, 0), velocity=(0, 1.0, 0)),
        closing_wall("swept", 0.01),
        closing_wall("resting", 0.0001) | {"run": {"duration": 2.0}},
    ],
)
@pytest.mark.sampled(3)
def test_sound_runs_raise_no_finding(scene):
    assert warned(scene) == []


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("far", [0.0, 1e6, 1e12, 1e15])
@pytest.mark.sampled(3)
def test_a_position_is_called_lost_exactly_where_a_run_does_not_move_it(precision, far):
    """A single body keeps its velocity: a first step that changes nothing proves that no later step does."""
    scene = flight(position=(far, 0, 0))
    with mpp.Simulation(scene, backend="cpu", precision=precision) as simulation, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        state = simulation.state
        low = getattr(state, "position_low", None)

        def place():
            return state.position.to_numpy()[0, 0], 0.0 if low is None else low.to_numpy()[0, 0]

        before = place()
        simulation.run(steps=3)
        assert (place() == before) == ("rounding" in [each.kind for each in simulation.verdict.findings])


@pytest.mark.parametrize("speed, lost", [(1e6, False), (1e16, True)])
def test_a_velocity_that_gravity_would_not_change_is_found(speed, lost):
    scene = flight(velocity=(0, 0, speed)) | {"forces": [{"uniform_gravity": {"acceleration": [0, 0, -9.81]}}]}
    with mpp.Simulation(scene, backend="cpu", precision="f64") as simulation, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        simulation.run(steps=1)
        assert (simulation.snapshot().velocity[0, 2] == speed) == lost
        assert ("rounding" in [each.kind for each in simulation.verdict.findings]) == lost


@pytest.mark.sampled(3)
def test_methods_that_keep_rounding_errors_and_moving_frames_lose_nothing():
    """ias15 keeps the rounding error of each sum; yoshida8 steps in the frame of the centre of mass, as nothing else acts."""
    far = flight(position=(1e12, 0, 0), velocity=(1e-3, 0, 0))
    for integrator in ({"ias15": {"dt": 0.01}}, {"yoshida8": {"dt": 0.01}}):
        with mpp.Simulation(far | {"integrator": integrator}, backend="cpu", precision="f64") as simulation:
            simulation.run(steps=500)
            assert simulation.verdict.is_sound
            moved = simulation.snapshot().position[0, 0] - 1e12
            assert abs(moved - 1e-3 * simulation.time) <= np.spacing(1e12)


def test_rounding_is_judged_anew_in_each_phase():
    events = [{"at": 0.05, "set": {"integrator.symplectic_euler.dt": 1e-11}}]
    scene = flight(position=(1e6, 0, 0)) | {"timeline": events, "run": {"duration": 0.05 + 3e-11}}
    assert warned(scene) == ["rounding"]
    assert warned(scene, duration=0.04) == []


def test_many_short_calls_are_judged_like_one_long_call():
    with mpp.Simulation(fall(), backend="cpu", precision="f64") as simulation, pytest.warns(AccuracyWarning, match="energy"):
        for _ in range(500):
            simulation.run(steps=1)
    with mpp.Simulation(fall(), backend="cpu", precision="f64") as simulation, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        simulation.run(steps=500)
        assert [each.kind for each in simulation.verdict.findings] == ["energy"]


def test_a_restart_forgets_and_a_change_of_a_parameter_is_no_error():
    with mpp.Simulation(fall(), backend="cpu", precision="f64") as simulation, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        simulation.run()
        assert not simulation.verdict.is_sound
        simulation.restart()
        assert simulation.verdict.is_sound
        simulation.run(steps=10)
        simulation.set("forces[0].newtonian_gravity.strength", 3.0)
        simulation.run(steps=10)
        assert simulation.verdict.is_sound


def test_a_judged_run_keeps_its_bits():
    for scene in (orbit(), fall()):
        found = []
        for judge in ("warn", "off"):
            with mpp.Simulation(scene, backend="cpu") as simulation, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                simulation.run(judge=judge)
                found.append((simulation.snapshot().position, simulation.time, simulation.step_count))
        assert np.array_equal(found[0][0], found[1][0]) and found[0][1:] == found[1][1:]


def test_the_warning_stands_at_the_line_of_the_caller():
    with mpp.Simulation(fall(), backend="cpu") as simulation, pytest.warns(AccuracyWarning) as seen:
        simulation.run()
    assert [each.filename for each in seen] == [__file__]


def test_the_limits_are_those_that_the_words_name():
    with mpp.Simulation(deep_overlap(), backend="cpu") as simulation, pytest.warns(AccuracyWarning):
        simulation.run()
        assert simulation.contact_report.largest_overlap > OVERLAP_LIMIT
    assert ENERGY_LIMIT == 0.1


def test_the_steps_after_the_last_look_are_looked_at_when_the_simulation_is_closed():
    scene = orbit(mass=1e-3, speed=1.0, dt=0.01)
    simulation = mpp.Simulation(scene, backend="cpu", precision="f64")
    simulation.run(steps=100)
    simulation.dt = 6.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulation.run(steps=3)  # fewer than an eighth of the steps before: not looked at yet
    with pytest.warns(AccuracyWarning, match="energy"):
        simulation.close()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulation.close()


def test_an_error_within_the_block_of_a_simulation_is_not_followed_by_a_last_look():
    with pytest.raises(ZeroDivisionError), warnings.catch_warnings():
        warnings.simplefilter("error")
        with mpp.Simulation(orbit(mass=1e-3, speed=1.0, dt=0.01), backend="cpu", precision="f64") as simulation:
            simulation.run(steps=100)
            simulation.dt = 6.0
            simulation.run(steps=3)
            raise ZeroDivisionError
