"""Networks at rest under their weight against an independent nonlinear truss computation."""

import math
from pathlib import Path

import numpy as np
import pytest
from compiled import random_snapshot, snapshot_of
from measured import MadeUpSample
from reference import truss
from scipy.optimize import brentq

from mpp_taichi import Simulation, component
from mpp_taichi.quantities._base import NoResultError

SCENES = Path(__file__).parents[2] / "scenes"


def settled(scene, gravity, drag, duration, overrides=()):
    """Where a scene comes to rest with a drag on every particle, and where Newton's method on its energy puts it.

    The drag exerts nothing on what stands still, so that the rest is that of the springs and their load alone.
    """
    overrides = [*overrides, f"+forces[1]={{linear_drag: {{coefficient: {drag}}}}}"]
    with Simulation(scene, backend="cpu", precision="f64", overrides=overrides) as simulation:
        end = simulation.run(duration=duration).snapshot()
        start = simulation.start
    s = start.springs
    load = start.mass[:, None] * np.array([0.0, 0.0, -gravity])
    # From a shape of its own: the start, let down a little where it is free, so that no bar of a straight row is singular.
    begin = start.position - 0.01 * start.free * np.array([0.0, 0.0, 1.0])
    plane = start.free & [True, False, True]  # across it a compressed bar would rather buckle, but nothing pushes it there
    return start, end, truss.static_shape(begin, s.between, s.stiffness, s.rest_length, load, plane)


def test_the_sag_of_the_cantilever_is_that_of_the_truss():
    """Its slowest mode swings at ω = 3.95: with c/m = 4 every one falls as e^{−2t}, to 4e-11 after 12."""
    start, end, expected = settled(SCENES / "cantilever.yaml", 2.0, 0.4, 12.0)
    sag = start.position - expected
    tip = 5
    assert sag[tip, 2] == pytest.approx(0.16804, abs=1e-5), "the scene is another one than this test was written for"
    assert (start.position - end.position)[tip, 2] == pytest.approx(sag[tip, 2], rel=1e-6)
    assert np.abs(end.position - expected).max() < 1e-6 * sag[tip, 2]
    assert np.abs(end.velocity).max() < 1e-6 * sag[tip, 2]


def test_without_cross_links_the_cantilever_has_five_ways_to_move_that_cost_nothing():
    """Its stiffness matrix: one zero mode in the plane for the shear of each of the five squares; across it, all ten masses."""
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.start.assemble import assemble

    for name, zeros in (("cantilever", 10), ("cantilever_loose", 15)):
        start = assemble(load_scene(SCENES / f"{name}.yaml"))
        s, free = start.springs, start.free.ravel()
        _, matrix = truss.derivatives(start.position, s.between, s.stiffness, s.rest_length)
        values = np.linalg.eigvalsh(matrix[np.ix_(free, free)])
        assert np.count_nonzero(np.abs(values) < 1e-9 * values.max()) == zeros


def hanging_chain(stiffness=2000.0, count=51, span=1.6, gravity=1.0):
    """Fifty links of 2 in all, 1 in mass, their ends brought together to the span."""
    lattice = {"name": "chain", "shape": [count], "lower": [0, 0, 0], "upper": [2, 0, 0], "mass": 1.0 / (count - 1)}
    lattice |= {"fixed": "ends", "displacement": [f"{span - 2} * u", 0, "-1.6 * u * (1 - u)"]}
    return {
        "particles": [{"lattice": lattice}],
        "springs": [{"lattice_links": {"of": "chain", "stiffness": stiffness}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -gravity]}}],
        "integrator": {"leapfrog": {"dt": 2.5e-3}},
    }


def elastic_catenary(length, span, weight, stiffness, s):
    """Places at the rest length s from the middle of an elastic string of stiffness EA and weight per rest length."""

    def place(pull, s):
        x = pull * s / stiffness + pull / weight * math.asinh(weight * s / pull)
        z = weight * s * s / (2.0 * stiffness) + pull / weight * (math.hypot(1.0, weight * s / pull) - 1.0)
        return x, z

    pull = brentq(lambda pull: place(pull, length / 2)[0] - span / 2, 1e-3, 10.0)
    return np.array([place(pull, each) for each in s])


def test_a_chain_of_fifty_links_hangs_as_the_truss_and_nearly_as_the_elastic_catenary():
    """Its slowest mode swings at ω = 2.32; with c/m = 5 the slower of its two rates is 1.57: e^{−28} = 5e-13 is left."""
    stiffness, count = 2000.0, 51
    _, end, expected = settled(hanging_chain(stiffness, count), 1.0, 5.0 / 50.0, 18.0)
    assert np.abs(end.position - expected).max() < 1e-6
    # Links of h = 0.04 leave the smooth curve by order h² times its curvature, which is below 4 here.
    s = np.linspace(-1.0, 1.0, count)
    curve = elastic_catenary(2.0, 1.6, 0.5, stiffness * 2.0 / (count - 1), s)
    curve = np.stack([curve[:, 0] + 0.8, curve[:, 1] - curve[0, 1]], axis=1)
    assert np.abs(end.position[:, [0, 2]] - curve).max() < 0.04**2
    assert end.position[count // 2, 2] < -0.5


def pull(snapshot, of, axis):
    """The spring force that the quantity measures."""
    return component.build("quantities", "spring_force", {"of": of, "axis": axis}).measure(MadeUpSample(snapshot))


def test_springs_pull_against_the_gradient_of_their_energy_and_within_a_group_not_at_all():
    snapshot = random_snapshot(7)
    s = snapshot.springs
    gradient, _ = truss.derivatives(snapshot.position, s.between, s.stiffness, s.rest_length)
    for of in ((0, 1), (3, 1), (1, 3), (0, 6), (0, 7)):
        for column, axis in enumerate("xyz"):
            expected = -gradient[of[0] : of[0] + of[1], column].sum()
            assert pull(snapshot, of, axis) == pytest.approx(expected, abs=1e-13)
    assert abs(pull(snapshot, (0, 6), "x")) > 0.1  # springs that cross are there


def test_particles_without_springs_have_no_spring_force():
    with pytest.raises(NoResultError, match="no springs"):
        pull(snapshot_of([[0.0, 0.0, 0.0]]), (0, 1), "x")


def test_hooks_bear_the_weight_of_a_hanging_chain():
    """49 links' masses of 1/50 between two hooks that share it; at rest to e^{−28}, as above."""
    _, end, _ = settled(hanging_chain(), 1.0, 5.0 / 50.0, 18.0)
    first, last = (pull(end, (hook, 1), "z") for hook in (0, 50))
    assert -(first + last) == pytest.approx(49 / 50, rel=1e-10) and first == pytest.approx(last, rel=1e-10)
    # The row of the left half, hook and all: what the right hook bears is not pulled at by it.
    assert pull(end, (0, 26), "z") == pytest.approx(25 / 50 - 49 / 100, rel=1e-8)
