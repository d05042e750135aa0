"""Every force of the catalogue: gradient of its potential, third law, dissipation; a new file is tested by being there."""

from dataclasses import replace

import numpy as np
import pytest
from compiled import CompiledForces, build_force, random_snapshot, snapshot_of
from reference import accelerations

from mpp_taichi import backends, component
from mpp_taichi.snapshot import Springs

FORCES = component.names("forces")
STEP = 1e-5  # of the central difference: its error ~ STEP² U''' and the round-off ~ 1e-16 U / STEP balance near here


def family(name):
    return component.declaration("forces", name).base


@pytest.fixture(autouse=True)
def cpu():
    backends.start("cpu", "f64")


@pytest.mark.parametrize("name", FORCES)
@pytest.mark.parametrize("dimensions", [2, 3])
def test_force_is_minus_the_gradient_of_the_potential(name, dimensions):
    snapshot = random_snapshot(dimensions=dimensions)
    compiled = CompiledForces([build_force(name)], snapshot, dimensions=dimensions)
    rest = np.zeros_like(snapshot.velocity)
    force = snapshot.mass[:, None] * compiled.acceleration(snapshot.position, rest)
    gradient = np.zeros_like(force)
    for i in range(snapshot.particle_count):
        for k in range(dimensions):
            moved = snapshot.position.copy()
            moved[i, k] += STEP
            above = compiled.potential(moved, rest)
            moved[i, k] -= 2 * STEP
            gradient[i, k] = (above - compiled.potential(moved, rest)) / (2 * STEP)
    # Third derivatives of 1/r at the smallest distance here are below 1e3, so the difference formula errs by less than 1e-6.
    np.testing.assert_allclose(force, -gradient, atol=1e-6 * max(1.0, np.abs(force).max()))


@pytest.mark.parametrize("name", [name for name in FORCES if family(name) != "ExternalForce"])
def test_internal_forces_sum_to_zero(name):
    snapshot = random_snapshot(7)
    compiled = CompiledForces([build_force(name)], snapshot)
    force = snapshot.mass[:, None] * compiled.acceleration(snapshot.position, snapshot.velocity)
    assert np.abs(force).max() > 1e-3
    rounding = 7 * 2.0**-53 * np.abs(force).sum()
    assert np.abs(force.sum(0)).max() <= 4 * rounding


@pytest.mark.parametrize("name", [name for name in FORCES if family(name) != "ExternalForce"])
def test_internal_forces_exert_no_torque(name):
    snapshot = random_snapshot(7)
    compiled = CompiledForces([build_force(name)], snapshot)
    force = snapshot.mass[:, None] * compiled.acceleration(snapshot.position, snapshot.velocity)
    torque = np.cross(snapshot.position, force)
    assert np.abs(torque.sum(0)).max() <= 40 * 2.0**-53 * np.abs(torque).sum()


@pytest.mark.parametrize("name", FORCES)
def test_forces_that_depend_on_velocity_take_energy_out(name):
    force = build_force(name)
    snapshot = random_snapshot(6)
    compiled = CompiledForces([force], snapshot)
    acceleration = compiled.acceleration(snapshot.position, snapshot.velocity, parts="all")
    still = compiled.acceleration(snapshot.position, np.zeros_like(snapshot.velocity), parts="all")
    power = (snapshot.mass[:, None] * (acceleration - still) * snapshot.velocity).sum()
    if force.depends_on_velocity:
        assert power < -1e-3
        assert not force.conserves_energy
    else:
        assert np.array_equal(acceleration, still)


def test_gravity_matches_the_textbook_sum():
    snapshot = random_snapshot(9)
    gravity = component.build("forces", "newtonian_gravity", {"strength": 2.5, "softening": 0.05})
    expected = accelerations.gravity(snapshot.position, snapshot.mass, 2.5, 0.05)
    found = CompiledForces([gravity], snapshot).acceleration(snapshot.position, snapshot.velocity)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(expected).max())


