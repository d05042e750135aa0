"""Where a run leads."""

from mpp_taichi import Simulation


def end_of(scene, time=1.0, **more):
    """The particles of a scene at a time, in f64 on the CPU unless `more` says otherwise."""
    with Simulation(scene, **({"backend": "cpu", "precision": "f64"} | more)) as simulation:
        simulation.run(duration=time)
        return simulation.snapshot()
