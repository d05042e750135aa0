"""Start the simulation of a session: from a scene, from the state of an earlier run, or in the window of another scene."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._step_check import check_steps
from mpp_taichi.cli._terminal import say
from mpp_taichi.errors import MppError, StateError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec

if TYPE_CHECKING:
    from mpp_taichi.device.backends import Device
    from mpp_taichi.simulation.simulation import Simulation


def start(spec: SceneSpec, request: Request) -> "Simulation":
    """Start the simulation of a scene as the request asks.

    Raises:
        MppError: the simulation cannot be started.
    """
    _tell(spec, request)
    from mpp_taichi.simulation.simulation import Simulation  # the first import of Taichi: the scene is known to be sound

    options: dict[str, Any] = {name: getattr(request, name) for name in ("backend", "precision", "plan", "threads", "force")}
    options["event_log"] = request.events is not None
    if request.rewind is None or request.rewind.state is None:
        return _checked(Simulation(spec, **options), request)
    try:
        return Simulation(spec, **options, start=request.rewind.state)
    except StateError as error:
        raise StateError(f"--rewind {request.rewind.file}: it is of another scene: {error}") from None


def _checked(simulation: "Simulation", request: Request) -> "Simulation":
    """The simulation, unless it has another start than the run that it is to repeat."""
    from mpp_taichi.simulation.run_archive import start_digest

    if request.start_digest and start_digest(simulation) != request.start_digest:
        simulation.close()
        raise StateError("the scene reads a file that has changed since the run, so its start cannot be had again")
    return simulation


def start_another(file: Path, *, device: "Device", request: Request) -> "Simulation":
    """Start the simulation of another scene on the device of the present simulation; its steps are checked.

    Raises:
        MppError: the scene cannot be run.
    """
    from mpp_taichi.simulation.simulation import Simulation

    spec = load_scene(file)
    goal = Goal.of(spec, None, None)
    goal.check(spec, may_be_endless=True)
    where: dict[str, Any] = {"backend": device.backend, "precision": device.precision, "threads": request.threads}
    _tell(spec, request)
    simulation = Simulation(spec, **where, plan=request.plan, force=request.force)
    try:
        check_steps(simulation, goal, force=request.force)
    except MppError:
        simulation.close()
        raise
    return simulation


def _tell(spec: SceneSpec, request: Request) -> None:
    """Say on the terminal what a window is waiting for; other runs show their progress."""
    if request.window and not request.quiet:
        say(f"compiling {spec.title} …")
