"""Python scripts: parameters that change during a run, results as arrays, and their display."""

import io
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

import mpp_taichi as mpp
from mpp_taichi.scene.write import scene_text
from mpp_taichi.simulation.notebook import picture
from scenes import kepler


def falling(*events):
    """A free body of mass 2 in a field; leapfrog is exact in it but for rounding."""
    return {
        "particles": [{"body": {"name": "stone", "mass": 2.0, "position": [0, 0, 0], "velocity": [1, 0, 2], "radius": 0.1}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -2]}}, {"linear_drag": {"coefficient": 0}}],
        "integrator": {"leapfrog": {"dt": 0.125}},
        "run": {"duration": 4.0},
        "timeline": list(events),
    }


@pytest.fixture
def stone():
    with mpp.Simulation(falling(), backend="cpu") as simulation:
        yield simulation


# --- parameters that change ---------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_what_is_set_holds_from_then_on(stone):
    stone.run(until=1.0)  # z = 2 − 1, v_z = 2 − 2
    stone.set("forces.uniform_gravity.acceleration", np.array([0.0, 0.0, 3.0]))
    stone.run(until=3.0)  # two more units of time upwards
    # Binary fractions all along: exact.
    assert stone.snapshot().position.tolist() == [[3.0, 0.0, 1.0 + 0.5 * 3.0 * 4.0]]
    assert stone.phase_work == [2.0 * -(3.0 + 2.0) * 1.0]  # −m Δg · z: the field rose while the stone was at z = 1


@pytest.mark.sampled(3)
def test_setting_is_what_a_timeline_does(stone):
    change = {"forces.uniform_gravity.acceleration": [0.3, 0, 1 / 3], "forces.linear_drag.coefficient": 0.7}
    stone.run(until=1.0)
    stone.set(change)
    stone.run(until=4.0)
    with mpp.Simulation(falling({"at": 1.0, "set": change}), backend="cpu") as by_timeline:
        by_timeline.run()
        assert np.array_equal(by_timeline.snapshot().position, stone.snapshot().position)
        assert by_timeline.phase_work == stone.phase_work and stone.phase_number == 1


@pytest.mark.sampled(3)
def test_what_was_set_is_kept_and_can_be_run_again(stone, tmp_path):
    stone.run(steps=3)
    stone.set("forces.uniform_gravity.acceleration", [0, 0, 0])
    stone.set("forces.linear_drag.coefficient", 0.5)  # at the same time: one event
    assert stone.phase_work == [-2.0 * 2.0 * (2.0 * 0.375 - 0.375**2)]  # m g z was lost, z = 2 t − t²
    stone.run(until=2.0)
    stone.set("integrator.leapfrog.dt", 0.01)
    stone.run(until=6.0)  # beyond the scene's own end
    assert [event.at for event in stone.scene.timeline] == [0.375, 2.0] and len(stone.phase_work) == 2
    seen = stone.snapshot()
    stone.restart()
    stone.run(until=6.0)
    assert np.array_equal(stone.snapshot().position, seen.position) and stone.step_count == seen.step
    written = tmp_path / "again.yaml"
    written.write_text(scene_text(stone.scene.resolved), encoding="utf-8")
    with mpp.Simulation(written, backend="cpu") as again:
        again.run(until=6.0)
        assert np.array_equal(again.snapshot().position, seen.position)


@pytest.mark.sampled(3)
def test_later_events_of_the_timeline_stay():
    at_three = {"at": 3.0, "set": {"forces.uniform_gravity.acceleration": [0, 0, 0]}}
    with mpp.Simulation(falling(at_three), backend="cpu") as simulation:
        simulation.run(until=2.0).set({"forces.uniform_gravity.acceleration": [0, 0, -1]})
        simulation.run(until=4.0)
        # v_z = 2 − 4 at t = 2, −3 at t = 3, and no force after that.
        assert simulation.snapshot().velocity[0, 2] == -3.0


def test_before_the_first_step_all_of_the_scene_may_change(stone):
    stone.set({"particles[0].body.velocity": [0, 0, 5], "forces.uniform_gravity.acceleration": [0, 0, 0]})
    stone.run(until=1.0)
    assert stone.snapshot().position.tolist() == [[0.0, 0.0, 5.0]] and not stone.scene.timeline


