"""SceneSpec: the immutable, checked description of a scene. Pure Python; no device, no Taichi."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Location:
    """Where in which file something was written; `file` is `--set …` for an override."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        """`file:line:column`, or the file alone where there are no lines (`--set path=value`, a dict)."""
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


@dataclass(frozen=True, eq=False)
class ComponentSpec:
    """One component that the scene names, with every parameter checked and defaults filled in."""

    name: str
    parameters: dict[str, Any]
    location: Location


@dataclass(frozen=True)
class CameraSpec:
    """Where the picture is taken from; None means: chosen so that every particle is in view."""

    position: tuple[float, float, float] | None = None
    look_at: tuple[float, float, float] | None = None
    up: tuple[float, float, float] | None = None
    field_of_view: float = 45.0  # vertical, degrees
    projection: str = "perspective"  # or "orthographic"
    height: float | None = None  # of the picture in scene lengths, orthographic only


@dataclass(frozen=True)
class ViewSpec:
    """What is drawn."""

    camera: CameraSpec = field(default_factory=CameraSpec)
    background: tuple[float, float, float] = (0.02, 0.02, 0.05)
    radius_scale: float = 1.0  # display only
    minimum_pixels: float = 1.5  # radius in pixels below which no sphere is drawn smaller
    spring_width: float = 2.0  # pixels
    trails: int = 0  # frames of trail kept per particle, 0 = none
    caption: bool = True  # title and time


@dataclass(frozen=True)
class RecordSpec:
    """How a film is made; `seconds` is the length of the film, over which `run.duration` is spread."""

    size: tuple[int, int] = (1280, 720)
    fps: float = 30.0
    seconds: float = 10.0


@dataclass(frozen=True)
class RunSpec:
    """How long to run and how often to look. `every` counts steps between diagnostic samples."""

    duration: float | None = None
    steps: int | None = None
    every: int | None = None


@dataclass(frozen=True, eq=False)
class Expectation:
    """A statement of physics that `check` asserts: `quantity` bounded by `below`/`above`, or `near ± within`.

    Bounds are {"f64": number, "f32": number}; `parameters` are the diagnostic's own (say `of:` and `around:`).
    `within` is relative to `near`.
    """

    quantity: str
    parameters: dict[str, Any]
    below: dict[str, float] | None
    above: dict[str, float] | None
    near: float | None
    within: dict[str, float] | None
    location: Location


@dataclass(frozen=True, eq=False)
class SceneSpec:
    """A scene as it will be run: every name known, every number finite, every default filled in."""

    source: str
    title: str
    dimensions: int
    seed: int
    units: dict[str, str] | None
    constants: dict[str, float]
    particles: tuple[ComponentSpec, ...]
    springs: tuple[ComponentSpec, ...]
    spring_damping: str  # "axial" (along the spring) or "full" (the whole relative velocity)
    forces: tuple[ComponentSpec, ...]
    integrator: ComponentSpec
    move_to_center_of_mass: bool
    run: RunSpec
    view: ViewSpec
    record: RecordSpec
    expect: tuple[Expectation, ...]
    resolved: dict[str, Any]  # plain YAML-able mapping with extends, constants and overrides applied
