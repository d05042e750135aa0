"""Modes of spring networks: frequencies against matrices and closed forms, zero-frequency modes, and modes along a run."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import yaml
from PIL import Image

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.cli.main import main
from mpp_taichi.modes.frequency_meter import FrequencyMeter
from mpp_taichi.modes.lattice_theory import NoTheoryError, lattice_theory
from mpp_taichi.modes.linear_network import linearise
from mpp_taichi.modes.mode_set import ModeError, find_modes
from mpp_taichi.modes.network_report import network_facts, note
from mpp_taichi.modes.predicted_damping import predicted_damping
from mpp_taichi.modes.spectrum import spectrum
from mpp_taichi.recorders import _mode_plot
from mpp_taichi.recorders.modes import ModeRecorder
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import ModesSpec
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.start.assemble import assemble

EPS = np.finfo(float).eps

SCENES = Path(__file__).parents[2] / "scenes"


def network_of(position, links, *, held=(), mass=None, stiffness=10.0, rest=None, dimensions=3):
    """Particles at `position`, springs at rest as placed where `rest` does not say otherwise."""
    position = np.array([[*point, 0.0, 0.0][:3] for point in position], float)
    count, between = len(position), np.array(links, np.int32)
    placed = np.sqrt(np.sum((position[between[:, 1]] - position[between[:, 0]]) ** 2, axis=1))
    free = np.ones((count, 3), bool)
    free[list(held)] = False
    springs = Springs(
        between=between,
        stiffness=np.broadcast_to(np.asarray(stiffness, float), len(between)),
        damping=np.zeros(len(between)),
        rest_length=placed if rest is None else np.broadcast_to(np.asarray(rest, float), len(between)),
        color=np.ones((len(between), 3)),
    )
    zero, ones = np.zeros((count, 3)), np.ones(count)
    mass = ones if mass is None else np.asarray(mass, float)
    snapshot = Snapshot(position, zero, mass, ones, 0 * ones, np.ones((count, 3)), free, ("",) * count, springs)
    return linearise(snapshot, dimensions=dimensions)


def grid_network(counts=(5, 4), steps=(0.3, 0.5), stiffness=(50.0, 20.0), tension=(6.0, 2.5), mass=1.7):
    """A sheet in the x–y plane, springs of one kind along x and of another along y, its rim held."""
    (nx, ny), (dx, dy) = counts, steps
    points = [(i * dx, j * dy) for j in range(ny) for i in range(nx)]
    along_x = [(i + nx * j, i + 1 + nx * j) for j in range(ny) for i in range(nx - 1)]
    along_y = [(i + nx * j, i + nx * (j + 1)) for j in range(ny - 1) for i in range(nx)]
    rim = [i + nx * j for j in range(ny) for i in range(nx) if i in (0, nx - 1) or j in (0, ny - 1)]
    parts = len(along_x), len(along_y)
    each = [np.repeat(values, parts) for values in (stiffness, np.array(steps) - np.array(tension) / np.array(stiffness))]
    return network_of(points, along_x + along_y, held=rim, mass=[mass] * len(points), stiffness=each[0], rest=each[1]), (
        stiffness,
        tension,
        steps,
        mass,
    )


def sheet(amplitude="0", *, prestretch=1.5, dt=0.01, **more):
    """The paper's membrane: 8 × 8 on [−1, 1]², D = 50, its rim held."""
    lattice = {"name": "sheet", "shape": [8, 8], "lower": [-1, -1, 0], "upper": [1, 1, 0], "fixed": "rim"}
    return {
        "title": "Sheet",
        "particles": [{"lattice": {**lattice, "displacement": [0, 0, amplitude]}}],
        "springs": [{"lattice_links": {"of": "sheet", "stiffness": 50, "prestretch": prestretch}}],
        "integrator": {"leapfrog": {"dt": dt}},
        **more,
    }


ONE_MODE = "0.004 * sin(pi * u) * sin(pi * v)"


# --- the linear network ---------------------------------------------------------------------------------------------------


def random_network(seed=2, count=9):
    random = np.random.default_rng(seed)
    position = random.uniform(-1, 1, (count, 3))
    links = [(i, j) for i in range(count) for j in range(i) if random.random() < 0.6]
    stiffness, rest = random.uniform(1, 5, len(links)), random.uniform(0.2, 0.6, len(links))
    mass = random.uniform(0.5, 2, count)
    return position, links, stiffness, rest, mass


