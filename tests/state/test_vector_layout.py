"""The vectors of a copy of a small system lie side by side, where a thread of the CPU works on the copy."""

import numpy as np
import pytest

from mpp_taichi import Simulation
from scenes import kepler


def holder(simulation, name):
    """The node of Taichi's tree that holds all vectors of a particle, and None where there is no such node.

    Above a number stand its own node and the root of the tree, and between them the holder.
    """
    nodes, node = [], simulation.state.field(name).get_scalar_field(0).parent()
    while node is not None:
        nodes.append(node)
        node = node.parent()
    return nodes[1] if len(nodes) == 3 else None


def test_the_vectors_of_a_copy_lie_side_by_side():
    names = ("position", "velocity", "acceleration", "start_position", "b0", "b6")
    with Simulation(kepler(integrator="ias15"), backend="cpu") as simulation:
        start = simulation.start
        assert [holder(simulation, name) for name in names] == [None] * 6
    with Simulation(kepler(integrator="ias15"), backend="cpu", replica_starts=[start] * 3) as simulation:
        first = holder(simulation, "position")
        assert first is not None and all(holder(simulation, name) == first for name in names)
        # Explicit vectors read a wrong number where two components have one parent.
        assert simulation.state.position.get_scalar_field(0).parent() != simulation.state.position.get_scalar_field(1).parent()


def test_replicas_of_a_gpu_have_an_array_for_each_component(software_vulkan):
    with Simulation(kepler(), backend="cpu", precision="f32") as simulation:
        start = simulation.start
    with Simulation(kepler(), backend="vulkan", precision="f32", replica_starts=[start] * 3) as simulation:
        assert holder(simulation, "position") is None
        field = simulation.state.position
        assert field.get_scalar_field(0).parent() != field.get_scalar_field(1).parent()


def ends_of(simulation):
    """Positions and velocities of each copy."""
    return np.hstack([simulation.state.field(name).to_numpy() for name in ("position", "velocity")]).reshape(-1, 2, 6)


@pytest.mark.parametrize("method", ["dop853", "taylor", "implicit_midpoint"])
def test_a_copy_among_others_has_the_bits_of_a_copy_alone(method):
    ends = []
    with Simulation(kepler(integrator=method), backend="cpu", precision="f64") as simulation:
        start = simulation.start
        simulation.run(steps=50, judge="off")
        ends.append(ends_of(simulation)[0])
    with Simulation(kepler(integrator=method), backend="cpu", precision="f64", replica_starts=[start] * 5) as simulation:
        simulation.run(steps=50, judge="off")
        ends.append(ends_of(simulation)[3])
    np.testing.assert_array_equal(*ends)
