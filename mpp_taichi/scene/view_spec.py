"""ViewSpec: how a scene is drawn. Display only: no key of the view changes a motion."""

from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Field

from mpp_taichi.scene.body_view_spec import (
    BodyLightSpec,
    BodyViewSpec,
    CloudsSpec,
    NightSpec,
    NormalSpec,
    RingSpec,
    RingTextureSpec,
    SpecularSpec,
    SpinSpec,
    TextureSpec,
)
from mpp_taichi.scene.colors import Color
from mpp_taichi.scene.fields import FileBeside, Flag, ListOf, Number, OneOrMore, Reference, Text, Whole
from mpp_taichi.scene.flag_or import FlagOr

COLOR_MAPS = ("viridis", "cividis", "diverging")
ARROW_QUANTITIES = ("velocity", "acceleration", "force")
_CLOSED = ConfigDict(extra="forbid")
_COLOR = Color()
_MOST_GROUPS = 64
_MOST_LABELS = 1000


def _nothing_is_empty(value: Any) -> Any:
    """`speed:` with nothing after it asks for the speed with all defaults."""
    return {} if value is None else value


def _nothing_is_none(value: Any) -> Any:
    """`light:` with nothing after it asks for no light."""
    return [] if value is None else value


_ASKED = BeforeValidator(_nothing_is_empty)


@dataclass(frozen=True)
class CameraSpec:
    """The place of the camera; an absent value is chosen so that every particle is in view."""

    __pydantic_config__ = _CLOSED
    position: Annotated[tuple[float, float, float] | None, ListOf(Number()), Field(description="position of the eye")] = None
    look_at: Annotated[
        tuple[float, float, float] | None, ListOf(Number()), Field(description="point in the middle of the picture")
    ] = None
    up: Annotated[tuple[float, float, float] | None, ListOf(Number()), Field(description="direction that is up")] = None
    field_of_view: Annotated[
        float, Number(minimum=1.0, maximum=170.0), Field(description="vertical field of view, degrees")
    ] = 45.0
    projection: Annotated[str, Text(("perspective", "orthographic")), Field(description="perspective or orthographic")] = (
        "perspective"
    )
    height: Annotated[float | None, Number(above=0.0), Field(description="height of an orthographic picture [length]")] = None


@dataclass(frozen=True)
class LightSpec:
    """Light from afar, in which spheres cast shadows on one another."""

    __pydantic_config__ = _CLOSED
    direction: Annotated[
        tuple[float, float, float], ListOf(Number()), Field(description="direction towards the source of the light")
    ]
    angular_radius: Annotated[
        float,
        Number(above=0.0, maximum=20.0),
        Field(description="angular radius of the source, degrees; a larger source makes softer shadows"),
    ] = 0.27
    color: Annotated[tuple[float, float, float], _COLOR, Field(description="red, green, blue in 0…1")] = (1.0, 1.0, 1.0)
    brightness: Annotated[float, Number(minimum=0.0, maximum=100.0), Field(description="factor of the light")] = 1.0


@dataclass(frozen=True)
class SkySpec:
    """The background: stars from a seed, or a picture of the whole sky."""

    __pydantic_config__ = _CLOSED
    stars: Annotated[int, Whole(minimum=0, maximum=100_000), Field(description="number of stars in all directions")] = 0
    seed: Annotated[int, Whole(minimum=0, maximum=2**31), Field(description="seed of the stars")] = 0
    file: Annotated[str | None, FileBeside(), Field(description="a picture: longitude along its width, north (+z) on top")] = (
        None
    )
    brightness: Annotated[float, Number(minimum=0.0, maximum=100.0), Field(description="brightness of stars and picture")] = 1.0


@dataclass(frozen=True)
class ColorScaleSpec:
    """The scale that turns a quantity into a colour."""

    __pydantic_config__ = _CLOSED
    map: Annotated[
        str | None,
        Text(COLOR_MAPS),
        Field(description=" or ".join(COLOR_MAPS) + "; absent: viridis, of strain and tension diverging"),
    ] = None
    range: Annotated[
        tuple[float, float] | None,
        ListOf(Number(), (2,)),
        Field(description="values at the two ends; absent: the range of the values since the first picture"),
    ] = None
    logarithmic: Annotated[bool, Flag(), Field(description="colours by the logarithm of positive values")] = False
    label: Annotated[str, Text(), Field(description="text of the legend; absent: the name of the quantity")] = ""