def spring_force(position, links, stiffness, rest):
    force = np.zeros_like(position)
    for (i, j), d, length in zip(links, stiffness, rest):
        separation = position[j] - position[i]
        size = math.sqrt(separation @ separation)
        force[i] += d * (size - length) * separation / size
        force[j] -= d * (size - length) * separation / size
    return force


def test_the_stiffness_is_the_derivative_of_the_force():
    position, links, stiffness, rest, mass = random_network()
    network = network_of(position, links, mass=mass, stiffness=stiffness, rest=rest)
    motion = np.random.default_rng(5).uniform(-1, 1, position.shape)
    h = 1e-5
    forces = [spring_force(position + sign * h * motion, links, stiffness, rest) for sign in (1, -1)]
    # Central differences: truncation h² F'''/6 and rounding eps F / h are both about 1e-9 of forces of order 10.
    np.testing.assert_allclose(network.pull(motion), -(forces[0] - forces[1]) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(network.stiffness_matrix @ motion.ravel(), network.pull(motion).ravel(), rtol=0, atol=1e-12)


def test_frequencies_are_those_of_scipy_on_a_matrix_made_otherwise():
    position, links, stiffness, _rest, mass = random_network()
    held = (0, 3)
    lengths = np.array([np.linalg.norm(position[i] - position[j]) for i, j in links])
    network = network_of(position, links, held=held, mass=mass, stiffness=stiffness, rest=0.8 * lengths)  # taut: no buckling
    full = np.zeros((27, 27))
    for (i, j), d, length in zip(links, stiffness, lengths):
        n = (position[j] - position[i]) / length
        block = d * (np.outer(n, n) + 0.2 * (np.eye(3) - np.outer(n, n)))
        elongate = np.zeros((3, 27))
        elongate[:, 3 * i : 3 * i + 3], elongate[:, 3 * j : 3 * j + 3] = -np.eye(3), np.eye(3)
        full += elongate.T @ block @ elongate
    keep = [k for k in range(27) if k // 3 not in held]
    values = scipy.linalg.eigh(full[np.ix_(keep, keep)], np.diag(np.repeat(mass, 3)[keep]), eigvals_only=True)
    found = spectrum(network, shapes=True)
    np.testing.assert_allclose(found.angular_frequency, np.sqrt(values), rtol=1e-12)
    np.testing.assert_allclose(found.shape.T @ (network.freedom_masses[:, None] * found.shape), np.eye(len(keep)), atol=1e-12)


SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
SIDES = [(0, 1), (1, 2), (2, 3), (3, 0)]
TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0.3, 1, 0), (0.2, 0.3, 1)]
FAR = [(x + 1e4, y - 5e3, z) for x, y, z in TETRAHEDRON]
EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
LADDER = [(i, j) for j in range(2) for i in range(6)]
RAILS = [(i + 6 * j, i + 1 + 6 * j) for j in range(2) for i in range(5)] + [(i, i + 6) for i in range(6)]
CROSSES = [(i, i + 7) for i in range(5)] + [(i + 1, i + 6) for i in range(5)]
ROPE = [(0, 0), (1, 0), (2, 0), (3, 0)]
LOOSE = [(0, 0), (1, -0.5), (2, -0.5), (3, 0)]
THREE = [(0, 1), (1, 2), (2, 3)]
COUNTS = {
    # name: (points, links, options), (zero, rigid, mechanisms, stiffened by tension, unstable)
    "square": ((SQUARE, SIDES, {}), (4, 3, 1, 0, 0)),
    "square with a diagonal": ((SQUARE, [*SIDES, (0, 2)], {}), (3, 3, 0, 0, 0)),
    "square on two pins": ((SQUARE, SIDES, {"held": (0, 1)}), (1, 0, 1, 0, 0)),
    "tetrahedron": ((TETRAHEDRON, EDGES, {"dimensions": 3}), (6, 6, 0, 0, 0)),
    "tetrahedron far away": ((FAR, EDGES, {"dimensions": 3}), (6, 6, 0, 0, 0)),
    # 2 · 10 freedoms; 16 bars, of which that between the two pins bears nothing: 20 − 15 = 5.
    "cantilever": ((LADDER, RAILS, {"held": (0, 6)}), (5, 0, 5, 0, 0)),
    "cantilever with cross-links": ((LADDER, RAILS + CROSSES, {"held": (0, 6)}), (0, 0, 0, 0, 0)),
    "rope at rest": ((ROPE, THREE, {"held": (0, 3)}), (2, 0, 2, 2, 0)),
    "rope hanging slack": ((LOOSE, THREE, {"held": (0, 3)}), (1, 0, 1, 0, 0)),
    "rope in tension": ((ROPE, THREE, {"held": (0, 3), "rest": 0.9}), (0, 0, 0, 0, 0)),
    "rope in compression": ((ROPE, THREE, {"held": (0, 3), "rest": 1.1}), (0, 0, 0, 0, 2)),
    "pendulum": ((ROPE[:2], [(0, 1)], {"held": (0,), "dimensions": 3}), (2, 2, 0, 0, 0)),
    "straight double pendulum": ((ROPE[:3], [(0, 1), (1, 2)], {"held": (0,), "dimensions": 3}), (4, 2, 2, 0, 0)),
    "two pendulums on one pin": (([(0, 0), (1, 0), (-1, 0)], [(0, 1), (0, 2)], {"held": (0,)}), (2, 2, 0, 0, 0)),
    "two free pairs": (([(0, 0), (1, 0), (5, 5), (6, 6)], [(0, 1), (2, 3)], {}), (6, 6, 0, 0, 0)),
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", COUNTS)
def test_zero_frequency_modes_are_counted_and_told_apart(name):
    (points, links, options), expected = COUNTS[name]
    found = spectrum(network_of(points, links, **{"dimensions": 2, **options}))
    counts = (found.zero_frequency_modes, found.rigid_motions, found.mechanism_modes, found.second_order_modes)
    assert (*counts, found.unstable_modes) == expected
    assert (
        len(found.angular_frequency) + found.zero_frequency_modes + found.unstable_modes
        == network_of(points, links, **{"dimensions": 2, **options}).freedom_count
    )


def test_shapes_are_solved_for_only_where_they_are_asked_for():
    network = network_of(SQUARE, SIDES, dimensions=2)
    assert spectrum(network).shape is None
    assert spectrum(network, shapes=True).shape.shape == (8, 4)  # freedoms, modes that vibrate


def test_counts_do_not_depend_on_masses_and_stiffnesses_of_any_ratio():
    random = np.random.default_rng(1)
    stiffness = 10.0 ** random.uniform(-4, 4, len(RAILS))
    mass = 10.0 ** random.uniform(-3, 3, len(LADDER))
    found = spectrum(network_of(LADDER, RAILS, held=(0, 6), dimensions=2, stiffness=stiffness, mass=mass))
    assert (found.zero_frequency_modes, found.mechanism_modes, found.unstable_modes) == (5, 5, 0)


def test_a_slack_sheet_is_soft_across_itself_only_to_second_order():
    spec = load_scene(sheet(prestretch=1.0))
    facts = network_facts(spec, assemble(spec), lambda angle: np.eye(2), 0.01)
    assert (facts["zero_frequency_modes"], facts["mechanism_modes"], facts["second_order_modes"]) == (36, 36, 36)
    assert note(facts) == ""  # it does hold itself up, if softly
    few = network_facts(spec, assemble(spec), lambda angle: np.eye(2), 0.01, most_freedoms=100)
    assert few["zero_frequency_modes_least"] == 108 - 84  # 84 of the 112 springs have a free end


# --- lattice theory -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [0, 2])
def test_a_chain_has_the_textbook_frequencies(direction):
    n, d, stiffness, rest, mass = 7, 0.4, 30.0, 0.3, 2.0
    points = [(k * d,) for k in range(n + 2)]
    network = network_of(
        points, [(k, k + 1) for k in range(n + 1)], held=(0, n + 1), mass=[mass] * 9, stiffness=stiffness, rest=rest
    )
    theory = lattice_theory(network, 0, (n + 2, 1, 1), direction)
    resistance = stiffness if direction == 0 else stiffness * (d - rest) / d
    modes = np.arange(1, n + 1)
    expected = 2.0 * np.sqrt(resistance / mass) * np.sin(modes * np.pi / (2 * (n + 1)))
    np.testing.assert_allclose([theory.angular_frequency((k, 1, 1)) for k in modes], expected, rtol=1e-14)
    shape = theory.shape((3, 1, 1), n + 2, 3)[:, direction]
    np.testing.assert_allclose(shape, np.sin(3 * np.pi * np.arange(n + 2) / (n + 1)), atol=1e-15)
    assert theory.lowest(3) == [(1, 1, 1), (2, 1, 1), (3, 1, 1)]


def test_the_theory_gives_every_frequency_of_a_sheet_of_unequal_axes():
    network, (stiffness, tension, (dx, dy), mass) = grid_network()
    theories = [lattice_theory(network, 0, (5, 4, 1), direction) for direction in range(3)]
    all_modes = [theory.angular_frequency((r, s, 1)) for theory in theories for r in (1, 2, 3) for s in (1, 2)]
    # All 18 of the matrix, whose eigenvalues of order 100 are right to some eps · 100.
    np.testing.assert_allclose(np.sort(all_modes), spectrum(network).angular_frequency, rtol=1e-12)
    across = 4 / mass * (tension[0] / dx * math.sin(math.pi / 8) ** 2 + tension[1] / dy * math.sin(2 * math.pi / 6) ** 2)
    assert theories[2].angular_frequency((1, 2, 1)) == pytest.approx(math.sqrt(across), rel=1e-12)


def test_the_membrane_has_the_periods_of_the_paper():
    spec = load_scene(sheet())
    found = find_modes(spec, assemble(spec), of="sheet", show=[(1, 1, 1), (2, 1, 1), (2, 2, 1)])
    periods = [2 * math.pi / mode.angular_frequency for mode in found.modes]
    assert periods == pytest.approx([2.445, 1.578, 1.254], abs=6e-4)  # three decimals are given
    assert found.source == "lattice theory"


def test_springs_without_an_end_in_the_sheet_change_none_of_its_modes():
    """A body hangs on the sheet by a spring, which counts, and on a hook by another, which does not."""
    scene, found = sheet(), []
    scene["particles"] += [{"body": {"name": name, "mass": 1, "position": [0, 0, z]}} for name, z in (("body", 1), ("hook", 2))]
    scene["springs"].append({"link": {"between": ["sheet[27]", "body"], "stiffness": 1}})
    hook = {"link": {"between": ["body", "hook"], "stiffness": 1000}}
    for springs in (scene["springs"], [*scene["springs"], hook]):
        spec = load_scene({**scene, "springs": springs})
        found.append(find_modes(spec, assemble(spec), of="sheet", show=[(1, 1, 1)], along="z"))
    assert all("other springs" in each.source for each in found)
    assert found[0].modes[0].angular_frequency == found[1].modes[0].angular_frequency


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"springs": [{"link": {"between": ["sheet[9]", "sheet[18]"], "stiffness": 1}}]}, "other springs"),
        ({"springs": [{"link": {"between": ["sheet[9]", "sheet[10]"], "stiffness": 1}}]}, "other springs"),
        ({"fixed": "none"}, "not held"),
    ],
)
def test_what_is_no_lattice_gets_the_modes_of_its_matrix(change, reason):
    scene = sheet()
    scene["springs"] += change.get("springs", [])
    scene["particles"][0]["lattice"]["fixed"] = change.get("fixed", "rim")
    spec = load_scene(scene)
    found = find_modes(spec, assemble(spec), of="sheet", show=[(2, 2, 1)], along="z")
    assert found.source.startswith("the network's matrix, for") and reason in found.source
    (mode,) = found.modes
    # It is a mode: K s = ω² M s on every freedom, to the eigensolver's error on stiffnesses of order 100.
    pull, inertia = found.network.pull(mode.shape), mode.angular_frequency**2 * mode.shape
    np.testing.assert_allclose(np.where(found.network.free, pull - inertia, 0.0), 0.0, atol=1e-11)
    # And one near to the theory's: a spring of 1 among those of 50 / 3, or an edge that is free, changes it little.
    assert mode.angular_frequency == pytest.approx(5.0100, rel=0.2 if change.get("fixed") else 0.02)