@pytest.mark.sampled(3)
def test_a_run_that_continues_from_a_state_applies_the_timeline_at_its_times(stone):
    stone.run(until=2.0)
    state = stone.snapshot()
    with mpp.Simulation(falling(), backend="cpu", start=state) as simulation:
        simulation.set("forces.uniform_gravity.acceleration", [0, 0, 0])
        simulation.restart()
        simulation.run(until=3.0)
        assert np.array_equal(simulation.snapshot().position, state.position + state.velocity)
        assert simulation.phase_work == []  # it began so
        assert [event.at for event in simulation.scene.timeline] == [2.0]


IMPOSSIBLE = [
    ("forces.linear_drg.coefficient", 1, "forces has no entry 'linear_drg', did you mean 'linear_drag'?"),
    ("forces.linear_drag.coefficient", -1, "-1 is not allowed, must be at least 0"),
    ("forces.uniform_gravity.acceleration", np.zeros(2), "must be a list of 3 numbers"),
    ("particles[0].body.position", [1, 1, 1], "particles stay where the motion has brought them"),
    ("view.trails", 5, "'view' stays as it is"),
    ("integrator", {"event_driven": {}}, "event_driven"),
    ("forces.linear_drag.coefficient", object(), "a object cannot stand in a scene"),
    ("forces..coefficient", 1, "is no path"),
]


def test_what_cannot_be_set_is_named_and_changes_nothing(stone):
    stone.run(until=1.0)
    phases, scene = stone.phases, stone.scene
    for path, value, said in IMPOSSIBLE:
        with pytest.raises(mpp.SceneError) as error:
            stone.set(path, value)
        assert said in str(error.value) and path in str(error.value) and "\n" not in str(error.value)
        assert (stone.phases, stone.scene, stone.phase_work) == (phases, scene, [])
    stone._runner.compiled.plan_asked = (
        "parallel"  # as if it had been asked for: ias15 has no such plan, which is found as it is built
    )
    with pytest.raises(mpp.BackendError, match="no parallel plan"):
        stone.set("integrator", {"ias15": {"dt": 0.125}})
    stone.run(until=2.0)
    assert stone.snapshot().position.tolist() == [[2.0, 0.0, 0.0]] and not stone.scene.timeline  # 2 t − t²


def test_a_step_that_the_changed_springs_do_not_allow_is_refused():
    spring = {"link": {"between": ["wall", "bob"], "stiffness": 1.0}}
    scene = {
        "particles": [
            {"body": {"name": "wall", "mass": 1, "position": [0, 0, 0], "free": False}},
            {"body": {"name": "bob", "mass": 1, "position": [1, 0, 0], "displacement": [0.1, 0, 0]}},
        ],
        "springs": [spring],
        "integrator": {"leapfrog": {"dt": 0.1}},
    }
    with mpp.Simulation(scene, backend="cpu") as simulation:
        simulation.run(steps=5).set("springs[0].link.stiffness", 500.0)  # 2/√500 = 0.089
        with pytest.raises(mpp.StabilityError, match="beyond the largest stable step"):
            simulation.run(steps=1)


# --- results ------------------------------------------------------------------------------------------------------------


class Tags(HTMLParser):
    """The tags of a page and their attributes, and the text between them."""

    def __init__(self, page):
        super().__init__()
        self.found, self.text = {}, ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found[tag] = dict(attrs)

    def handle_data(self, data):
        self.text += data


def middle(picture):
    """Column and row of the middle of what is bright."""
    rows, columns = np.nonzero(picture.max(axis=2) > 100)
    return columns.mean(), rows.mean()


def opened(png):
    return np.asarray(Image.open(io.BytesIO(png)))


