"""General relativity between bodies that all move: its Lagrangian, its constants of motion, and binaries of closed forms."""

import numpy as np
import pytest
from compiled import CompiledForces, random_snapshot
from mpmath import matrix, mp, mpf

from mpp_taichi import Simulation, component
from mpp_taichi.device import backends
from mpp_taichi.errors import MppError, SceneError

TAU = 2.0 * np.pi


def build(c, **more):
    return component.build("forces", "einstein_infeld_hoffmann", {"speed_of_light": c, **more})


def lagrangian(mass, place, velocity, c, g):
    """The Lagrangian of the first order: Landau & Lifshitz, The Classical Theory of Fields (1975), eq. 106.17."""
    count, total = len(mass), mpf(0)
    d = [[[place[j][k] - place[i][k] for k in range(3)] for j in range(count)] for i in range(count)]
    r = [[mp.sqrt(sum(x * x for x in d[i][j])) for j in range(count)] for i in range(count)]

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b))

    for i in range(count):
        square = dot(velocity[i], velocity[i])
        total += mass[i] * (square / 2 + square**2 / (8 * c**2))
        others = [j for j in range(count) if j != i]
        total -= mass[i] * sum(g * mass[j] / r[i][j] for j in others) ** 2 / (2 * c**2)
        for j in others:
            n = [x / r[i][j] for x in d[i][j]]
            mixed = 7 * dot(velocity[i], velocity[j]) + dot(velocity[i], n) * dot(velocity[j], n)
            total += g * mass[i] * mass[j] / r[i][j] * (mpf(1) / 2 + (3 * square / 2 - mixed / 4) / c**2)
    return total


def accelerations_of_the_lagrangian(mass, place, velocity, c, g):
    """a of d(∂L/∂v)/dt = ∂L/∂x, solved as it stands: with (∂²L/∂v∂v) a = ∂L/∂x − (∂²L/∂v∂x) v. Differences of 40 digits."""
    count, h = len(mass), mpf(10) ** -10
    x0, v0 = ([mpf(float(number)) for row in rows for number in row] for rows in (place, velocity))

    def value(x, v):
        rows = ([numbers[3 * i : 3 * i + 3] for i in range(count)] for numbers in (x, v))
        return lagrangian(mass, *rows, c, g)

    def moved(numbers, a, by):
        return [number + (by if k == a else 0) for k, number in enumerate(numbers)]

    size = 3 * count
    momentum_change = matrix(size, 1)
    inertia = matrix(size, size)
    for a in range(size):
        momentum_change[a] = (value(moved(x0, a, h), v0) - value(moved(x0, a, -h), v0)) / (2 * h)
        along = [
            (s * t) * value([x + s * h * v for x, v in zip(x0, v0)], moved(v0, a, t * h)) for s in (1, -1) for t in (1, -1)
        ]
        momentum_change[a] -= sum(along) / (4 * h * h)
        for b in range(a, size):
            corners = [(s * t) * value(x0, moved(moved(v0, a, s * h), b, t * h)) for s in (1, -1) for t in (1, -1)]
            inertia[a, b] = inertia[b, a] = sum(corners) / (4 * h * h)
    found = mp.lu_solve(inertia, momentum_change)
    return np.array([float(number) for number in found]).reshape(count, 3)


def test_accelerations_are_those_of_the_lagrangian_but_for_terms_of_the_next_order():
    """Three bodies, so that terms of three bodies are there; the difference falls with c⁻⁴, and the force with c⁻²."""
    backends.start("cpu", "f64")
    snapshot, strength, differences, sizes = random_snapshot(3, seed=11), 1.3, [], []
    gravity = component.build("forces", "newtonian_gravity", {"strength": strength})
    with mp.workdps(40):
        for c in (5000.0, 10000.0):
            both = CompiledForces([gravity, build(c, strength=strength)], snapshot)
            alone = CompiledForces([gravity], snapshot)
            found = both.acceleration(snapshot.position, snapshot.velocity)
            sizes.append(np.abs(found - alone.acceleration(snapshot.position, snapshot.velocity)).max())
            mass = [mpf(float(number)) for number in snapshot.mass]
            wanted = accelerations_of_the_lagrangian(mass, snapshot.position, snapshot.velocity, mpf(c), mpf(strength))
            differences.append(np.abs(found - wanted).max())
    assert sizes[0] / sizes[1] == pytest.approx(4.0, rel=1e-9)
    assert differences[0] / differences[1] == pytest.approx(16.0, rel=0.05)
    assert differences[1] < 1e-5 * sizes[1]


