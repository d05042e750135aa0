"""Desk: the actions of a window besides running: sliders, a way back, and files. A window without a desk has none of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mpp_taichi.views.method_box import Methods
from mpp_taichi.views.scene_list import Shelf
from mpp_taichi.views.slider_panel import Knob
from mpp_taichi.views.window_film import Tape, no_film


def _no_way_back() -> bool:
    return False


def _nothing_saved() -> str:
    return "there is nothing to save"


def _no_title(file: Path) -> str:
    return ""


def _nothing_opened(file: Path) -> str:
    return "no other scene can be opened from here"


def _nothing_moved(moved: Mapping[str, float]) -> str:
    return ""


@dataclass(frozen=True)
class Desk:
    """Sliders and actions; each action except `back` and `film` returns a line to show.

    move   set parameters, path → value; the line states the error, if there is one
    back   go back by a frame; False where no earlier frame is kept
    save   write the state to a file
    log    write the moves of the sliders to a file, as a scene
    film   open a film of a size in pixels, and so many pictures in a second
    place  the place with which the list of files begins that can be opened instead of the file `present`, which runs
    title_of  the title of such a file; empty where it has none
    methods  the integrators from which another one is chosen for the scene, to which the window is handed on
    open   prepare another file, to which the window is handed on; the line states the error, if there is one
    """

    knobs: Sequence[Knob] = ()
    move: Callable[[Mapping[str, float]], str] = _nothing_moved
    back: Callable[[], bool] = _no_way_back
    save: Callable[[], str] = _nothing_saved
    log: Callable[[], str] = _nothing_saved
    film: Callable[[tuple[int, int], float], Tape] = no_film
    place: Shelf | None = None
    title_of: Callable[[Path], str] = _no_title
    open: Callable[[Path], str] = _nothing_opened
    present: Path | None = None
    methods: Methods | None = None
