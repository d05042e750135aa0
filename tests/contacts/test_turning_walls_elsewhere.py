"""Walls that turn in pictures, saved runs, sweeps, other precisions and on Vulkan, and scenes that are refused."""

import numpy as np
import pytest
from turned_walls import AXIS, FRICTION, SHIFT, WALLS, Reference, end_of, scene

import mpp_taichi
from mpp_taichi import SceneError, Simulation
from mpp_taichi.errors import MppError, PrecisionError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.sweep.structure import key_of
from mpp_taichi.views.wall_outline import outline_of


def test_bits_do_not_depend_on_threads_on_cuts_and_on_saved_states(tmp_path):
    given = scene("polygon", flat=True, motion=SHIFT[:2], friction=FRICTION)
    rng = np.random.default_rng(3)
    given["particles"] = [
        {"body": {"mass": 1, "position": [x, y], "velocity": rng.normal(0.0, 1.0, 2).tolist(), "radius": 0.015}}
        for x in np.linspace(-0.6, 0.6, 19)
        for y in np.linspace(-0.6, 0.6, 19)
    ]
    with Simulation(given, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=300)
        whole = simulation.snapshot()
    with Simulation(given, backend="cpu", precision="f64", threads=1) as simulation:
        simulation.checkpoint(tmp_path / "cut.run", every=1000.0)
        for steps in (1, 150):
            simulation.run(steps=steps)
    with mpp_taichi.resume(tmp_path / "cut.run") as simulation:
        simulation.run(steps=149)
        cut = simulation.snapshot()
    assert np.array_equal(whole.position, cut.position) and np.array_equal(whole.velocity, cut.velocity)


def test_pictures_follow_a_wall_that_turns():
    spec = load_scene(scene("polygon", motion=SHIFT))
    outline = outline_of(spec, assemble(spec).position)
    reference = Reference("polygon", flat=False)
    expected = [[reference.from_wall(point, 0.7) for point in edge] for edge in outline.segments]
    assert outline.at(0.7) == pytest.approx(np.array(expected))
    drum = load_scene(
        scene("cylinder", flat=True, turning={"angle": "t", "about": WALLS["cylinder"]["point"][:2]}, friction=FRICTION)
    )
    outline = outline_of(drum, assemble(drum).position)
    assert np.abs(outline.at(0.1) - outline.at(0.0)).max() > 0.05, "the marks of a circle show that it turns"


@pytest.mark.parametrize(
    ("wall", "given", "message"),
    [
        ("polygon", {"turning": {"angle": "sin(u)"}}, r"turning.angle: .*u"),
        ("polygon", {"turning": {"angle": "1/(t - 1)"}}, "turning.angle: the angle is no finite number at t = 1"),
        ("polygon", {"turning": {"about": [0, 0, 0]}}, "needs an angle, a formula of the time t"),
        ("polygon", {"turning": {"angle": "t", "point": [0, 0, 0]}}, "turning.point: 'point' is unknown"),
        ("polygon", {"turning": "t"}, "must be a mapping with the keys angle, about and axis, not 't'"),
        ("polygon", {"turning": {"angle": "t", "axis": [1, 0, 0]}}, "strip along z: only axis"),
        ("plane", {"turning": {"angle": "t", "axis": [0, 0, 0]}}, r"turning.axis: must not be \[0, 0, 0\]"),
        ("sphere", {"turning": {"angle": "t", "about": [0.1, 0, 0]}}, "looks the same from the axis about which it turns"),
        ("sphere", {"friction": 0.1, "temperature": 1.0}, "a friction beside a temperature"),
        ("polygon", {"velocity": [1, 0, 0], "motion": ["t", "0", "0"]}, "is beside a velocity"),
        ("polygon", {"turning": {"angle": "sin(2000*t)"}}, "leaves its parabola by .* in the step of 0.001 at t = "),
    ],
)
def test_turnings_that_are_none_are_refused(wall, given, message):
    with pytest.raises(SceneError, match=message):
        end_of(scene(wall, steps=2000, **given))


