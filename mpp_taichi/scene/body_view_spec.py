"""BodyViewSpec: how a body or a group is drawn. Display only: no key of the view changes a motion."""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from mpp_taichi.scene.colors import Color
from mpp_taichi.scene.fields import FileBeside, ListOf, Number, Reference, Text, Whole
from mpp_taichi.scene.flag_or import FlagOrMapping

PATTERNS = ("banded", "continents", "coasts", "cratered", "checker")
NIGHT_PATTERNS = ("cities",)
CLOUD_PATTERNS = ("scattered",)
SPECULAR_PATTERNS = ("oceans",)
NORMAL_PATTERNS = ("mountains", "craters")
RING_PATTERNS = ("bands", "saturn")
_CLOSED = ConfigDict(extra="forbid")
_SEED = Whole(minimum=0, maximum=2**31)


@dataclass(frozen=True)
class SpinSpec:
    """The rotation of a body's surface: by phase + 2π t / period about its axis."""

    __pydantic_config__ = _CLOSED
    period: Annotated[
        float, Number(), Field(description="period of a turn about the axis; below 0 for the opposite direction [time]")
    ]
    axis: Annotated[tuple[float, float, float], ListOf(Number()), Field(description="direction of the north pole")] = (0, 0, 1)
    phase: Annotated[
        float,
        Number(),
        Field(
            description="angle at time 0 from the rising of the equator through the x–y plane to the prime meridian, radians"
        ),
    ] = 0.0
    precession: Annotated[
        float | None,
        Number(),
        Field(
            description="period in which the axis turns about the z axis, the normal of the reference plane; below 0 for the "
            "opposite direction; absent: the axis rests [time]"
        ),
    ] = None


@dataclass(frozen=True)
class TextureSpec:
    """The surface of a body: a picture of it, or a pattern made from a seed and the body's colour."""

    __pydantic_config__ = _CLOSED
    file: Annotated[
        str | None, FileBeside(), Field(description="a picture beside the scene; longitude along its width, north on top")
    ] = None
    pattern: Annotated[str | None, Text(PATTERNS), Field(description="or a pattern: " + ", ".join(PATTERNS))] = None
    seed: Annotated[int, _SEED, Field(description="seed of the pattern")] = 0


@dataclass(frozen=True)
class NightSpec:
    """The lights of the dark side, which fade over the terminator."""

    __pydantic_config__ = _CLOSED
    file: Annotated[str | None, FileBeside(), Field(description="a picture beside the scene, placed like a texture")] = None
    pattern: Annotated[
        str | None, Text(NIGHT_PATTERNS), Field(description="or a pattern: cities, on the land of continents of the same seed")
    ] = None
    seed: Annotated[int, _SEED, Field(description="seed of the pattern")] = 0
    brightness: Annotated[float, Number(minimum=0.0, maximum=100.0), Field(description="factor of the light")] = 1.0


@dataclass(frozen=True)
class CloudsSpec:
    """Clouds over the surface, which turn about its axis with a period of their own."""

    __pydantic_config__ = _CLOSED
    file: Annotated[
        str | None,
        FileBeside(),
        Field(
            description="a picture with transparency beside the scene, placed like a texture; without transparency its "
            "brightness is the opacity of white clouds"
        ),
    ] = None
    pattern: Annotated[str | None, Text(CLOUD_PATTERNS), Field(description="or a pattern: scattered")] = None
    seed: Annotated[int, _SEED, Field(description="seed of the pattern")] = 0
    period: Annotated[
        float | None,
        Number(),
        Field(description="period of a turn about the axis of spin:; absent: clouds turn with the surface [time]"),
    ] = None
    opacity: Annotated[float, Number(minimum=0.0, maximum=1.0), Field(description="factor of the opacity")] = 1.0


@dataclass(frozen=True)
class NormalSpec:
    """Mountains and valleys as the slopes of the surface, which change its light and not its outline."""

    __pydantic_config__ = _CLOSED
    file: Annotated[
        str | None,
        FileBeside(),
        Field(
            description="a picture beside the scene, placed like a texture: a normal map (red to the east, green to the north, "
            "blue outwards), or in grey a height map"
        ),
    ] = None
    pattern: Annotated[
        str | None,
        Text(NORMAL_PATTERNS),
        Field(description="or a pattern: mountains of continents, or craters of cratered, of the same seed"),
    ] = None
    seed: Annotated[int, _SEED, Field(description="seed of the pattern")] = 0
    strength: Annotated[
        float,
        Number(minimum=-100.0, maximum=100.0),
        Field(description="factor of the slopes; at 1, white of a height map is higher than black by 0.02 radii"),
    ] = 1.0


