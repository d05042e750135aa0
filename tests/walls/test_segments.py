"""Segments: time of contact against a search along the flight in NumPy, which place can hold a sphere, and what is refused."""

import numpy as np
import pytest
from first_contacts import assert_first_contacts

import mpp_taichi as mpp
from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.errors import SceneError
from mpp_taichi.start.overlaps import surface_depth
from mpp_taichi.walls._base import Enclosure, joined, segment

COUNT, END, MOVING = 300, 4.0, (0.2, -0.1, 0.0)


def side(begin, end, *, velocity=(0.0, 0.0, 0.0), restitution=1.0, label="side"):
    """A segment."""
    return segment((*begin, 0.0), (*end, 0.0), velocity=velocity, restitution=restitution, label=label)


def gap(wall, x, radius, time):
    """Distance of spheres to a segment, by its nearest point."""
    depth, _ = surface_depth(wall, x.reshape(-1, 3), np.full(x[..., 0].size, radius), np.ravel(time)[:, None])
    return -depth.reshape(x.shape[:-1])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("radius", [0.1, 0.6])
def test_the_first_contact_is_found_in_straight_and_in_falling_flight(dimensions, radius):
    """No contact in steps of 2e-3 is earlier, and at the time found the gap is 0. With a large radius most hit an end."""
    backends.start("cpu", "f64")
    import taichi as ti

    from mpp_taichi.walls._surfaces import WallSurfaces

    wall = side((-0.4, -0.3), (0.5, 0.2), velocity=MOVING)
    walls = WallSurfaces(Enclosure((wall,)))
    rng = np.random.default_rng(2)
    x = rng.uniform(-3, 3, (8 * COUNT, 3)) * (np.arange(3) < dimensions)
    x = x[gap(wall, x, radius, np.zeros(len(x))) > 0][:COUNT]
    # A weak fall, so that many flights turn and come back, some of them around an end to the other side.
    v, a = (rng.normal(size=(COUNT, 3)) * (np.arange(3) < dimensions) for _ in range(2))
    places, speeds, falls = (ti.Vector.field(dimensions, float, COUNT) for _ in range(3))
    found = ti.field(float, (2, COUNT))
    for field, values in ((places, x), (speeds, v), (falls, a)):
        field.from_numpy(np.ascontiguousarray(values[:, :dimensions]))

    @ti.kernel
    def fill():
        for i in range(COUNT):
            for g in range(walls.segment_count):
                found[0, i] = walls.time_of_contact(g, places[i], speeds[i], radius, 0.0, END)
                found[1, i] = walls.time_of_contact_falling(g, places[i], speeds[i], falls[i], radius, 0.0, END)

    with quick_compilation():
        fill()
    # As in test_wall_geometry.py; a graze has half the digits in its time and all of them in its gap.
    allowed = 40 * 8 * 2.0**-53
    assert_first_contacts(found.to_numpy(), (x, v, a), END, lambda places, times: gap(wall, places, radius, times), allowed)


@pytest.mark.sampled(3)
def test_what_overlaps_meets_now_if_it_approaches_and_not_while_it_recedes():
    """On both sides and at an end, in straight flight, and in flight that turns back before or after it has left."""
    backends.start("cpu", "f64")
    import taichi as ti

    from mpp_taichi.walls._surfaces import WallSurfaces

    walls = WallSurfaces(Enclosure((side((-1, 0), (1, 0)),)))
    cases = [
        ((0.0, 0.08), (0.3, -1.0), 0.0, 0.0),
        ((0.0, -0.08), (0.3, 1.0), 0.0, 0.0),
        ((0.0, 0.08), (0.3, 1.0), 0.0, np.inf),
        ((0.0, -0.08), (0.3, -1.0), 0.0, np.inf),
        ((1.05, 0.0), (-1.0, 0.2), 0.0, 0.0),
        ((1.05, 0.0), (1.0, 0.2), 0.0, np.inf),
        # 0.08 + s − s² = 0.1 at its later root; with a tenth of the speed the top is still below, and 0.08 comes back at 0.1.
        ((0.0, 0.08), (0.0, 1.0), -2.0, (1 + np.sqrt(1 - 0.08)) / 2),
        ((0.0, 0.08), (0.0, 0.1), -2.0, 0.1),
        # Thrown up beside the end, it comes down on the wall; falling past it, it comes up from below: 1 − 3 s + s² = −0.1.
        ((-1.5, 0.05), (1.0, 1.0), -2.0, (1 + np.sqrt(1 - 4 * 0.05)) / 2),
        ((-1.5, 1.0), (0.6, -3.0), 2.0, (3 + np.sqrt(9 - 4.4)) / 2),
    ]
    count = len(cases)
    found, table = ti.field(float, count), ti.Vector.field(5, float, count)
    table.from_numpy(np.array([(*x, *v, a) for x, v, a, _ in cases]))

    @ti.kernel
    def fill():
        for k in range(count):
            x, v = ti.Vector([table[k][0], table[k][1]]), ti.Vector([table[k][2], table[k][3]])
            if table[k][4] == 0.0:
                found[k] = walls.time_of_contact(k * 0, x, v, 0.1, 0.0, 10.0)
            else:
                found[k] = walls.time_of_contact_falling(k * 0, x, v, ti.Vector([0.0, table[k][4]]), 0.1, 0.0, 10.0)

    with quick_compilation():
        fill()
    assert np.allclose(found.to_numpy(), [time for *_, time in cases], rtol=8e-16, atol=0)


