"""Texts over a finished picture of the scene: names of bodies and the scale bar; nothing is done where a view asks for none."""

import numpy as np
from PIL import Image

from mpp_taichi.scene.view_spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import ink
from mpp_taichi.views.labels import letters_of, name_tags, write_names
from mpp_taichi.views.legend import line_height
from mpp_taichi.views.scale_bar import ScaleBar, draw_scale_bar

COVERED = 128  # of 255: a pixel of a layer that is at least half covered counts


def has_overlay(view: ViewSpec) -> bool:
    """Whether a view has names or a scale bar."""
    return bool(view.labels) or view.scale_bar


def draw_overlay(picture: np.ndarray, frame: Frame, view: ViewSpec, camera: Camera) -> None:
    """Write names and scale bar into a picture (height, width, 3), in place."""
    if not has_overlay(view):
        return
    image = Image.fromarray(picture)
    height, width = picture.shape[:2]
    _write(image, frame, view, camera, (width, height), (0.0, 0.0), (width, height))
    picture[:] = np.asarray(image)


def overlay_layer(
    frame: Frame,
    view: ViewSpec,
    camera: Camera,
    size: tuple[int, int],
    shift: tuple[float, float],
    part: tuple[int, int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and colours (count, 3) as bytes of the pixels of names and scale bar in a window of this size.

    `shift` is as in `name_tags`; `part` is the scene's part of the window, from its upper left corner.
    """
    image = Image.new("RGBA", size, (*ink(view.background)[1], 0))
    _write(image, frame, view, camera, size, shift, part)
    pixels = np.asarray(image)
    rows, columns = np.nonzero(pixels[:, :, 3] >= COVERED)
    inside = (rows < part[1]) & (columns < part[0])
    rows, columns = rows[inside], columns[inside]
    return rows, columns, pixels[rows, columns, :3]


def _write(
    image: Image.Image,
    frame: Frame,
    view: ViewSpec,
    camera: Camera,
    size: tuple[int, int],
    shift: tuple[float, float],
    part: tuple[int, int],
) -> None:
    line = line_height(part)
    colors, letters = ink(view.background), letters_of(line)
    write_names(image, name_tags(frame, view, camera, size, letters, shift), letters, colors)
    if view.scale_bar:
        draw_scale_bar(image, ScaleBar.of(camera, size, frame.units), line, colors, *part)
