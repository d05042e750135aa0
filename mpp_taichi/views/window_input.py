"""Keys and mouse of a window: each key goes to the camera, to the list that is shown, or to the controls."""

from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.controls import BUTTONS, ZOOM_PER_CLICK, Controls
from mpp_taichi.views.film_look import seeing
from mpp_taichi.views.flight import ARROWS, MODIFIERS, fly, is_flight, turn_to
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.paper import Mouse
from mpp_taichi.views.steering import Steering
from mpp_taichi.views.window_boxes import WindowBoxes
from mpp_taichi.views.window_layout import Area
from mpp_taichi.views.window_scene import WindowScene

HELD_KEYS = ("LMB", "MMB", "RMB", *MODIFIERS, *ARROWS, "i", "o")


class WindowInput:
    """Reads the input of a window once in each frame."""

    def __init__(self, glass: Glass, scene: WindowScene, boxes: WindowBoxes) -> None:
        """Nothing has been pressed yet."""
        self._glass, self._scene, self._boxes = glass, scene, boxes
        self._steering = Steering(boxes.sliders.knobs)
        self.moved: dict[str, float] = {}  # parameters, by keys

    def read(self, controls: Controls, camera: Camera, frame: Frame, picture: Area, seconds: float) -> Mouse:
        """Take the input since the last call, `seconds` ago, where the picture lies in an area; returns the mouse."""
        keys = self._glass.pressed()
        held = self._glass.held((*HELD_KEYS, *self._steering.keys))
        self.moved = self._steering.moves({*held, *keys})
        held, keys = held - set(self._steering.keys), [key for key in keys if key not in self._steering.keys]
        held |= BUTTONS & set(keys)  # a click may begin and end between two frames
        modifiers = {key for key in MODIFIERS if key in held or key in keys}  # and so may a key
        flown = {key for key in keys if is_flight(key, modifiers)}
        pressed = [*self._boxes.keys, *(key for key in keys if key not in flown)]
        self._press(pressed, "Shift" in modifiers, controls, camera, frame, picture)
        size, cursor = self._glass.size, self._glass.cursor
        pixel = cursor[0] * size[0], (1.0 - cursor[1]) * size[1]
        part = self._scene.part(picture)
        controls.occupied = [part.box_of(area) for area in self._boxes.areas]
        away = any(area.holds(pixel) for area in self._boxes.areas)
        clicks = self._glass.take_wheel()
        if away:
            self._boxes.scroll(-clicks)
        factor = self._scene.film.factor(part.size)
        shape, share = part.width / part.height, part.share(pixel)
        with seeing(camera, factor):
            controls.move(share, held, camera=camera, seconds=seconds, aspect=shape)
            fly(camera, held | flown | modifiers, seconds)
            camera.zoom(self._boxes.zoom * (1.0 if away else ZOOM_PER_CLICK**clicks))
        if controls.take_click(turns=True) is not None:
            found = self._scene.found(frame, camera, picture, pixel)
            with seeing(camera, factor):
                aside = (share[0] - 0.5) * shape, share[1] - 0.5
                turn_to(camera, *aside, None if found is None else frame.position[found])
        if controls.take_click() is not None:
            self._scene.picked.index = self._scene.found(frame, camera, picture, pixel)
        return Mouse(pixel, "LMB" in keys, "LMB" in held)

    def _press(self, keys: list[str], shift: bool, controls: Controls, camera: Camera, frame: Frame, picture: Area) -> None:
        aspect, scenes, method = self._scene.aspect(picture), self._boxes.scenes, self._boxes.method
        for key in keys:
            if not scenes.press(key) and not method.press(key):
                controls.press(key, shift=shift, camera=camera, frame=frame, aspect=aspect)
            if controls.take("scenes"):  # at once: the next keys of the same frame are for the list
                scenes.toggle()
                method.shown = False
            if controls.take("method"):
                method.toggle()
                scenes.shown = False
        method.look()
