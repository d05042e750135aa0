"""Desk: what a window offers besides running: sliders, a way back, and files; a window without one offers none of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from mpp_taichi.views.slider_panel import Knob


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
    """What lies on it; each of the actions but `back` gives a line to show.

    move   set parameters, path → value; the line says what is wrong, if anything is
    back   go back by a frame; False where there is none to go back to
    save   write the state to a file
    log    write what was done to a file
    scenes the scenes that can be opened instead of this one, by name; `present` is this one
    open   make another scene ready, for the window to be handed on to; the line says why it cannot be, if it cannot
    """

    knobs: Sequence[Knob] = ()
    move: Callable[[Mapping[str, float]], str] = _nothing_moved
    back: Callable[[], bool] = _no_way_back
    save: Callable[[], str] = _nothing_saved
    log: Callable[[], str] = _nothing_saved
    scenes: Callable[[], Sequence[str]] = _no_scenes
    open: Callable[[str], str] = _nothing_opened
    present: str = ""
