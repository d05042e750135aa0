"""What keys and mouse do in a window; knows nothing of GGUI, so that it can be tested without a display."""

from dataclasses import dataclass, field

from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera

HELP = (
    ("space", "run, pause"),
    ("right arrow", "one step (Shift: 50)"),
    ("Backspace", "back to the start"),
    ("left drag", "rotate"),
    ("right drag, Shift+left", "pan"),
    ("Ctrl+left drag, I, O", "zoom"),
    ("R", "reset the camera"),
    ("F", "frame everything"),
    ("X  Y  Z", "look along an axis"),
    ("T", "trails on, off"),
    ("P", "panels on, off"),
    ("E", "panels to CSV and SVG"),
    ("C", "picture to a file"),
    ("K", "print the camera"),
    ("H", "this help"),
    ("Q, Esc", "quit"),
)
ZOOM_PER_SECOND = 2.5  # factor while I or O is held
ZOOM_PER_HEIGHT = 8.0  # factor for a drag over the height of the window
MANY_STEPS = 50


@dataclass(eq=False)
class Controls:
    """What the user has asked for. Keys are named as GGUI names them: letters in lower case, `Escape`, `Right`, … ."""

    running: bool = True
    trails: bool = True
    help: bool = False
    quit: bool = False
    restart: bool = False
    screenshot: bool = False
    print_camera: bool = False
    panels: bool = False
    export: bool = False
    single_steps: int = 0
    _cursor: tuple[float, float] | None = field(default=None, repr=False)

    def press(self, key: str, *, shift: bool, camera: Camera, frame: Frame, aspect: float) -> None:
        """A key went down."""
        if key in (" ", "Space"):
            self.running = not self.running
        elif key == "Right":
            self.running = False
            self.single_steps += MANY_STEPS if shift else 1
        elif key == "BackSpace":
            self.restart = True
        elif key in ("q", "Escape"):
            self.quit = True
        elif key == "h":
            self.help = not self.help
        elif key == "t":
            self.trails = not self.trails
        elif key == "c":
            self.screenshot = True
        elif key == "p":
            self.panels = True
        elif key == "e":
            self.export = True
        elif key == "k":
            self.print_camera = True
        elif key == "r":
            camera.reset()
        elif key == "f":
            camera.frame_all(frame, aspect)
        elif key in ("x", "y", "z"):
            camera.look_along(key)

    def move(self, cursor: tuple[float, float], held: set[str], *, camera: Camera, seconds: float, aspect: float) -> None:
        """Drag and held keys since the last call, `seconds` ago; `cursor` in 0…1 from the lower left corner of the window."""
        last, self._cursor = self._cursor, cursor if held & {"LMB", "MMB", "RMB"} else None
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

    def take(self, request: str) -> bool:
        """Whether a request (`restart`, `screenshot`, `panels`, …) is open; it is answered by this call."""
        asked = bool(getattr(self, request))
        setattr(self, request, False)
        return asked

    def take_steps(self) -> int:
        """Single steps asked for since the last call."""
        steps, self.single_steps = self.single_steps, 0
        return steps
