"""Arrows of accelerations and forces: the forces of the program at the time of the picture, without effect on the run."""

import re
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
import yaml
from pictures import frame_of, view_spec
from PIL import Image

from mpp_taichi import Simulation
from mpp_taichi.cli.main import main
from mpp_taichi.compare.numpy_reference import ROUNDINGS, Limits, NumpyForces, bodies
from mpp_taichi.errors import SceneError
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import CameraSpec
from mpp_taichi.scene.view_spec import ArrowsSpec
from mpp_taichi.simulation.notebook import picture
from mpp_taichi.views._base import Frame, View
from mpp_taichi.views.appearance import Appearance
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.legend import legend_lines
from mpp_taichi.views.offscreen import open_offscreen
from scenes import cluster, everything, kepler, takes_friction

UNIT = {"f32": 2.0**-24, "f64": 2.0**-53}
PULL = {"quantity": "acceleration", "scale": 0.5}


def expected(simulation, snapshot):
    """Accelerations of a snapshot by direct sums in NumPy, and what rounding may make of them."""
    spec, precision = simulation.spec, simulation.device.precision
    reference = NumpyForces(spec, bodies(snapshot, spec.dimensions, [precision]))
    position, velocity = snapshot.position[None], snapshot.velocity[None]
    terms, _ = reference.magnitude(position, velocity, np.arange(snapshot.particle_count), Limits(0.0, 0.0))
    bound = (ROUNDINGS + reference.most_terms()) * UNIT[precision] * terms[0]
    return reference.acceleration(position, velocity)[0], bound


# What a look finds


@pytest.mark.sampled(3)
@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_two_bodies_pull_at_each_other_by_the_inverse_square(precision, plan, dimensions):
    scene = {**kepler(eccentricity=0.5), "dimensions": dimensions, "move_to_center_of_mass": False}
    with Simulation(scene, backend="cpu", precision=precision, plan=plan) as simulation:
        found = simulation.accelerations()
    # r = 1/2 and G = 1: 4 M towards the other, with M = 1 for the planet and 1e-3 for the sun.
    np.testing.assert_allclose(found, [[4e-3, 0, 0], [-4, 0, 0]], rtol=10 * UNIT[precision], atol=0)


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("integrator", "precision", "plan"),
    [
        ("leapfrog", "f64", "serial"),
        ("leapfrog", "f32", "parallel"),
        ("hermite6", "f64", "parallel"),
        ("bdf2", "f32", "serial"),
    ],
)
def test_all_forces_of_a_scene_are_in_it_and_friction_too(integrator, precision, plan):
    with Simulation(everything(integrator=integrator), backend="cpu", precision=precision, plan=plan) as simulation:
        found, (exact, bound) = simulation.accelerations(), expected(simulation, simulation.snapshot())
        assert (np.abs(found - exact) <= bound).all() and found[0, 2] == 0.0, "and nothing along an axis that is held"
        still = replace(simulation.snapshot(), velocity=np.zeros((5, 3)))
        change = np.abs(simulation.accelerations(still) - exact).max()
        assert change > 1e-2 if takes_friction(integrator) else (change <= bound.max()), "friction is a part of it"


@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.sampled(3)
def test_a_graphics_device_gives_the_same(software_vulkan, plan):
    with Simulation(everything(), backend="vulkan", precision="f32", plan=plan) as simulation:
        found, (exact, bound) = simulation.accelerations(), expected(simulation, simulation.snapshot())
    assert (np.abs(found - exact) <= bound).all()


