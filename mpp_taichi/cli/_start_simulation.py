"""Start the simulation of a session: from a scene, from the state of an earlier run, or in the window of another scene."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._file_scene import FileScene
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._rewind import Rewind
from mpp_taichi.cli._step_check import check_steps
from mpp_taichi.cli._terminal import say
from mpp_taichi.errors import MppError, StateError
from mpp_taichi.scene.spec import SceneSpec

if TYPE_CHECKING:
    from mpp_taichi.device.backends import Device
    from mpp_taichi.simulation.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Started:
    """The simulation of another scene that was opened in a window, and the length of its run.

    Of a saved state also the rewind with which it goes on, and a line with its step.
    """

    simulation: "Simulation"
    goal: Goal
    rewind: Rewind | None = None
    rewound: str = ""


def start(spec: SceneSpec, request: Request) -> "Simulation":
    """Start the simulation of a scene as the request asks.

    Raises:
        MppError: the simulation cannot be started.
    """
    _tell(spec, request)
    from mpp_taichi.simulation.simulation import Simulation  # the first import of Taichi: the scene is known to be sound

    options: dict[str, Any] = {name: getattr(request, name) for name in ("backend", "precision", "plan", "threads", "force")}
    options["event_log"] = request.events is not None and not spec.limited_springs
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


def start_another(found: FileScene, *, device: "Device", request: Request, goal: Goal | None = None) -> Started:
    """Start the simulation of another scene on the device of the window; its steps are checked.

    `goal` is the length of its run, by default the length that the scene says.

    Raises:
        MppError: the scene cannot be run.
    """
    from mpp_taichi.simulation.simulation import Simulation

    rewind = None if found.state is None else Rewind(found.state, found.state_file, step_is_given=False)
    length = goal or Goal.of(found.spec, None, None)
    length.check(found.spec, may_be_endless=True)
    where: dict[str, Any] = {"backend": device.backend, "precision": device.precision, "threads": request.threads}
    _tell(found.spec, request)
    simulation = Simulation(found.spec, **where, plan=request.plan, force=request.force, start=found.state)
    rewound = ""
    try:
        if rewind is not None:
            rewound = rewind.choose_step(simulation)
            length = goal or rewind.goal(length, simulation, beyond=True)
        check_steps(simulation, length, force=request.force)
    except MppError:
        simulation.close()
        raise
    return Started(simulation, length, rewind, rewound)


def _tell(spec: SceneSpec, request: Request) -> None:
    """Say on the terminal what a window is waiting for; other runs show their progress."""
    if request.window and not request.quiet:
        say(f"compiling {spec.title} …")
