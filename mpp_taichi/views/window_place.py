"""The place of a new window on the screen, and a size with which all of it can be seen."""

import ctypes

PLACE = (100, 100)  # left and top of a window on a screen with room
FRAME = (0, 36)  # pixels beside and above a window for its frame and its title
BAR = 44  # pixels at the lower rim of a screen for the bar of a desktop
LEAST = (320, 200)
Pair = tuple[int, int]


def fitted(size: Pair, screen: Pair | None, place: Pair = PLACE) -> tuple[Pair, Pair]:
    """The size and the upper left corner of a window of a wanted size and place, so that all of it is on the screen."""
    if screen is None:
        return size, place
    room = screen[0] - FRAME[0], screen[1] - FRAME[1] - BAR
    width, height = (max(min(wanted, most), least) for wanted, most, least in zip(size, room, LEAST, strict=True))
    left = max(0, min(place[0], screen[0] - width - FRAME[0]))
    top = max(0, min(place[1], max(FRAME[1], screen[1] - BAR - height)))
    return (width, height), (left, top)


def windows_screen() -> Pair | None:
    """Width and height of the first screen under Windows; None elsewhere."""
    library = getattr(ctypes, "windll", None)
    if library is None:
        return None
    return int(library.user32.GetSystemMetrics(0)), int(library.user32.GetSystemMetrics(1))
