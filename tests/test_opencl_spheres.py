"""Hard spheres in OpenCL bounce as the program's own pairwise step has it, off each other and off every kind of wall."""

from dataclasses import replace

import numpy as np
import pytest
from opencl_models import UNIT, change_kernel, loaded

from mpp_taichi import Simulation

NUDGE = 1e-9  # of the start, to see what the run makes of a perturbation
OPERATIONS = 60  # that round a number in a step


def spheres(count, *, dimensions=3, walls=(), dt=0.02, integrator="leapfrog", radius=0.25, **contacts):
    """A gas in a box 8 wide, of different radii and masses; one sphere is held."""
    lower, upper = [0.0] * dimensions, [8.0] * dimensions
    bead = {"mass": 3.0, "radius": 0.4, "position": [4.0] * dimensions + [0.0] * (3 - dimensions), "free": [False] * 3}
    gas = {"name": "gas", "count": count, "lower": lower, "upper": upper, "radius": radius, "radius_spread": 0.3, "speed": 2.0}
    field = [{"uniform_gravity": {"acceleration": [0.3, -1.0, 0.2 * (dimensions == 3)]}}]
    solver = {"solver": "pairwise", "restitution": 0.9, **contacts}
    return {
        "title": "Spheres",
        "dimensions": dimensions,
        "seed": 3,
        "particles": [{"body": {"name": "bead", **bead}}, {"gas": gas}],
        "forces": field,
        "contacts": {"hard_spheres": solver},
        "walls": [{"box": {"lower": lower, "upper": upper, "restitution": 0.8}}, *walls],
        "integrator": {integrator: {"dt": dt}},
    }


ROUND_WALLS = (
    {"cylinder": {"point": [4, 4, 0], "axis": [0, 0, 1], "radius": 5.4, "restitution": 0.7}},
    {"plane": {"point": [0, 0.2, 0], "normal": [0.1, 1, 0], "velocity": [0, 0.4, 0]}},
)
MATERIALS = [{"between": ["bead", "gas"], "restitution": 0.2}]
CASES = {
    # More than those that one work-item looks at all pairs of, so that they are found on the grid.
    "a crowd in a box": (spheres(400), 40),
    "disks of two materials on the grid": (
        spheres(200, dimensions=2, integrator="velocity_verlet", radius=0.15, contact_time=0.05, pairs=MATERIALS),
        40,
    ),
    "a few among moving and round walls": (spheres(60, walls=ROUND_WALLS, radius=0.6, overlap="separate"), 60),
}


def ways(opencl, spec, start, steps, precision):
    """Where a run leads, and where from a nudged start."""
    nudged = replace(
        start, position=start.position + NUDGE * np.random.default_rng(1).uniform(-1, 1, start.position.shape) * start.free
    )
    found = []
    with opencl.Runner(spec, start, precision=precision) as runner:
        variant = runner.variant
        for each in (start, nudged):
            runner.restart(each)
            runner.advance(steps // 2)
            runner.advance(steps - steps // 2)
            found.append(runner.snapshot())
    return *found, variant


@pytest.mark.parametrize("name", CASES)
def test_spheres_bounce_as_the_programs_own_do(opencl, name):
    """The bound is what rounding a step's numbers, of at most 8, makes, times what the run made of a nudge."""
    scene, steps = CASES[name]
    spec, start = loaded(scene)
    with Simulation(spec, backend="cpu", precision="f64") as simulation:
        expected = simulation.run(steps=steps).snapshot()
        report = simulation.contact_report
    found, nudged, variant = ways(opencl, spec, start, steps, "f64")
    assert ("grid" in variant) == (start.particle_count > 128)
    growth = max(
        1.0, np.abs(nudged.position - found.position).max() / NUDGE, np.abs(nudged.velocity - found.velocity).max() / NUDGE
    )
    limit = steps * OPERATIONS * 8.0 * UNIT["f64"] * growth
    assert limit < 1e-6  # else the spheres are too chaotic for the comparison to mean anything
    assert np.abs(found.position - expected.position).max() < limit
    assert np.abs(found.velocity - expected.velocity).max() < limit
    assert report.pair_count > start.particle_count / 4 and report.wall_count > 10
    assert np.array_equal(found.position[0], start.position[0])  # the bead is held


def test_spheres_in_f32_are_those_of_f64_while_rounding_does_not_grow(opencl):
    spec, start = loaded(CASES["a crowd in a box"][0])
    steps = 8
    found, nudged, _ = ways(opencl, spec, start, steps, "f64")
    growth = max(1.0, np.abs(nudged.velocity - found.velocity).max() / NUDGE)
    narrow = opencl.run(spec, start, steps, precision="f32")
    assert np.abs(narrow.velocity - found.velocity).max() < steps * OPERATIONS * 8.0 * UNIT["f32"] * growth
    assert np.abs(found.velocity - start.velocity).max() > 1.0


def test_the_bits_do_not_depend_on_the_order_in_which_pairs_are_found(opencl):
    """Atomics count spheres into cells and pairs into rows; nothing of their order is left."""
    spec, start = loaded(CASES["a crowd in a box"][0])
    results = {opencl.run(spec, start, 30).position.tobytes() for _ in range(3)}
    assert len(results) == 1


FAULTS = {
    "wrong sign": ("v[i] -= impulse * (w_i * n);", "v[i] += impulse * (w_i * n);"),
    "dropped pair": ("begin = up == 0 ? slot + 1 :", "begin = up == 0 ? slot + 2 :"),
    "dropped row of cells": ("up < (DIMENSIONS == 3 ? 5 : 2)", "up < (DIMENSIONS == 3 ? 4 : 2)"),
    "pairs out of order": ("hole > begin && partner[hole - 1] > j", "hole > begin && partner[hole - 1] < j"),
    "wall forgotten": ("s < SURFACES", "s < SURFACES - 1"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_contact_is_seen(opencl, fault, monkeypatch):
    spec, start = loaded(CASES["a crowd in a box"][0])
    steps = CASES["a crowd in a box"][1]
    expected = opencl.run(spec, start, steps)
    change_kernel(monkeypatch, "hard_spheres", *FAULTS[fault])
    try:
        found = opencl.run(spec, start, steps)
    except opencl.Failed:
        return
    assert np.abs(found.velocity - expected.velocity).max() > 1e-6