def test_theory_refuses_unequal_masses_and_springs():
    network, _ = grid_network()
    network.mass[6] *= 1.001
    with pytest.raises(NoTheoryError, match="masses"):
        lattice_theory(network, 0, (5, 4, 1), 2)
    network, _ = grid_network()
    network.lateral[5] *= 1.001
    with pytest.raises(NoTheoryError, match="springs differ"):
        lattice_theory(network, 0, (5, 4, 1), 2)


# --- projection and measurement -------------------------------------------------------------------------------------------


def test_amplitudes_and_shares_of_a_mixture_are_what_was_put_in():
    scene = sheet("0.01 * sin(pi * u) * sin(pi * v) - 0.003 * sin(2 * pi * u) * sin(pi * v)")
    spec = load_scene(scene)
    start = assemble(spec)
    found = find_modes(spec, start, of="sheet", show=[(1, 1, 1), (2, 1, 1)])
    reading = found.read(start)
    np.testing.assert_allclose(reading.amplitude, [0.01, -0.003], rtol=1e-13)
    energies = [mode.angular_frequency**2 * a**2 for mode, a in zip(found.modes, (0.01, 0.003))]  # equal modal masses
    np.testing.assert_allclose(reading.share, np.array(energies) / sum(energies), rtol=1e-12)
    assert reading.total_energy == pytest.approx(0.5 * 12.25 * sum(energies), rel=1e-12)  # Σ sin² sin² = (7/2)²


