"""Positions in `expect:` blocks, computed again by SciPy and Newton's method, and their change by one per cent of a force."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from reference import rigid_pendulum, truss
from reference.spring_motion import motion

from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

SCENES = Path(__file__).parents[2] / "scenes"
UNCHANGED = {"gravity": 1.0, "drag": 1.0, "springs": 1.0}
DIGITS = 0.05  # of the tolerance, for the digits that a scene gives
NOTICED = 3.0  # tolerances that one per cent of a force moves the place by at least


@cache
def start_of(name):
    spec = load_scene(SCENES / f"{name}.yaml")
    return spec, assemble(spec)


def expected(name, quantity, number=0):
    """The value that the scene names, and the tolerance in f32, the wider one [length]."""
    spec, _ = start_of(name)
    each = [one for one in spec.expect if one.quantity == quantity][number]
    return each.near, each.within["f32"] * abs(each.near)


def forces_of(name):
    """Gravity and drag of the scene."""
    forces = {force.name: force.parameters for force in start_of(name)[0].forces}
    drag = forces["linear_drag"]["coefficient"] if "linear_drag" in forces else 0.0
    return np.array(forces["uniform_gravity"]["acceleration"]), drag


def path(name, times, changes):
    """Places at the times, (T, N, 3), with forces so many times as strong."""
    gravity, drag = forces_of(name)
    by = UNCHANGED | changes
    return motion(
        start_of(name)[1], gravity=gravity * by["gravity"], drag=drag * by["drag"], stiffness=by["springs"], times=times
    )[0]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "name, particle, axis, at, noticed",
    [
        ("cloth", 0, 1, 0.8, ("gravity", "drag", "springs")),
        ("rope", 30, 0, 0.7, ("gravity", "springs")),
        ("cantilever_loose", 5, 2, 3.2, ("gravity", "springs")),
        ("membrane_release", 27, 2, 1.0, ("gravity", "drag")),
    ],
)
def test_a_place_on_the_way_is_that_of_the_equations_and_one_per_cent_of_a_force_moves_it(name, particle, axis, at, noticed):
    near, tolerance = expected(name, "position")
    place = path(name, [at], {})[0, particle, axis]
    assert near == pytest.approx(place, abs=DIGITS * tolerance)
    for force in noticed:
        assert abs(path(name, [at], {force: 1.01})[0, particle, axis] - place) > NOTICED * tolerance, force


@pytest.mark.parametrize("name, last", [("cantilever", 10.0), ("cantilever_loose", 2.0)])
def test_the_lowest_place_is_that_of_the_equations(name, last):
    near, tolerance = expected(name, "lowest_position")
    lowest = path(name, np.arange(0.0, last, 1e-3), {})[:, 5, 2].min()
    # Between times h = 1e-3 apart a minimum is at most a h²/8 lower, the acceleration a below 40.
    assert near == pytest.approx(lowest, abs=40e-6 / 8.0 + DIGITS * tolerance)


def test_pendulums_end_where_the_equations_put_them():
    near, tolerance = expected("double_pendulum", "end_position")
    assert near == pytest.approx(path("double_pendulum", [20.0], {})[0, 2, 0], abs=DIGITS * tolerance)
    near, tolerance = expected("stiff_pendulum", "end_position")
    _, start = start_of("stiff_pendulum")
    gravity = forces_of("stiff_pendulum")[0][[0, 2]]
    first, second = start.position[1:, [0, 2]]
    ends = [
        rigid_pendulum.end_positions(first, second, soft, by * gravity, 20.0)[1, 0]
        for soft, by in ((5, 1), (5.05, 1), (5, 1.01))
    ]
    assert near == pytest.approx(ends[0], abs=DIGITS * tolerance)
    assert min(abs(ends[1] - ends[0]), abs(ends[2] - ends[0])) > NOTICED * tolerance


@pytest.mark.parametrize(
    "name, quantity, number, particle", [("membrane_release", "position", 1, 27), ("cloth", "end_position", 0, 0)]
)
def test_what_comes_to_rest_does_so_where_newtons_method_puts_it(name, quantity, number, particle):
    near, tolerance = expected(name, quantity, number)
    _, start = start_of(name)
    gravity, _ = forces_of(name)
    s, load = start.springs, start.mass[:, None] * gravity
    # Newton's method begins where four times the mass per time of drag has all but brought it: a cloth, to its folds.
    begin = motion(start, gravity=gravity, drag=4.0 * start.mass[0], times=[6.0], tolerance=1e-6)[0][0]
    shape = truss.static_shape(begin, s.between, s.stiffness, s.rest_length, load, start.free)
    assert near == pytest.approx(shape[particle, 2], abs=DIGITS * tolerance)