def invariants(snapshot, c, g=1.0):
    """Energy and momentum of the first order, written down here once more."""
    x, v, m = snapshot.position, snapshot.velocity, snapshot.mass
    energy, momentum = 0.0, np.zeros(3)
    for i in range(len(m)):
        square, potential = v[i] @ v[i], 0.0
        for j in range(len(m)):
            if j != i:
                d = x[j] - x[i]
                r = np.sqrt(d @ d)
                potential += g * m[j] / r
                mixed = 7 * v[i] @ v[j] + (v[i] @ d) * (v[j] @ d) / r**2
                energy += g * m[i] * m[j] / r * (-0.5 + (1.5 * square - 0.25 * mixed) / c**2)
                momentum -= 0.5 * g * m[i] * m[j] / (r**3 * c**2) * (v[i] @ d) * d
        energy += m[i] * (0.5 * square + (0.375 * square**2 + 0.5 * potential**2) / c**2)
        momentum += m[i] * v[i] * (1.0 + (square - potential) / (2.0 * c**2))
    return energy, momentum


def binary(ratio, c, *, e=0.3, method="dop853", steps=300, precision="f64", **more):
    """Two bodies of the mass 1 together, of Newton's semi-major axis 1, at the pericentre at the start."""
    heavy = ratio / (1.0 + ratio)
    near, fast = 1.0 - e, np.sqrt((1.0 + e) / (1.0 - e))
    bodies = [
        {"body": {"name": name, "mass": mass, "position": [arm * near, 0, 0], "velocity": [0, arm * fast, 0]}}
        for name, mass, arm in (("large", heavy, heavy - 1.0), ("small", 1.0 - heavy, heavy))
    ]
    return {
        "particles": bodies,
        "forces": [{"newtonian_gravity": {}}, {"einstein_infeld_hoffmann": {"speed_of_light": c}}],
        "integrator": {method: {"dt": TAU / steps, **more}},
    }


@pytest.mark.parametrize("ratio", [1.0, 3.0])
def test_energy_and_momentum_of_the_first_order_are_kept_but_for_terms_of_the_next(ratio):
    spreads = []
    for c in (100.0, 200.0):
        with Simulation(binary(ratio, c), backend="cpu", precision="f64") as simulation:
            energies, momenta, told, plain = [], [], [], []
            for _ in range(60):
                simulation.run(steps=10)
                now = simulation.snapshot()
                energy, momentum = invariants(now, c)
                energies.append(energy)
                momenta.append(momentum)
                told.append(simulation.mechanics()["total_energy"])
                plain.append(now.mass @ now.velocity)
        np.testing.assert_allclose(told, energies, rtol=1e-13)
        spreads.append([np.ptp(energies), np.ptp(momenta, axis=0).max()])
        # Newton's momentum changes by the order before, unless both masses are equal, where all is symmetric.
        assert np.ptp(plain, axis=0).max() < 1e-13 if ratio == 1.0 else np.ptp(plain, axis=0).max() > 0.01 / c**2
    energy, momentum = np.array(spreads[0]) / np.maximum(spreads[1], 1e-300)
    assert energy == pytest.approx(16.0, rel=0.02) and spreads[0][0] < 20.0 / 100.0**4
    assert (spreads[0][1] < 1e-13) if ratio == 1.0 else momentum == pytest.approx(16.0, rel=0.1)


