"""Request: the options of a run beside the scene itself, checked before anything is computed."""

import importlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from mpp_taichi.cli._options import require_suffix
from mpp_taichi.cli._terminal import UsageError
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.views.renderers import RENDERERS, needs_ggui
from mpp_taichi.views.window_settings import WindowSettings

if TYPE_CHECKING:
    from mpp_taichi.beside.settings import Beside
    from mpp_taichi.cli._excerpt import Excerpt
    from mpp_taichi.cli._rewind import Rewind

RECORDERS = {
    "video": "video",
    "still": "still",
    "html": "html",
    "trajectory": "trajectory",
    "diagnostics": "table",
    "inspect": "inspection",
    "modes": "modes",
    "speeds": "speed_histogram",
    "events": "event_log",
}
"""The recorder of each option that names a file; it is imported where the file is asked for."""


@dataclass(frozen=True)
class Request:
    """The options of a run beside the scene itself; each attribute has the name of its option."""

    backend: str = "auto"
    precision: str | None = None
    plan: str = "auto"
    threads: int | None = None
    until: float | None = None
    steps: int | None = None
    video: Path | None = None
    frames: Path | None = None
    still: Path | None = None
    html: Path | None = None
    size: tuple[int, int] | None = None
    renderer: str = RENDERERS[0]
    fps: float | None = None
    film_seconds: float | None = None
    trajectory: Path | None = None
    snapshot: Path | None = None
    diagnostics: Path | None = None
    inspect: Sequence[Path] = ()
    modes: Path | None = None
    speeds: Path | None = None
    events: Path | None = None
    log: Path | None = None
    every: int | None = None
    quiet: bool = False
    allow_inaccurate: bool = False
    energy_balance: bool = False
    window: bool = False
    look: str | None = None
    settings: WindowSettings = field(default_factory=WindowSettings)
    force: bool = False
    rewind: "Rewind | Excerpt | None" = None
    start_digest: str = ""
    beside: "Beside | None" = None
    archive: bool = False
    archive_at: Path | None = None  # by default the archive of the scene; another one is left to be removed by the caller
    fresh: bool = False

    @property
    def films(self) -> bool:
        """Whether pictures are recorded."""
        return any(path is not None for path in (self.video, self.frames, self.still, self.html))

    @property
    def is_new(self) -> bool:
        """Whether the run is no part of an earlier run that is shown again."""
        from mpp_taichi.cli._excerpt import Excerpt

        return not isinstance(self.rewind, Excerpt)

    def frame_count(self, spec: SceneSpec) -> int:
        """The number of frames of the film; a single frame shows the start, so that a picture of the end needs two."""
        count = round((self.fps or spec.record.fps) * (self.film_seconds or spec.record.seconds))
        return max(2, count) if self.still is not None and count > 0 else count

    def for_another_scene(self, rewind: "Rewind | None" = None) -> "Request":
        """The part of the request that holds for a scene opened in its window: how to run, without any file.

        `rewind` is the state from which that scene goes on.
        """
        kept = (
            "backend",
            "precision",
            "plan",
            "threads",
            "quiet",
            "allow_inaccurate",
            "energy_balance",
            "window",
            "look",
            "settings",
            "force",
        )
        return Request(**{name: getattr(self, name) for name in kept}, rewind=rewind)

    def check(self) -> None:
        """Refuse files that cannot be written, before anything is computed.

        Raises:
            UsageError: the suffix of a file is no format that the file may have.
            OutputError: a film is wanted and no encoder can write it.
            BackendError: a plot is wanted and there is no matplotlib, or pictures of GGUI, which does not work here.
        """
        for option, recorder in RECORDERS.items():
            asked = getattr(self, option)
            for path in asked if option == "inspect" else () if asked is None else (asked,):
                formats = importlib.import_module(f"mpp_taichi.recorders.{recorder}").FORMATS
                require_suffix(path, formats, f"--{option}")
        require_suffix(self.snapshot, (".npz",), "--snapshot")
        require_suffix(self.log, (".yaml", ".yml"), "--log")
        self._check_renderer()
        if self.video is not None:
            from mpp_taichi.recorders.video import check_encoder

            check_encoder(self.video.suffix)
        if self.modes is not None or self.speeds is not None:
            from mpp_taichi.recorders._mode_plot import require_matplotlib
            from mpp_taichi.recorders.modes import PLOT_FORMATS

            if any(path is not None and path.suffix.lower() in PLOT_FORMATS for path in (self.modes, self.speeds)):
                require_matplotlib()

    def _check_renderer(self) -> None:
        if not needs_ggui(self.renderer):
            return
        if self.beside is not None:
            raise UsageError(f"--renderer {self.renderer}: two halves are drawn by --renderer {RENDERERS[0]} only")
        if all(path is None for path in (self.video, self.frames, self.still)):
            raise UsageError(f"--renderer {self.renderer} is of pictures, and a page is drawn by the browser: leave it out")
        from mpp_taichi.views.ggui_probe import require_ggui

        require_ggui()
