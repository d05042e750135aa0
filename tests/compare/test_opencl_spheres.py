"""Hard spheres in OpenCL bounce as in the program's pairwise solver, off each other and off every kind of wall."""

from dataclasses import replace

import numpy as np
import pytest
from opencl_models import UNIT, change_kernel, loaded, spheres

from mpp_taichi import Simulation

NUDGE = 1e-9  # of the start, to see what the run makes of a perturbation
OPERATIONS = 60  # that round a number in a step


ROUND_WALLS = (
    {"cylinder": {"point": [4, 4, 0], "axis": [0, 0, 1], "radius": 5.4, "restitution": 0.7}},
    {"plane": {"point": [0, 0.2, 0], "normal": [0.1, 1, 0], "velocity": [0, 0.4, 0]}},
)
MATERIALS = [{"between": ["bead", "gas"], "restitution": 0.2}]
CASES = {
    "a crowd in a box": (spheres(400), 40),
    "disks of two materials": (
        spheres(200, edges=(8, 8), integrator="velocity_verlet", radius=0.15, contact_time=0.05, pairs=MATERIALS),
        40,
    ),
    "a box that repeats": (spheres(300, repeats=True), 40),
    "a flat box that repeats": (spheres(200, repeats=True, edges=(9, 9, 2), radius=0.3), 30),
    "a few among moving and round walls": (spheres(60, walls=ROUND_WALLS, radius=0.6, overlap="separate"), 60),
}
# Too few for a grid, or an axis that repeats has no room for three cells.
WITHOUT_GRID = ("a flat box that repeats", "a few among moving and round walls")


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


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", CASES)
def test_spheres_bounce_as_the_programs_own_do(opencl, name):
    """The bound is what rounding a step's numbers, of at most 8, makes, times what the run made of a nudge."""
    scene, steps = CASES[name]
    spec, start = loaded(scene)
    with Simulation(spec, backend="cpu", precision="f64") as simulation:
        expected = simulation.run(steps=steps).snapshot()
        report = simulation.contact_report
    found, nudged, variant = ways(opencl, spec, start, steps, "f64")
    assert ("grid" in variant) == (name not in WITHOUT_GRID)
    growth = max(
        1.0, np.abs(nudged.position - found.position).max() / NUDGE, np.abs(nudged.velocity - found.velocity).max() / NUDGE
    )
    limit = steps * OPERATIONS * 8.0 * UNIT["f64"] * growth
    assert limit < 1e-6  # else the spheres are too chaotic for the comparison to mean anything
    assert np.abs(found.position - expected.position).max() < limit
    assert np.abs(found.velocity - expected.velocity).max() < limit
    assert report.pair_count > start.particle_count / 4 and (report.wall_count > 10 or "repeats" in name)
    assert np.array_equal(found.position[0], start.position[0])  # the bead is held


@pytest.mark.sampled(3)
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


CROWD = "a crowd in a box"


@pytest.mark.sampled(3)
def test_pairs_in_rounds_lead_where_one_after_the_other_does(opencl):
    """As GPUs work them off, here in the driver at hand; a close packing, so that spheres have several pairs at once."""
    spec, start = loaded(spheres(1200, radius=0.26))
    device = opencl.choose()
    ends = []
    for kind in ("cpu", "gpu"):
        with opencl.Runner(spec, start, device=replace(device, type=kind)) as runner:
            assert ("rounds" in runner.variant) == (kind == "gpu")
            runner.advance(20)
            ends.append(runner.snapshot())
    assert np.array_equal(ends[0].position, ends[1].position) and np.array_equal(ends[0].velocity, ends[1].velocity)


FAULTS = {
    "wrong sign": (CROWD, "v[i] -= impulse * (w_i * n);", "v[i] += impulse * (w_i * n);"),
    "dropped pair": (CROWD, "LOOK(up == 0 ? slot + 1 :", "LOOK(up == 0 ? slot + 2 :"),
    "dropped row of cells": (CROWD, "up < (DIMENSIONS == 3 ? 5 : 2)", "up < (DIMENSIONS == 3 ? 4 : 2)"),
    "pairs out of order": (CROWD, "hole > begin && partner[hole - 1] > j", "hole > begin && partner[hole - 1] < j"),
    "wall forgotten": (CROWD, "s < SURFACES", "s < SURFACES - 1"),
    "cells behind the last forgotten": ("a box that repeats", "repeats ? (cell + cells) % cells : -1", "-1"),
    "images forgotten": ("a flat box that repeats", "return period > 0 && fabs(d) > period / 2", "return 0"),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_contact_is_seen(opencl, fault, monkeypatch):
    name, text, instead = FAULTS[fault]
    scene, steps = CASES[name]
    spec, start = loaded(scene)
    expected = opencl.run(spec, start, steps)
    change_kernel(monkeypatch, "hard_spheres", text, instead)
    try:
        found = opencl.run(spec, start, steps)
    except opencl.Failed:
        return
    assert np.abs(found.velocity - expected.velocity).max() > 1e-6


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"motion": ["0", "0.1*sin(t)", "0"]}, "with a motion"),
        ({"turning": {"angle": "0.1*t", "axis": [1, 0, 0]}}, "with a turning"),
        ({"friction": 0.3}, "with a friction"),
    ],
)
def test_walls_that_the_kernels_do_not_know_are_refused_by_name(opencl, given, words):
    wall = {"plane": {"point": [0, -1, 0], "normal": [0, 1, 0], **given}}
    spec, start = loaded(spheres(10, walls=(wall,), radius=0.3, overlap="separate"))
    with pytest.raises(opencl.Refused, match=f"no OpenCL kernel for walls\\[1\\].plane.* {words}"):
        opencl.Runner(spec, start, precision="f64")