@pytest.mark.parametrize("ratio", [1.0, 3.0, 1e6])
def test_the_pericentre_of_two_bodies_turns_by_the_sum_of_their_masses(ratio):
    """6π G M/(c² a (1 − e²)) in each radial period 2π G M/(c³ ε^(3/2) (1 − (15 − ν) ε/8)), ε = −2 E/(μ c²), ν = μ/M.

    L. Blanchet, Living Rev. Relativity 17 (2014) 2, eq. 347. The next order is some ten G M/(c² a (1 − e²)).
    """
    e, turns, errors = 0.3, 8, []
    nu = ratio / (1.0 + ratio) ** 2
    for c in (100.0, 200.0):
        near, v2 = 1.0 - e, (1.0 + e) / (1.0 - e)
        energy = v2 / 2 - 1 / near + (0.375 * (1 - 3 * nu) * v2**2 + 0.5 * (3 + nu) * v2 / near + 0.5 / near**2) / c**2
        momentum = near * np.sqrt(v2) * (1 + (0.5 * (1 - 3 * nu) * v2 + (3 + nu) / near) / c**2)
        small = -2.0 * energy / c**2
        period = TAU / (c**3 * small**1.5 * (1.0 - (15.0 - nu) * small / 8.0))
        steps = 300 * turns
        scene = binary(ratio, c)
        scene["integrator"] = {"dop853": {"dt": period * turns / steps}}
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.run(steps=steps)
            now = simulation.snapshot()
        d, w = now.position[1] - now.position[0], now.velocity[1] - now.velocity[0]
        vector = np.cross(w, np.cross(d, w)) - d / np.linalg.norm(d)
        wanted = turns * TAU * 3.0 / (c**2 * momentum**2)
        errors.append(np.arctan2(vector[1], vector[0]) / wanted - 1.0)
        assert abs(errors[-1]) < 10.0 / (c**2 * (1 - e**2))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_a_light_body_moves_as_about_a_star_that_stands():
    c, e = 60.0, 0.4
    near, fast = 1.0 - e, np.sqrt((1.0 + e) / (1.0 - e))
    star = {"body": {"mass": 1.0, "position": [0, 0, 0]}}
    moon = {"body": {"mass": 0.0, "position": [near, 0, 0.1], "velocity": [0.1, fast, 0]}}
    ends = []
    for relativity, free in ((build_entry(c), True), ({"schwarzschild": {"mass": 1.0, "speed_of_light": c}}, False)):
        held = {"body": star["body"] | {"free": [free] * 3}}
        heavy = {"body": moon["body"] | {"mass": 0.0 if free else 1e-12}}
        forces = [{"newtonian_gravity": {}}, relativity]
        scene = {"particles": [held, heavy], "forces": forces, "integrator": {"dop853": {"dt": 0.01}}}
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.run(steps=1000)
            ends.append(simulation.snapshot().position[1])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-10)


def build_entry(c, **more):
    return {"einstein_infeld_hoffmann": {"speed_of_light": c, **more}}


METHODS = [("leapfrog", 2, 100), ("velocity_verlet", 2, 100), ("ruth3", 3, 800), ("pefrl", 4, 50), ("rk4", 4, 100)]
METHODS += [("implicit_midpoint", 2, 100), ("newmark", 2, 100), ("imex_midpoint", 2, 100), ("bogacki_shampine", 3, 100)]


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("method", "order", "steps"), METHODS)
def test_methods_keep_their_order(method, order, steps):
    """For two bodies whose correction is 1 % of the force, so that a wrong order of it would be seen.

    A kick whose last slope reads velocities that have been kicked already has the second order; so pefrl and ruth3 show it.
    """
    ends = []
    for name, count in (("dop853", 2000), (method, steps), (method, 2 * steps)):
        with Simulation(binary(3.0, 20.0, method=name, steps=4 * count), backend="cpu", precision="f64") as simulation:
            simulation.run(steps=count)
            ends.append(simulation.snapshot().position)
    errors = [np.abs(end - ends[0]).max() for end in ends[1:]]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)


PAIR = {"name": "pair", "shape": [2, 1, 1], "lower": [-0.35, 0, 0], "upper": [0.35, 0, 0], "mass": 0.5}
PAIR["velocity"] = [0, "1.36*(u - 0.5)", 0]


