"""Time of contact with walls, against a search along the flight in NumPy."""

import numpy as np
import pytest
from first_contacts import assert_first_contacts

from mpp_taichi.device import backends
from mpp_taichi.walls._base import Surface

RADIUS, COUNT, END = 0.1, 200, 4.0
PLANE = Surface("plane", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.0, True, (0.0, 0.3, 0.0), 1.0, "plane")
CYLINDER = Surface("cylinder", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2.0, True, (0.1, 0.0, 0.0), 1.0, "cylinder")
SPHERE = Surface("sphere", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, False, (0.1, 0.0, 0.0), 1.0, "sphere")


def gap(surface, x, time):
    """Of a sphere to the surface."""
    q = x - np.multiply.outer(time, surface.velocity)
    if surface.kind == "plane":
        return q[..., 1] - RADIUS
    if surface.kind == "cylinder":
        return 2.0 - RADIUS - np.hypot(q[..., 0], q[..., 1])
    return np.linalg.norm(q, axis=-1) - 1.0 - RADIUS


def outside(rng, surface):
    """Places that do not touch the surface at time 0."""
    x = rng.uniform(-1, 1, (COUNT, 3))
    if surface.kind == "plane":
        x[:, 1] += 1.2
    if surface.kind == "sphere":
        x *= (rng.uniform(1.15, 3.0, COUNT) / np.linalg.norm(x, axis=1))[:, None]
    return x


@pytest.mark.parametrize("surface", [PLANE, CYLINDER, SPHERE], ids=lambda surface: surface.kind)
@pytest.mark.sampled(3)
def test_the_first_contact_is_found_in_straight_and_in_falling_flight(surface):
    """No contact in steps of 2e-3 is earlier, and at the time found the gap is 0."""
    backends.start("cpu", "f64")
    import taichi as ti

    from mpp_taichi.walls._geometry import time_of_contact, time_of_contact_falling

    rng = np.random.default_rng(1)
    x, v, a = outside(rng, surface), rng.normal(size=(COUNT, 3)), rng.normal(size=(COUNT, 3))
    places, speeds, falls = (ti.Vector.field(3, float, COUNT) for _ in range(3))
    found = ti.field(float, (2, COUNT))
    for field, values in ((places, x), (speeds, v), (falls, a)):
        field.from_numpy(values)

    @ti.kernel
    def fill():
        for i in range(COUNT):
            found[0, i] = time_of_contact(surface, places[i], speeds[i], RADIUS, 0.0, END)
            found[1, i] = time_of_contact_falling(surface, places[i], speeds[i], falls[i], RADIUS, 0.0, END)

    fill()
    # Terms up to |a| s² / 2 < 40 are added; a shallow contact has no more digits in its gap than they have.
    allowed = 40 * 8 * 2.0**-52
    assert_first_contacts(found.to_numpy(), (x, v, a), END, lambda places, times: gap(surface, places, times), allowed)


def test_what_overlaps_meets_now_if_it_approaches_and_not_while_it_recedes():
    """Also in flight that turns back: a sphere below the floor rises, falls, and meets it where the gap is 0, or as before."""
    backends.start("cpu", "f64")
    import taichi as ti

    from mpp_taichi.walls._geometry import time_of_contact, time_of_contact_falling

    floor = Surface("plane", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.0, True, (0.0, 0.0, 0.0), 1.0, "floor")
    found = ti.field(float, 6)

    @ti.kernel
    def fill():
        low, up, down = ti.Vector([0.0, 0.08]), ti.Vector([0.0, 1.0]), ti.Vector([0.0, -1.0])
        g = ti.Vector([0.0, -2.0])
        found[0] = time_of_contact(floor, low, down, RADIUS, 0.0, 10.0)
        found[1] = time_of_contact(floor, low, up, RADIUS, 0.0, 10.0)
        found[2] = time_of_contact_falling(floor, low, up, g, RADIUS, 0.0, 10.0)
        found[3] = time_of_contact_falling(floor, low, up * 0.1, g, RADIUS, 0.0, 10.0)
        found[4] = time_of_contact(SPHERE, ti.Vector([1.05, 0.0, 0.0]), ti.Vector([0.0, 0.5, 0.0]), RADIUS, 0.0, 10.0)
        found[5] = time_of_contact(SPHERE, ti.Vector([1.05, 0.0, 0.0]), ti.Vector([1.0, 0.5, 0.0]), RADIUS, 0.0, 10.0)

    fill()
    # −0.02 + s − s² = 0 at its later root; with a tenth of the speed the top is still below, and it is back at 0.1.
    later = (1 + np.sqrt(1 - 0.08)) / 2
    # The second sphere's surface moves at 0.1: towards the first one, and slower than the last one.
    assert np.allclose(found.to_numpy(), [0.0, np.inf, later, 0.1, 0.0, np.inf], rtol=4e-16, atol=0)


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
@pytest.mark.sampled(3)
def test_normals_of_curved_walls_are_of_unit_length_and_across_the_axis_however_far_away(kind, inside):
    """Along the axis up to 10⁶ radii away. A normal is rounded by some four units of 2⁻⁵³: see the bounds."""
    backends.start("cpu", "f64")
    import taichi as ti

    from mpp_taichi.walls._base import unit_vector
    from mpp_taichi.walls._geometry import normal

    axis = unit_vector((0.3, -0.5, 0.81), "axis")
    surface = Surface(kind, (0.1, 0.2, 0.3), axis, 1.0, inside, (0.0, 0.0, 0.0), 1.0, kind)
    rng = np.random.default_rng(4)
    across = np.cross(rng.normal(size=(COUNT, 3)), axis)
    across /= np.linalg.norm(across, axis=1)[:, None]
    far = rng.uniform(-1e6, 1e6, COUNT) if kind == "cylinder" else np.zeros(COUNT)
    x = np.array(surface.point) + across + np.outer(far, axis)
    places, found = ti.Vector.field(3, float, COUNT), ti.Vector.field(3, float, COUNT)
    places.from_numpy(x)

    @ti.kernel
    def fill():
        for i in range(COUNT):
            found[i] = normal(surface, places[i], 0.0)

    fill()
    n = found.to_numpy().astype(np.longdouble)
    # The norm is rounded by at most 1 + 3/2 units (root, and half of the errors of squares and sums), the quotient by 1.
    assert np.abs(np.linalg.norm(n, axis=1) - 1).max() < 4 * 2.0**-53
    if kind == "cylinder":
        # Five roundings of a·q, one of q, two of the quotient, each of at most 2⁻⁵³ of a length that is at most 1.
        assert np.abs(n @ np.array(axis, np.longdouble)).max() < 8 * 2.0**-53
    sign = -1 if inside else 1
    assert np.abs(sign * n - across).max() < 8 * 2.0**-53 * (1 + np.abs(x).max())
