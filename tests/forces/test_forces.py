"""Every force of the package: gradient of its potential, third law, dissipation; a new file is tested automatically."""

from dataclasses import replace

import numpy as np
import pytest
import taichi as ti
from compiled import TIME, CompiledForces, build_force, random_snapshot, snapshot_of
from reference import accelerations

from mpp_taichi import Simulation, component
from mpp_taichi.device import backends
from mpp_taichi.errors import PrecisionError
from mpp_taichi.forces._base import PairForce
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.snapshot import Springs
from scenes import kepler

FORCES = component.names("forces")
# Their energy depends on velocities, or they act at rest without a potential; both have files of tests of their own.
OF_MOTION = ("einstein_infeld_hoffmann", "mutual_tides")
OTHERS = [name for name in FORCES if name not in OF_MOTION]
STEP = 1e-5  # of the central difference: its error ~ STEP² U''' and the round-off ~ 1e-16 U / STEP balance near here


def family(name):
    return component.declaration("forces", name).base


def test_every_force_between_pairs_is_known_as_such_without_taichi():
    """Plans and estimates read the class of a force from its file; a family that they do not know would count as O(N)."""
    for name in FORCES:
        assert is_pair_force(name) == issubclass(component.load("forces", name), PairForce), name


@pytest.fixture(autouse=True)
def cpu():
    backends.start("cpu", "f64")


IN_SPACE = [(name, 3) for name in OTHERS]
IN_PLANE = [(name, 2) for name in OTHERS if not component.flag("forces", name, "twists")]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("name", "dimensions"), IN_PLANE + IN_SPACE)
def test_force_is_minus_the_gradient_of_the_potential(name, dimensions):
    snapshot = random_snapshot(dimensions=dimensions)
    compiled = CompiledForces([build_force(name, dimensions)], snapshot, dimensions=dimensions)
    rest = np.zeros_like(snapshot.velocity)
    force = snapshot.mass[:, None] * compiled.acceleration(snapshot.position, rest)
    (tried,) = compiled.total_force.forces
    if not tried.conserves_energy and (family(name) == "FormulaField" or not tried.depends_on_velocity):
        force *= 0.0  # it has no potential, and must not pretend to one
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


@pytest.mark.parametrize("name", [name for name in FORCES if family(name) not in ("ExternalForce", "FormulaField")])
@pytest.mark.sampled(3)
def test_internal_forces_sum_to_zero(name):
    snapshot = random_snapshot(7)
    compiled = CompiledForces([build_force(name)], snapshot)
    force = snapshot.mass[:, None] * compiled.acceleration(snapshot.position, snapshot.velocity)
    assert np.abs(force).max() > 1e-3
    rounding = 7 * 2.0**-53 * np.abs(force).sum()
    assert np.abs(force.sum(0)).max() <= 4 * rounding


@pytest.mark.parametrize("name", [name for name in FORCES if family(name) not in ("ExternalForce", "FormulaField")])
def test_internal_forces_exert_no_torque(name):
    snapshot = random_snapshot(7)
    compiled = CompiledForces([build_force(name)], snapshot)
    force = snapshot.mass[:, None] * compiled.acceleration(snapshot.position, snapshot.velocity)
    torque = np.cross(snapshot.position, force)
    assert np.abs(torque.sum(0)).max() <= 40 * 2.0**-53 * np.abs(torque).sum()


GIVE_AND_TAKE = ("schwarzschild",)  # its energy is not the energy of Newton


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", OTHERS)
def test_forces_that_depend_on_velocity_take_energy_out(name):
    force = build_force(name)
    snapshot = random_snapshot(6)
    compiled = CompiledForces([force], snapshot)
    still = compiled.acceleration(snapshot.position, np.zeros_like(snapshot.velocity), parts="all")
    acceleration = compiled.acceleration(snapshot.position, snapshot.velocity, parts="all")
    power = (snapshot.mass[:, None] * (acceleration - still) * snapshot.velocity).sum()
    total = (snapshot.mass[:, None] * acceleration * snapshot.velocity).sum()
    if force.depends_on_velocity and force.conserves_energy:  # what depends on the velocity is across it
        assert abs(power) < 1e-13 * np.abs(acceleration).sum() and not np.array_equal(acceleration, still)
        expected = [0.0, 0.0]
    elif force.depends_on_velocity:
        assert power < -1e-3 or (name in GIVE_AND_TAKE and abs(power) > 1e-3)
        expected = [-(total if family(name) == "FormulaField" else power), 0.0]
    else:
        assert np.array_equal(acceleration, still)
        expected = [0.0, 0.0 if force.conserves_energy else total]
    np.testing.assert_allclose(compiled.powers(), expected, rtol=0, atol=1e-14 * np.abs(acceleration).sum())


