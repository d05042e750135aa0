"""The picture in a window while a scene is being compiled."""

import numpy as np
from PIL import Image

from mpp_taichi.views.caption import Background, ink, text_height, write_outlined

WORD = "compiling …"


def waiting_picture(title: str, size: tuple[int, int], background: Background) -> np.ndarray:
    """The title of a scene, and below it the word "compiling", in the middle of a picture of (width, height) pixels."""
    width, height = size
    image = Image.new("RGB", size, tuple(round(255.0 * min(max(share, 0.0), 1.0)) for share in background))
    letters, colors = text_height(height), ink(background)
    for text, scale, row in ((title, 3 / 2, -1.0), (WORD, 1.0, 1.0)):
        place = width / 2.0, height / 2.0 + row * letters
        write_outlined(image, place, text, round(scale * letters), colors, anchor="mm", outline=1)
    return np.asarray(image)
