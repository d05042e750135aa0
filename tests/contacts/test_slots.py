"""Spheres that stay in their slots: each drift is planned from the measurements of the drift before."""

import numpy as np
import pytest
from sphere_gases import Places, setup_of

from mpp_taichi.contacts.sweep.sweep import sweep_in_pairs
from mpp_taichi.device import backends
from mpp_taichi.walls._base import Enclosure

SIDE, STEP = 7, 1 / 64
EDGE = 2.5 * SIDE


@pytest.fixture
def at_rest():
    """Spheres on a lattice in a periodic box, none of which moves, and their sweep."""
    backends.start("cpu", "f64", threads=2)
    position = np.stack(np.meshgrid(*[np.arange(SIDE) * 2.5] * 3, indexing="ij"), -1).reshape(-1, 3)
    position = np.delete(position, [1, 2, 3], axis=0)  # a gap of 8 radii above the first of them
    state = Places(position, np.zeros_like(position))
    setup = setup_of(np.ones(len(position)), enclosure=Enclosure(period=(EDGE,) * 3), force_free=True)
    return state, sweep_in_pairs(setup, state, event_limit=1000, all_pairs=False)


def kick(state, sweep, i, velocity):
    """Give sphere i another velocity, from outside."""
    sweep.write_back()
    x, v = state.read()
    v[i] = velocity
    state.write(x, v)
    sweep.forget()


@pytest.mark.sampled(3)
def test_the_longest_way_is_measured_also_of_spheres_that_bounce(at_rest):
    """A ball goes half of a free way in each drift, in each second of them into the next ball of its row."""
    state, sweep = at_rest
    kick(state, sweep, 0, [0.25 / STEP, 0.0, 0.0])
    before, ways = state.read()[0], []
    for step in range(6):
        sweep.drift(step * STEP, STEP)
        sweep.write_back()
        after = state.read()[0]
        ways.append(np.linalg.norm(after - before, axis=1).max())
        assert sweep.parts.slots.motion.way == pytest.approx(ways[-1], abs=8 * np.spacing(EDGE))
        before = after
    assert min(ways) == pytest.approx(0.25, rel=1e-12) and sweep.collect().pair_count >= 2


@pytest.mark.sampled(3)
def test_a_ball_whose_velocity_is_set_between_drifts_hits_the_next_ball(at_rest):
    """Slow drifts first, whose margins show no ball eight radii ahead; then one that goes ten radii."""
    state, sweep = at_rest
    kick(state, sweep, 50, [0.1, 0.0, 0.0])
    for step in range(3):
        sweep.drift(step * STEP, STEP)
    kick(state, sweep, 0, [0.0, 0.0, 10.0 / STEP])
    sweep.drift(3 * STEP, STEP)
    sweep.write_back()
    x, v = state.read()
    assert x[:4, 2] == pytest.approx([8.0, 10.5, 13.0, 16.0], abs=1e-12)
    assert v[:4, 2] * STEP == pytest.approx([0.0, 0.0, 0.0, 10.0], abs=1e-12)
    assert sweep.collect().pair_count >= 3