@pytest.mark.parametrize(("of", "driven"), [(None, [0, 1, 2, 3]), ((2, 1), [2]), ((1, 2), [1, 2])])
def test_a_drive_pushes_those_that_it_names_with_its_force_whatever_their_mass(of, driven):
    snapshot = random_snapshot(4)
    parameters = {"force": (0.3, -0.2, 0.5), "angular_frequency": 2.0, "phase": 0.4, "of": of}
    compiled = CompiledForces([component.build("forces", "harmonic_drive", parameters)], snapshot)
    expected = np.zeros((4, 3))
    expected[driven] = np.sin(2.0 * TIME + 0.4) * np.array([0.3, -0.2, 0.5])
    found = snapshot.mass[:, None] * compiled.acceleration(snapshot.position, snapshot.velocity)
    np.testing.assert_allclose(found, expected, rtol=0, atol=4 * 2.0**-53)


def test_forces_on_a_held_particle_without_mass_are_no_nan():
    """0 · (F / 0) is NaN: a held axis must be left out, not multiplied away."""
    springs = Springs(
        between=np.array([[0, 1]], np.int32),
        stiffness=np.ones(1),
        damping=np.ones(1),
        rest_length=np.full(1, 0.5),
        color=np.ones((1, 3)),
    )
    held = snapshot_of(
        [[0, 0, 0], [1, 0, 0]], velocity=[[0, 0, 0], [1, 0, 0]], mass=[0, 1], free=[[0] * 3, [1] * 3], springs=springs
    )
    forces = [build_force("linear_drag"), build_force("harmonic_drive"), build_force("spring")]
    compiled = CompiledForces(forces, held)
    assert np.array_equal(compiled.acceleration(held.position, held.velocity)[0], np.zeros(3))
    # Drag 0.7 v² and axial damping c v² at v = 1; the drive of 0.7 along v.
    assert compiled.powers() == pytest.approx([1.7, 0.7 * np.sin(0.7 * TIME)], rel=1e-14)


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


@pytest.mark.parametrize("length", [0.0, 0.2, 3.0])
def test_the_stiffness_of_a_spring_is_the_slope_of_its_force_along_and_across(length):
    """f = D (l − L): f′ = D along, f/l = D (1 − L/l) across; ends that coincide have no direction, and D holds all round."""
    spring = component.build("forces", "spring", {"damping": "none"})
    state = CompiledForces([spring], random_snapshot(2)).state
    found = ti.field(float, 2)

    @ti.kernel
    def ask(at: float):
        for _ in range(1):
            found[0], found[1] = spring.stiffness(state, 0, 1, 0, at)

    ask(length)
    stiffness, rest = state.spring_stiffness[0], state.spring_rest_length[0]
    across = stiffness * (1.0 - rest / length) if length else stiffness
    assert found.to_numpy().tolist() == pytest.approx([stiffness, across], rel=1e-15)


def test_massless_bodies_feel_gravity_and_exert_none():
    snapshot = random_snapshot(5)
    gravity = component.build("forces", "newtonian_gravity", {"strength": 1.0})
    alone = CompiledForces([gravity], snapshot).acceleration(snapshot.position, snapshot.velocity)
    extended = snapshot_of(np.vstack([snapshot.position, [[0.3, 0.2, 0.1]]]), mass=np.append(snapshot.mass, 0.0))
    together = CompiledForces([gravity], extended).acceleration()
    np.testing.assert_allclose(together[:5], alone, rtol=1e-15)
    assert np.abs(together[5]).max() > 0.1


def test_a_drive_is_refused_by_name_where_there_is_no_sine_for_it(software_vulkan):
    """Vulkan's sine is of f32 alone: in f64 Taichi stops with an error of its own."""
    scene = kepler(forces=[{"harmonic_drive": {"force": [0, 0.1, 0], "angular_frequency": 1.0}}])
    with pytest.raises(PrecisionError, match="harmonic_drive takes a sine, which vulkan has only in f32"):
        Simulation(scene, backend="vulkan", precision="f64")
    ends = []
    for backend in ("vulkan", "cpu"):
        with Simulation(scene, backend=backend, precision="f32", plan="serial") as simulation:
            ends.append(simulation.run(steps=20).snapshot().position)
    # 20 steps of some ten roundings of places below two.
    assert 0 < np.abs(ends[1]).max() and np.abs(ends[0] - ends[1]).max() <= 20 * 10 * 2 * 2.0**-24
