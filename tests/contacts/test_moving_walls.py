"""Walls of every shape that move: at a constant velocity, and as formulas of the time say."""

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation
from mpp_taichi.errors import MppError, PrecisionError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.sweep.structure import key_of
from mpp_taichi.views.wall_outline import outline_of

WALLS = {
    "plane": {"point": [0.0, -1.0, 0.0], "normal": [0.2, 1.0, 0.1]},
    "box": {"lower": [-1.0, -1.1, -0.9], "upper": [1.0, 1.0, 1.1]},
    "cylinder": {"point": [0.1, 0.0, 0.0], "axis": [0.1, 0.2, 1.0], "radius": 1.0},
    "sphere": {"center": [0.1, 0.0, 0.0], "radius": 1.0},
    "segment": {"from": [-1.0, -1.2, 0.0], "to": [1.0, -0.9, 0.0]},
    "polygon": {"points": [[-1.0, -0.9, 0.0], [0.9, -1.0, 0.0], [1.0, 1.0, 0.0], [-0.9, 0.8, 0.0]]},
}
OUTSIDE = {"sphere": {"center": [0.0, -1.3, 0.0], "radius": 0.7, "inside": False}}
SPEED = np.array([0.3, -0.2, 0.1])
PUSH = np.array([0.4, 0.8, -0.3])


def scene(wall, given, *, solver="swept", frame=(0.0, 0.0, 0.0), push=(0.0, 0.0, 0.0), dt=1e-3, steps=1500, **more):
    """Three spheres beside or in a wall, which may also be pushed by a uniform field."""
    balls = [
        {"body": {"position": place, "velocity": (np.array(speed) - frame).tolist(), "mass": 1 + k, "radius": 0.1}}
        for k, (place, speed) in enumerate(
            [([0.0, 0.1, 0.0], [0.5, -1.2, 0.3]), ([0.3, -0.3, 0.2], [-0.7, -0.9, 0.4]), ([-0.4, 0.2, -0.2], [0.2, -1.5, -0.6])]
        )
    ]
    contacts = {"hard_spheres": {"solver": solver, "restitution": 0.9}}
    found = {
        "particles": balls,
        "walls": [{wall: given | more}],
        "contacts": contacts,
        "forces": [{"uniform_gravity": {"acceleration": (-np.array(push)).tolist()}}] if any(push) else [],
        "run": {"duration": steps * dt},
    }
    return found if solver == "event_driven" else found | {"integrator": {"velocity_verlet": {"dt": dt}}}


def end_of(given, *, duration=1.5, **more):
    with Simulation(given, **({"backend": "cpu", "precision": "f64"} | more)) as simulation:
        simulation.run(duration=duration)
        return simulation.snapshot(), simulation.contact_report


CASES = [*WALLS.items(), *OUTSIDE.items()]


@pytest.mark.parametrize(("wall", "given"), CASES, ids=[*WALLS, "sphere from outside"])
@pytest.mark.parametrize("solver", ["event_driven", "swept", "simultaneous"])
def test_a_wall_at_a_constant_velocity_is_a_wall_at_rest_in_its_frame(wall, given, solver):
    moving, report = end_of(scene(wall, given, solver=solver, velocity=SPEED.tolist()))
    resting, same = end_of(scene(wall, given, solver=solver, frame=SPEED))
    assert report.wall_count == same.wall_count > 1
    # The same contacts, rounded in another way; each collision multiplies errors by some three.
    bound = 1e-9 if solver == "event_driven" else 1e-7
    assert np.abs(moving.position - (resting.position + 1.5 * SPEED)).max() < bound
    assert np.abs(moving.velocity - (resting.velocity + SPEED)).max() < bound


@pytest.mark.parametrize(("wall", "given"), CASES, ids=[*WALLS, "sphere from outside"])
@pytest.mark.parametrize("solver", ["swept", "pairwise"])
def test_a_motion_at_a_constant_rate_is_a_velocity(wall, given, solver):
    motion = [f"{v} * t" for v in SPEED]
    one, _ = end_of(scene(wall, given, solver=solver, motion=motion))
    other, report = end_of(scene(wall, given, solver=solver, velocity=SPEED.tolist()))
    assert report.wall_count > 1
    assert np.abs(one.position - other.position).max() < 1e-9


@pytest.mark.parametrize(("wall", "given"), CASES, ids=[*WALLS, "sphere from outside"])
def test_a_wall_that_speeds_up_is_a_wall_at_rest_in_a_field(wall, given):
    motion = [f"{a / 2} * t^2" for a in PUSH]
    errors = []
    for dt in (1e-3, 1.25e-4):
        pushed, report = end_of(scene(wall, given, dt=dt, motion=motion), duration=0.9)
        falling, same = end_of(scene(wall, given, dt=dt, push=PUSH), duration=0.9)
        assert report.wall_count == same.wall_count > 1
        errors.append(np.abs(pushed.position - (falling.position + 0.5 * PUSH * 0.81)).max())
    # Each bounce is wrong by the field over a part of a step, in one of the two scenes or in both.
    assert errors[1] < 1e-3 and errors[1] < errors[0] / 2.0


