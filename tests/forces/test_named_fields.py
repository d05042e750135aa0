"""Fields whose formulas stand in the package: the motion in each against its closed form, energies, and planes."""

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.scene.load import load_scene

TAU = 2.0 * np.pi


def run(
    forces, position, velocity, duration, *, steps=2000, method="dop853", dimensions=3, charge=0.0, precision="f64", mass=1.0
):
    """Place and velocity of a particle at times, (steps + 1, 3) each, and the relative change of its energy."""
    scene = {
        "dimensions": dimensions,
        "particles": [{"body": {"mass": mass, "charge": charge, "position": position, "velocity": velocity}}],
        "forces": forces,
        "integrator": {method: {"dt": duration / steps}},
    }
    places, speeds = [], []
    with Simulation(scene, backend="cpu", precision=precision) as simulation:
        first = simulation.mechanics()["total_energy"]
        for number in range(steps // 10 + 1):
            if number:
                simulation.run(steps=10)
            now = simulation.snapshot()
            places.append(now.position[0])
            speeds.append(now.velocity[0])
        change = simulation.mechanics()["total_energy"] / first - 1.0 if first else 0.0
    return np.array(places), np.array(speeds), change


def elements(place, velocity, gm=1.0):
    """Semi-major axis, eccentricity vector and unit normal."""
    r, h = np.linalg.norm(place), np.cross(place, velocity)
    e = np.cross(velocity, h) / gm - place / r
    return 1.0 / (2.0 / r - velocity @ velocity / gm), e, h / np.linalg.norm(h)


def test_each_coordinate_of_a_trap_swings_by_itself():
    w, t = np.array([1.0, 2.5, 0.7]), 9.0
    start, push = np.array([0.3, -0.4, 1.0]), np.array([0.2, 0.5, -0.1])
    places, _, change = run([{"harmonic_trap": {"frequencies": w.tolist()}}], start.tolist(), push.tolist(), t)
    np.testing.assert_allclose(places[-1], start * np.cos(w * t) + push / w * np.sin(w * t), atol=1e-11)
    assert abs(change) < 1e-11


def test_an_ion_in_a_penning_trap_has_the_three_frequencies():
    wc, u, q, m = 10.0, 2.0, 1.6, 0.8
    wz = np.sqrt(q * u / m)
    fast, slow = wc / 2 + np.sqrt(wc**2 / 4 - wz**2 / 2), wc / 2 - np.sqrt(wc**2 / 4 - wz**2 / 2)
    forces = [{"magnetic_field": {"field": [0, 0, wc * m / q]}}, {"quadrupole_trap": {"strength": u}}]
    t = 12.0
    places, _, change = run(forces, [1.0, 0, 0.5], [0, -(0.2 * fast + 0.8 * slow), 0], t, charge=q, mass=m)
    wanted = [0.2 * np.cos(fast * t) + 0.8 * np.cos(slow * t), -0.2 * np.sin(fast * t) - 0.8 * np.sin(slow * t)]
    np.testing.assert_allclose(places[-1], [*wanted, 0.5 * np.cos(wz * t)], atol=1e-9)
    assert abs(change) < 1e-11


@pytest.mark.parametrize("method, order", [("leapfrog", 2), ("velocity_verlet", 2), ("yoshida4", 4), ("rk4", 4)])
def test_methods_keep_their_order_in_a_magnetic_field(method, order):
    """E = 1 along x and B = 2 along z: the circle of the cyclotron drifts along −y with E/B."""
    b, e, t = 2.0, 1.0, 3.0
    forces = [{"magnetic_field": {"field": [0, 0, b]}}, {"uniform_gravity": {"acceleration": [e, 0, 0]}}]
    x = e / b**2 * (1 - np.cos(b * t))
    y = -e / b * t + e / b**2 * np.sin(b * t)
    errors = []
    for steps in (40, 80):
        places, *_ = run(forces, [0, 0, 0], [0, 0, 0], t, steps=steps, method=method, charge=1.0)
        errors.append(np.abs(places[-1] - [x, y, 0]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


def test_a_charge_near_a_dipole_keeps_its_speed_and_is_mirrored():
    places, speeds, change = run(
        [{"magnetic_dipole": {"strength": 2000.0}}], [2.0, 0, 0], [0, 0.6, 0.8], 2.5, steps=8000, charge=1.0
    )
    np.testing.assert_allclose(np.linalg.norm(speeds, axis=1), 1.0, atol=1e-8)
    assert abs(change) < 1e-8
    # The angular momentum about the axis is m R v_φ + q A_φ R with A_φ = M R/r³.
    r = np.linalg.norm(places, axis=1)
    twist = places[:, 0] * speeds[:, 1] - places[:, 1] * speeds[:, 0] + 2000.0 * (places[:, 0] ** 2 + places[:, 1] ** 2) / r**3
    np.testing.assert_allclose(twist, twist[0], rtol=1e-7)
    # v_⊥²/B has the same value at the mirror as at the start: cos⁶λ/√(1 + 3 sin²λ) = 0.36 at the latitude λ.
    latitude = np.degrees(np.arcsin(np.abs(places[:, 2]) / r).max())
    at = np.radians(np.linspace(0, 60, 6001))
    mirror = np.degrees(at[np.argmin(np.abs(np.cos(at) ** 6 / np.sqrt(1 + 3 * np.sin(at) ** 2) - 0.36))])
    assert latitude == pytest.approx(mirror, abs=0.5)


def test_a_free_particle_in_a_rotating_frame_goes_straight():
    rate, t = np.array([0.3, -0.2, 0.5]), 4.0
    start, velocity = np.array([1.0, 0.5, -0.3]), np.array([0.1, 0.4, 0.2])
    places, _, change = run([{"rotating_frame": {"rate": rate.tolist()}}], start.tolist(), velocity.tolist(), t)
    straight = start + (velocity + np.cross(rate, start)) * t
    axis, angle = rate / np.linalg.norm(rate), -np.linalg.norm(rate) * t
    turned = (
        straight * np.cos(angle) + np.cross(axis, straight) * np.sin(angle) + axis * (axis @ straight) * (1 - np.cos(angle))
    )
    np.testing.assert_allclose(places[-1], turned, atol=1e-11)
    assert abs(change) < 1e-11


CIRCLES = {
    "logarithmic_halo": ({"speed": 1.3, "core": 0.4}, lambda r: 1.3**2 * r**2 / (0.4**2 + r**2)),
    "miyamoto_nagai": ({"mass": 2.0, "scale": 0.5, "height": 0.3}, lambda r: 2.0 * r**2 / (r**2 + 0.8**2) ** 1.5),
    "navarro_frenk_white": ({"mass": 5.0, "scale": 2.0}, lambda r: 5.0 * (np.log(1 + r / 2) - r / 2 / (1 + r / 2)) / r),
    "mass_loss": ({"mass": 3.0, "rate": 0.0}, lambda r: 3.0 / r),
}


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("name", CIRCLES)
def test_circular_orbits_have_the_speed_of_the_closed_form(name, dimensions):
    parameters, square = CIRCLES[name]
    r = 1.7
    v = np.sqrt(square(r))
    period = TAU * r / v
    places, _, change = run([{name: parameters}], [r, 0, 0][:dimensions], [0, v, 0][:dimensions], period, dimensions=dimensions)
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), r, rtol=1e-9)
    np.testing.assert_allclose(places[-1], [r, 0, 0], atol=1e-8)
    assert abs(change) < 1e-11


def test_forces_off_the_plane_are_the_slopes_of_halo_and_disc():
    """The ratio of the forces along z and x at a place: z/q² : x in the halo, z (a + b′)/b′ : x in the disc, b′² = z² + b²."""
    x, z = 0.9, 0.6
    for name, extra, ratio in (
        ("logarithmic_halo", {"flattening": 0.7}, z / 0.7**2 / x),
        ("miyamoto_nagai", {}, z * (0.5 + np.hypot(z, 0.3)) / np.hypot(z, 0.3) / x),
    ):
        scene = {
            "particles": [{"body": {"mass": 1.0, "position": [x, 0, z]}}],
            "forces": [{name: CIRCLES[name][0] | extra}],
            "integrator": {"leapfrog": {"dt": 0.1}},
        }
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            pull = simulation.accelerations()[0]
        assert pull[2] / pull[0] == pytest.approx(ratio, rel=1e-12)
        assert pull[0] < 0.0


STAR = {"external": {"potential": "-m/r"}}


def orbit_after(force, turns, *, e=0.2, inclination=0.0, steps_a_turn=200):
    """Elements of an orbit with a = 1 about G M = 1 at the start and after some periods."""
    v = np.sqrt((1 + e) / (1 - e))
    start = [1 - e, 0, 0]
    velocity = [0, v * np.cos(inclination), v * np.sin(inclination)]
    places, speeds, _ = run([STAR, force], start, velocity, TAU * turns, steps=steps_a_turn * turns)
    return elements(places[0], speeds[0]), elements(places[-1], speeds[-1])


def test_the_node_of_a_satellite_moves_as_the_moment_of_its_planet_says():
    j2, size, e, inclination, turns = 1e-4, 0.5, 0.05, 0.9, 40
    force = {"oblateness": {"mass": 1.0, "planet_radius": size, "j2": j2}}
    first, last = orbit_after(force, turns, e=e, inclination=inclination)
    nodes = [np.arctan2(normal[0], -normal[1]) for *_, normal in (first, last)]
    wanted = -1.5 * j2 * (size / (1 - e**2)) ** 2 * np.cos(inclination) * TAU * turns
    assert nodes[1] - nodes[0] == pytest.approx(wanted, rel=5e-3)  # terms of second order, and those that come and go
    # J₄ beside it, as accelerations: −∇V by differences of a potential that is written down here.
    scene = {"particles": [{"body": {"mass": 1.0, "position": [0.8, 0.3, 0.5]}}], "integrator": {"leapfrog": {"dt": 0.1}}}
    scene["forces"] = [{"oblateness": {"mass": 2.0, "planet_radius": 0.6, "j2": 0.01, "j4": -0.02}}]

    def potential(x):
        r = np.sqrt(x @ x)
        s = x[2] / r
        terms = 0.01 * (0.6 / r) ** 2 * (3 * s**2 - 1) / 2 - 0.02 * (0.6 / r) ** 4 * (35 * s**4 - 30 * s**2 + 3) / 8
        return 2.0 / r * terms

    x, h = np.array([0.8, 0.3, 0.5]), 1e-3
    away = [
        8 * (potential(x + h * k) - potential(x - h * k)) - potential(x + 2 * h * k) + potential(x - 2 * h * k)
        for k in np.eye(3)
    ]
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        np.testing.assert_allclose(simulation.accelerations()[0], -np.array(away) / (12 * h), rtol=1e-8)


def test_the_pericentre_turns_as_in_general_relativity():
    """From one pericentre to another: with −k/r² beside −1/r the radial period is Kepler's for the same energy."""
    c, e, turns = 300.0, 0.4, 20
    near, fast, k = 1 - e, np.sqrt((1 + e) / (1 - e)), 3 / c**2
    period = TAU * (2 * (1 / near + k / near**2 - fast**2 / 2)) ** -1.5
    scene = {
        "particles": [
            {"body": {"name": "sun", "mass": 1.0, "position": [0, 0, 0], "free": [False, False, False]}},
            {"body": {"mass": 1e-9, "position": [near, 0, 0], "velocity": [0, fast, 0]}},
        ],
        "forces": [{"newtonian_gravity": {}}, {"post_newtonian": {"central_mass": 1.0, "speed_of_light": c}}],
        "integrator": {"dop853": {"dt": period / 300}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=300 * turns)
        now = simulation.snapshot()
    _, vector, _ = elements(now.position[1], now.velocity[1])
    turned = np.arctan2(vector[1], vector[0])
    assert turned == pytest.approx(turns * TAU * (1 / np.sqrt(1 - 2 * k / (near * fast) ** 2) - 1), rel=1e-7)
    assert turned == pytest.approx(turns * 6 * np.pi / (c**2 * (1 - e**2)), rel=20 / c**2)  # the next order of 1/c²


def test_dust_spirals_into_the_star_as_poynting_and_robertson_say():
    beta, c, turns = 2e-3, 20.0, 30
    force = {"radiation_pressure": {"mass": 1.0, "ratio": beta, "speed_of_light": c}}
    gm = 1.0 - beta
    places, speeds, _ = run([STAR, force], [1, 0, 0], [0, np.sqrt(gm), 0], TAU * turns, steps=200 * turns)
    a = [elements(x, v, gm)[0] for x, v in zip((places[0], places[-1]), (speeds[0], speeds[-1]))]
    assert a[1] ** 2 == pytest.approx(a[0] ** 2 - 4 * beta / c * TAU * turns, rel=2e-4)


def test_migration_shrinks_orbits_and_rounds_them():
    rate, damping, turns = 1e-4, 1e-3, 30
    first, last = orbit_after({"migration": {"rate": rate}}, turns, e=0.0)
    assert last[0] == pytest.approx(first[0] * np.exp(-rate * TAU * turns), rel=1e-5)
    first, last = orbit_after({"migration": {"rate": 0.0, "circularization": damping}}, turns, e=0.02)
    assert np.linalg.norm(last[1]) == pytest.approx(0.02 * np.exp(-damping * TAU * turns), rel=0.02)


def test_an_orbit_widens_as_its_star_loses_mass():
    rate, turns, e = 1e-4, 30, 0.3
    v = np.sqrt((1 + e) / (1 - e))
    t = TAU * turns
    places, speeds, _ = run([{"mass_loss": {"mass": 1.0, "rate": rate}}], [1 - e, 0, 0], [0, v, 0], t, steps=200 * turns)
    a, vector, _ = elements(places[-1], speeds[-1], np.exp(-rate * t))
    assert a == pytest.approx(np.exp(rate * t), rel=5e-4)  # the changes within a period are of the order of k
    assert np.linalg.norm(vector) == pytest.approx(e, abs=5e-4)


def test_tides_drive_a_moon_away_from_a_planet_that_turns_faster_and_brake_it_at_a_slower_one():
    """ȧ = 6 k τ G m R⁵ (Ω − n)/(n a⁷) on a circle whose angular frequency has the pull of the bulge in it."""
    k, lag, m, radius, turns = 0.3, 0.05, 1e-3, 0.2, 20
    for spin in (2.5, 1.0, -1.0):
        force = {"tides": {"radius": radius, "love_number": k, "lag": lag, "spin": [0, 0, spin]}}
        bulge = 3 * k * m * radius**5
        places, speeds, _ = run([STAR, force], [1, 0, 0], [0, np.sqrt(1 + bulge), 0], TAU * turns, steps=200 * turns, mass=m)
        momentum = [np.cross(x, v)[2] for x, v in zip((places[0], places[-1]), (speeds[0], speeds[-1]))]
        # L' = a × the push along the orbit, which is constant to the order of the change itself.
        wanted = 3 * k * lag * m * radius**5 * (spin - np.sqrt(1 + bulge)) * TAU * turns
        assert momentum[1] - momentum[0] == pytest.approx(wanted, rel=1e-3, abs=1e-11)


def test_the_tide_of_a_planet_with_an_oblique_spin_is_that_of_a_bulge_that_lags():
    """The bulge of the moon's place of τ ago, turned with the planet: the difference quotient of the static tide."""
    x, v, spin = np.array([0.8, -0.3, 0.5]), np.array([0.2, 0.9, -0.4]), np.array([0.3, -0.7, 1.1])
    k, lag, m, radius = 0.4, 1e-5, 0.6, 0.5

    def pull(moon, raised):
        """−∇ of the potential of the quadrupole that a moon at `raised` induces, on a moon at `moon`, for each mass."""
        r, d = np.linalg.norm(moon), np.linalg.norm(raised)
        along = moon @ raised
        # W = −(k m R⁵/(r⁵ d⁵)) (3 (x·y)² − r² d²)/2
        slope = 3 * along * raised - d**2 * moon - 2.5 * (3 * along**2 - r**2 * d**2) * moon / r**2
        return k * m * radius**5 / (r**5 * d**5) * slope

    before = x - lag * (v - np.cross(spin, x))  # seen from the turning planet
    force = {"tides": {"radius": radius, "love_number": k, "lag": lag, "spin": spin.tolist()}}
    scene = {
        "particles": [{"body": {"mass": m, "position": x.tolist(), "velocity": v.tolist()}}],
        "forces": [force],
        "integrator": {"dop853": {"dt": 0.1}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        found = simulation.accelerations()[0]
    wanted = pull(x, before)
    np.testing.assert_allclose(found, wanted, atol=(10 * lag) ** 2 * np.abs(wanted).max())  # the next order of τ
    assert np.abs(found - pull(x, x)).max() > 1e-6 * np.abs(wanted).max()  # and not the static tide


def test_near_a_star_orbits_turn_and_keep_the_energy_of_the_first_order():
    c, e, turns = 200.0, 0.4, 20
    near, fast = 1 - e, np.sqrt((1 + e) / (1 - e))
    force = {"schwarzschild": {"mass": 1.0, "speed_of_light": c}}
    places, speeds, _ = run([STAR, force], [near, 0, 0], [0, fast, 0], TAU * turns, steps=300 * turns)
    _, vector, _ = elements(places[-1], speeds[-1])
    # Within a revolution the osculating pericentre swings by some 1/c²; the turn of 20 revolutions is 380/c².
    assert np.arctan2(vector[1], vector[0]) == pytest.approx(turns * 6 * np.pi / (c**2 * (1 - e**2)), rel=0.05)
    r, v2 = np.linalg.norm(places, axis=1), (speeds**2).sum(axis=1)
    newton = v2 / 2 - 1 / r
    energy = newton + (3 / 8 * v2**2 + 3 / 2 * v2 / r + 1 / (2 * r**2)) / c**2
    # The next terms are products of three of v² and 1/r over c⁴, with coefficients near 1.
    assert np.ptp(energy) < (v2 + 1 / r).max() ** 3 / c**4 < 1e-2 * np.ptp(newton)


HIGH_SPLITTINGS = [
    name
    for name in component.names("integrators")
    if component.flag("integrators", name, "solves_kicks") and component.flag("integrators", name, "order") > 4
]
QUADRATIC = {
    "schwarzschild": {"schwarzschild": {"mass": 1.0, "speed_of_light": 30.0}},
    "drag of air": {"external": {"acceleration": ["-0.1*v*vx", "-0.1*v*vy", "-0.1*v*vz"]}},
    "a product of components": {"external": {"acceleration": ["vx*vy", "0", "0"]}},
}
LINEAR = {
    "friction that depends on place and time": {"external": {"acceleration": ["-(1 + x^2)*vx*cos(t)", "x*y", "-vz"]}},
    "magnetic field": {"magnetic_field": {"field": [0.0, 0.0, 2.0]}},
    "migration": {"migration": {"rate": 0.01, "circularization": 0.02}},
}


@pytest.mark.parametrize("method", HIGH_SPLITTINGS)
def test_splittings_of_high_order_refuse_forces_that_are_not_linear_in_the_velocity(method):
    scene = {"particles": [{"body": {"mass": 1.0, "position": [1.0, 0.0, 0.0]}}], "integrator": {method: {"dt": 0.1}}}
    for force in QUADRATIC.values():
        with pytest.raises(SceneError, match=rf"integrator.{method}: would have the third order beside {next(iter(force))}"):
            load_scene({**scene, "forces": [force]})
    for force in LINEAR.values():
        load_scene({**scene, "forces": [force]})


@pytest.mark.parametrize("method", ["leapfrog", "yoshida4", "rk4", "dop853", "implicit_midpoint"])
def test_other_methods_take_forces_that_are_not_linear_in_the_velocity(method):
    scene = {"particles": [{"body": {"mass": 1.0, "position": [1.0, 0.0, 0.0]}}], "integrator": {method: {"dt": 0.1}}}
    for force in QUADRATIC.values():
        load_scene({**scene, "forces": [force]})


@pytest.mark.parametrize(("method", "order"), [("yoshida4", 4), ("kahan_li6", 6), ("kahan_li8", 8)])
def test_splittings_keep_their_order_with_friction_that_depends_on_the_place(method, order):
    """Half the step divides the error by 2^order, if the next term of the error is at most a third: by (1 ± 1/3)/(1 ± 1/6) of
    it, or by (1 ± 1/3)/(1 ± 1/12) in a method that is symmetric."""
    forces = [
        {"harmonic_trap": {"frequencies": [1.0, 1.3, 0.7]}},
        {"external": {"acceleration": ["-(0.2 + 0.3*y^2)*vx", "-0.1*x*vy", "0"]}},
    ]
    start = ([1.0, 0.2, 0.3], [0.1, 0.7, -0.2], 4.0)
    exact = run(forces, *start, steps=2000)[0][-1]
    coarse, fine = (np.abs(run(forces, *start, steps=steps, method=method)[0][-1] - exact).max() for steps in (20, 40))
    assert 0.72 * 2**order < coarse / fine < 1.24 * 2**order
