"""Runs that must have the bits of a plain run: with a way that is gone back, and as copies side by side."""

import numpy as np

from mpp_taichi import Simulation
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble


def run_with_a_way_back(simulation, before, lost, after):
    """Run some steps, others that are gone back, and more; the snapshot after `before` + `after` steps."""
    simulation.run(steps=before)
    mark = simulation.bookmark()
    simulation.run(steps=lost)
    simulation.go_back(mark)
    simulation.run(steps=after)
    return simulation.snapshot()


def assert_copies_have_the_bits_of(single, scene, *, copies, steps):
    """Each of several copies of a scene ends with the positions and velocities of a single run, bit for bit."""
    starts = [assemble(load_scene(scene))] * copies
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=starts) as simulation:
        simulation.run(steps=steps)
        for position, velocity in zip(*simulation.state.read_replicas(), strict=True):
            assert np.array_equal(position, single.position) and np.array_equal(velocity, single.velocity)
