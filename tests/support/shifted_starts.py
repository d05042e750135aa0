"""Runs of one scene from several starts, whose differences are compared with the tangent of a step."""

import numpy as np

from mpp_taichi import Simulation


def ends_from(scene, starts, steps):
    """Positions and velocities after some steps from each start, without a tangent."""
    ends = []
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for start in starts:
            simulation.restart()
            simulation.state.write(*np.split(start, 2))
            simulation.run(steps=steps, judge="off")
            ends.append(np.concatenate(simulation.state.read()))
    return ends