@dataclass(frozen=True)
class GroupColorsSpec:
    """A different colour for each group, from the palette of Okabe and Ito.

    Once the scene is loaded, `of` holds (name, first index, count) of each.
    """

    __pydantic_config__ = _CLOSED
    of: Annotated[
        Any,
        ListOf(Reference(), tuple(range(1, _MOST_GROUPS + 1)), "particles and groups"),
        Field(description="bodies and groups; absent: every entry of particles:"),
    ] = None


@dataclass(frozen=True)
class ColorBySpec:
    """The quantity by which particles are coloured; one of these keys."""

    __pydantic_config__ = _CLOSED
    speed: Annotated[ColorScaleSpec | None, _ASKED, Field(description="size of the velocity")] = None
    kinetic_energy: Annotated[ColorScaleSpec | None, _ASKED, Field(description="½ m v²")] = None
    mass: Annotated[ColorScaleSpec | None, _ASKED, Field(description="m")] = None
    charge: Annotated[ColorScaleSpec | None, _ASKED, Field(description="q")] = None
    radius: Annotated[ColorScaleSpec | None, _ASKED, Field(description="radius of the sphere, without display scales")] = None
    x: Annotated[ColorScaleSpec | None, _ASKED, Field(description="coordinate")] = None
    y: Annotated[ColorScaleSpec | None, _ASKED, Field(description="coordinate")] = None
    z: Annotated[ColorScaleSpec | None, _ASKED, Field(description="coordinate")] = None
    index: Annotated[ColorScaleSpec | None, _ASKED, Field(description="number in the list of all particles")] = None
    group: Annotated[
        GroupColorsSpec | None, _ASKED, Field(description="number of the entry of particles: that placed the particle")
    ] = None


@dataclass(frozen=True)
class SpringColorBySpec:
    """The quantity by which springs are coloured; one of these keys."""

    __pydantic_config__ = _CLOSED
    strain: Annotated[ColorScaleSpec | None, _ASKED, Field(description="(l − L)/L, above 0 where stretched")] = None
    tension: Annotated[ColorScaleSpec | None, _ASKED, Field(description="D (l − L), without friction [force]")] = None
    length: Annotated[ColorScaleSpec | None, _ASKED, Field(description="l")] = None


@dataclass(frozen=True)
class ArrowsSpec:
    """An arrow at each particle for a vector quantity; its length is a scale times the vector.

    The arrow of a velocity ends where the particle would be after `time` on a straight line.
    """

    __pydantic_config__ = _CLOSED
    quantity: Annotated[
        str, Text(ARROW_QUANTITIES), Field(description="velocity, acceleration, or force: the mass times the acceleration")
    ] = "velocity"
    time: Annotated[
        float | None,
        Number(above=0.0),
        Field(description="time over which an arrow shows the way of a velocity; absent: a time that fits the first picture"),
    ] = None
    scale: Annotated[
        float | None,
        Number(above=0.0),
        Field(description="length of an arrow over acceleration or force; absent: a ratio that fits the first picture"),
    ] = None
    of: Annotated[
        Any,
        ListOf(Reference(), tuple(range(1, _MOST_GROUPS + 1)), "particles and groups"),
        Field(description="bodies and groups; absent: all"),
    ] = None
    color: Annotated[
        tuple[float, float, float] | None,
        _COLOR,
        Field(description="red, green, blue in 0…1; absent: white, orange for accelerations, red for forces"),
    ] = None
    width: Annotated[float, Number(above=0.0, maximum=100.0), Field(description="pixels of a picture of 720 rows")] = 2.0

    @property
    def length_per_quantity(self) -> float | None:
        """The factor by which the vector is multiplied, where the scene gives one."""
        return self.time if self.quantity == "velocity" else self.scale


@dataclass(frozen=True)
class AxesSpec:
    """The axes x, y, z with their letters."""

    __pydantic_config__ = _CLOSED
    origin: Annotated[tuple[float, float, float], ListOf(Number()), Field(description="point at which the axes begin")] = (
        0.0,
        0.0,
        0.0,
    )
    length: Annotated[float | None, Number(above=0.0), Field(description="absent: a round number that fits the picture")] = None


@dataclass(frozen=True)
class GridSpec:
    """A grid of squares in a plane through the origin; the legend gives its spacing."""

    __pydantic_config__ = _CLOSED
    plane: Annotated[str, Text(("xy", "xz", "yz")), Field(description="xy, xz or yz")] = "xy"
    spacing: Annotated[float | None, Number(above=0.0), Field(description="absent: a round number that fits the picture")] = (
        None
    )
    lines: Annotated[int, Whole(minimum=1, maximum=500), Field(description="lines on each side of the middle")] = 5
    at: Annotated[float, Number(), Field(description="position of the plane on the third axis")] = 0.0


