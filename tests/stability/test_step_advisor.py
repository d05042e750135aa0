"""The step advisor: frequencies against eigenvalues of independent matrices, limits against real runs."""

import json
import math
import re

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg
from compiled import snapshot_of

from mpp_taichi import Simulation, StabilityError, component
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.blow_up import BlowUpWatch
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Springs
from mpp_taichi.stability import advise, network, spectrum, step_limit
from mpp_taichi.stability.operator import damping_bonds, row_sum_bound, stiffness_bonds
from mpp_taichi.stability.spectrum import LargestEigenvalue
from mpp_taichi.start.assemble import assemble
from scenes import INTEGRATORS, everything, kepler, takes_friction

PENDULUM = "scenes/double_pendulum.yaml"


@pytest.fixture(autouse=True)
def at_root(monkeypatch, request):
    monkeypatch.chdir(request.config.root_folder)


# --- frequencies -------------------------------------------------------------------------------------------------------------


def random_network(kind, *, count=14, seed=5):
    """Particles at random, each linked to several others; `kind` says what is hard about it."""
    random = np.random.default_rng(seed)
    position = random.uniform(-1, 1, (count, 3))
    pairs = np.array([(i, j) for i in range(count) for j in range(i) if random.random() < 0.35], np.int32)
    length = np.linalg.norm(position[pairs[:, 1]] - position[pairs[:, 0]], axis=1)
    stiffness, mass = random.uniform(1, 5, len(pairs)), random.uniform(0.5, 2, count)
    free = np.ones((count, 3), bool)
    rest = length.copy()
    if kind == "prestretched":
        rest = length / 1.5
    if kind == "compressed":
        rest = length * random.uniform(1.0, 3.0, len(pairs))
    if kind == "flat":
        position[:, 2] = 0.0
    if kind == "held":
        free = random.random((count, 3)) < 0.6
    if kind == "masses":
        mass = 10.0 ** random.uniform(-3, 3, count)
    if kind == "stiffnesses":
        stiffness = 10.0 ** random.uniform(-4, 4, len(pairs))
    if kind == "no length":
        rest = np.zeros_like(rest)
    damping = random.uniform(0, 2, len(pairs))
    springs = Springs(pairs, stiffness, damping, rest, np.ones((len(pairs), 3)))
    return snapshot_of(position, mass=mass, springs=springs, free=free)


def forces(springs, position):
    """Forces of the springs, for complex positions as well."""
    total = np.zeros_like(position)
    for (i, j), stiffness, rest in zip(springs.between, springs.stiffness, springs.rest_length):
        d = position[j] - position[i]
        length = np.sqrt(np.sum(d * d))
        total[i] += stiffness * (length - rest) * d / length
        total[j] -= stiffness * (length - rest) * d / length
    return total


def mass_weighted(snapshot, matrix, dimensions):
    """M^(−1/2) matrix M^(−1/2) on the axes that can move."""
    moves = snapshot.free.copy()
    moves[:, dimensions:] = False
    root = np.sqrt(np.repeat(snapshot.mass, 3))
    return (matrix / root / root[:, None])[np.ix_(moves.ravel(), moves.ravel())]


def stiffness_by_complex_step(snapshot):
    """−∂F/∂x, column by column from F(x + iε): exact to rounding, and not the formula that the program uses."""
    size = 3 * snapshot.particle_count
    columns = np.empty((size, size))
    for k in range(size):
        place = snapshot.position.astype(complex)
        place.flat[k] += 1e-30j
        columns[:, k] = -forces(snapshot.springs, place).ravel().imag / 1e-30
    return columns


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["plain", "prestretched", "compressed", "flat", "held", "masses", "stiffnesses", "no length"])
def test_the_largest_frequency_is_that_of_the_whole_matrix(kind):
    snapshot, dimensions = random_network(kind), 2 if kind == "flat" else 3
    matrix = mass_weighted(snapshot, stiffness_by_complex_step(snapshot), dimensions)
    expected = scipy.linalg.eigvalsh(matrix)[-1]
    found = LargestEigenvalue(stiffness_bonds(snapshot, dimensions))
    # The residual is followed to 1e-9 of the value, and the value of a symmetric operator is off by less than that.
    assert found.converged and found.value == pytest.approx(expected, rel=2e-9)
    assert found.value <= expected * (1.0 + 1e-12) <= found.upper * (1.0 + 2e-12)
    assert row_sum_bound(snapshot, dimensions, snapshot.springs.stiffness) >= expected


