"""Scenes that must be refused: one line with the place in the file and the word that is wrong, before anything runs."""

import math
import re
import tempfile
from functools import partial
from pathlib import Path

from mpp_taichi.errors import MppError, StabilityError
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.verify.case import Case, Found, case
from mpp_taichi.verify.cases._published import bodies, gravity, row
from mpp_taichi.verify.place import Place

SCENE = """\
title: Two bodies
particles:
  - body: {name: sun, mass: 1.0, position: [0, 0, 0], radius: 0.1}
  - body: {name: earth, mass: 1e-3, position: [1, 0, 0], velocity: [0, 1, 0], radius: 0.1}
forces: [newtonian_gravity]
integrator: {leapfrog: {dt: 0.01}}
run: {duration: 1}
"""
CONTRACT = "the rule of this program that bad input gets a line with file, line and column"

FAULTS = {
    "negative_mass": ("mass: 1e-3", "mass: -1e-3", 4, "at least 0"),
    "negative_radius": ("radius: 0.1}\nforces", "radius: -0.1}\nforces", 4, "at least 0"),
    "place_that_is_no_number": ("[1, 0, 0]", "[1, .nan, 0]", 4, "nan"),
    "place_without_end": ("[1, 0, 0]", "[1, 1/0, 0]", 4, "zero"),
    "two_bodies_in_a_place": ("[1, 0, 0]", "[0, 0, 0]", 4, "is where particle 0"),
    "step_of_zero": ("dt: 0.01", "dt: 0", 6, "above 0"),
    "step_backwards": ("dt: 0.01", "dt: -0.01", 6, "above 0"),
    "unknown_integrator": ("leapfrog", "leapfrgo", 6, "leapfrog"),
    "unknown_force": ("newtonian_gravity", "newtonian_gravty", 5, "newtonian_gravity"),
    "unknown_key": ("duration", "durration", 7, "duration"),
    "key_twice": ("run:", "title: Again\nrun:", 7, "twice"),
    "too_few_coordinates": ("[1, 0, 0]", "[1, 0]", 4, "3 numbers"),
    "open_brace": ("dt: 0.01}}", "dt: 0.01}", 7, "line 6, column 13 is not closed"),
    "restitution_above_one": ("run:", "contacts: {hard_spheres: {solver: swept, restitution: 1.5}}\nrun:", 7, "at most 1"),
}
"""What is replaced in the scene, by what, the line that must be named, and a word of the answer."""


def _refusal(name: str, place: Place) -> Found:
    old, new, line, word = FAULTS[name]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.yaml"
        file.write_text(SCENE.replace(old, new, 1), encoding="utf-8")
        try:
            Simulation(file, backend=place.backend, precision=place.precision).close()
            told = "the scene was taken"
        except MppError as error:
            told = str(error).replace(str(file), "scene.yaml")
    right = re.match(rf"scene\.yaml:{line}:\d+: ", told) and word in told and "\n" not in told.strip()
    return Found(
        0.0 if right else 1.0, 0.0, f"1 for an answer without line {line} or without the word '{word}'; it was: {told}"
    )


def _row(name: str) -> Case:
    title = f"a scene with a fault is refused in one line: {name.replace('_', ' ')}"
    return row(__name__, name, title, CONTRACT, partial(_refusal, name), quick=name in ("negative_mass", "unknown_key"))


rows = [_row(name) for name in FAULTS]


@case("a step beyond what a spring allows is refused, with a step that holds", "stability limit dt ω < 2", quick=True)
def step_beyond_the_spring(place: Place) -> Found:
    """ω = √(D (1/m + 1/m)) = 20, so that leapfrog holds below dt = 0.1."""
    pair = bodies([1.0, 1.0], [[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]])
    scene = gravity(pair, {"leapfrog": {"dt": 0.11}}) | {"forces": []}
    scene["springs"] = [{"link": {"between": [0, 1], "stiffness": 200.0, "rest_length": 0.5}}]
    told = place.refusal(scene, steps=1)
    named = [float(number) for number in re.findall(r"\b0\.\d+", told)]
    limit = 2.0 / math.sqrt(400.0)
    holds = any(0.9 * limit <= each <= limit for each in named)
    return Found(0.0 if holds else 1.0, 0.0, f"1 where no step from 0.9 to 1 of the limit {limit:g} is named; it was: {told}")


@case(
    "a number that is no longer finite is traced to its step and its particle", "two bodies that meet at one point", quick=True
)
def first_bad_step(place: Place) -> Found:
    """Two bodies that meet exactly at the origin in the middle of step 5, so that their distance is 0."""
    pair = bodies([1.0, 1.0], [[-1.125, 0.0], [1.125, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    scene = gravity(pair, {"leapfrog": {"dt": 0.25}}, strength=1e-30)
    try:
        with place.simulation(scene) as simulation:
            simulation.run(steps=20)
        told = "the run ended without a word"
    except StabilityError as error:
        told = str(error)
    right = re.search(r"step 5\b", told) and re.search(r"particles? [01]", told)
    return Found(0.0 if right else 1.0, 0.0, f"1 for an answer without step 5 or without a particle; it was: {told}")
