"""Checks of the appearance of a body: contradictory keys, and pictures that cannot be read."""

from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

from mpp_taichi.scene.body_view_spec import (
    BodyViewSpec,
    CloudsSpec,
    NightSpec,
    NormalSpec,
    RingTextureSpec,
    SpecularSpec,
    TextureSpec,
)

MOST_PIXELS = 150_000_000  # of a picture that is wrapped around a body, or around all
UNREADABLE = "is no picture that can be read, allowed: PNG, JPEG, WebP, TIFF and others"


class Finder(Protocol):
    """Finds the particles that a scene names; a missing particle becomes a fault."""

    def group(self, reference: int | str, path: tuple[Any, ...]) -> tuple[int, int] | None:
        """First index and count of a group, or of one particle."""

    def fault(self, path: tuple[Any, ...], message: str) -> None:
        """Add a fault at a path of the scene."""


def check_body(body: BodyViewSpec, path: tuple[Any, ...], finder: Finder, *, lit: bool) -> None:
    """Add the faults of a body's appearance; `lit` says whether the scene has a light."""
    if body.distance_scale != 1.0 and body.around is None:
        finder.fault((*path, "distance_scale"), "must say around: which body it is measured from")
    if body.spin is not None and body.spin.period == 0.0:
        finder.fault((*path, "spin", "period"), "must not be 0")
    if body.spin is not None and body.spin.precession == 0.0:
        finder.fault((*path, "spin", "precession"), "must not be 0")
    if body.spin is not None and not any(body.spin.axis):
        finder.fault((*path, "spin", "axis"), "must not be [0, 0, 0]")
    if body.clouds is not None and body.clouds.period == 0.0:
        finder.fault((*path, "clouds", "period"), "must not be 0")
    for key in ("texture", "night", "clouds", "normal", "specular"):
        if (surface := getattr(body, key)) is not None:
            _check_surface(surface, (*path, key), finder)
    if body.ring is not None:
        if not body.ring.inner < body.ring.outer:
            finder.fault((*path, "ring", "outer"), f"must be above inner, which is {body.ring.inner:g}")
        if body.ring.texture is not None:
            _check_surface(body.ring.texture, (*path, "ring", "texture"), finder)
    for key in ("night", "clouds", "normal", "specular", "ring"):
        if body.light is not None and getattr(body, key) is not None:
            finder.fault((*path, key), "is not for a body that shines")
    if body.night is not None and not lit:
        finder.fault((*path, "night"), "needs a light, without which there is no night: view.light, or light: true of a body")


def _check_surface(
    surface: TextureSpec | NightSpec | CloudsSpec | NormalSpec | SpecularSpec | RingTextureSpec,
    path: tuple[Any, ...],
    finder: Finder,
) -> None:
    if (surface.file is None) == (surface.pattern is None):
        finder.fault(path, "must have a file or a pattern, and not both")
    check_picture(surface.file, (*path, "file"), finder)


def check_picture(file: str | None, path: tuple[Any, ...], finder: Finder) -> None:
    """Read a file from its beginning to its end, and add a fault where that is not possible."""
    if file is None:
        return
    try:
        stamp = Path(file).stat().st_mtime_ns
    except OSError:
        finder.fault(path, UNREADABLE)
        return
    if wrong := _wrong(file, stamp):
        finder.fault(path, wrong)


@lru_cache(maxsize=128)
def _wrong(file: str, stamp: int) -> str:
    """The fault of a picture file as it was written at a time; empty where there is none."""
    del stamp  # part of the key
    from PIL import Image  # only for scenes that bring pictures

    try:
        with Image.open(file) as picture:
            pixels = picture.size[0] * picture.size[1]
            if pixels > MOST_PIXELS:
                return f"is a picture of {pixels:,} pixels, allowed: up to {MOST_PIXELS:,}"
            picture.draft("RGB", (picture.size[0] // 8, picture.size[1] // 8))  # a JPEG is decoded at an eighth of its size
            picture.load()
    except (OSError, ValueError, SyntaxError, EOFError, Image.DecompressionBombError) as error:
        damaged = "truncated" in str(error) or "broken" in str(error)
        return f"is a damaged picture: {error}" if damaged else UNREADABLE
    return ""