@dataclass(frozen=True)
class SpecularSpec:
    """Where the surface mirrors lights: the seas of a planet, or ice."""

    __pydantic_config__ = _CLOSED
    file: Annotated[
        str | None,
        FileBeside(),
        Field(
            description="a picture beside the scene, placed like a texture: white where the highlight of a light has its full "
            "brightness, black where there is none"
        ),
    ] = None
    pattern: Annotated[
        str | None,
        Text(SPECULAR_PATTERNS),
        Field(description="or a pattern: oceans, the seas of continents of the same seed"),
    ] = None
    seed: Annotated[int, _SEED, Field(description="seed of the pattern")] = 0
    strength: Annotated[float, Number(minimum=0.0, maximum=100.0), Field(description="factor of the highlight")] = 1.0


@dataclass(frozen=True)
class RingTextureSpec:
    """Colour and opacity of a ring from its inner to its outer edge: a picture, or a pattern in shades of the ring's colour."""

    __pydantic_config__ = _CLOSED
    file: Annotated[
        str | None,
        FileBeside(),
        Field(
            description="a picture with transparency beside the scene, whose width goes from the inner to the outer edge; "
            "without transparency its brightness is the opacity of the ring's colour"
        ),
    ] = None
    pattern: Annotated[
        str | None,
        Text(RING_PATTERNS),
        Field(description="or a pattern: bands, from the seed, or saturn, the main rings C, B and A with their gaps"),
    ] = None
    seed: Annotated[int, _SEED, Field(description="seed of the pattern bands")] = 0


@dataclass(frozen=True)
class RingSpec:
    """A half-transparent ring in the plane of a body's equator, with shadows of bodies on it and of it on bodies."""

    __pydantic_config__ = _CLOSED
    inner: Annotated[float, Number(minimum=1.0, maximum=1e3), Field(description="inner radius, in radii of the body")]
    outer: Annotated[float, Number(minimum=1.0, maximum=1e3), Field(description="outer radius, in radii of the body")]
    color: Annotated[
        tuple[float, float, float] | None, Color(), Field(description="red, green, blue in 0…1; absent: the body's colour")
    ] = None
    texture: Annotated[RingTextureSpec | None, Field(description="bands; absent: a uniform ring")] = None
    opacity: Annotated[
        float | None,
        Number(minimum=0.0, maximum=1.0),
        Field(description="opacity seen from the pole, with a texture a factor of its opacity; absent: 0.7, with a texture 1"),
    ] = None


@dataclass(frozen=True)
class BodyLightSpec:
    """The light of a body on other bodies."""

    __pydantic_config__ = _CLOSED
    color: Annotated[
        tuple[float, float, float] | None,
        Color(),
        Field(description="red, green, blue in 0…1; absent: white if it is the only light, else the body's colour"),
    ] = None
    brightness: Annotated[
        float, Number(minimum=0.0, maximum=100.0), Field(description="factor of the light on other bodies")
    ] = 1.0


@dataclass(frozen=True)
class BodyViewSpec:
    """The appearance of a body or a group; display only, no motion changes.

    `around` is an index once the scene is loaded.
    """

    __pydantic_config__ = _CLOSED
    radius_scale: Annotated[float, Number(above=0.0), Field(description="factor by which the radius is drawn larger")] = 1.0
    around: Annotated[Any, Reference(), Field(description="the body from which distance_scale is measured")] = None
    distance_scale: Annotated[
        float,
        Number(above=0.0),
        Field(description="factor by which the distance from the body `around` is drawn larger, for moons"),
    ] = 1.0
    light: Annotated[
        BodyLightSpec | None,
        FlagOrMapping(),
        Field(description="true, or {color, brightness}: the body shines and lights other bodies, which then cast shadows"),
    ] = None
    texture: Annotated[TextureSpec | None, Field(description="surface of the body")] = None
    night: Annotated[NightSpec | None, Field(description="lights of the dark side")] = None
    clouds: Annotated[CloudsSpec | None, Field(description="clouds over the surface")] = None
    normal: Annotated[NormalSpec | None, Field(description="slopes of the surface: a normal map or a height map")] = None
    specular: Annotated[SpecularSpec | None, Field(description="where the surface mirrors lights")] = None
    ring: Annotated[RingSpec | None, Field(description="ring in the plane of the equator")] = None
    spin: Annotated[SpinSpec | None, Field(description="rotation of the surface")] = None