def test_gravity_energy_is_that_of_the_softened_potential():
    snapshot = random_snapshot(9)
    gravity = component.build("forces", "newtonian_gravity", {"strength": 2.5, "softening": 0.3})
    expected = accelerations.gravity_energy(snapshot.position, snapshot.mass, 2.5, 0.3)
    found = CompiledForces([gravity], snapshot).potential(snapshot.position, snapshot.velocity)
    assert found == pytest.approx(expected, rel=1e-14)


def test_charges_of_one_sign_repel():
    snapshot = snapshot_of([[0, 0, 0], [1, 0, 0]], charge=[1.0, 1.0])
    found = CompiledForces([component.build("forces", "coulomb", {})], snapshot).acceleration()
    np.testing.assert_allclose(found, [[-1, 0, 0], [1, 0, 0]], atol=1e-15)


@pytest.mark.parametrize("full", [False, True])
def test_springs_match_the_textbook_sum(full):
    """At particles of 0 to 12 springs: sums run over four at a time and the rest singly."""
    count = 14
    between = np.array([(i, j) for i in range(count) for j in range(i) if i + j >= count], np.int32)
    random = np.random.default_rng(4)
    snapshot = random_snapshot(count)
    kinds = {key: random.uniform(0.5, 2.0, len(between)) for key in ("stiffness", "damping", "rest_length")}
    snapshot = replace(snapshot, springs=Springs(between=between, color=np.ones((len(between), 3)), **kinds))
    assert set(np.bincount(between.ravel(), minlength=count)) == set(range(count - 1))
    s = snapshot.springs
    spring = component.build("forces", "spring", {"damping": "full" if full else "axial"})
    expected = accelerations.springs(
        snapshot.position, snapshot.velocity, snapshot.mass, s.between, s.stiffness, s.damping, s.rest_length, full=full
    )
    found = CompiledForces([spring], snapshot).acceleration(snapshot.position, snapshot.velocity)
    np.testing.assert_allclose(found, expected, atol=1e-14 * np.abs(expected).max())


def test_a_stretched_spring_pulls_its_ends_together():
    """Equation 4 of the MPPhys paper, as printed, has the opposite sign."""
    snapshot = random_snapshot(2)
    spring = component.build("forces", "spring", {"damping": "none"})
    apart = snapshot.position + np.array([[-5.0, 0, 0], [5.0, 0, 0]])
    acceleration = CompiledForces([spring], snapshot).acceleration(apart, np.zeros_like(apart))
    assert (acceleration[0] @ (apart[1] - apart[0])) > 0


def test_axial_damping_leaves_rigid_rotation_alone_and_full_damping_does_not():
    snapshot = random_snapshot(4)
    center = snapshot.position.mean(0)
    turning = np.cross([0.3, -0.5, 1.0], snapshot.position - center)
    for mode, braked in (("axial", False), ("full", True)):
        spring = component.build("forces", "spring", {"damping": mode})
        damping = CompiledForces([spring], snapshot)
        change = damping.acceleration(snapshot.position, turning) - damping.acceleration(snapshot.position, 0 * turning)
        assert (np.abs(change).max() > 1e-2) == braked


def test_a_spring_between_coincident_ends_exerts_nothing():
    snapshot = random_snapshot(2)
    together = np.zeros((2, 3))
    spring = component.build("forces", "spring", {"damping": "none"})
    assert np.array_equal(CompiledForces([spring], snapshot).acceleration(together, together), np.zeros((2, 3)))


def test_massless_bodies_feel_gravity_and_exert_none():
    snapshot = random_snapshot(5)
    gravity = component.build("forces", "newtonian_gravity", {"strength": 1.0})
    alone = CompiledForces([gravity], snapshot).acceleration(snapshot.position, snapshot.velocity)
    extended = snapshot_of(np.vstack([snapshot.position, [[0.3, 0.2, 0.1]]]), mass=np.append(snapshot.mass, 0.0))
    together = CompiledForces([gravity], extended).acceleration()
    np.testing.assert_allclose(together[:5], alone, rtol=1e-15)
    assert np.abs(together[5]).max() > 0.1