@pytest.mark.sampled(2)
@pytest.mark.parametrize("mode", ["axial", "full"])
@pytest.mark.parametrize("drag", [0.0, 3.0])
def test_the_largest_damping_rate_is_that_of_the_whole_matrix(mode, drag):
    snapshot = random_network("masses")
    matrix = drag * np.eye(3 * snapshot.particle_count)
    for (i, j), damping in zip(snapshot.springs.between, snapshot.springs.damping):
        n = snapshot.position[j] - snapshot.position[i]
        block = damping * (np.outer(n, n) / (n @ n) if mode == "axial" else np.eye(3))
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            matrix[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += sign * block
    expected = scipy.linalg.eigvalsh(mass_weighted(snapshot, matrix, 3))[-1]
    found = LargestEigenvalue(damping_bonds(snapshot, 3, mode=mode, drag=drag))
    assert found.value == pytest.approx(expected, rel=2e-9)
    assert row_sum_bound(snapshot, 3, snapshot.springs.damping, drag) >= expected


def sheet(side, *, jitter=0.0, stretch=1.5):
    """side × side particles a unit apart, linked along x and y."""
    random = np.random.default_rng(2)
    position = np.zeros((side * side, 3))
    position[:, 1], position[:, 0] = np.divmod(np.arange(side * side), side)
    position += jitter * random.standard_normal(position.shape)
    index = np.arange(side * side).reshape(side, side)
    along, across = (index[:, :-1], index[:, 1:]), (index[:-1], index[1:])
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in (along, across)]).astype(np.int32)
    count = len(pairs)
    springs = Springs(pairs, np.full(count, 50.0), np.zeros(count), np.full(count, 1 / stretch), np.ones((count, 3)))
    return snapshot_of(position, springs=springs)


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_a_large_network_is_followed_as_far_as_is_claimed(jitter):
    """A sheet of 2500: its spectrum is dense at its end, the worst there is for the iteration."""
    snapshot = sheet(50, jitter=jitter)
    blocks, count = {}, snapshot.particle_count
    for (i, j), stiffness, rest in zip(
        snapshot.springs.between, snapshot.springs.stiffness, snapshot.springs.rest_length, strict=True
    ):
        d = snapshot.position[j] - snapshot.position[i]
        length = np.linalg.norm(d)
        block = stiffness * ((1 - rest / length) * np.eye(3) + rest / length**3 * np.outer(d, d))
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            blocks[a, b] = blocks.get((a, b), 0.0) + sign * block
    rows = np.repeat(np.array([[3 * a + k for k in range(3)] for a, _ in blocks]), 3, axis=1).ravel()
    columns = np.tile(np.array([[3 * b + k for k in range(3)] for _, b in blocks]), 3).ravel()
    values = np.concatenate([np.asarray(block).ravel() for block in blocks.values()])
    matrix = scipy.sparse.csr_matrix((values, (rows, columns)), shape=(3 * count, 3 * count))
    expected = scipy.sparse.linalg.eigsh(matrix, k=1, which="LA", tol=1e-10)[0][0]
    found = LargestEigenvalue(stiffness_bonds(snapshot, 3))
    assert expected * (1.0 - spectrum.CLOSE) <= found.value <= expected * (1.0 + 1e-12)
    assert found.residual <= spectrum.CLOSE * found.value and found.upper >= expected * (1.0 - 1e-12)
    # The vector is made a second time, and must be that of the value.
    vector = found.vector
    assert vector @ found.bonds.product(vector) == pytest.approx(found.value, rel=1e-9)


