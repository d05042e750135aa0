"""Ring choreographies: table 1 of T. Müller, arXiv:1403.1695, from the generator, from the scene and from runs."""

import math

import numpy as np
import pytest
from conftest import ROOT

from mpp_taichi import Simulation, load_scene
from mpp_taichi.start.assemble import assemble

SCENE = ROOT / "scenes" / "choreography_ring.yaml"
# v² R 2^(3/2) / k² as printed; the paper's 7.933369 for N = 8 has a wrong digit, eq. (16) gives 7.933359.
TABLE = {2: 0.707107, 3: 1.632993, 4: 2.707107, 5: 3.892996, 6: 5.168527, 7: 6.518859, 8: 7.933359, 9: 9.404033}
LAST_DIGIT = 0.51e-6


def polygon(gravity=(), **given):
    bodies = [{"body": {"name": "middle", "mass": 3, "position": [0.4, 0.1, 0], "velocity": [0, 0.2, 0]}}]
    entry = {"polygon": {"name": "ring", "count": 6, "circumradius": 1.7, "mass": 0.3, **given}}
    forces = [{"newtonian_gravity": {"strength": 0.8, **dict(gravity)}}]
    return assemble(load_scene({"particles": [*bodies, entry], "forces": forces, "integrator": {"leapfrog": {"dt": 0.1}}}))


@pytest.mark.parametrize("n", TABLE)
def test_speed_and_period_of_the_scene_are_those_of_table_1(n):
    """Speeds from the generator, the period from the scene's own expressions, for another radius than 1."""
    spec = load_scene(SCENE, overrides=[f"constants.n={n}", "constants.radius=2.5"])
    start = assemble(spec)
    assert start.particle_count == n
    squared = np.sum(start.velocity**2, axis=1)
    assert squared * 2.5 * 2**1.5 == pytest.approx(np.full(n, TABLE[n]), abs=LAST_DIGIT)
    period = 1000 * spec.integrator.parameters["dt"]
    assert (2 * math.pi * 2.5 / period) ** 2 * 2.5 * 2**1.5 == pytest.approx(TABLE[n], abs=LAST_DIGIT)


@pytest.mark.parametrize("softening", [0.0, 0.6])
def test_a_polygon_around_a_body_goes_round_on_a_circle(softening):
    """The pull of all the others, summed here pair by pair, is v²/R towards the centre for each corner."""
    start = polygon({"softening": softening}, around="middle")
    apart = start.position[None] - start.position[:, None]
    weight = start.mass / np.maximum(np.sum(apart**2, axis=2) + softening**2, 1e-100) ** 1.5
    np.fill_diagonal(weight, 0.0)
    pull = 0.8 * np.einsum("ij,ijk->ik", weight, apart)[1:]
    outward, motion = start.position[1:] - start.position[0], start.velocity[1:] - start.velocity[0]
    assert np.linalg.norm(outward, axis=1) == pytest.approx(np.full(6, 1.7), rel=1e-14)
    assert pull == pytest.approx(-outward * np.sum(motion**2, axis=1)[:, None] / 1.7**2, rel=1e-12, abs=1e-13)
    assert np.cross(outward, motion)[:, 2] == pytest.approx(1.7 * np.linalg.norm(motion, axis=1), rel=1e-13)


@pytest.mark.parametrize("n", [2, 8])
def test_after_a_turn_every_body_is_where_it_was(n):
    """Fourth order at 1000 steps a turn: the phase errs by (ω dt)⁴ = 1.6e-9 of 2π times a coefficient near 1; round-off 1e-16
    grows 2e5-fold at N = 9, below it."""
    with Simulation(SCENE, backend="cpu", precision="f64", overrides=[f"constants.n={n}", "constants.turns=1"]) as run:
        run.run()
        assert np.linalg.norm(run.snapshot().position - run.start.position, axis=1).max() < 2e-8
