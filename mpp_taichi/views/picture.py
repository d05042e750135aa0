"""A picture in a file."""

from pathlib import Path

import numpy as np
from PIL import Image

from mpp_taichi.atomic_file import whole_file


def save_picture(picture: np.ndarray, path: Path) -> None:
    """Write a PNG through a temporary file, so that no incomplete picture remains.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_file(path, "the picture") as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", compress_level=3)
