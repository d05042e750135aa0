"""SceneSpec: the immutable, checked description of a scene. Pure Python; no device, no Taichi."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from mpp_taichi import component
from mpp_taichi.scene.expressions import Formula
from mpp_taichi.scene.fields import Counts, ListOf, Number, Reference, Settings, Text, Whole
from mpp_taichi.scene.formulas.laws import law_of
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.target import TargetSpec
from mpp_taichi.scene.view_spec import CameraSpec as CameraSpec
from mpp_taichi.scene.view_spec import ViewSpec

__all__ = [
    *("CameraSpec", "ComponentSpec", "ContactsSpec", "Event", "EventSpec", "Expectation", "Location", "ModesSpec"),
    *(
        "PanelSpec",
        "RecordSpec",
        "RunSpec",
        "SceneSpec",
        "SliderSpec",
        "SliderTarget",
        "SpringTypeSpec",
        "TableSpec",
        "ViewSpec",
    ),
]
_CLOSED = ConfigDict(extra="forbid")
_COLOR = ListOf(Number(minimum=0.0, maximum=1.0))


def default_integrator() -> str:
    """The integrator of a scene that names none."""
    return component.marked("integrators", "default_of_kind")[0]


@dataclass(frozen=True, eq=False)
class ComponentSpec:
    """One component that the scene names, with every parameter checked and defaults filled in."""

    name: str
    parameters: dict[str, Any]
    location: Location
    live: tuple[str, ...] = ()  # parameters that sliders move while kernels run

    @property
    def label(self) -> str:
        """The name of a force in messages, which differs for each force of a scene."""
        return str(self.parameters.get("name") or self.name)

    @property
    def has_limits(self) -> bool:
        """Whether an entry of `springs:` makes springs that break or yield."""
        return any(self.parameters.get(name) is not None for name in ("breaks_at", "yields_at"))

    @cached_property
    def law(self) -> Any:
        """The law of a force that is a formula, else None."""
        return law_of(self)

    def flag(self, kind: str, key: str) -> Any:
        """The literal value that the component, of this kind, gives to an attribute; None where it gives none.

        A force that is a formula says what follows from the formula.
        """
        if kind == "forces" and self.law is not None and key in self.law.flags:
            return self.law.flags[key]
        if key == "is_uniform" and self.parameters.get("on") is not None:  # the same for all that feel it, and not for all
            return False
        return component.flag(kind, self.name, key)


@dataclass(frozen=True)
class TableSpec:
    """The table of a run: a column for each quantity; `units`: with its unit in the header of a CSV file."""

    columns: tuple[ComponentSpec, ...]
    location: Location
    units: bool = False


@dataclass(frozen=True)
class RecordSpec:
    """The settings of a film, and the table of a run; `seconds`: length of the film, which shows the whole `run.duration`."""

    __pydantic_config__ = _CLOSED
    size: Annotated[tuple[int, int], ListOf(Whole(minimum=16, maximum=8192), (2,)), Field(description="pixels")] = (1280, 720)
    fps: Annotated[float, Number(above=0.0, maximum=1000.0), Field(description="frames per second")] = 30.0
    seconds: Annotated[float, Number(above=0.0, maximum=86_400.0), Field(description="length of the film")] = 10.0
    panels: Annotated[
        str, Text(("right", "bottom", "none")), Field(description="where the panels of inspect: are: right, bottom or none")
    ] = "right"
    panel_share: Annotated[
        float, Number(minimum=0.1, maximum=0.9), Field(description="share of the picture's width or height that panels take")
    ] = 0.35
    beside: Annotated[
        dict[str, Any] | None,
        Settings(optional=True),
        Field(
            description="path: value, the parameters that differ in a right half beside the scene, as in record --beside: "
            "integrator: rk4, dt: 0.05 say; absent: one picture"
        ),
    ] = None
    table: TableSpec | None = None


@dataclass(frozen=True)
class RunSpec:
    """The length of the run and the time between samples. `every` counts steps between diagnostic samples."""

    __pydantic_config__ = _CLOSED
    duration: Annotated[float | None, Number(above=0.0), Field(description="time to simulate; steps can be given instead")] = (
        None
    )
    steps: Annotated[int | None, Whole(minimum=1), Field(description="number of steps; duration can be given instead")] = None
    every: Annotated[int | None, Whole(minimum=1), Field(description="steps between diagnostic samples")] = None


@dataclass(frozen=True)
class EventSpec:
    """A change at a time: `set` maps paths, as `--set` takes them, to the values that hold from then on."""

    __pydantic_config__ = _CLOSED
    at: Annotated[
        float, Number(minimum=0.0), Field(description="time of the change, reached exactly; 0 for parameters of sliders")
    ]
    set: Annotated[dict[str, Any], Settings(), Field(description="path: value, for example forces.linear_drag.coefficient: 0")]


@dataclass(frozen=True)
class SpringTypeSpec:
    """The parameters that all springs of one type share; each entry of springs: gives the other parameters."""

    __pydantic_config__ = _CLOSED
    stiffness: Annotated[float | None, Number(minimum=0.0), Field(description="stiffness D [force length⁻¹]")] = None
    damping: Annotated[float | None, Number(minimum=0.0), Field(description="damping c [force time length⁻¹]")] = None
    prestretch: Annotated[
        float | None, Number(above=0.0), Field(description="length as placed, divided by the rest length")
    ] = None
    breaks_at: Annotated[float | None, Number(above=0.0), Field(description="strain (l − L)/L at which a spring breaks")] = None
    yields_at: Annotated[
        float | None,
        Number(above=0.0),
        Field(description="elastic strain, of a longer or a shorter spring, beyond which the rest length follows"),
    ] = None
    color: Annotated[tuple[float, float, float] | None, _COLOR, Field(description="red, green, blue in 0…1")] = None


@dataclass(frozen=True)
class ModesSpec:
    """Modes of the spring network that are followed: modes of a lattice, [r, s], or of the whole network, [k] from below."""

    __pydantic_config__ = _CLOSED
    of: Annotated[str | None, Text(), Field(description="a lattice; absent: the scene's only one, or the whole network")] = None
    show: Annotated[
        tuple[tuple[int, int, int], ...],
        ListOf(Counts(), tuple(range(1, 13)), "modes"),
        Field(description="mode numbers, for example [[1, 1], [2, 1]]; absent: the four lowest modes"),
    ] = ()
    along: Annotated[
        str | None, Text(("x", "y", "z")), Field(description="direction of the motion; absent: across the lattice")
    ] = None
    after: Annotated[float, Number(minimum=0.0), Field(description="time of the first sample [time]")] = 0.0


@dataclass(frozen=True)
class PairSpec:
    """The restitution of contacts between two particles or groups, where it differs from the common one."""

    __pydantic_config__ = _CLOSED
    between: Annotated[tuple[Any, Any], ListOf(Reference(), (2,), "particles or groups"), Field(description="the two")]
    restitution: Annotated[
        float, Number(minimum=0.0, maximum=1.0), Field(description="restitution e of a contact between the two")
    ]


@dataclass(frozen=True, eq=False)
class ContactsSpec:
    """Collisions of hard spheres: the solver with its parameters, exceptions for pairs, and the rule for overlaps at the start.

    `pairs` hold (first index, count) of the two groups in place of references once the scene is loaded.
    """

    solver: ComponentSpec
    pairs: tuple[PairSpec, ...]
    overlap: str  # "refuse" or "separate"


@dataclass(frozen=True, eq=False)
class PanelSpec:
    """One panel: curves of `y` over `x`, or the histogram of a quantity that every particle has.

    `theory` holds formulas over t and x, or of a histogram the name of a distribution, or its density.
    """

    title: str
    x: ComponentSpec
    y: tuple[ComponentSpec, ...]
    histogram: ComponentSpec | None
    bins: int
    after: float | None
    theory: tuple[Formula, ...] | str | None
    logarithmic: bool
    location: Location


@dataclass(frozen=True)
class SliderTarget:
    """A number that a slider moves: a parameter of an entry of `kind` (forces, springs, integrator), or one axis of a vector.

    A force is found by its name, which occurs once, an entry of springs by its number.
    """

    kind: str
    entry: str | int
    parameter: str
    axis: int | None


@dataclass(frozen=True, eq=False)
class SliderSpec:
    """A parameter that may change between `low` and `high` while the scene runs; `steps` are its path in the scene's tree.

    A parameter of a spring type belongs to several entries, all of them `targets`. `keys` are two letters that move it to its
    ends while they are held, or none.
    """

    path: str
    steps: tuple[Any, ...]
    targets: tuple[SliderTarget, ...]
    low: float
    high: float
    logarithmic: bool
    label: str
    location: Location
    keys: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Expectation:
    """A statement of physics that `check` asserts: `quantity` bounded by `below`/`above`, or `near ± within`.

    Bounds are numbers by precision; `parameters` are the diagnostic's own (say `of:` and `around:`).
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
class Event:
    """An event of the timeline: its time, its changes as plain data, and the scene after it, which has no timeline itself."""

    at: float
    changes: dict[str, Any]
    scene: "SceneSpec"
    location: Location
    live: bool = False  # only parameters of sliders change, so that nothing is compiled


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
    contacts: ContactsSpec | None
    walls: tuple[ComponentSpec, ...]
    integrator: ComponentSpec
    move_to_center_of_mass: bool
    run: RunSpec
    view: ViewSpec
    record: RecordSpec
    expect: tuple[Expectation, ...]
    modes: ModesSpec | None
    inspect: tuple[PanelSpec, ...]
    resolved: dict[str, Any]  # plain YAML-able mapping, itself a scene: extends and overrides applied, expressions kept
    timeline: tuple[Event, ...] = ()  # this scene itself is the first phase
    sliders: tuple[SliderSpec, ...] = ()
    horizon: bool | None = None  # None: only where `accuracy` chooses the method
    accuracy: TargetSpec | None = None  # until a method is chosen, the integrator is the first candidate
    sweep: Any = None  # SweepSpec, of a scene with `sweep:`
    leaves_interval_open: bool = False  # the time between samples is not the scene's own, see `load_scene`

    @property
    def damping_is_live(self) -> bool:
        """Whether a slider may give damping to springs without damping."""
        return any(slider.steps[-1] == "damping" for slider in self.sliders)

    @cached_property
    def driven_entries(self) -> list[tuple[int, ComponentSpec]]:
        """Number and entry of each entry of `particles:` whose body moves on a given path."""
        takers = {name for name in {each.name for each in self.particles} if component.flag("generators", name, "takes_path")}
        return [
            (k, each) for k, each in enumerate(self.particles) if each.name in takers and each.parameters["path"] is not None
        ]

    @cached_property
    def changing_entries(self) -> list[tuple[int, ComponentSpec, str]]:
        """Number and entry of each body whose mass or charge is a given function of the time, with "mass" or "charge"."""
        takers = {name for name in {each.name for each in self.particles} if component.flag("generators", name, "takes_path")}
        return [
            (k, each, quantity)
            for k, each in enumerate(self.particles)
            if each.name in takers
            for quantity in ("mass", "charge")
            if each.parameters[f"{quantity}_factor"] is not None
        ]

    @property
    def rigid_entries(self) -> list[tuple[int, ComponentSpec]]:
        """Number and entry of each entry of `springs:` that makes rods in place of springs."""
        rigid = {name for name in {entry.name for entry in self.springs} if component.flag("networks", name, "is_rigid")}
        return [(k, entry) for k, entry in enumerate(self.springs) if entry.name in rigid] if rigid else []

    @property
    def limited_springs(self) -> list[ComponentSpec]:
        """The entries of `springs:` whose springs break or yield."""
        return [entry for entry in self.springs if entry.has_limits]

    @property
    def rods_named(self) -> str:
        """The name of the entries that make rods, in the plural, for messages."""
        return " and ".join(dict.fromkeys(f"{entry.name}s" for _, entry in self.rigid_entries))

    def forces_with(self, key: str) -> list[ComponentSpec]:
        """The forces whose flag `key` is true, in the order of the scene."""
        return [force for force in self.forces if force.flag("forces", key)]

    @property
    def bonds(self) -> list[ComponentSpec]:
        """The forces along springs whose potential is a formula."""
        return [force for force in self.forces if component.declaration("forces", force.name).base == "FormulaBond"]

    @property
    def gravity(self) -> float:
        """The strength G of the scene's gravity; 0 without gravity."""
        return sum((float(force.parameters["strength"]) for force in self.forces_with("gravitates")), 0.0)

    @property
    def thermal_walls(self) -> tuple[ComponentSpec, ...]:
        """The walls that give the spheres that meet them velocities of their temperature."""
        return tuple(wall for wall in self.walls if wall.parameters.get("temperature") is not None)

    def effects(self, spring_count: int) -> list[str]:
        """The names of all effects: forces, springs where the scene has some, a bath of heat, contacts and walls."""
        names = [entry.label for entry in self.forces] + (component.marked("forces", "acts_on_springs") if spring_count else [])
        names += list(dict.fromkeys(entry.name for _, entry in self.rigid_entries))
        names += [self.integrator.name] if self.integrator.flag("integrators", "draws_random") else []
        contacts = ["hard_spheres"] if self.contacts is not None else []
        return names + contacts + list(dict.fromkeys(wall.name for wall in self.walls))
