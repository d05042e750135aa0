"""Particle lists of MPPhys: one command a line (T. Müller, arXiv:1403.1695, §2.1 and appendix A)."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mpp_taichi.errors import SceneError
from mpp_taichi.importers._title import title_of
from mpp_taichi.importers._words import Word, words

SUFFIXES = (".plist",)
STEP = 0.01  # of a list without dt
MOST = 1_000_000  # particles, types of springs


def recognises(text: str) -> bool:
    """Whether the first command of the text is one of MPPhys."""
    return any(line[0].text in COMMANDS for line in words(text, "", comments=("#", "//")))


def read(text: str, source: str) -> dict[str, Any]:
    """The scene. Positions are at rest, and `dis` displaces from them; friction takes the whole relative velocity, as there.

    SceneError with line and column where the text is no particle list.
    """
    found = _List()
    line: list[Word] = []
    for line in words(text, source, comments=("#", "//")):
        command = line[0]
        if command.text not in COMMANDS:
            raise command.fault(f"{command.shown} is no command, allowed: {', '.join(COMMANDS)}")
        take, arguments = COMMANDS[command.text]
        if len(line) - 1 != len(arguments):
            many = "too many" if len(line) - 1 > len(arguments) else "too few"
            raise command.fault(f"{command.text} has {many} values, {len(line) - 1}; it takes {' '.join(arguments)}")
        take(found, line[1:])
    if not found.bodies:
        raise SceneError(f"{line[0].location if line else source}: the list has no particle: no line begins with pos")
    return found.scene(title_of(source))


@dataclass
class _List:
    """The content read so far."""

    bodies: list[dict[str, Any]] = field(default_factory=list)
    types: dict[int, dict[str, Any]] = field(default_factory=dict)
    links: list[dict[str, Any]] = field(default_factory=list)
    gravity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    damping: float = 0.0
    strength: float | None = None
    dt: float = STEP

    def body(self, word: Word) -> dict[str, Any]:
        """A body that was placed before."""
        if not self.bodies:
            raise word.fault("no particle was placed before: pos comes first")
        return self.bodies[word.whole("a particle's number", 0, len(self.bodies) - 1)]

    def scene(self, title: str) -> dict[str, Any]:
        """The whole list as a scene."""
        forces: list[dict[str, Any]] = []
        if self.strength is not None:
            forces.append({"newtonian_gravity": {"strength": self.strength}})
        if any(self.gravity):
            forces.append({"uniform_gravity": {"acceleration": self.gravity}})
        if self.damping:
            forces.append({"linear_drag": {"coefficient": self.damping}})
        made: dict[str, Any] = {"title": title, "particles": [{"body": body} for body in self.bodies]}
        if self.links:
            made |= {"springs": [{"link": link} for link in self.links], "spring_damping": "full"}
        return made | {"forces": forces, "integrator": {"leapfrog": {"dt": self.dt}}}


def _numbers(values: list[Word], names: str) -> list[float]:
    return [word.number(name) for word, name in zip(values, names.split(), strict=True)]


def _check_color(word: Word, color: list[float]) -> None:
    if not all(0.0 <= each <= 1.0 for each in color):
        raise word.fault("a colour is three numbers from 0 to 1")


def _pos(found: _List, values: list[Word]) -> None:
    number = values[0].whole("a particle's number", 0, MOST)
    if number != len(found.bodies):
        raise values[0].fault(f"particles are numbered from 0 on: {len(found.bodies)} comes next, not {number}")
    x, y, z, mass, charge, radius, *color = _numbers(values[1:], "x y z m c r R G B")
    _check_color(values[7], color)
    for name, value, word in (("m", mass, values[4]), ("r", radius, values[6])):
        if value < 0.0:
            raise word.fault(f"{name} must be at least 0, not {value:g}")
    found.bodies.append({"mass": mass, "position": [x, y, z], "charge": charge, "radius": radius, "color": color})


def _vel(found: _List, values: list[Word]) -> None:
    found.body(values[0])["velocity"] = _numbers(values[1:], "vx vy vz")


def _dis(found: _List, values: list[Word]) -> None:
    found.body(values[0])["displacement"] = _numbers(values[1:], "dx dy dz")


def _vfix(found: _List, values: list[Word]) -> None:
    found.body(values[0])["free"] = [bool(word.whole("0 (fixed) or 1 (free)", 0, 1)) for word in values[1:]]


def _s(found: _List, values: list[Word]) -> None:
    stiffness, damping, *color = _numbers(values[1:], "D c R G B")
    for word, value in zip(values[1:3], (stiffness, damping)):
        if value < 0.0:
            raise word.fault(f"must be at least 0, not {value:g}")
    _check_color(values[3], color)
    kind = {"stiffness": stiffness, "damping": damping, "color": color}
    found.types[values[0].whole("the number of a type of springs", 0, MOST)] = kind


def _sl(found: _List, values: list[Word]) -> None:
    for word in values[:2]:
        found.body(word)
    ends = [int(word.text) for word in values[:2]]
    if ends[0] == ends[1]:
        raise values[1].fault(f"a spring needs two different ends, not {ends[0]} twice")
    kind = values[2].whole("the number of a type of springs", 0, MOST)
    if kind not in found.types:
        raise values[2].fault(f"no type of springs has the number {kind}: s comes before sl")
    found.links.append({"between": ends, **found.types[kind]})


def _grav(found: _List, values: list[Word]) -> None:
    found.gravity = _numbers(values, "gx gy gz")


def _positive(name: str) -> Callable[[_List, list[Word]], None]:
    def take(found: _List, values: list[Word]) -> None:
        value = values[0].number(name)
        if value < 0.0 or (name == "dt" and value == 0.0):
            raise values[0].fault(f"{name} must be {'above' if name == 'dt' else 'at least'} 0, not {value:g}")
        setattr(found, {"k2": "strength", "damp": "damping", "dt": "dt"}[name], value)

    return take


COMMANDS: dict[str, tuple[Callable[[_List, list[Word]], None], list[str]]] = {
    "pos": (_pos, "ID x y z m c r R G B".split()),
    "vel": (_vel, "ID vx vy vz".split()),
    "vfix": (_vfix, "ID fx fy fz".split()),
    "dis": (_dis, "ID dx dy dz".split()),
    "s": (_s, "ID D c R G B".split()),
    "sl": (_sl, "i j ID".split()),
    "grav": (_grav, "gx gy gz".split()),
    "damp": (_positive("damp"), ["c"]),
    "k2": (_positive("k2"), ["value"]),
    "dt": (_positive("dt"), ["value"]),
}
