"""`run` without a scene: a window with the list of scenes, from which the first scene is opened."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._file_scene import scene_in
from mpp_taichi.cli._last_files import farewell
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._shelves import Beginning
from mpp_taichi.cli._start_simulation import Started, start_another
from mpp_taichi.cli._terminal import UsageError, explain_error
from mpp_taichi.cli._window_desk import title_of
from mpp_taichi.errors import BackendError, MppError

if TYPE_CHECKING:
    from mpp_taichi.cli._interactive import Stage

WITHOUT_SCENE = (
    *("verb", "scene", "backend", "precision", "plan", "threads", "look", "force", "allow_inaccurate", "energy_balance"),
    *("json", "quiet", "verbose", "fresh", "no_archive", "fresh_window"),
)
"""The options that hold for every scene which is opened in a window."""


def require_no_more(arguments: argparse.Namespace, problem: str) -> None:
    """Refuse a run without a scene where an option asks for more than a window, or where there is a `problem` with windows.

    Raises:
        UsageError: a scene is required.
    """
    given = {name: value for name, value in vars(arguments).items() if name not in WITHOUT_SCENE}
    asked = [name for name, value in given.items() if value not in (None, [], ()) and value is not False]
    if asked:
        option = "set" if asked[0] == "overrides" else asked[0].replace("_", "-")
        raise UsageError(f"run: with --{option} a scene is required: SCENE, as in `mpp-taichi run ring`")
    if problem:
        raise UsageError(f"run: {problem}, so a scene is required: SCENE; `mpp-taichi scenes` lists the scenes")


def first_stage(request: Request) -> "Stage | None":
    """Show the list of scenes until a scene is open; None where the window was closed."""
    from mpp_taichi.cli._interactive import Stage
    from mpp_taichi.device import backends
    from mpp_taichi.views.display_loss import DisplayLoss

    started: list[Started] = []
    device = backends.start(request.backend, request.precision, threads=request.threads)
    backends.retain(device)

    def open_file(file: Path) -> str:
        try:
            started.append(start_another(scene_in(file), device=device, request=request))
        except MppError as error:
            explain_error(error)
            return str(error).splitlines()[0]
        return ""

    def lost(display: str) -> int:
        return farewell(BackendError(f"the display {display} has gone away"), [], None)

    try:
        from mpp_taichi.views.empty_window import EmptyWindow

        with DisplayLoss(lost) as loss:
            window = EmptyWindow(Beginning(Path.cwd()), title_of, open_file, loss, settings=request.settings)
            handed_on = window.run()
        return Stage(started[0], window.glass) if handed_on else None
    finally:
        backends.release(device)


def request_without_scene(arguments: argparse.Namespace) -> Request:
    """The part of the options that holds for every scene."""
    given: dict[str, Any] = {"window": True}
    for name in ("backend", "precision", "plan", "threads", "quiet", "allow_inaccurate", "energy_balance", "force", "look"):
        given[name] = getattr(arguments, name)
    return Request(**given)
