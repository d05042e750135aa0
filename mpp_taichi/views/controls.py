"""The actions of keys and mouse in a window; without any use of GGUI, so that a test needs no display."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera

LOOK_KEY = "D"
HELP = (
    ("space", "run, pause"),
    ("right arrow", "one step (Shift: 50)"),
    ("left arrow", "back (Shift: 50 times)"),
    ("up, down arrow", "faster, slower"),
    ("Backspace", "back to the start"),
    ("V", "sliders on, off"),
    ("letters beside a slider", "steer"),
    ("left drag", "rotate"),
    ("right drag, Shift+left", "pan"),
    ("wheel, I, O, Ctrl+left drag", "zoom"),
    ("Alt+arrows", "go ahead, back, aside"),
    ("Shift+up, down arrow", "go up, down"),
    ("Ctrl+arrows", "turn (Ctrl+Shift: roll)"),
    ("Ctrl+click", "turn to the point"),
    ("R", "reset the camera"),
    ("F", "frame everything"),
    ("X  Y  Z", "look along an axis"),
    ("G", "with, without perspective"),
    ("click", "pick a particle"),
    ("Tab", "follow it, the center of mass"),
    ("T", "trails on, off"),
    (LOOK_KEY, "change the look"),
    ("P", "panels on, off"),
    ("E", "panels to CSV and SVG"),
    ("N", "another scene, from a list"),
    ("A", "integrator and step"),
    ("C", "picture to a file"),
    ("M", "film on, off"),
    ("S", "state to a file"),
    ("L", "log to a file"),
    ("K", "print the camera"),
    ("W", "whole screen on, off"),
    ("H", "this help"),
    ("Q, Esc", "quit"),
)
ZOOM_PER_SECOND = 2.5  # factor while I or O is held
ZOOM_PER_CLICK = 1.1  # factor for a click of the mouse wheel
ZOOM_PER_HEIGHT = 8.0  # factor for a drag over the height of the window
MANY_STEPS = 50
CLICK = 0.01  # heights of the window that a mouse may move during a click
Box = tuple[float, float, float, float]
"""Left, top, width and height, in 0…1 from the upper left corner of the window."""


BUTTONS = {"LMB", "MMB", "RMB"}
REQUESTS = {
    **{"c": "screenshot", "p": "panels", "e": "export", "k": "print_camera", "v": "sliders", "s": "save", "l": "log"},
    **{"Tab": "follow", "n": "scenes", "d": "look", "m": "film", "a": "method", "w": "whole_screen"},
}


def holds(box: Box, cursor: tuple[float, float]) -> bool:
    """Whether a place, in 0…1 from the lower left corner, is in a box."""
    left, top, width, height = box
    return left <= cursor[0] <= left + width and top <= 1.0 - cursor[1] <= top + height


@dataclass(eq=False)
class Controls:
    """The requests of the user. Keys have GGUI's names: letters in lower case, `Escape`, `Right`, … ."""

    running: bool = True
    trails: bool = True
    help: bool = False
    quit: bool = False
    restart: bool = False
    screenshot: bool = False
    print_camera: bool = False
    panels: bool = False
    export: bool = False
    sliders: bool = False
    save: bool = False
    log: bool = False
    follow: bool = False
    scenes: bool = False
    look: bool = False
    method: bool = False
    whole_screen: bool = False
    film: bool = False
    single_steps: int = 0
    steps_back: int = 0
    faster: int = 0
    occupied: Sequence[Box] = ()  # where the mouse belongs to a panel
    _cursor: tuple[float, float] | None = field(default=None, repr=False)
    _pressed: tuple[float, float] | None = field(default=None, repr=False)  # where a click may have begun
    _clicked: tuple[float, float] | None = field(default=None, repr=False)
    _turns: bool = field(default=False, repr=False)  # the click began with Ctrl
    _taken: bool = field(default=False, repr=False)  # the drag began where the mouse belongs to a panel

    def press(self, key: str, *, shift: bool, camera: Camera, frame: Frame, aspect: float) -> None:
        """A key went down."""
        if key in (" ", "Space"):
            self.running = not self.running
        elif key == "Right":
            self.running = False
            self.single_steps += MANY_STEPS if shift else 1
        elif key == "Left":
            self.running = False
            self.steps_back += MANY_STEPS if shift else 1
        elif key in ("Up", "Down"):
            self.faster += 1 if key == "Up" else -1
        elif key == "BackSpace":
            self.restart = True
        elif key in REQUESTS:
            setattr(self, REQUESTS[key], True)
        elif key in ("q", "Escape"):
            self.quit = True
        elif key == "h":
            self.help = not self.help
        elif key == "t":
            self.trails = not self.trails
        elif key == "g":
            camera.turn_projection()
        elif key == "r":
            camera.reset()
        elif key == "f":
            camera.frame_all(frame, aspect)
        elif key in ("x", "y", "z"):
            camera.look_along(key)

    def move(self, cursor: tuple[float, float], held: set[str], *, camera: Camera, seconds: float, aspect: float) -> None:
        """Take the drag and the held keys since the last call, `seconds` ago; `cursor` in 0…1 from the lower left corner."""
        last, self._cursor = self._cursor, cursor if held & BUTTONS else None
        self._watch_clicks(cursor, held, begins=last is None, aspect=aspect)
        if self._taken:
            last = None
        if last is not None and self._cursor is not None:
            right, up = (cursor[0] - last[0]) * aspect, cursor[1] - last[1]
            if "RMB" in held or ("LMB" in held and "Shift" in held):
                camera.pan(right, up)
            elif "MMB" in held or ("LMB" in held and "Control" in held):
                camera.zoom(ZOOM_PER_HEIGHT**up)
            else:
                camera.rotate(right, up)
        direction = ("i" in held) - ("o" in held)
        if direction:
            camera.zoom(ZOOM_PER_SECOND ** (direction * seconds))

    def _watch_clicks(self, cursor: tuple[float, float], held: set[str], *, begins: bool, aspect: float) -> None:
        """Notice clicks: the left button goes down and up again at one place, alone or with Ctrl."""
        if not held & BUTTONS:
            self._clicked, self._pressed, self._taken = self._pressed or self._clicked, None, False
        elif begins:
            self._taken = any(holds(box, cursor) for box in self.occupied)
            alone = not self._taken and not held & {"MMB", "RMB", "Shift"}
            self._pressed, self._turns = cursor if alone else None, "Control" in held
        elif self._pressed is not None:
            away = abs(cursor[0] - self._pressed[0]) * aspect + abs(cursor[1] - self._pressed[1])
            self._pressed = self._pressed if away < CLICK else None

    def take_click(self, *, turns: bool = False) -> tuple[float, float] | None:
        """The place of the user's click since the last call, in 0…1 from the lower left corner.

        A click with Ctrl `turns` the camera, and is told only where it is asked for.
        """
        if turns is not self._turns:
            return None
        clicked, self._clicked = self._clicked, None
        return clicked

    def take(self, request: str) -> bool:
        """Whether a request (`restart`, `screenshot`, `panels`, …) is open; it is answered by this call."""
        asked = bool(getattr(self, request))
        setattr(self, request, False)
        return asked

    def take_faster(self) -> int:
        """Number of requests for twice the speed since the last call, less the requests for half the speed."""
        faster, self.faster = self.faster, 0
        return faster

    def take_steps_back(self) -> int:
        """Number of requests to go back since the last call."""
        steps, self.steps_back = self.steps_back, 0
        return steps

    def take_steps(self) -> int:
        """Number of single steps requested since the last call."""
        steps, self.single_steps = self.single_steps, 0
        return steps