def test_the_meter_finds_the_frequency_of_a_damped_oscillation_off_its_centre():
    omega, gamma = 2.3, 0.02
    meter = FrequencyMeter()
    for t in np.arange(0.0, 60.0, 2 * math.pi / omega / 40):
        decay = math.exp(-gamma * t)
        value = 0.1 + decay * math.cos(omega * t)
        meter.observe(t, value, decay * (-gamma * math.cos(omega * t) - omega * math.sin(omega * t)))
    found = meter.measured()
    # Off centre by 0.1, falling to a third: crossings on the way up and down move apart by up to 0.2/ω, in opposite senses,
    # and each side's drift changes its slope by (0.1/e^(−γT) − 0.1)/(ω T) = 1.7e-3 of ω at most.
    assert found.angular_frequency == pytest.approx(omega, rel=1.7e-3)
    meter = FrequencyMeter()
    for t in np.arange(0.0, 60.0, 2 * math.pi / omega / 40):
        decay = math.exp(-gamma * t)
        meter.observe(t, decay * math.cos(omega * t), decay * (-gamma * math.cos(omega * t) - omega * math.sin(omega * t)))
    found = meter.measured()
    # The cubic moves a crossing by at most 1.6e-6/ω (h⁴/384 of the amplitude); over 43 half periods that is 2e-8.
    assert found.angular_frequency == pytest.approx(omega, rel=2e-8)
    assert abs(found.angular_frequency - omega) < 10 * found.uncertainty < 1e-5