def test_a_ball_bounces_once_in_each_period_of_a_plate():
    gravity, bounce, amplitude, period = 9.81, 0.8, 0.04, 0.5
    rate = 2.0 * np.pi / period
    speed = gravity * period / 2.0
    phase = np.arccos((1.0 - bounce) / (1.0 + bounce) * speed / (amplitude * rate))
    height = 0.05 + amplitude * np.sin(phase)
    errors = []
    for dt in (1e-3, 1.25e-4):
        given = {
            "dimensions": 2,
            "particles": [{"body": {"mass": 1, "position": [0, height, 0], "velocity": [0, speed, 0], "radius": 0.05}}],
            "forces": [{"uniform_gravity": {"acceleration": [0, -gravity, 0]}}],
            "walls": [
                {
                    "plane": {
                        "point": [0, 0],
                        "normal": [0, 1],
                        "motion": ["0", f"{amplitude} * sin({rate} * t + {phase})"],
                        "restitution": bounce,
                    }
                }
            ],
            "contacts": {"hard_spheres": {"solver": "swept"}},
            "integrator": {"velocity_verlet": {"dt": dt}},
        }
        end, report = end_of(given, duration=5.25)
        assert report.wall_count == 10
        errors.append(abs(end.position[0, 1] - (height + speed**2 / (2.0 * gravity))))
    # A bounce within a step is kicked for a whole step, so that its speed is wrong by up to g h; ten bounces add up.
    assert errors[0] < 10.0 * speed * 1e-3 and errors[1] < 10.0 * speed * 1.25e-4


def test_the_bits_do_not_depend_on_cuts_and_pictures_follow_the_wall():
    given = scene("box", WALLS["box"], motion=["0.1*sin(5*t)", "0.05*t", "0"])
    with Simulation(given, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=900)
        whole = simulation.snapshot()
    with Simulation(given, backend="cpu", precision="f64", threads=1) as simulation:
        for steps in (1, 400, 499):
            simulation.run(steps=steps)
        cut = simulation.snapshot()
    assert np.array_equal(whole.position, cut.position)
    spec = load_scene(given)
    outline = outline_of(spec, assemble(spec).position)
    assert outline.at(0.7) - outline.at(0.0) == pytest.approx(
        np.broadcast_to([0.1 * np.sin(3.5), 0.035, 0.0], outline.at(0.0).shape)
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"motion": ["sin(t)", "0", "0"], "velocity": [1, 0, 0]}, "is beside a velocity, leave one of them out"),
        ({"motion": ["sin(u)", "0", "0"]}, r"motion\[0\]: .*u"),
        ({"motion": ["0", "1/(t - 1)", "0"]}, r"motion\[1\]: x is no finite number at t = 1"),
        ({"motion": ["0", "0"]}, "must be a list of 3 formulas"),
    ],
)
def test_motions_that_are_none_are_refused(given, message):
    with pytest.raises(SceneError, match=message):
        end_of(scene("box", WALLS["box"], steps=2000, **given))


@pytest.mark.parametrize("solver", ["simultaneous", "resting", "event_driven"])
def test_solvers_that_do_not_know_motions_are_named(solver):
    with pytest.raises(SceneError, match=f"goes with the solvers pairwise, swept, not {solver}"):
        end_of(scene("box", WALLS["box"], solver=solver, motion=["sin(t)", "0", "0"]))


def test_what_other_parts_cannot_do_is_refused():
    from mpp_taichi.accuracy.problem import pose

    shaken = scene("plane", WALLS["plane"], motion=["0", "0.1*sin(t)", "0"])
    with pytest.raises(PrecisionError, match="the motion of a wall calls sin, which vulkan has only in f32"):
        end_of(shaken, backend="vulkan", precision="f64")
    with pytest.raises(MppError, match="do not know the motion of this wall"):
        pose(load_scene(shaken))


def test_members_of_a_sweep_share_kernels_only_with_the_same_motion():
    def key(amplitude):
        spec = load_scene(scene("box", WALLS["box"], motion=["a*sin(t)", "0", "0"]) | {"constants": {"a": amplitude}})
        return key_of(spec, assemble(spec))

    assert key(0.1) == key(0.1) != key(0.2)


def test_vulkan_shakes_a_box_as_the_cpu_does():
    shaken = scene("box", WALLS["box"], dt=5e-3, motion=["0.1*sin(5*t)", "0", "0"])
    one, _ = end_of(shaken, duration=0.5, precision="f32")
    other, _ = end_of(shaken, duration=0.5, precision="f32", backend="vulkan")
    assert np.abs(one.position - other.position).max() < 1e-4