@dataclass(frozen=True)
class ViewSpec:
    """The picture: camera, colors and marks."""

    __pydantic_config__ = _CLOSED
    camera: Annotated[CameraSpec, Field(description="camera of the picture")] = field(default_factory=CameraSpec)
    background: Annotated[
        tuple[float, float, float], _COLOR, Field(description="color of the background: red, green, blue in 0…1")
    ] = (0.02, 0.02, 0.05)
    radius_scale: Annotated[float, Number(above=0.0), Field(description="factor of the spheres' radii, display only")] = 1.0
    minimum_pixels: Annotated[float, Number(minimum=0.0), Field(description="smallest radius of a sphere, in pixels")] = 1.5
    spring_width: Annotated[float, Number(above=0.0, maximum=100.0), Field(description="pixels")] = 2.0
    trails: Annotated[int, Whole(minimum=0, maximum=10_000), Field(description="frames of trail per particle, 0 = none")] = 0
    caption: Annotated[bool, Flag(), Field(description="whether the picture shows title and time")] = True
    bodies: Annotated[dict[Any, BodyViewSpec], Field(description="appearance of single bodies and groups, by name")] = field(
        default_factory=dict
    )  # by (first index, count) once the scene is loaded
    light: Annotated[
        tuple[LightSpec, ...],
        OneOrMore(),
        BeforeValidator(_nothing_is_none),
        Field(
            description="distant light, with shadows, or a list of several; absent, and no body a light: light from the upper "
            "left, without shadows"
        ),
    ] = ()
    sky: Annotated[
        SkySpec | None, Field(description="stars or a picture behind the scene; only in the program's own renderer")
    ] = None
    ambient: Annotated[
        float,
        Number(minimum=0.0, maximum=1.0),
        Field(description="brightness of surfaces in shadow, where the scene has a light or a body that is a light"),
    ] = 0.03
    color_by: Annotated[
        ColorBySpec | None, Field(description="colour of the particles by a quantity, for example {speed: {}}")
    ] = None
    spring_color_by: Annotated[
        SpringColorBySpec | None, Field(description="colour of the springs by a quantity, for example {strain: {}}")
    ] = None
    legend: Annotated[bool, Flag(), Field(description="legend with the numbers of colours, arrows and grid")] = True
    arrows: Annotated[
        tuple[ArrowsSpec, ...],
        OneOrMore(),
        _ASKED,
        Field(description="velocities as arrows, or accelerations, or forces; several of these as a list"),
    ] = ()
    labels: Annotated[
        Any,
        FlagOr(ListOf(Reference(), tuple(range(1, _MOST_LABELS + 1)), "bodies and groups")),
        Field(description="names beside bodies: true for every body with a name, or a list of bodies and groups"),
    ] = False  # once the scene is loaded: True, or (name, first index, count) of each
    scale_bar: Annotated[
        bool,
        Flag(),
        Field(description="a bar of a round length with its unit; its length holds at the depth of the camera's target"),
    ] = False
    axes: Annotated[AxesSpec | None, _ASKED, Field(description="axes with their letters")] = None
    grid: Annotated[GridSpec | None, _ASKED, Field(description="a grid in a plane")] = None

    @property
    def wants_acceleration(self) -> bool:
        """Whether something is drawn that needs the present accelerations."""
        return any(arrows.quantity != "velocity" for arrows in self.arrows)


VIEW_SPECS: dict[str, type] = {
    "view": ViewSpec,
    "view.camera": CameraSpec,
    "view.bodies.NAME": BodyViewSpec,
    "view.bodies.NAME.light": BodyLightSpec,
    "view.bodies.NAME.texture": TextureSpec,
    "view.bodies.NAME.night": NightSpec,
    "view.bodies.NAME.clouds": CloudsSpec,
    "view.bodies.NAME.normal": NormalSpec,
    "view.bodies.NAME.specular": SpecularSpec,
    "view.bodies.NAME.ring": RingSpec,
    "view.bodies.NAME.ring.texture": RingTextureSpec,
    "view.bodies.NAME.spin": SpinSpec,
    "view.light": LightSpec,
    "view.sky": SkySpec,
    "view.color_by": ColorBySpec,
    "view.color_by.QUANTITY": ColorScaleSpec,
    "view.color_by.group": GroupColorsSpec,
    "view.spring_color_by": SpringColorBySpec,
    "view.arrows": ArrowsSpec,
    "view.axes": AxesSpec,
    "view.grid": GridSpec,
}
"""Keys of a scene and the classes that describe them, as the reference lists them."""