def test_the_meter_needs_three_crossings():
    meter = FrequencyMeter()
    for t in (0.0, 0.5, 1.0, 1.5, 2.0):
        meter.observe(t, math.cos(2 * t), -2 * math.sin(2 * t))
    assert len(meter.crossings) == 1 and meter.measured() is None


# --- a run ----------------------------------------------------------------------------------------------------------------

WATCHED = {
    "mode_frequency_error": {"of": "sheet", "mode": [1, 1], "below": 1e-4},
    "mode_leakage": {"of": "sheet", "mode": [1, 1], "below": 1e-3},
    "mode_frequency": [
        {"of": "sheet", "mode": [1, 1], "near": 2.5695, "within": 1e-3},
        {"of": "sheet", "mode": [2, 2], "near": 1, "within": 1},
    ],
}


@pytest.fixture(scope="module")
def swung():
    """Twenty periods of the sheet in its lowest mode; the recorder, and what the scene's expectations came to."""
    with Simulation(sheet(ONE_MODE, expect=WATCHED), backend="cpu") as simulation:
        recorder = ModeRecorder(simulation, ModesSpec(of="sheet", show=((1, 1, 1), (2, 1, 1))), 1000)
        watcher = Watcher(simulation.spec.expect, 1000)
        simulation.run(duration=48.9, recorders=[recorder, watcher])
        recorder.finish(simulation)
        watcher.finish(simulation)
        damping = predicted_damping(simulation.integrator.amplification, 2.5695, simulation.dt)
        return recorder, {verdict.label: verdict for verdict in watcher.verdicts({}, "f64")}, damping


