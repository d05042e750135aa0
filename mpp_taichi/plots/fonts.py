"""The font of all text in pictures."""

import importlib.util
from functools import lru_cache
from pathlib import Path

from PIL import ImageFont


@lru_cache(maxsize=8)
def font_of(height: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Go Regular, which comes with Taichi and holds Latin, Greek and Cyrillic; Pillow's own font holds little beyond ASCII."""
    taichi = importlib.util.find_spec("taichi")
    if taichi is not None and taichi.origin is not None:
        font = Path(taichi.origin).parent / "assets" / "Go-Regular.ttf"
        if font.is_file():
            return ImageFont.truetype(str(font), height)
    return ImageFont.load_default(size=height)
