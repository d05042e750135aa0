"""A method has no step of its own: it uses the step of the run, which may change after the scene was read."""

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.component import PACKAGE_FOLDER
from mpp_taichi.report.adaptive_summary import step_control
from scenes import kepler

SCENE_DT, RUN_DT = 0.01, 0.0025


@pytest.mark.sampled(3)
def test_janus_puts_the_particles_on_the_lattice_of_the_step_of_the_run():
    ends = []
    for dt in (SCENE_DT, RUN_DT):
        with Simulation(kepler(dt=dt, integrator="janus"), backend="cpu", precision="f64") as simulation:
            simulation.dt = RUN_DT
            ends.append(simulation.run(steps=20).snapshot())
    assert np.array_equal(ends[0].position, ends[1].position)
    assert np.array_equal(ends[0].velocity, ends[1].velocity)


@pytest.mark.parametrize("integrator", ["ias15", "adaptive_dop853"])
@pytest.mark.sampled(3)
def test_an_adaptive_method_begins_with_the_step_of_the_run(integrator):
    """A body at rest without forces gives no hint of how long the first step may be; the time between two samples does."""
    body = {"mass": 1.0, "position": [0, 0, 0]}
    found = []
    for dt in (SCENE_DT, RUN_DT):
        scene = {"particles": [{"body": body}], "forces": [], "integrator": {integrator: {"dt": dt}}}
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.dt = RUN_DT
            found.append(step_control(simulation.run(steps=1)))
    assert found[0] == found[1]


@pytest.mark.parametrize("room", ["step", "integrators", "contacts"])
def test_no_step_reads_the_step_that_the_scene_gave(room):
    readers = [path.name for path in (PACKAGE_FOLDER / room).rglob("*.py") if "self.dt" in path.read_text(encoding="utf-8")]
    assert readers == []