@pytest.mark.parametrize(("damping", "limit"), [(0.012, 0.012), (0.006, 0.006), (0.0016, 0.0016), (0.001, 0.0)])
def test_a_method_that_damping_alone_keeps_stable_has_a_limit_below_the_first_angle(damping, limit):
    """Explicit Euler on (x, v dt) has the determinant 1 − γ dt + (ω dt)²: it is stable up to dt = γ/ω², here with ω = 1."""

    def euler(angle, damped):
        return np.array([[1.0, 1.0], [-(angle**2), 1.0 - damped]])

    # The determinant may be above 1 by ROUNDING. As γ dt − dt² has the slope γ at the limit, this is worth ROUNDING/γ² of the
    # limit; twice as much for the rounding of the determinant itself. The search goes down to 1.25e-3.
    allowed = 2.0 * step_limit.ROUNDING / damping**2
    assert step_limit.largest_stable_step(euler, 1.0, damping) == pytest.approx(limit, rel=allowed)


def test_springs_without_a_direction_count_in_full():
    springs = Springs(np.array([[0, 1]], np.int32), np.array([8.0]), np.zeros(1), np.array([1.0]), np.ones((1, 3)))
    snapshot = snapshot_of(np.zeros((2, 3)), mass=[1.0, 1.0], springs=springs)
    assert LargestEigenvalue(stiffness_bonds(snapshot, 3)).value == pytest.approx(8.0 * (1 + 1), rel=1e-12)


def test_a_network_that_does_not_converge_is_answered_by_its_bound(monkeypatch):
    monkeypatch.setattr(spectrum, "MOST_PRODUCTS", 1)
    scene = load_scene({**everything(damping=0.0, drag=0.0), "forces": []})
    advice = advise(scene, assemble(scene), component.build("integrators", "leapfrog", {"dt": 1.0}), 1.0)
    assert advice.limit == pytest.approx(2.0 / advice.network.frequency_bound, rel=1e-9)
    assert "did not converge" in advice.decided_by and "the spring between" in advice.culprit


# --- limits ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "limit"), [("leapfrog", 2 / math.sqrt(5010)), ("rk4", math.sqrt(8 / 5010))])
def test_the_limits_of_the_double_pendulum(name, limit):
    """D₁ + 2 D₂ = 5010 bounds ω² in every arrangement; the true one, springs in line, is 5005.005: so near that it decides.

    0.028256 and 0.03996 for D = 5000 and 5.
    """
    spec = load_scene(PENDULUM, overrides=[f"integrator={{{name}: {{dt: 1e-3}}}}"])
    advice = advise(spec, assemble(spec), component.build("integrators", name, {"dt": 1e-3}), 1e-3)
    assert advice.limit == pytest.approx(limit, rel=1e-9)
    stiffer = scipy.linalg.eigvalsh([[5005.0, -5.0], [-5.0, 5.0]])[-1]
    assert advice.placed_limit == pytest.approx(limit * math.sqrt(5010 / stiffer), rel=1e-9)
    assert re.search(
        r"particle 0 \(pivot\) and particle 1 \(upper\), D = 5000 \(springs\[0\]\.link, \S*yaml:17:", advice.culprit
    )
    assert 0.85 * limit < advice.at(1.0).holding_step <= 0.9 * limit


OSCILLATORS = [(1.0, 0.0), (1.0, 0.02), (1.0, 1.0), (1.0, 5.0), (0.0, 1.0)]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("name", "frequency", "damping"),
    [(name, w, c) for name in INTEGRATORS for w, c in OSCILLATORS if c == 0.0 or takes_friction(name)],
)
def test_a_step_is_stable_up_to_the_limit_and_not_beyond(name, frequency, damping):
    method = component.build("integrators", name, {"dt": 1.0})
    limit = step_limit.largest_stable_step(method.amplification, frequency, damping)

    def radius(dt):
        return np.abs(np.linalg.eigvals(method.amplification(frequency * dt, damping * dt))).max()

    if limit == 0.0:  # explicit Euler and its kin
        assert radius(0.02) > 1.0 and damping == 0.0
        return
    # Eigenvalues are simple below the limit, so they are rounded by 1e-15 over their distance, 1e-2 and more. Hermite's schemes
    # make an oscillation grow a little with every step: their limit is where that is as much as a limit is known to.
    allowed = step_limit.ROUNDING_OF_ROOTS if name.startswith("hermite") else 1e-9
    for part in (1e-2, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99):
        assert radius(min(limit, 1e3) * part) < 1.0 + allowed
    if math.isfinite(limit):
        # The slowest growth is that of Euler's (ω dt)² − γ dt, 4e-6 at 1.01 of the limit. Accurate methods of many stages are
        # unstable in a gap near ω dt = π alone, where cos passes −1: the narrowest, of srkn11b, is 3e-4 wide.
        assert max(radius(part * limit) for part in (1.0001, 1.001, 1.01)) > 1.0 + 1e-6


