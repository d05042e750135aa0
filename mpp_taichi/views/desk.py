"""Desk: the actions of a window besides running: sliders, a way back, and files. A window without a desk has none of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from mpp_taichi.views.slider_panel import Knob
from mpp_taichi.views.window_film import Tape, no_film


def _no_way_back() -> bool:
    return False


def _nothing_saved() -> str:
    return "there is nothing to save"


def _no_scenes() -> Sequence[str]:
    return ()


def _nothing_opened(name: str) -> str:
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
    scenes the scenes that can be opened instead of this one, by name; `present` is this one
    title_of  the title of such a scene
    open   prepare another scene, to which the window is handed on; the line states the error, if there is one
    """

    knobs: Sequence[Knob] = ()
    move: Callable[[Mapping[str, float]], str] = _nothing_moved
    back: Callable[[], bool] = _no_way_back
    save: Callable[[], str] = _nothing_saved
    log: Callable[[], str] = _nothing_saved
    film: Callable[[tuple[int, int], float], Tape] = no_film
    scenes: Callable[[], Sequence[str]] = _no_scenes
    title_of: Callable[[str], str] = str
    open: Callable[[str], str] = _nothing_opened
    present: str = ""