@pytest.mark.sampled(3)
def test_a_result_holds_arrays_and_shows_itself():
    scene = kepler(eccentricity=0.0, dt=np.pi / 512) | {"run": {"duration": 2 * np.pi}, "title": "Circle <&> line"}
    scene["move_to_center_of_mass"] = False
    scene["particles"][1]["body"] |= {"mass": 0, "radius": 0.1, "color": [1, 1, 1]}
    scene["expect"] = {
        "relative_energy_error_max": {"below": 1e-6},
        "end_position": {"of": "planet", "axis": "x", "near": 2, "within": 0.1},
    }
    scene["view"] = {"caption": False, "camera": {"position": [0, 0, 5], "look_at": [0, 0, 0], "up": [0, 1, 0]}}
    with mpp.run(scene, backend="cpu", samples=64) as result:
        t = result.time
        assert t.shape == (65,) and result.position.shape == result.velocity.shape == (65, 2, 3)
        # A leapfrog begun on a circle makes each turn longer by (ω dt)²/3, dt = π/512, and its radius wobbles by (ω dt)²/4.
        exact = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
        assert np.abs(result.position[:, 1] - exact).max() < (np.pi / 512) ** 2 * (2 * np.pi / 3 + 1 / 4)
        assert np.array_equal(result.table["time"], t) and result.table["momentum"].shape == (65, 3)
        assert [verdict.passed for verdict in result.verdicts] == [True, False] and not result.passed
        assert result.summary["status"] == "failed" and result.summary["steps"] == 1024
        assert "FAIL  end_position" in str(result)
        page = Tags(result._repr_html_())
        assert page.found["img"]["src"].startswith("data:image/png;base64,iVBOR") and str(result) in page.text
        assert "result" not in page.found and "<&>" not in result._repr_html_()  # what a title holds is text, not HTML

        half = result.simulation.picture((320, 180))
        assert half.shape == (180, 320, 3) and half.dtype == np.uint8
        body = dict(particles=scene["particles"][1:], view=scene["view"], integrator=scene["integrator"])
    assert result._repr_png_() is None and "img" not in Tags(result._repr_html_()).found and str(result)

    with mpp.Simulation(body, backend="cpu") as simulation:  # the planet alone, on its way straight up
        before = middle(opened(simulation._repr_png_()))
        simulation.run(duration=1.0)
        after = middle(opened(simulation._repr_png_()))
        # A camera at a height of 5 with an angle of 45° sees 2 · 5 · tan(22.5°) in 540 rows.
        assert before[1] - after[1] == pytest.approx(540 / (10 * np.tan(np.pi / 8)), abs=1.5)
        assert after[0] == pytest.approx(before[0], abs=0.5)
        page = Tags(simulation._repr_html_())
        assert "t = 1, 163 steps; 1 particles; leapfrog" in page.text and "energy 0" in page.text
        assert "energy" not in repr(simulation)  # a debugger that shows a simulation computes nothing
    assert repr(simulation).endswith("ended") and "img" not in Tags(simulation._repr_html_()).found


@pytest.mark.sampled(3)
def test_a_picture_after_earlier_moments_shows_all_places_of_the_motion():
    """Two bodies at rest, and one that goes ten times as far as they are apart: the bodies at rest are drawn smaller then."""
    bodies = [{"mass": 1, "radius": 0.2, "position": [x, 0, 0], "color": [1, 0, 0]} for x in (-1.0, 1.0)]
    bodies.append({"mass": 1, "radius": 0.2, "position": [0, 0, 0], "velocity": [20, 0, 0], "color": [0, 0, 1]})
    scene = {"particles": [{"body": each} for each in bodies], "integrator": {"leapfrog": {"dt": 0.25}}}
    scene["view"] = {"caption": False, "background": [0, 0, 0]}
    with mpp.Simulation(scene, backend="cpu") as simulation:
        simulation.run(steps=4)
        far = simulation.snapshot()
        simulation.restart()
        pictures = [picture(simulation, (320, 180), earlier=earlier) for earlier in ((), (far,))]
    red = [(each[:, :, 0] > each[:, :, 2] + 40).sum() for each in pictures]
    # The motion is 21 long and at first 2, so that areas fall at least by (2 · 2 / 21)², with 0.2 for the rims of the bodies.
    assert red[0] > 100 and 0 < red[1] < 0.2 * red[0]


@pytest.mark.sampled(3)
def test_a_run_of_too_many_moments_is_refused():
    with pytest.raises(mpp.CapacityError, match="fewer samples"):
        mpp.run("scenes/cloth.yaml", backend="cpu", samples=10**8, overrides={"integrator.leapfrog.dt": 1e-5})


@pytest.mark.sampled(3)
def test_ipython_shows_the_picture():
    display = pytest.importorskip("IPython.core.formatters", reason="IPython is not installed").DisplayFormatter()
    with mpp.Simulation("scenes/kepler.yaml", backend="cpu") as simulation:
        shown, _ = display.format(simulation)
    assert shown["text/html"].startswith("<figure>") and shown["image/png"][:4] == b"\x89PNG"
    assert shown["text/plain"].startswith("Kepler's ellipse: t = 0")