def test_a_narrow_gap_of_stability_is_not_stepped_over():
    """A made-up method of determinant 1 and trace 2 a cos(ω dt), a = 1.0001: unstable only within 0.014 of half a turn."""

    def amplification(frequency, damping):
        half = 1.0001 * math.cos(frequency)
        return np.array([[half, half * half - 1.0], [1.0, half]])

    limit = step_limit.largest_stable_step(amplification, 1.0)
    assert limit == pytest.approx(math.acos(-1.0 / 1.0001), rel=1e-6)


@pytest.mark.parametrize("name", ["leapfrog", "rk4", "pefrl"])
@pytest.mark.sampled(3)
def test_a_predicted_limit_is_the_one_that_is_seen(name):
    """A chain of nine springs along a line, ends held: linear, ω² = (4D/m) sin²(kπ/18); the mode of k = 8 is the fastest."""
    bodies = [{"body": {"mass": 1, "position": [float(k), 0, 0], "free": [0 < k < 9, False, False]}} for k in range(10)]
    bodies[4]["body"]["position"][0] += 0.01
    scene = {
        "particles": bodies,
        "springs": [{"link": {"between": [k, k + 1], "stiffness": 100, "rest_length": 1}} for k in range(9)],
        "integrator": {name: {"dt": 1.0}},
    }
    with Simulation(scene, backend="cpu", precision="f64", force=True) as simulation:
        limit = simulation.step_advice.placed_limit
        frequency = math.sqrt(400) * math.sin(8 * math.pi / 18)
        own = step_limit.largest_stable_step(simulation.integrator.amplification, 1.0)
        assert limit == pytest.approx(own / frequency, rel=1e-8)
        table = TableRecorder(50)
        watch = BlowUpWatch(table)
        simulation.dt = 0.999 * limit
        simulation.run(steps=4000, recorders=[table, watch])
        # Near its limit leapfrog turns a displacement of 0.01 into swings of it over √(1 − (ω dt/2)²), 22 times: bounded.
        assert np.abs(simulation.snapshot().position[:, 0] - np.arange(10)).max() < 0.01 * 10 * 25
        simulation.restart()
        table.restart(), watch.restart()
        simulation.dt = 1.01 * limit
        with pytest.raises(StabilityError, match="blows up"):
            simulation.run(steps=4000, recorders=[table, watch])


# --- what is said and done ---------------------------------------------------------------------------------------------------


def test_python_refuses_what_cannot_hold_unless_it_is_forced():
    with Simulation(PENDULUM, backend="cpu", overrides={"integrator.leapfrog.dt": 0.0285}) as simulation:
        with pytest.raises(StabilityError, match=r"leapfrog.dt = 0.0285 is beyond .* 0.028256.*dt = 0.025 holds"):
            simulation.run(steps=1)
        assert simulation.step_count == 0
        simulation.dt = 0.025
        simulation.run(steps=5)
        simulation.dt = 0.03
        with pytest.raises(StabilityError):
            simulation.run(steps=1)
    with Simulation(PENDULUM, backend="cpu", overrides={"integrator.leapfrog.dt": 0.0285}, force=True) as simulation:
        assert simulation.run(steps=3).step_count == 3