def test_a_run_shows_the_theory_and_its_own_step(swung):
    recorder, verdicts, damping = swung
    one, two = recorder.summary()["modes"]
    # Beside the step's own error, the tension grows with the square of the amplitude: 0.35 · 0.004² = 6e-6 (measured: 3.5e-3 at
    # 0.1 and 8.9e-4 at 0.05).
    assert one["relative_frequency_error"] == pytest.approx(damping.frequency_error, abs=1e-5)
    assert 2e-5 < damping.frequency_error < 3e-5  # (ω dt)²/24
    assert one["angular_frequency_uncertainty"] < 1e-6
    assert one["amplitude_max"] == pytest.approx(0.004, rel=1e-3) and one["energy_share"] > 0.999
    assert two["angular_frequency_measured"] is None and two["amplitude_max"] < 1e-12  # the sheet's symmetry keeps it out
    assert recorder.summary()["mode_leakage_max"] < 1e-3
    error = verdicts["mode_frequency_error(of=sheet, mode=(1, 1, 1))"]
    # The two take samples at different times; a crossing is known to 1.6e-6/ω, a mean over 40 of them to a part in 1e-7.
    assert error.passed and error.value == pytest.approx(one["relative_frequency_error"], abs=1e-7)
    # What leaves the mode goes as the amplitude squared too: it is 1.95e-4 at 0.01.
    assert verdicts["mode_leakage(of=sheet, mode=(1, 1, 1))"].value == pytest.approx(1.95e-4 * 0.16, rel=0.5)
    assert verdicts["mode_frequency(of=sheet, mode=(1, 1, 1))"].passed
    never = verdicts["mode_frequency(of=sheet, mode=(2, 2, 1))"]
    assert not never.passed and never.value is None and "is not excited" in never.reason


@pytest.mark.parametrize(("r", "s"), [(1, 1), (2, 1), (2, 2)])
@pytest.mark.sampled(3)
def test_a_membrane_keeps_to_its_mode_and_its_frequency(r, s):
    """The lattice formula to 1e-4, and less than 1e-3 of the energy elsewhere, in 20 periods."""
    omega = math.sqrt(50 * (1 - 1 / 1.5) * 4 * (math.sin(r * math.pi / 14) ** 2 + math.sin(s * math.pi / 14) ** 2))
    mode = {"of": "sheet", "mode": [r, s]}
    expect = {
        "mode_frequency": {**mode, "near": omega, "within": 1e-4},
        "mode_frequency_error": {**mode, "below": 1e-4},
        "mode_leakage": {**mode, "below": 1e-3},
    }
    # The step's own error (ω dt)²/24 is 2.6e-5 at most, and the growing tension's is a tenth of 1e-4 at this amplitude.
    scene = sheet(f"0.004 * sin({r} * pi * u) * sin({s} * pi * v)", dt=0.005, expect=expect)
    with Simulation(scene, backend="cpu") as simulation:
        watcher = Watcher(simulation.spec.expect, 1000)
        simulation.run(duration=20 * 2 * math.pi / omega, recorders=[watcher])
        watcher.finish(simulation)
        assert all(verdict.passed for verdict in watcher.verdicts({}, "f64")), watcher.verdicts({}, "f64")


def test_files_hold_what_was_recorded_and_plots_open_again(swung, tmp_path):
    recorder, _, _ = swung
    for suffix in (".csv", ".npz", ".png", ".svg", ".pdf"):
        recorder.save(tmp_path / f"modes{suffix}")
    columns = recorder.columns()
    with open(tmp_path / "modes.csv", encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["amplitude_1_1"]) for row in rows] == columns["amplitude"][:, 0].tolist()
    assert float(rows[0]["amplitude_1_1"]) == pytest.approx(0.004, rel=1e-13)
    with np.load(tmp_path / "modes.npz") as data:
        assert data["mode"].tolist() == [[1, 1], [2, 1]]
        assert np.array_equal(data["rate"], columns["rate"]) and data["angular_frequency_theory"][0] == pytest.approx(2.5694504)
    with Image.open(tmp_path / "modes.png") as picture:
        colors = {color for _, color in picture.convert("RGB").getcolors(1 << 24)}
    assert {(0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00)} <= colors  # both curves are drawn
    curves = _mode_plot.figure_of(recorder).axes[0].lines
    assert [np.array_equal(curve.get_ydata(), columns["amplitude"][:, k]) for k, curve in enumerate(curves)] == [True, True]
    drawing = (tmp_path / "modes.svg").read_text(encoding="utf-8")
    assert "<svg" in drawing and "amplitude a" in drawing and "mode (2, 1)" in drawing
    assert (tmp_path / "modes.pdf").read_bytes().startswith(b"%PDF")
    assert recorder.caption().startswith("modes (1, 1) ")
    recorder.restart()
    assert not recorder.times and recorder.measured() == [None, None] and recorder.caption() == ""