def test_a_flight_meets_what_it_would_meet_without_the_other_segments_of_a_joint():
    """Two segments that meet in the middle of a straight wall do the same as the whole wall, at the joint and beside it."""
    backends.start("cpu", "f64")
    import taichi as ti

    from mpp_taichi.walls._surfaces import WallSurfaces

    whole = WallSurfaces(Enclosure((side((-1, -1), (1, 1)),)))
    halves = WallSurfaces(Enclosure((side((-1, -1), (0, 0)), side((0, 0), (1, 1)))))
    rng = np.random.default_rng(3)
    x = np.array([-0.5, 0.5]) + 1e-3 * rng.normal(size=(COUNT, 2))
    places, found = ti.Vector.field(2, float, COUNT), ti.Vector.field(3, float, (2, COUNT))
    places.from_numpy(x)

    @ti.kernel
    def fill():
        for i in range(COUNT):
            v = ti.Vector([0.7, -0.6])
            for k, walls in ti.static(enumerate((whole, halves))):
                best, n = ti.math.inf, ti.Vector([0.0, 0.0])
                for g in range(walls.segment_count):
                    s = walls.time_of_contact(g, places[i], v, 0.1, 0.0, 10.0)
                    if s < best:
                        best, n = s, walls.normal(g, places[i] + s * v, s)
                found[k, i] = ti.Vector([best, n[0], n[1]])

    with quick_compilation():
        fill()
    one, two = found.to_numpy()
    # Half way along the wall a circle of radius r around the joint lies below the line by x²/2r, so that a side rounded to the
    # other one's part is met later by rounding alone.
    assert np.abs(one - two).max() < 1e-14


def test_a_sphere_beside_a_corner_is_borne_by_the_half_planes_of_the_region_that_is_open_to_it():
    """At a flat or a pointed corner one segment bears it, in a hollow both do, and the point itself counts once."""
    backends.start("cpu", "f64")
    import taichi as ti

    from mpp_taichi.walls._surfaces import WallSurfaces

    line, roof = [(-1, 0), (0, 0), (1, 0)], [(2, 0), (3, 0.1), (4, 0), (5, 0.1)]
    sides = [side(begin, end) for corners in (line, roof) for begin, end in zip(corners, corners[1:])]
    walls = WallSurfaces(joined([Enclosure(tuple(sides))]))
    r = 0.1
    places = np.array([(-0.02, r), (0.02, r), (3.0, 0.1 + r), (3.9999, 0.0001 * 0.1 + r), (3.0, 0.1 - r * 1.01)])
    table, found = ti.Vector.field(2, float, len(places)), ti.Vector.field(3, float, (len(places), walls.segment_count))
    table.from_numpy(places)

    @ti.kernel
    def fill():
        for i, g in found:
            gap, n = walls.support(g, table[i], r, 0.0)
            found[i, g] = ti.Vector([gap, n[0], n[1]])

    with quick_compilation():
        fill()
    support = found.to_numpy()
    bearing = support[:, :, 0] < 0.1
    assert bearing.tolist() == [
        [True, False, False, False, False],
        [False, True, False, False, False],
        [False, False, True, False, False],  # before the point of a roof
        [False, False, False, True, True],  # beside a hollow
        [False, False, True, True, False],  # under the roof
    ]
    # In the hollow the gap is that of the line of the other segment, −0.1 x across it, whose normal leans back.
    slope = np.hypot(1, 0.1)
    assert support[3, 4, 1:] == pytest.approx([-0.1 / slope, 1 / slope], abs=1e-15)
    assert support[3, 4, 0] == pytest.approx((r + 1e-5 + 1e-5) / slope - r, abs=1e-15)


SCENE = {
    "title": "A ball",
    "dimensions": 2,
    "particles": [{"body": {"name": "ball", "mass": 1.0, "radius": 0.1, "position": [0, 0.5], "velocity": [0, -1]}}],
    "contacts": {"hard_spheres": {"solver": "event_driven"}},
    "run": {"duration": 1},
}


def refusal(walls, **changes):
    """The message for a scene with these walls."""
    from mpp_taichi.start.assemble import assemble

    with pytest.raises(SceneError) as caught:
        assemble(mpp.load_scene({**SCENE, **changes, "walls": walls}))
    return str(caught.value)


def test_walls_that_are_no_walls_and_starts_in_a_wall_are_refused_by_name():
    """Each message names the wall and what is wrong."""
    assert "walls[0].segment: begins and ends at one place, [1, 2]" in refusal([{"segment": {"from": [1, 2], "to": [1, 2]}}])
    corners = [[0, 0], [1, 0], [1, 0], [0, 1]]
    assert "walls[0].polygon: side 1 begins and ends at one place, [1, 0]" in refusal([{"polygon": {"points": corners}}])
    assert "has 2 points, a closed polygon needs 3 at least" in refusal([{"polygon": {"points": corners[:2]}}])
    assert "has 1 points, an open line needs 2 at least" in refusal([{"polygon": {"points": corners[:1], "closed": False}}])
    assert "must be a list of points" in refusal([{"polygon": {"points": 3}}])
    assert "points[1]" in refusal([{"polygon": {"points": [[0, 0], [1, "x"], [0, 1]]}}])
    line = {"segment": {"from": [-1, 0.45], "to": [1, 0.45]}}
    assert "particle 0 (ball) reaches 0.05 into walls[0].segment" in refusal([line])
    roof = {"polygon": {"points": [[-1, -1], [0, 0.45], [1, -1]], "closed": False}}
    assert "reaches 0.05 into walls[0].polygon, side 0" in refusal([roof])
    period = {"periodic_box": {"lower": [-2, -2], "upper": [2, 2]}}
    assert "segments and polygons have no copies in a periodic_box" in refusal([line, period])
    point = [{"body": {"mass": 1.0, "position": [0, 0.5]}}]
    assert "has no radius, and walls[0].segment has particles on both sides" in refusal([line], particles=point)
