"""The list of candidate pairs of `pairwise`, which serves several steps: no pair is missed, and its skin follows the motion."""

import numpy as np
import pytest
from sphere_gases import Places, box, gas, setup_of

from mpp_taichi.contacts.overlap.kept_candidates import FEWEST_STEPS, PAUSE, STEPS, WIDEST
from mpp_taichi.contacts.overlap.overlaps import Overlaps
from mpp_taichi.device import backends
from mpp_taichi.walls._base import Enclosure

SLOW, FAST = 0.004, 1.0  # steps, of spheres whose speeds are near 1 and whose radius is 1


def bound(position, velocity, enclosure, *, all_pairs=False):
    """A solver of unit spheres, whose grid counts how often it is built, and its state."""
    state = Places(position, velocity)
    solver = Overlaps(setup_of(np.ones(len(position)), enclosure=enclosure), state, all_pairs=all_pairs)
    solver.builds = 0
    if not all_pairs:
        build = solver.grid.build

        def counted(*arguments, **options):
            solver.builds += 1
            build(*arguments, **options)

        solver.grid.build = counted
    return solver, state


def run(solver, steps, h):
    """Drift; the number of times that the grid was built."""
    before = solver.builds
    for step in range(steps):
        solver.drift(step * h, h)
    return solver.builds - before


@pytest.mark.parametrize("walls", [True, False], ids=["walls", "periodic"])
def test_pairs_of_a_list_that_serves_several_steps_are_those_of_all_pairs(walls):
    """The same bits after 120 steps, in each tenth of which or more rarely the grid is sorted."""
    position, velocity, edges = gas(7, 0.3)
    backends.start("cpu", "f64", threads=2)
    found = []
    for all_pairs in (True, False):
        solver, state = bound(position, velocity, box(edges) if walls else Enclosure(period=edges), all_pairs=all_pairs)
        builds = run(solver, 120, 0.01)
        report = solver.collect()
        x, v = state.read()
        found.append((x.tobytes(), v.tobytes(), report.pair_count))
        if not all_pairs:
            assert 1 < builds <= 120 // FEWEST_STEPS
            assert report.pair_count > 100
        solver.destroy()
    assert found[0] == found[1]


def test_the_skin_grows_where_spheres_are_slow_and_a_list_is_given_up_where_they_are_fast():
    """No sphere of speed v leaves the widest skin within WIDEST / (v h) steps; a list that serves fewer than three is none."""
    position, velocity, edges = gas(7, 0.05)
    velocity *= (1.0 / np.linalg.norm(velocity, axis=1))[:, None]
    backends.start("cpu", "f64", threads=2)
    solver, _ = bound(position, velocity, Enclosure(period=edges))
    kept = solver.kept
    run(solver, 200, SLOW)
    assert run(solver, 200, SLOW) <= 200 // STEPS + 2  # the skin of a list that served n steps is multiplied by STEPS / n
    run(solver, 4, FAST)
    assert kept.skin == 0.0
    assert run(solver, PAUSE // 2, FAST) == PAUSE // 2  # a build in each step, for a while
    run(solver, PAUSE, SLOW)
    assert kept.skin > 0.0
    assert run(solver, 200, SLOW) < 200 // FEWEST_STEPS
    assert kept.skin <= WIDEST
    solver.destroy()


@pytest.mark.sampled(3)
def test_places_that_are_changed_from_outside_are_seen():
    """Two spheres that were far apart are put onto each other between two steps."""
    position, velocity, edges = gas(7, 0.05)
    backends.start("cpu", "f64", threads=2)
    solver, state = bound(position, 0.0 * velocity, box(edges))
    run(solver, 3, SLOW)
    assert solver.collect().pair_count == 0
    moved = position.copy()
    moved[5] = moved[300] + [1.5, 0.0, 0.0]
    velocity = np.zeros_like(position)
    velocity[5] = [-1.0, 0.0, 0.0]
    state.write(moved, velocity)
    run(solver, 1, SLOW)
    assert solver.collect().pair_count == 1
    solver.destroy()


@pytest.mark.sampled(3)
def test_a_list_without_room_has_a_narrower_skin():
    """Spheres in a heap have hundreds of neighbours each."""
    random = np.random.default_rng(3)
    backends.start("cpu", "f64", threads=2)
    solver, _ = bound(random.uniform(5.0, 7.0, size=(400, 3)), np.zeros((400, 3)), box([12.0] * 3))
    skin = solver.kept.skin
    assert not solver.kept.find() and solver.kept.skin == skin / 2
    solver.destroy()


@pytest.mark.sampled(3)
def test_a_sphere_that_is_nowhere_makes_no_list():
    """A place that is not a number is never within the skin."""
    position, velocity, edges = gas(7, 0.05)
    position[17] = np.nan
    backends.start("cpu", "f64", threads=2)
    solver, _ = bound(position, velocity, box(edges))
    assert not solver.kept.find() and not solver.kept.find()
    solver.destroy()