def test_a_turning_in_the_plane_has_no_axis():
    with pytest.raises(SceneError, match="turning.axis: is not needed in a scene of dimensions: 2"):
        end_of(scene("polygon", flat=True, turning={"angle": "t", "axis": [0, 0, 1]}))


def test_pairwise_refuses_walls_that_jump_over_spheres():
    with pytest.raises(SceneError, match="moves by .* in the step of 0.001 at t = 0, more than 0.1, .*or solver: swept"):
        end_of(scene("polygon", flat=True, solver="pairwise", turning={"angle": "200*t"}))


@pytest.mark.parametrize("solver", ["simultaneous", "resting", "event_driven", "merging"])
def test_solvers_that_do_not_know_turnings_and_friction_are_named(solver):
    given = scene("polygon", flat=True, solver=solver, friction=FRICTION)
    given["contacts"]["hard_spheres"] = {"solver": solver}
    if solver == "event_driven":
        del given["integrator"]
    with pytest.raises(SceneError, match=f"turning: goes with the solvers pairwise, swept, not {solver}") as error:
        end_of(given)
    assert f"friction: goes with the solvers pairwise, swept, not {solver}" in str(error.value)


def test_what_does_not_know_turnings_is_refused():
    from mpp_taichi.accuracy.problem import pose

    turned, rough = scene("plane", turning={"angle": "t"}), scene("plane", turning=None, friction=FRICTION)
    with pytest.raises(PrecisionError, match="the motion of a wall calls sin, which vulkan has only in f32"):
        end_of(turned, backend="vulkan", precision="f64")
    for given, what in ((turned, "motion"), (rough, "friction")):
        with pytest.raises(MppError, match=f"do not know the {what} of this wall"):
            pose(load_scene(given))


def test_members_of_a_sweep_share_kernels_only_with_the_same_turning():
    def key(rate):
        given = scene("polygon", flat=True, turning={"angle": "w*t"}) | {"constants": {"w": rate}}
        spec = load_scene(given)
        return key_of(spec, assemble(spec))

    assert key(0.1) == key(0.1) != key(0.2)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("kind", "flat"), [("polygon", True), ("cylinder", False), ("box", False)])
def test_single_precision_and_vulkan_turn_a_wall_as_double_precision_does(kind, flat):
    given = scene(kind, flat=flat, dt=5e-3, motion=SHIFT[: 2 if flat else 3], friction=FRICTION, axis=AXIS)
    double, report = end_of(given, duration=1.0)
    assert report.wall_count > 0
    for backend in ("cpu", "vulkan"):
        single, _ = end_of(given, duration=1.0, precision="f32", backend=backend)
        assert np.abs(single.position - double.position).max() < 1e-4  # rounding of 200 steps and two bounces


def test_walls_that_move_and_rub_are_told():
    from mpp_taichi.cli._explained_walls import walls_told

    given = scene("polygon", flat=True, motion=SHIFT[:2], friction=FRICTION)
    given["walls"] *= 2
    given["walls"].append({"plane": {"point": [0, -5], "normal": [0, 1]}})
    told = walls_told(load_scene(given))
    assert told == [f"2 polygon: motion [{', '.join(SHIFT[:2])}], turning by 0.3 + 0.8*t + 0.2*sin(2*t), friction 0.2"]


def test_a_start_is_looked_at_where_the_wall_is():
    reference = Reference("segment", flat=True, shifts=False)
    there = reference.from_wall(np.array([0.3, -0.42, 0.0]), 0.0)
    with pytest.raises(SceneError, match=r"reaches 0.1 into walls\[0\].segment"):
        end_of(scene("segment", flat=True, x=there, v=(0.0, 0.0, 0.0)))
    free = np.array([-0.5, -0.5, 0.0])  # an end of the segment at the angle 0
    assert reference.gap_on(free, np.zeros(3), 0.0, 0.0) > 0.05
    end_of(scene("segment", flat=True, x=free, v=(0.0, 0.0, 0.0), steps=1), duration=1e-3)