def test_a_force_that_swings_is_that_of_the_time_shown():
    scene = {
        "particles": [{"body": {"mass": 2, "position": [0, 0, 0]}}],
        "forces": [{"harmonic_drive": {"force": [3, 0, 0], "angular_frequency": 2}}],
        "integrator": {"leapfrog": {"dt": 0.25}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(until=0.5)
        (now,), (later,) = simulation.accelerations(), simulation.accelerations(simulation.snapshot_ahead(0.1))
    np.testing.assert_allclose([now[0], later[0]], 1.5 * np.sin([1.0, 1.2]), rtol=1e-14)


def test_a_phase_without_forces_has_none():
    release = [{"at": 0.1, "set": {"forces.newtonian_gravity.strength": 0}}]
    with Simulation({**kepler(dt=0.05), "timeline": release}, backend="cpu", precision="f64") as simulation:
        assert simulation.accelerations().any() and not simulation.run(until=0.2).accelerations().any()


@pytest.mark.sampled(3)
def test_a_move_of_a_slider_is_seen_at_once():
    scene = {**kepler(), "sliders": [{"set": "forces.newtonian_gravity.strength"}], "run": {"duration": 1}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.run(steps=2).accelerations()
        simulation.set("forces.newtonian_gravity.strength", 2.0)
        np.testing.assert_array_equal(simulation.accelerations(), 2.0 * before)


@pytest.mark.sampled(3)
def test_a_tree_sums_what_it_sums_for_a_step():
    scene = cluster(600, softening=0.05)
    direct = {**scene, "forces": [{"newtonian_gravity": {"strength": 1.0, "softening": 0.05}}]}
    tree = {**scene, "forces": [{"newtonian_gravity": {"strength": 1.0, "softening": 0.05, "solver": "tree"}}]}
    with Simulation(tree, backend="cpu", precision="f64") as simulation:
        found = simulation.accelerations()
    with Simulation(direct, backend="cpu", precision="f64") as simulation:
        exact = simulation.accelerations()
    error = np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert 0.0 < np.median(error) < 1e-3


# No run notices

BALLS = {
    "dimensions": 2,
    "particles": [
        {"body": {"mass": 1, "position": [x, 0.5], "velocity": [v, 0.1], "radius": 0.2}} for x, v in ((0.5, 0.9), (1.5, -0.4))
    ],
    "forces": [{"uniform_gravity": {"acceleration": [0, -1, 0]}}],
    "walls": [{"box": {"lower": [0, 0], "upper": [2, 2]}}],
}
PLANETS = {
    "particles": [
        {"body": {"name": "sun", "mass": 1, "position": [0, 0, 0]}},
        {"body": {"mass": 1e-3, "position": [1, 0, 0], "velocity": [0, 1, 0]}},
        {"body": {"mass": 1e-3, "position": [0, 2, 0], "velocity": [-0.7, 0, 0]}},
    ],
    "forces": [{"newtonian_gravity": {"strength": 1}}],
}


def with_contacts(solver, integrator="leapfrog", **more):
    """Two balls that fall in a box, and meet."""
    return {**BALLS, "contacts": {"hard_spheres": {"solver": solver}}, "integrator": {integrator: {"dt": 0.02}}, **more}


CASES = [
    *(
        pytest.param(everything(integrator=name, dt=0.02), {}, id=name)
        for name in ("velocity_verlet", "hermite4", "bdf2", "janus")  # that remember a force, its derivatives, steps, a lattice
    ),
    *(
        pytest.param({**PLANETS, "integrator": {name: {"dt": 0.1}}}, {}, id=name)
        for name in ("taylor", "adaptive_leapfrog", "adaptive_bogacki_shampine", "wisdom_holman")
    ),
    *(pytest.param(kepler(dt=0.05), {"precision": each}, id=each) for each in ("f32c", "ds")),
    pytest.param(kepler(integrator="hermite6"), {"plan": "parallel"}, id="snaps"),
    pytest.param(cluster(600), {}, id="symmetric pairs"),
    *(pytest.param(with_contacts(each), {}, id=each) for each in ("swept", "pairwise", "resting", "simultaneous")),
    pytest.param(with_contacts("located", "adaptive_bogacki_shampine"), {}, id="located"),
    pytest.param(with_contacts("merging", forces=PLANETS["forces"], walls=[]), {}, id="merging"),
    pytest.param({**with_contacts("event_driven", "event_driven"), "forces": []}, {}, id="event_driven"),
]


@pytest.mark.sampled(5)
@pytest.mark.parametrize(("scene", "how"), CASES)
def test_looks_change_no_bit_of_a_run(scene, how):
    with Simulation(scene, backend="cpu", **{"precision": "f64", **how}) as simulation:
        simulation.run(steps=25)
        plain = simulation.snapshot()
        simulation.restart()
        seen = []
        for steps in (0, 1, 2, 7, 15):
            simulation.run(steps=steps)
            before = simulation.snapshot()
            seen.append(simulation.accelerations(simulation.snapshot_ahead(0.4 * simulation.dt)))
            assert np.array_equal(simulation.accelerations(), simulation.accelerations())
            after = simulation.snapshot()
            assert np.array_equal(before.position, after.position) and np.array_equal(before.velocity, after.velocity)
        end = simulation.snapshot()
        simulation.restart()
        again = simulation.run(steps=1).run(steps=2).run(steps=7).run(steps=15).snapshot()
    assert np.isfinite(seen).all() and (np.any(seen) == bool(simulation.spec.forces))
    for name in ("position", "velocity", "mass"):
        assert np.array_equal(getattr(end, name), getattr(again, name)), "neither samples nor the launches between them matter"
    np.testing.assert_allclose(end.position, plain.position, rtol=0, atol=1e-9)


# What is drawn

PARALLEL = CameraSpec(position=(0, 0, 10), look_at=(0, 0, 0), up=(0, 1, 0), projection="orthographic", height=4.0)


class Kept(View):
    """Keeps the frames that a film would draw."""

    def __init__(self):
        self.frames = []

    def draw(self, frame: Frame) -> np.ndarray:
        self.frames.append(frame)
        return np.zeros((1, 1, 3), np.uint8)

    def close(self) -> None:
        pass


def filmed(simulation, count, span):
    """The frames of a film."""
    view = Kept()
    film = FilmRecorder(view, (), count, span, stopwatch=lambda _: nullcontext())
    simulation.run(until=span, recorders=[film])
    film.finish(simulation)
    return view.frames


def arrows_of(frame, arrows):
    """The table of what is drawn: where each shaft begins and ends, [length], (arrows, 2, 3)."""
    look = Appearance(view_spec(PARALLEL, arrows=arrows))
    return look.segments(frame, Camera(PARALLEL, frame, aspect=1.0)), look


def test_arrows_end_at_x_plus_scale_times_a_at_the_times_of_the_pictures():
    scene = {**kepler(dt=0.05), "run": {"duration": 1}, "view": {"arrows": PULL}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        frames = filmed(simulation, 8, 1.0)  # at multiples of 1/7, between steps
        arrows = simulation.spec.view.arrows
    for frame in frames:
        apart = frame.position[1] - frame.position[0]
        pull = apart / np.linalg.norm(apart) ** 3
        exact = np.array([1e-3 * pull, -pull])
        segments, look = arrows_of(frame, arrows)
        shafts = segments.ends[:2]
        np.testing.assert_allclose(shafts[:, 0], frame.position, rtol=0, atol=0)
        np.testing.assert_allclose(shafts[:, 1], frame.position + 0.5 * exact, rtol=0, atol=1e-14)
        assert legend_lines(look.legend()) == ["arrows: acceleration × 0.5"]
    assert len({frame.time for frame in frames}) == 8


def test_a_force_is_the_mass_times_that_and_both_bodies_feel_the_same():
    scene = {**kepler(), "view": {"arrows": {"quantity": "force", "scale": 300}}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        (frame,) = filmed(simulation, 1, 1.0)
        ends = arrows_of(frame, simulation.spec.view.arrows)[0].ends[:2]
    force = 1e-3 / 0.7**2  # at the pericentre, G m M / r²
    np.testing.assert_allclose(ends[:, 1] - ends[:, 0], [[300 * force, 0, 0], [-300 * force, 0, 0]], rtol=1e-12, atol=1e-15)


def test_a_scale_that_fits_the_first_picture_stays_for_the_film():
    frame = frame_of([[0, 0, 0], [1, 0, 0]], 0.1, velocity=np.ones((2, 3)), mass=np.ones(2))
    frames = [replace(frame, acceleration=factor * np.array([[0, 3.0, 0], [0, 0, 0]])) for factor in (0.0, 1.0, 50.0)]
    look = Appearance(view_spec(PARALLEL, arrows=(ArrowsSpec(quantity="acceleration"),)))
    lengths = []
    for each in frames:
        ends = look.segments(each, Camera(PARALLEL, each, aspect=1.0)).ends
        lengths.append(np.linalg.norm(ends[0, 1] - ends[0, 0]) if len(ends) else 0.0)
    # 0.14 of a height of 4 over 3 is 0.187, and the nearest of 1, 2, 5 · 10ᵏ is 0.2; nothing is chosen while nothing acts.
    np.testing.assert_allclose(lengths, [0.0, 0.6, 30.0], rtol=1e-12)
    assert legend_lines(look.legend()) == ["arrows: acceleration × 0.2"]


@pytest.mark.parametrize("renderer", ["own", "ggui"])
@pytest.mark.sampled(3)
def test_arrows_are_in_the_picture_each_kind_in_its_colour(renderer, request):
    """A body at rest in the middle is pulled to the right, another moves upwards: 45 pixels a length."""
    if renderer == "ggui":
        from mpp_taichi.views import ggui_probe

        if problem := ggui_probe.probe(shown=False):
            pytest.skip(problem)
    scene = {
        "particles": [
            {"body": {"mass": 2, "position": [0, 0, 0], "radius": 1e-3}},
            {"body": {"mass": 1, "position": [-1, 0, 0], "velocity": [0, 1, 0], "radius": 1e-3, "free": False}},
        ],
        "forces": [{"uniform_gravity": {"acceleration": [1.5, 0, 0]}}],
        "integrator": {"leapfrog": {"dt": 0.1}},
    }
    shown = (
        ArrowsSpec(time=1.0, of=((1, 1),), color=(0.0, 0.0, 1.0), width=4.0),
        ArrowsSpec("acceleration", scale=1.0, color=(0.0, 1.0, 0.0), width=4.0),
        ArrowsSpec("force", scale=0.2, color=(1.0, 0.0, 0.0), width=4.0),
    )
    with Simulation(scene, backend="cpu", precision="f32") as simulation:
        frame = Frame.of(simulation.snapshot(), acceleration=simulation.accelerations())
        frame = replace(frame, velocity=np.array([[0, 0, 0], [0, 1.0, 0]]))
        view = open_offscreen(
            view_spec(PARALLEL, arrows=shown, minimum_pixels=0.0, legend=False), (180, 180), renderer=renderer
        )
        drawn = view.draw(frame).astype(int)
        view.close()
    _, green, blue = (drawn[:, :, k] - np.delete(drawn, k, axis=2).max(axis=2) > 100 for k in range(3))
    red = drawn[:, :, 0] > 100
    rows, columns = np.nonzero(green | red)
    # From 90 on over 1.5 lengths; the body that is held in place is not accelerated. A pixel for the edge, one for the width.
    assert abs(columns.max() - (90 + 1.5 * 45)) <= 2 and abs(columns.min() - 90) <= 2 and abs(rows.mean() - 90) <= 2
    assert abs(np.nonzero(red)[1].max() - (90 + 0.6 * 45)) <= 2, "the force: 0.2 · 2 · 1.5"
    rows, columns = np.nonzero(blue)
    assert abs(rows.min() - 45) <= 2 and abs(columns.mean() - 45) <= 2, "a velocity upwards"


def test_several_kinds_are_told_apart_in_the_legend():
    frame = frame_of([[0, 0, 0]], 0.1, velocity=np.ones((1, 3)), acceleration=np.ones((1, 3)), mass=np.ones(1))
    shown = (ArrowsSpec(time=0.3), ArrowsSpec("force", scale=2.0))
    _, look = arrows_of(frame, shown)
    assert legend_lines(look.legend()) == ["arrows: velocity × 0.3, force × 2"]
    (key,) = look.legend().entries
    assert not np.array_equal(key.colors[0], key.colors[1])


@pytest.mark.sampled(3)
def test_forces_are_asked_for_where_a_scene_draws_them_and_nowhere_else():
    for arrows, asked in (({}, False), ({"time": 0.3}, False), (PULL, True), ([{"time": 1}, PULL], True)):
        with Simulation({**kepler(), "view": {"arrows": arrows}}, backend="cpu", precision="f32") as simulation:
            frames = filmed(simulation.run(steps=1), 2, 0.1)
            assert picture(simulation, (64, 48)).shape == (48, 64, 3)
            assert ("acceleration_meter" in vars(simulation.phase)) == asked
            assert all((frame.acceleration is not None) == asked for frame in frames)


@pytest.mark.sampled(3)
def test_halves_side_by_side_have_their_own_forces(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = kepler(dt=0.05) | {"run": {"duration": 0.5}, "view": {"caption": False, "legend": False, "trails": 0}}
    scene["view"] |= {"camera": {"position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0]}, "arrows": PULL}
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    words = ["record", "a.yaml", "--still", "a.png", "--size", "400x300", "--fps", "4", "--duration", "1", "--quiet"]
    assert main([*words, "--beside", "forces=[]", "--set", "record.panels=none", "--backend", "cpu"]) == 0
    drawn = np.asarray(Image.open("a.png")).astype(int)[:240]
    orange = (drawn[:, :, 0] > 150) & (drawn[:, :, 2] < 110) & (drawn[:, :, 0] > drawn[:, :, 1] + 40)
    assert orange[:, :200].sum() > 50 and orange[:, 200:].sum() == 0, "without a force there is no arrow"


# What may be said


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("arrows", "fault"),
    [
        (
            "{quantity: acceleration, time: 2}",
            "7:42: view.arrows.time: is not for arrows of acceleration: their length is said by scale",
        ),
        ("{scale: 2}", "7:19: view.arrows.scale: is not for arrows of velocity: their length is said by time"),
        ("{quantity: acceleraton}", "7:22: view.arrows.quantity: 'acceleraton' is unknown, did you mean 'acceleration'?"),
        ("[{time: 1}, {quantity: force, scale: 0}]", "7:48: view.arrows[1].scale: 0 is not allowed, must be above 0"),
        ("[{time: 1}, {quantity: force, of: [mars]}]", "7:46: view.arrows[1].of[0]: no particle is called 'mars'"),
        ("{scal: 1}", "7:12: view.arrows.scal: unknown key 'scal', did you mean 'scale'?"),
        ("speed", "7:11: view.arrows: must be a mapping"),
    ],
)
def test_faulty_arrows_are_refused_at_their_place(tmp_path, arrows, fault):
    path = tmp_path / "a.yaml"
    text = "particles:\n  - body: {name: sun, mass: 1, position: [0, 0, 0]}\nforces: []\nintegrator: {leapfrog: {dt: 0.1}}\n"
    path.write_text(f"{text}run: {{duration: 1}}\nview:\n  arrows: {arrows}\n", encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert re.sub(r"^.*?a\.yaml:", "", str(caught.value)).startswith(fault), caught.value


def test_scenes_without_a_list_of_arrows_show_velocities_and_an_empty_list_shows_none():
    for said, found in (({}, ["velocity"]), (None, ["velocity"]), ({"time": 0.3}, ["velocity"]), ([], [])):
        assert [each.quantity for each in load_scene({**kepler(), "view": {"arrows": said}}).view.arrows] == found
    assert load_scene(kepler()).view.arrows == ()
