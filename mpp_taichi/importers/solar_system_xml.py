"""SolarSystem.xml: `<SolarSystem TimeStep="…">` with a `<Body …/>` for each body, in SI units (A. Roman, compphys.go.ro)."""

import math
from typing import Any
from xml.parsers import expat

from mpp_taichi.errors import SceneError
from mpp_taichi.importers._pictures import Pictures
from mpp_taichi.importers._title import title_of
from mpp_taichi.importers._words import Word
from mpp_taichi.scene.location import Location
from mpp_taichi.wording.told_apart import told_apart

SUFFIXES = (".xml",)
ENCODINGS = ("utf-8-sig", "latin-1")
G = 6.67408e-11  # the value of that program [m³ / (kg s²)]
STEP = 60.0  # of a file without a time step [s]
DAY = 86400.0
YEAR = 365.25 * DAY
MAPS = {
    "skin": "texture",
    "shadowSkin": "night",
    "transparentSkin": "clouds",
    "normalSkin": "normal",
    "specularSkin": "specular",
}
"""Attributes that name pictures, and the keys of a body's appearance for them."""


def recognises(text: str) -> bool:
    """Whether the text has the root element."""
    return "<SolarSystem" in text


def read(text: str, source: str) -> dict[str, Any]:
    """The scene: gravity, by velocity Verlet; scales, spins, the light, and pictures beside the file are for `view:`.

    Pictures that are missing are left out, and a line tells which. A position or velocity that is not
    given is 0, a colour 255. A moon is drawn around the last body before it that is no moon. Axes are tilted towards +y, as the
    Earth's axis is where x is the direction of the equinox. SceneError with line and column where the text is no such file.
    """
    reader = _SystemReader(source)
    try:
        reader.parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        raise SceneError(f"{source}:{error.lineno}:{error.offset + 1}: {expat.ErrorString(error.code)}") from None
    if not reader.bodies:
        raise SceneError(f"{source}: has no <Body>")
    reader.pictures.tell()
    far = max(math.hypot(*body["position"]) for body in reader.bodies) or 1.0
    return {
        "title": title_of(source),
        "particles": [{"body": body} for body in reader.bodies],
        "forces": [{"newtonian_gravity": {"strength": G}}],
        "integrator": {"velocity_verlet": {"dt": reader.dt}},
        "run": {"duration": YEAR},
        "view": {
            "camera": {"position": [0.0, -1.5 * far, 1.5 * far], "look_at": [0.0, 0.0, 0.0], "up": [0.0, 0.0, 1.0]},
            **({"bodies": reader.drawn} if reader.drawn else {}),
        },
    }


class _SystemReader:
    """Reads the elements one after the other."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.bodies: list[dict[str, Any]] = []
        self.names: set[str] = set()
        self.drawn: dict[str, dict[str, Any]] = {}
        self.pictures = Pictures(source)
        self.planet = ""  # the last body that is no moon
        self.dt = STEP
        self.depth = 0
        self.parser = expat.ParserCreate("utf-8")  # the text is decoded already, whatever its first line says
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._refuse_types

    def _word(self, text: str) -> Word:
        return Word(text, Location(self.source, self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1))

    def _refuse_types(self, *_: object) -> None:
        raise self._word("").fault("a declaration of a document type is not read")

    def _start(self, name: str, given: dict[str, str]) -> None:
        expected = ("SolarSystem", "Body")[min(self.depth, 1)]
        if name != expected or self.depth > 1:
            raise self._word(name).fault(f"<{name}> stands where only <{expected}> may")
        self.depth += 1
        if name == "SolarSystem":
            self.dt = self._number(given, "TimeStep", STEP, above=0.0)
        else:
            self._add(given)

    def _end(self, _: str) -> None:
        self.depth -= 1

    def _number(
        self,
        given: dict[str, str],
        key: str,
        default: float | None = None,
        *,
        least: float = -math.inf,
        above: float = -math.inf,
    ) -> float:
        if key not in given:
            if default is None:
                raise self._word("").fault(f"the body has no {key}")
            return default
        value = self._word(given[key]).number(key, least)
        if not value > above:
            bound, said = told_apart(above, value)
            raise self._word("").fault(f"{key} must be above {bound}, not {said}")
        return value

    def _add(self, given: dict[str, str]) -> None:
        name = given.get("Name", "")
        if name in self.names:
            raise self._word("").fault(f"two bodies are called {name!r}")
        self.names |= {name} if name else set()
        color = [self._number(given, key, 255.0) / 255.0 for key in "RGB"]
        if not all(0.0 <= each <= 1.0 for each in color):
            raise self._word("").fault("R, G and B go from 0 to 255")
        self.bodies.append(
            {
                "name": name,
                "mass": self._number(given, "Mass", least=0.0),
                "position": [self._number(given, f"{axis}Position", 0.0) for axis in "XYZ"],
                "velocity": [self._number(given, f"{axis}Velocity", 0.0) for axis in "XYZ"],
                "radius": self._number(given, "Radius", 0.0, least=0.0),
                "color": color,
            }
        )
        if name:
            self._draw(name, given)

    def _draw(self, name: str, given: dict[str, str]) -> None:
        """Keep the attributes of a body that concern its picture."""
        drawn: dict[str, Any] = {}
        if (scale := self._number(given, "Scale", 1.0, above=0.0)) != 1.0:
            drawn["radius_scale"] = scale
        if _says_yes(given, "IsSun"):
            drawn["light"] = True
        moon = _says_yes(given, "IsMoon")
        if moon and self.planet and (scale := self._number(given, "ScaleDistance", 1.0, above=0.0)) != 1.0:
            drawn |= {"around": self.planet, "distance_scale": scale}
        if period := self._number(given, "RotationPeriod", 0.0):
            tilt = math.radians(self._number(given, "Tilt", 0.0))
            drawn["spin"] = {"period": DAY * period, "axis": [0.0, math.sin(tilt), math.cos(tilt)]}
        elif self._number(given, "Tilt", 0.0):
            self.pictures.leave_out(f"Tilt of {name}", "the body has no RotationPeriod")
        drawn |= self._surface(name, given, shines="light" in drawn)
        if not moon:
            self.planet = name
        if drawn:
            self.drawn[name] = drawn

    def _surface(self, name: str, given: dict[str, str], *, shines: bool) -> dict[str, Any]:
        """The maps of a body whose pictures are there."""
        found: dict[str, Any] = {}
        for attribute, key in MAPS.items():
            if not given.get(attribute):
                continue
            what = f"{attribute} of {name}"
            if shines and key != "texture":
                self.pictures.leave_out(what, "a body that shines has a texture only")
            elif (file := self.pictures.find(given[attribute], what)) is not None:
                found[key] = {"file": file}
        strength = self._number(given, "bumpParam", 1.0)
        if "normal" in found and strength != 1.0:
            found["normal"]["strength"] = strength
        return found


def _says_yes(given: dict[str, str], key: str) -> bool:
    return given.get(key, "").strip().lower() in ("yes", "true", "1")
