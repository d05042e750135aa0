"""A pile of slightly soft spheres: it gains no energy, comes to rest without drag, and its forces balance."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mpp_taichi.scene.estimate import estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.simulation.simulation import Simulation

COUNT, RADIUS, WIDTH, COMPLIANCE, STEP, TOLERANCE = 100, 0.5, 4.2, 1e-3, 0.1, 1e-10
GRAVITY = [0.05, 0.03, -1.0]
SMALLER = [
    f"constants.count={COUNT}",
    f"constants.width={WIDTH}",
    f"constants.compliance={COMPLIANCE}",
    "constants.drained=20",
    f"contacts.hard_spheres.tolerance={TOLERANCE}",
]


def contacts(snapshot, width=WIDTH):
    """Of everything that overlaps: the spheres i and j (−1 for a wall), the unit vector towards i, and the overlap."""
    x, r = snapshot.position, snapshot.radius
    i, j = cKDTree(x).query_pairs(2 * r.max(), output_type="ndarray").T
    apart = x[i] - x[j]
    distance = np.linalg.norm(apart, axis=1)
    found = [(i, j, apart / distance[:, None], r[i] + r[j] - distance)]
    for axis, sign, place in [(axis, sign, width * (sign < 0)) for axis in (0, 1) for sign in (1, -1)] + [(2, 1, 0.0)]:
        normal = np.zeros_like(x)
        normal[:, axis] = sign
        found.append((np.arange(len(x)), np.full(len(x), -1), normal, r - sign * (x[:, axis] - place)))
    i, j, normal, overlap = (np.concatenate(each) for each in zip(*found, strict=True))
    closed = overlap > 0.0
    return i[closed], j[closed], normal[closed], overlap[closed]


def energy(snapshot, width=WIDTH):
    """Kinetic, of gravity, and elastic."""
    overlap = contacts(snapshot, width)[3]
    kinetic = 0.5 * np.sum(snapshot.velocity**2)
    return kinetic + (-np.sum(snapshot.position @ GRAVITY)) + 0.5 * np.sum(overlap**2) / COMPLIANCE


@pytest.mark.sampled(3)
def test_a_pile_gains_no_energy_and_comes_to_rest(request):
    """The scene of 10,000, with fewer."""
    path = request.config.root_folder / "scenes" / "large" / "pile_10000.yaml"
    assert estimate(load_scene(path)).particle_count == 10_000
    simulation = Simulation(path, backend="cpu", precision="f64", overrides=SMALLER)
    # Implicit Euler on a convex energy; spheres curve away from the tangents that a step takes for them, which gives nothing.
    # What a contact may lack, tolerance × radius, is worth that times the force it bears, of some thousand contacts at most.
    room = 1e3 * TOLERANCE * RADIUS * COUNT
    before = energy(simulation.snapshot())
    for _ in range(60):
        simulation.run(10 * STEP)
        now = energy(simulation.snapshot())
        assert now <= before + room
        before = now
    simulation.run(until=70.0)
    start, told = simulation.snapshot(), simulation.contact_report
    simulation.run(until=80.0)
    end, report = simulation.snapshot(), simulation.contact_report
    simulation.close()
    assert report.unresolved == 0
    # At rest: a hundred steps, each solved to what its contacts may lack, times the condition number 6 h²/c of what yields.
    lacking = 6 * STEP**2 / COMPLIANCE * TOLERANCE * RADIUS
    assert np.abs(end.position - start.position).max() < 100 * lacking
    # The floor bears the weight, and the forces on each sphere, found from how deep spheres are in each other, balance.
    floor = (report.wall_impulse[4] - told.wall_impulse[4]) / 10.0
    assert floor == pytest.approx(COUNT * -GRAVITY[2], rel=1e-6)
    i, j, normal, overlap = contacts(end)
    push = normal * (overlap / COMPLIANCE)[:, None]
    total = np.tile(GRAVITY, (COUNT, 1))
    np.add.at(total, i, push)
    np.subtract.at(total, j[j >= 0], push[j >= 0])
    assert np.abs(total).max() < 12 * lacking / COMPLIANCE  # twelve neighbours at most


def pytest_generate_tests(metafunc):
    """The scene of 10,000 itself takes minutes, and runs with `--thorough` alone; a tenth of it, as deep, takes seconds."""
    if "count" in metafunc.fixturenames:
        metafunc.parametrize("count", (1000, 10_000) if metafunc.config.getoption("--thorough") else (1000,))


@pytest.mark.sampled(3)
def test_thousands_come_to_rest_sink_no_more_and_never_gain_energy(request, count):
    """Until the kinetic energy is 1e-8 m g d each (Silbert et al., Phys. Rev. E 65 (2002) 031304), and on.

    When the last avalanche ends is a matter of chance: of 10,000 at t = 250 to 410 of five seeds.
    """
    width, rest = 58.0 * (count / 10_000) ** 0.5, 1e-8
    simulation = Simulation(
        request.config.root_folder / "scenes" / "large" / "pile_10000.yaml",
        backend="cpu",
        precision="f64",
        overrides=["run.duration=1000", f"constants.count={count}", f"constants.width={width}"],
    )

    def kinetic(snapshot):
        return 0.5 * np.sum(snapshot.velocity**2) / count

    now = simulation.snapshot()
    before = energy(now, width)
    while now.time < 900.0 and (kinetic(now) > rest or now.time < 20.0):  # they begin at rest in the air
        simulation.run(1.0)
        now = simulation.snapshot()
        # Ten steps, after each of which a contact may lack tolerance × radius, times the force it bears.
        room = 10 * 1e-6 * RADIUS * contacts(now, width)[3].sum() / COMPLIANCE
        assert energy(now, width) <= before + room
        before = energy(now, width)
    assert kinetic(now) <= rest
    simulation.run(50.0)
    later, report = simulation.snapshot(), simulation.contact_report
    simulation.close()
    assert report.unresolved == 0 and kinetic(later) <= rest
    # No faster than what that energy is worth, downwards.
    sunk = (now.position - later.position)[:, 2].mean()
    assert abs(sunk) < 50.0 * np.sqrt(2 * rest)
    assert contacts(later, width)[3].max() < 0.02  # 6 deep, a contact bears some ten weights: 1e-3 each
