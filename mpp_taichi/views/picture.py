"""A picture in a file."""

from pathlib import Path

import numpy as np
from PIL import Image

from mpp_taichi.errors import OutputError


def save_picture(picture: np.ndarray, path: Path) -> None:
    """Write one PNG by way of a temporary file, so that no half a picture is left.

    Raises:
        OutputError: it cannot be written.
    """
    temporary = path.with_name(path.name + ".part")
    try:
        Image.fromarray(picture).save(temporary, format="PNG", compress_level=3)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(f"{path}: cannot write the picture: {error.strerror or error}") from error