def test_a_slack_sheet_swings_the_slower_the_smaller_it_swings():
    with Simulation(sheet("0.1 * sin(pi * u) * sin(pi * v)", prestretch=1.0), backend="cpu") as simulation:
        recorder = ModeRecorder(simulation, ModesSpec(of="sheet", show=((1, 1, 1),)), 20)
        simulation.run(duration=32.0, recorders=[recorder])
    (row,) = recorder.summary()["modes"]
    # The paper's sheet: period 25.2 at amplitude 0.1; it loses its shape on the way, so one period is known to some per cent.
    assert 2 * math.pi / row["angular_frequency_measured"] == pytest.approx(25.2, rel=0.05)
    assert row["angular_frequency_theory"] == 0.0
    assert row["relative_frequency_error"] is None and recorder.summary()["mode_leakage_max"] is None


def test_the_command_line_tells_modes_and_mechanisms(tmp_path, capsys):
    path = tmp_path / "ladder.yaml"
    ladder = [{"body": {"mass": 1, "position": list(point), "free": k not in (0, 6)}} for k, point in enumerate(LADDER)]
    links = [{"link": {"between": list(pair), "stiffness": 10}} for pair in RAILS]
    scene = {
        "dimensions": 2,
        "particles": ladder,
        "springs": links,
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"steps": 20},
    }
    scene["particles"][5]["body"]["velocity"] = [0.1, 0]
    path.write_text(yaml.safe_dump({**scene, "modes": {"show": [[2]]}}), encoding="utf-8")
    assert main(["run", str(path), "--headless", "--json", "-v", "--modes", str(tmp_path / "m.csv")]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["zero_frequency_modes"], found["mechanism_modes"], found["rigid_motions"]) == (5, 5, 0)
    assert [row["at"] for row in found["predicted_damping"]] == ["lowest", "excited", "highest"]
    assert found["predicted_damping"][0]["energy_loss_per_oscillation"] == 0.0
    assert found["modes"][0]["mode"] == [2] and found["modes_source"] == "the network's matrix"
    assert str(tmp_path / "m.csv") in found["files"]
    assert "note: the network is a mechanism: 5 zero-frequency modes beside 0 rigid motions" in err
    assert "5 of zero frequency: 0 rigid motions, 5 mechanisms" in err
    assert "damping predicted at the lowest ω" in err and "no energy lost" in err


def test_faulty_modes_are_refused_before_the_run(tmp_path, capsys, monkeypatch):
    def faults(**modes):
        with pytest.raises(SceneError) as caught:
            load_scene(sheet(modes=modes))
        return str(caught.value)

    assert "modes.of: no lattice is called 'sheat', did you mean 'sheet'" in faults(of="sheat")
    assert "modes.show[1]: sheet has no mode [7, 1, 1], allowed: from [1, 1, 1] to [6, 6, 1]" in faults(
        of="sheet", show=[[1, 1], [7, 1]]
    )
    assert "modes.along" in faults(of="sheet", along="w")
    with pytest.raises(SceneError, match="expect.mode_leakage.mode: sheet has no mode"):
        load_scene(sheet(expect={"mode_leakage": {"of": "sheet", "mode": [1, 9], "below": 1}}))
    with pytest.raises(SceneError, match="expect.mode_leakage.of: no lattice is called 'x'"):
        load_scene(sheet(expect={"mode_leakage": {"of": "x", "mode": [1, 1], "below": 1}}))
    path = tmp_path / "scene.yaml"
    path.write_text(yaml.safe_dump(sheet(run={"steps": 5})), encoding="utf-8")
    assert main(["run", str(path), "--headless", "--modes", "m.txt"]) == 2
    assert "--modes m.txt: the suffix must be one of .png" in capsys.readouterr().err
    monkeypatch.setattr(_mode_plot.importlib.util, "find_spec", lambda name: None)
    assert main(["run", str(path), "--headless", "--modes", str(tmp_path / "m.png")]) == 3
    assert "pip install 'mpp-taichi[report]'" in capsys.readouterr().err
    monkeypatch.undo()
    with Simulation(sheet(dimensions=2), backend="cpu") as simulation:
        with pytest.raises(SceneError, match="scene: modes: along is not said, and sheet has no direction across itself"):
            ModeRecorder(simulation, ModesSpec(of="sheet"), 10)
        with pytest.raises(SceneError, match="there is no mode 1000, the network has 72 that vibrate"):
            ModeRecorder(simulation, ModesSpec(show=((1000, 1, 1),)), 10)


