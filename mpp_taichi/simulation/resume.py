"""Resume: the simulation of an archive, at the moment of one of its records."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mpp_taichi.errors import StateError
from mpp_taichi.scene.load import load_resolved
from mpp_taichi.simulation.moment import go_to
from mpp_taichi.simulation.run_archive import FoundRun, start_digest
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.wording.told_apart import told_apart


def resume(
    path: str | Path, *, at: float | None = None, threads: int | None = None, overrides: Sequence[str] = ()
) -> Simulation:
    """The run of an archive as a Simulation that goes on, bit for bit, from its last record, or its last record until `at`.

    Where every record is later than the time `at`, it goes on from the start of the run.

    The scene, backend, precision and plan are those of the run; `overrides` may change what is drawn of it, as in
    "view.camera.field_of_view=20", and nothing else. Tables and other recorders of the command line are not made
    again: repeat the command for that.

    Raises:
        StateError: the file is no archive; the run began after `at`; or the scene reads a file that has changed since the run.
        MppError: the simulation cannot be started here.
    """
    found = FoundRun(Path(path), to_append=False)
    try:
        header, times = found.header, found.times
        numbers = [number for number, time in enumerate(times) if at is None or time <= at]
        if not numbers and at is None:
            raise StateError(f"{path}: it has no state")
        if not numbers and "rewound" in header:
            raise StateError(f"{path}: the run was rewound, and its first record is of t = {min(times):.9g}, after {at:.9g}")
        state = found.state(numbers[-1]) if numbers else {}
        spec = load_resolved(scene_of(header, state), header["source"], overrides=overrides)
        where = {name: header[name] for name in ("backend", "precision", "plan")}
    finally:
        found.close()
    simulation = Simulation(spec, **where, threads=threads)
    try:
        if numbers:
            go_to(simulation, state["moment"])
        else:
            _check_start(simulation, header, path, at)
    except BaseException:
        simulation.close()
        raise
    return simulation


def scene_of(header: Mapping[str, Any], state: Mapping[str, Any]) -> Mapping[str, Any]:
    """The scene of a run at a state: that of the header, unless parameters were set while the run was going on.

    Raises:
        StateError: the state holds something else in its place.
    """
    found = state.get("scene", header["scene"])
    if not isinstance(found, Mapping):
        raise StateError("a record is damaged: its scene is no scene")
    return found


def _check_start(simulation: Simulation, header: Mapping[str, Any], path: str | Path, at: float | None) -> None:
    """Require a start that is the start of the run, and no later than `at`."""
    if at is not None and not simulation.time <= at:
        begin, asked = told_apart(simulation.time, at, digits=9)
        raise StateError(f"{path}: the run begins at t = {begin}, after {asked}")
    if start_digest(simulation) != header["start"]:
        raise StateError(f"{path}: the scene reads a file that has changed since the run, so its start cannot be had again")