IMPLICIT = ["bdf2", "energy_momentum", "imex_midpoint", "implicit_euler", "implicit_midpoint", "newmark"]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", IMPLICIT)
def test_implicit_methods_have_no_limit(name):
    method = component.build("integrators", name, {"dt": 0.5})
    spec = load_scene(PENDULUM, overrides=[f"integrator={{{name}: {{dt: 0.5}}}}"])
    advice = advise(spec, assemble(spec), method, 0.5)
    assert advice.is_unlimited and advice.facts()["dt_limit"] is None and "every step" in advice.line()
    advice.enforce()
    # So say their matrices, of four rows in bdf2, at every step that is tried: they are A-stable.
    for damping in (0.0, 0.3, 50.0):
        assert step_limit.largest_stable_step(method.amplification, 1.0, damping) == math.inf


@pytest.mark.parametrize(("dt", "words"), [(1e-3, "integrator.leapfrog.dt"), (0.026, "0.92 of the largest stable step")])
def test_the_command_line_warns_from_nine_tenths(dt, words, capsys):
    set_dt = f"integrator.leapfrog.dt={dt}"
    assert main(["run", PENDULUM, "--headless", "--quiet", "--steps", "2", "--set", set_dt]) == 0
    err = capsys.readouterr().err
    assert (words in err and f"{PENDULUM}:17:" in err) == (dt > 0.9 * 0.028256)


def test_the_command_line_refuses_with_the_line_of_the_spring(capsys):
    words = ["run", PENDULUM, "--headless", "--steps", "2", "--set", "integrator.leapfrog.dt=0.0285"]
    for extra in ([], ["--dry-run"]):
        assert main([*words, *extra, "--json"]) == 4
        captured = capsys.readouterr()
        found = json.loads(captured.out)
        assert found["exit_code"] == 4 and f"{PENDULUM}:17:" in found["error"] and "0.0285" in captured.err
    assert main([*words, "--force", "--quiet"]) == 0
    assert "asked for" in capsys.readouterr().err
    assert main([*words, "--force", "--dry-run", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["dt_limit"] == pytest.approx(2 / math.sqrt(5010)) and found["dt_limit_any_arrangement"] == found["dt_limit"]


@pytest.mark.parametrize(("dt", "code", "words"), [(1e-3, 4, "24.9 % each time"), (3e-5, 0, "0.669 % each time")])
def test_a_method_that_always_grows_is_refused_only_where_it_is_absurd(dt, code, words, capsys):
    """Euler multiplies an amplitude by √(1 + (ω dt)²) a step: (1 + 0.0707²)^(89/2) = 1.249 in 89 steps, one turn."""
    set_method = f"integrator={{euler: {{dt: {dt}}}}}"
    assert main(["run", PENDULUM, "--dry-run", "--steps", "20000", "--set", set_method]) == code
    captured = capsys.readouterr()
    assert words in captured.err and "no step keeps" in captured.err


def test_a_scene_without_springs_or_drag_is_not_limited():
    spec = load_scene(kepler())
    assert advise(spec, assemble(spec), component.build("integrators", "leapfrog", {"dt": 1.0}), 1.0) is None


def test_drag_alone_limits_a_step():
    """Leapfrog solves v' = −γ v by 1 − γh + (γh)²/2, stable for γh ≤ 2; γ = c/m = 500 on the lighter body."""
    spec = load_scene(kepler(forces=[{"linear_drag": {"coefficient": 0.5}}]))
    advice = advise(spec, assemble(spec), component.build("integrators", "leapfrog", {"dt": 1.0}), 0.05)
    assert advice.limit == pytest.approx(2.0 / 500.0, rel=1e-9) and "damping rate 500" in advice.culprit


def test_the_spring_that_is_named_is_the_one_that_swings():
    """A soft spring on a light mass swings faster than a stiff one between heavy ones."""
    bodies = [{"body": {"mass": mass, "position": [float(k), 0, 0]}} for k, mass in enumerate((1e3, 1e3, 1e-3))]
    links = [{"link": {"between": [0, 1], "stiffness": 1e3}}, {"link": {"between": [1, 2], "stiffness": 10}}]
    spec = load_scene({"particles": bodies, "springs": links, "integrator": {"leapfrog": {"dt": 1e-3}}})
    assert network.SpringNetwork(spec, assemble(spec)).stiffest_spring() == 1
