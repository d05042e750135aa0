"""Resume: the simulation of an archive, at the moment of its last record."""

from pathlib import Path

from mpp_taichi.errors import StateError
from mpp_taichi.scene.load import load_resolved
from mpp_taichi.simulation.moment import go_to
from mpp_taichi.simulation.run_archive import FoundRun
from mpp_taichi.simulation.simulation import Simulation


def resume(path: str | Path, *, at: float | None = None, threads: int | None = None) -> Simulation:
    """The run of an archive as a Simulation that goes on, bit for bit, from its last record, or from its last one until `at`.

    The scene, backend, precision and plan are those of the run. Tables and other recorders of the command line are not made
    again: repeat the command for that.

    Raises:
        StateError: the file is no archive, or holds no state at such a time.
        MppError: the simulation cannot be started here.
    """
    found = FoundRun(Path(path))
    try:
        header, times = found.header, found.times
        numbers = [number for number, time in enumerate(times) if at is None or time <= at]
        if not numbers:
            earliest = f"its first state is of t = {times[0]:.9g}" if times else "it has no state"
            raise StateError(f"{path}: {earliest}")
        state = found.state(numbers[-1])
        spec = load_resolved(state.get("scene", header["scene"]), header["source"])
        where = {name: header[name] for name in ("backend", "precision", "plan")}
    finally:
        found.close()
    simulation = Simulation(spec, **where, threads=threads)
    try:
        go_to(simulation, state["moment"])
    except BaseException:
        simulation.close()
        raise
    return simulation