# --- numerical damping ----------------------------------------------------------------------------------------------------


# That a method's amplification matrix is what its steps do, test_integrators asks of every method; here a matrix is read. No
# loss, little, much; two states in one, and derivatives.
@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["leapfrog", "rk4", "implicit_euler", "bdf2", "hermite4"])
def test_the_predicted_damping_is_that_of_a_simulated_oscillator(name):
    """Positions obey x_{n+1} = 2 |λ| cos θ x_n − |λ|² x_{n−1}, once what other eigenvalues a method has have died away."""
    bodies = [{"mass": 1, "position": [0, 0], "free": False}, {"mass": 1, "position": [101, 0]}]
    scene = {
        "dimensions": 2,
        "particles": [{"body": body} for body in bodies],
        "springs": [{"link": {"between": [0, 1], "stiffness": 1.0, "rest_length": 100.0}}],
        "integrator": {name: {"dt": 0.4}},
    }
    with Simulation(scene, backend="cpu", plan="serial") as simulation:
        simulation.run(steps=30)
        x = [simulation.snapshot().position[1, 0] - 100.0]
        for _ in range(20):
            x.append(simulation.run(steps=1).snapshot().position[1, 0] - 100.0)
        predicted = predicted_damping(simulation.integrator.amplification, 1.0, simulation.dt)
    x = np.array(x)
    (trace, minus_square), *_ = np.linalg.lstsq(np.stack([x[1:-1], x[:-2]], axis=1), x[2:], rcond=None)
    theta = math.acos(0.5 * trace / math.sqrt(-minus_square))
    loss = 1.0 - (-minus_square) ** (2.0 * math.pi / theta)
    # Positions of 100 are rounded by 1e-14; implicit Euler has brought the amplitude down to 1e-3 when it is measured, and to
    # 1e-4 at the end. Its equations, too, are solved to a tolerance of that kind.
    assert predicted.frequency_error == pytest.approx(theta / 0.4 - 1.0, abs=1e-7)
    assert predicted.energy_loss == pytest.approx(loss, abs=1e-6, rel=1e-6)


def test_a_step_beyond_the_limit_does_not_oscillate():
    def leapfrog(angle):
        return np.array([[1.0 - angle**2 / 2, 1.0 - angle**2 / 4], [-(angle**2), 1.0 - angle**2 / 2]])

    assert predicted_damping(leapfrog, 1.0, 2.01).frequency_error is None
    # cos θ = 1 − (ω dt)²/2, and no energy is lost: the leapfrog's own closed form.
    found = predicted_damping(leapfrog, 1.0, 1.9)
    assert found.frequency_error == pytest.approx(math.acos(1 - 1.9**2 / 2) / 1.9 - 1.0, rel=1e-12)
    assert found.energy_loss == 0.0


def test_the_highest_frequency_of_a_network_too_large_to_solve_is_the_one_that_is_given():
    spec = load_scene(Path(__file__).parents[2] / "scenes" / "chain.yaml")
    amplification = component.build("integrators", "leapfrog", {"dt": 0.01}).amplification
    told = network_facts(spec, assemble(spec), amplification, 0.01, most_freedoms=0, highest=3.0)
    assert told["highest_angular_frequency"] == 3.0
    # Leapfrog turns by 2 asin(ω dt/2) a step.
    (row,) = [each for each in told["predicted_damping"] if each["at"] == "highest"]
    assert row["relative_frequency_error"] == pytest.approx(math.asin(0.015) / 0.015 - 1.0, rel=1e-6)


def test_mode_numbers_without_a_lattice_apply_to_the_only_lattice():
    spec = load_scene(SCENES / "membrane.yaml")
    named = find_modes(spec, assemble(spec), of="sheet", show=[(1, 1, 1), (2, 1, 1), (1, 2, 1)])
    unnamed = find_modes(spec, assemble(spec), show=[(1, 1, 1), (2, 1, 1), (1, 2, 1)])
    assert [mode.label for mode in unnamed.modes] == [mode.label for mode in named.modes]
    pendulum = load_scene(SCENES / "double_pendulum.yaml")
    with pytest.raises(ModeError, match="of: must name one"):
        find_modes(pendulum, assemble(pendulum), show=[(1, 2, 1)])