@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.parametrize("method", ["leapfrog", "rk4"])
def test_a_group_among_other_bodies_moves_as_it_does_alone(plan, method):
    """Massless bodies around the group feel Newton's gravity alone; the indices of the group begin elsewhere."""
    dust = [{"body": {"mass": 0.0, "position": [3.0 + k, 0.5, 0]}} for k in range(3)]
    ends, felt = [], []
    for particles, of in (([{"lattice": PAIR}], {}), ([dust[0], {"lattice": PAIR}, *dust[1:]], {"of": "pair"})):
        forces = [{"newtonian_gravity": {}}, build_entry(30.0, **of)]
        scene = {"particles": particles, "forces": forces, "integrator": {method: {"dt": 0.02}}}
        with Simulation(scene, backend="cpu", precision="f64", plan=plan) as simulation:
            if of:
                felt = [simulation.accelerations()]
            simulation.run(steps=50)
            ends.append(simulation.snapshot().position[slice(1, 3) if of else slice(0, 2)])
            assert np.abs(ends[-1] - ends[-1].mean(axis=0)).max() > 0.05
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-13)
    with Simulation(scene | {"forces": [{"newtonian_gravity": {}}]}, backend="cpu", precision="f64") as simulation:
        felt.append(simulation.accelerations())
    same = np.all(felt[0] == felt[1], axis=1)
    assert same.tolist() == [True, False, False, True, True]


@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_single_precision_on_the_cpu_and_on_vulkan_moves_the_bodies_alike(software_vulkan, plan):
    ends = []
    for backend, precision in (("cpu", "f64"), ("cpu", "f32"), ("vulkan", "f32")):
        scene = binary(3.0, 20.0, method="leapfrog", steps=100)
        with Simulation(scene, backend=backend, precision=precision, plan=plan) as simulation:
            simulation.run(steps=50)
            ends.append(simulation.snapshot().position)
    # 50 steps of a kick and two drifts of places below 2; the correction moves the bodies by 0.02, which is far more.
    assert max(np.abs(end - ends[0]).max() for end in ends[1:]) <= 50 * 3 * 2 * 2.0**-24
    assert np.abs(ends[1] - ends[0]).max() > 0.0


REFUSED = [
    ({"forces": [build_entry(30.0)]}, "corrects Newton's gravity, must stand beside newtonian_gravity"),
    ({"forces": [{"newtonian_gravity": {"solver": "tree"}}, build_entry(30.0)]}, "solver: direct, not tree"),
    ({"forces": [{"newtonian_gravity": {"softening": 0.1}}, build_entry(30.0)]}, "without softening"),
    ({"forces": [{"newtonian_gravity": {"between": ["large", "small"]}}, build_entry(30.0)]}, "without between:"),
    ({"forces": [{"newtonian_gravity": {}}, build_entry(3.0)]}, r"must be below 0\.1 c²"),
    ({"integrator": {"hermite4": {"dt": 0.01}}}, "einstein_infeld_hoffmann"),
    ({"integrator": {"wisdom_holman": {"dt": 0.01}}}, "einstein_infeld_hoffmann"),
    ({"integrator": {"kahan_li8": {"dt": 0.01}}}, "would have the third order beside einstein_infeld_hoffmann"),
    ({"integrator": {"rkn8": {"dt": 0.01}}}, "einstein_infeld_hoffmann"),
]


@pytest.mark.parametrize(("changed", "told"), REFUSED)
def test_what_the_equations_are_not_made_for_is_refused_by_name(changed, told):
    with pytest.raises(MppError, match=told):
        Simulation(binary(3.0, 30.0) | changed, backend="cpu", precision="f64")


def test_bodies_that_are_held_and_too_many_bodies_are_refused():
    scene = binary(3.0, 30.0)
    scene["particles"][0]["body"]["free"] = [False] * 3
    with pytest.raises(SceneError, match="large.* is held, must be free"):
        Simulation(scene, backend="cpu", precision="f64")
    scene = binary(3.0, 300.0)
    scene["particles"] += [{"lattice": {"shape": [12, 11, 1], "lower": [5, 5, 5], "upper": [9, 9, 5], "mass": 0.001}}]
    with pytest.raises(SceneError, match="sums over 134 bodies, allowed: up to 128"):
        Simulation(scene, backend="cpu", precision="f64")
