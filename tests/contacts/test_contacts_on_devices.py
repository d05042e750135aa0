"""Contacts on a parallel device, tested on software Vulkan: the results of the CPU, and no contact lost in silence."""

import numpy as np
import pytest
import taichi as ti
from sphere_gases import Places, box, gas, setup_of
from test_contacts import UNIT, oblique_pair, spheres

from mpp_taichi import Simulation
from mpp_taichi.contacts.overlap.overlaps import Overlaps
from mpp_taichi.contacts.overlap.rounds import OverlapRounds
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.shared.loop_watch import LoopWatch
from mpp_taichi.contacts.sweep.sweep import sweep_in_pairs, sweep_on_device
from mpp_taichi.device import backends

STEPS = 4


def run(kind, position, velocity, setup, h, **how):
    """Places, velocities and the report after some drifts by a solver of that kind, where Taichi runs now."""
    state = Places(position, velocity)
    solver = kind(setup, state, **how)
    for step in range(STEPS):
        solver.drift(step * h, h)
    return *state.read(), solver.collect()


@pytest.mark.sampled(3)
def test_rounds_of_pairs_that_share_no_sphere_end_as_one_pair_after_the_other():
    """To the last bit, in a gas so dense that chains of pairs share spheres; on the CPU, where roots are the same."""
    backends.start("cpu", "f64", threads=2)
    position, velocity, edges = gas(6, 0.5)
    setup = setup_of(np.ones(216), np.linspace(1.0, 3.0, 216), enclosure=box(edges, 0.9), restitution=0.8, contact_time=0.02)
    one, together = (run(kind, position, velocity, setup, 0.1, all_pairs=False) for kind in (Overlaps, OverlapRounds))
    assert one[2].pair_count == together[2].pair_count > 216 and one[2].elastic_count == together[2].elastic_count > 0
    assert one[2].largest_overlap == together[2].largest_overlap and together[2].unresolved == 0
    assert one[2].dissipated_energy == pytest.approx(together[2].dissipated_energy, rel=1e-13)
    assert np.array_equal(one[0], together[0]) and np.array_equal(one[1], together[1])


DEVICE_KINDS = {
    "pairwise": (Overlaps, OverlapRounds, {"all_pairs": True}, {"all_pairs": True}),
    "swept": (sweep_in_pairs, sweep_on_device, {"event_limit": 1000, "all_pairs": False}, {"event_limit": 1000}),
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("solver", DEVICE_KINDS)
def test_software_vulkan_finds_the_contacts_of_the_cpu(solver, software_vulkan):
    """Every contact, and places to what rounding makes of them.

    Some 10 ulps of the edge for each place, and no sphere has more than three contacts in this time, each of which turns its
    way by at most the free path over the radius, here 1/2, for which 10 is allowed.
    """
    position, velocity, edges = gas(6, 0.3)
    setup = setup_of(np.ones(216), np.linspace(1.0, 3.0, 216), enclosure=box(edges))
    here, there, how_here, how_there = DEVICE_KINDS[solver]
    backends.start("cpu", "f64", threads=2)
    expected = run(here, position, velocity, setup, 0.05, **how_here)
    backends.stop()
    backends.start("vulkan", "f64")
    found = run(there, position, velocity, setup, 0.05, **how_there)
    assert found[2].pair_count == expected[2].pair_count > 20 and found[2].wall_count == expected[2].wall_count > 10
    assert found[2].unresolved == 0 and found[2].virial == pytest.approx(expected[2].virial, rel=1e-10)
    tolerance = 10 * 10**3 * UNIT["f64"] * edges[0]
    assert max(np.abs(found[k] - expected[k]).max() for k in (0, 1)) < tolerance
    mass = np.linspace(1.0, 3.0, 216)[:, None]
    assert (mass * found[1] ** 2).sum() == pytest.approx((mass * velocity**2).sum(), rel=1e-13)


@pytest.mark.parametrize("solver", ["swept", "resting"])
@pytest.mark.sampled(3)
def test_two_spheres_leave_a_contact_on_vulkan_as_the_formula_says(solver, software_vulkan):
    """The case, and the tolerance, of tests/contacts/test_contacts.py."""
    bodies, e, velocity, position = oblique_pair(0)
    reach = bodies[0]["radius"] + bodies[1]["radius"]
    approach = np.linalg.norm(velocity[0] - bodies[0]["velocity"])
    tolerance = 8 * (10 + 60) * UNIT["f32"] / min(1.0, approach) / min(1.0, reach)
    scene = spheres(bodies, solver=solver, restitution=e, duration=0.6)
    with Simulation(scene, backend="vulkan", precision="f32") as simulation:
        after = simulation.run().snapshot()
        assert simulation.contact_report.pair_count == 1
    scale = max(1.0, np.abs(velocity).max())
    assert np.abs(after.velocity - velocity).max() < tolerance * scale
    assert np.abs(after.position - position).max() < tolerance * scale


@ti.data_oriented
class Counter:
    """A thread that counts, and is asked whether it was let."""

    def __init__(self):
        self.watch = LoopWatch()
        self.count = ti.field(ti.i32, shape=2)

    @ti.kernel
    def run(self, most: ti.i32):
        for _ in range(1):
            for k in range(most):
                self.count[0] = k
            self.count[1] = ti.cast(self.watch.was_stopped(), ti.i32)


def test_a_thread_whose_loops_were_ended_knows_it(software_vulkan):
    """Software Vulkan stops at 65,535 iterations of all loops of a thread; other drivers do not, and say so in the probes."""
    device = backends.start("vulkan", "f32")
    counter = Counter()
    for most in (60_000, 70_000):
        counter.run(most)
        last, stopped = counter.count.to_numpy()
        assert stopped == (last != most - 1) == (device.probes.loop_limit is not None and most > device.probes.loop_limit)


@pytest.mark.parametrize("contact_time", [0.0, 1e-3])
@pytest.mark.parametrize("solver", ["swept", "simultaneous"])
def test_all_fields_of_contacts_are_allocated_and_given_back(solver, contact_time, monkeypatch):
    """Taichi allocates fields that were left out with the next kernel, but then nothing can give their memory back."""
    made, given_back = [], []
    begin, end = FieldTrees.__init__, FieldTrees.destroy
    monkeypatch.setattr(FieldTrees, "__init__", lambda trees: made.append(trees) or begin(trees))
    monkeypatch.setattr(FieldTrees, "destroy", lambda trees: given_back.append(trees) or end(trees))
    gas = {"count": 40, "lower": [0, 0], "upper": [3, 2], "radius": 0.1, "speed": 1.0}
    scene = {
        "dimensions": 2,
        "particles": [{"gas": gas}],
        "contacts": {"hard_spheres": {"solver": solver, "restitution": 0.8, "contact_time": contact_time}},
        "walls": [{"box": {"lower": [0, 0], "upper": [3, 2]}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=2)
        assert made and all(trees._trees for trees in made)
    assert set(map(id, given_back)) == set(map(id, made))
