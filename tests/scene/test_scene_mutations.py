"""Every broken scene ends in a SceneError or CapacityError with its place, in a short time and little memory."""

import json
import os
import re
import subprocess
import sys
import textwrap
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpp_taichi.errors import CapacityError, MppError, SceneError
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.start.assemble import assemble

GOOD = """\
title: Test
units: {length: AU, time: day, mass: Msun}
constants: {k2: 2.9584e-4, half: k2 / 2}
seed: 3
particles:
  - body: {name: sun, mass: 1.0, position: [0, 0, 0], radius: 0.1, color: [1, 1, 0], free: true}
  - body: {name: earth, mass: 3e-6, position: [1, 0, 0], velocity: [0, sqrt(k2), 0]}
  - lattice: {name: net, shape: [3, 2], lower: [2, 0, 0], upper: [3, 1, 0], displacement: [0, 0, 0.1 * u]}
  - ring: {count: 20, around: sun, inner_radius: 4, outer_radius: 5, mass: 1e-9}
springs:
  - link: {between: [sun, 1], stiffness: 50.0, damping: 0.003}
  - lattice_links: {of: net, stiffness: 5}
forces:
  - newtonian_gravity: {strength: k2, softening: 0.0}
  - linear_drag: {coefficient: 0.1}
integrator: {leapfrog: {dt: 0.03}}
run: {duration: 30}
view: {camera: {position: [0, 0, 9], projection: perspective}, trails: 10}
record: {size: [640, 480], fps: 30}
expect: {relative_energy_error_max: {below: {f64: 1e-6, f32: 1e-4}}}
"""


def change(old: str, new: str) -> str:
    assert old in GOOD, old
    return GOOD.replace(old, new, 1)


def run_whole(path) -> SceneSpec:
    spec = load_scene(path)
    check_capacity(estimate(spec))
    assemble(spec)
    return spec


def test_the_unbroken_scene_is_accepted(tmp_path):
    path = tmp_path / "good.yaml"
    path.write_text(GOOD)
    assert run_whole(path).constants["half"] == pytest.approx(1.4792e-4)


HEAVY_RING = "count: 999, around: sun, inner_radius: 4, outer_radius: 5, mass: 1, velocity: with_ring"
# (what is replaced, by what, what the message must say)
CHANGES = [
    ("mass: 1.0", "mass: .nan", "not a finite number"),
    ("mass: 1.0", "mass: .inf", "not a finite number"),
    ("mass: 1.0", "mass: -.inf", "not a finite number"),
    ("mass: 1.0", "mass: 1e400", "not a finite number"),
    ("mass: 3e-6", "mass: -3e-6", "-3e-06 is not allowed, must be at least 0"),
    ("mass: 1.0", "mass: true", "true is not a number"),
    ("mass: 1.0", "mass: yes", "unknown name 'yes'"),
    ("mass: 1.0", "mass: ~", "nothing is not a number"),
    ("mass: 1.0", "mass: [1]", "a list of 1 is not a number"),
    ("mass: 1.0", "mass: {a: 1}", "a mapping is not a number"),
    ("mass: 1.0", "mass: heavy", "unknown name 'heavy'"),
    ("mass: 1.0", "mass: 010", "begins with a zero"),
    ("mass: 1.0", "mass: 1:30", "not a number here"),
    ("mass: 1.0", "mass: 2020-01-01", "is a date and no number"),
    ("mass: 1.0", "mass: " + "9" * 5000, "5000 digits"),
    ("mass: 1.0", "mass: 1/0", "division by zero"),
    ("mass: 1.0", "mass: 9**9**9", "too large"),
    ("mass: 1.0", "mass: (-8)**(1/3)", "not a real number"),
    ("mass: 1.0", "mass: sqrt(-1)", "not a real number"),
    ("mass: 1.0", "mass: __import__('os')", "unknown function '__import__'"),
    ("mass: 1.0", "mass: k2.real", "only numbers, names"),
    ("mass: 1.0", "mass: k3", "did you mean 'k2'"),
    ("mass: 1.0", "mass: squrt(2)", "did you mean 'sqrt'"),
    ("mass: 1.0", "mass: 'sqrt(1, 2)'", "takes 1 number"),
    ("mass: 1.0", "mass: " + "(" * 300 + "1" + ")" * 300, "expression"),
    ("mass: 1.0", "mass: " + "+".join("1" * 400), "more than 300 parts"),
    ("mass: 1.0", "mass: " + "1+" * 600 + "1", "too long"),
    ("mass: 1.0, ", "", "missing key 'mass'"),
    ("mass: 1.0", "mas: 1.0", "did you mean 'mass'"),
    ("mass: 1.0", "mass: 1.0, mass: 2.0", "here twice, first at"),
    ("mass: 1.0", "<<: {}", "merge keys"),
    ("mass: 1.0", "mass: !!float 1", "tag"),
    ("mass: 1.0", "mass: !!python/object/apply:os.system ['touch PWNED']", "tag"),
    ("mass: 1.0", "mass: !include other.yaml", "tag"),
    ("mass: 1.0", "mass: *nothing", "alias *nothing"),
    ("mass: 1.0", "mass: 1.0, ? [1, 2] : 3", "a key must be a word"),
    ("radius: 0.1", "radius: -0.1", "must be at least 0"),
    ("radius: 0.1", "radius: 1e301", "not a finite number up to"),
    ("position: [1, 0, 0]", "position: [1, 0]", "must be a list of 3 numbers, not a list of 2"),
    ("position: [1, 0, 0]", "position: [1, 0, 0, 0]", "must be a list of 3 numbers, not a list of 4"),
    ("position: [1, 0, 0]", "position: 1", "must be a list of 3 numbers, not 1"),
    ("position: [1, 0, 0]", "position: [1, .nan, 0]", "position[1]"),
    ("position: [1, 0, 0]", "position: [1e200, 0, 0]", "beyond 1e+100"),
    ("position: [1, 0, 0]", "position: [0, 0, 0]", "must be elsewhere"),
    ("color: [1, 1, 0]", "color: [1, 2, 0]", "must be at least 0 and at most 1"),
    ("color: [1, 1, 0]", "color: rad", "did you mean 'red'?"),
    ("free: true", "free: 1", "must be a list of 3 of true and false"),
    ("free: true", "free: [true, 1, false]", "must be true or false, not 1"),
    ("mass: 3e-6", "mass: 0", "has no mass but a spring"),
    ("name: earth", "name: sun", "is the name of particles[0] already"),
    ("name: earth", "name: 'a[0]'", "cannot be a name"),
    ("name: earth", "name: 7", "must be text, not 7"),
    ("- body: {name: sun", "- bdy: {name: sun", "did you mean 'body'"),
    ("- body: {name: sun", "- {body: {}, ring: {}}\n  - body: {name: sun", "must be one entry"),
    ("- body: {name: sun", "- body\n  - body: {name: sun", "missing key 'mass'"),
    ("- body: {name: sun", "- body:\n  - body: {name: sun", "missing key 'mass'"),
    ("- body: {name: sun", "- body: [1]\n  - body: {name: sun", "must be a mapping"),
    ("shape: [3, 2]", "shape: [3, 0]", "must be at least 1"),
    ("shape: [3, 2]", "shape: [3, 2.5]", "not a whole number"),
    ("shape: [3, 2]", "shape: [100000, 100000]", "10000000022 particles"),
    ("shape: [3, 2]", "shape: []", "must be a list of 1 or 2 or 3 counts"),
    ("upper: [3, 1, 0]", "upper: [2, 0, 0]", "must be elsewhere"),
    ("0.1 * u", "0.1 * q", "unknown name 'q'"),
    ("0.1 * u", "1 / (u - u)", "not a real number"),
    ("0.1 * u", "log(u)", "not a real number"),
    ("count: 20", "count: 1000000000000", "1000000000008 particles, allowed: 2147483647"),
    ("count: 20", "count: 1e12", "particles, allowed: 2147483647"),
    ("count: 20", "count: 1e300", "particles, allowed: 2147483647"),
    ("count: 20", "count: 2000000000", "GiB"),
    ("count: 20", "count: 0", "must be at least 1"),
    ("count: 20", "count: -3", "must be at least 1"),
    ("around: sun", "around: moon", "no particle is called 'moon', allowed: earth, net, sun"),
    ("around: sun", "around: 1e9", "must be a particle's index or name"),
    ("around: sun", "around: 999", "there is no particle 999"),
    ("around: sun", "around: 11", "must come before"),
    ("inner_radius: 4", "inner_radius: 6", "must be below outer_radius"),
    ("inner_radius: 4", "inner_radius: 0", "must be above 0"),
    ("mass: 1e-9}", "mass: 1e-9, velocity: fast}", "allowed: central, rest, with_ring"),
    ("count: 20, around: sun, inner_radius: 4, outer_radius: 5, mass: 1e-9", HEAVY_RING, "no circular orbit"),
    ("between: [sun, 1]", "between: [sun, 0]", "must be two different particles"),
    ("between: [sun, 1]", "between: [sun, 28]", "there is no particle 28, allowed: 0 to 27"),
    ("between: [sun, 1]", "between: [sun, -1]", "there is no particle -1"),
    ("between: [sun, 1]", "between: [sun, 1.5]", "must be a particle's index or name"),
    ("between: [sun, 1]", "between: [sun]", "must be a list of 2 particles"),
    ("between: [sun, 1]", "between: [sun, eart]", "did you mean 'earth'"),
    ("between: [sun, 1]", "between: [sun, 'net[6]']", "allowed: net[0] to net[5]"),
    ("between: [sun, 1]", "between: [sun, net]", "allowed: net[0] to net[5]"),
    ("between: [sun, 1]", "between: [sun, 99999999999999999999999999]", "there is no particle"),
    ("stiffness: 50.0", "stiffness: -50.0", "must be at least 0"),
    ("damping: 0.003", "damping: 0.003, rest_length: -1", "must be at least 0"),
    ("of: net", "of: nett", "did you mean 'net'"),
    ("of: net", "of: net, neighbors: diagonals", "did you mean 'diagonal'"),
    ("of: net", "of: net, type: steel", "unknown spring type 'steel', none is allowed here"),
    ("stiffness: 50.0", "type: 5", "must be text, not 5"),
    ("stiffness: 50.0, ", "", "missing key 'stiffness'"),
    ("seed: 3", "seed: 3\nspring_types: {steel: {stiffness: .nan}}", "not a finite number"),
    ("seed: 3", "seed: 3\nspring_types: [steel]", "must be a mapping"),
    ("shape: [3, 2]", "shape: [3, 2], fixed: rims", "did you mean 'rim'"),
    ("shape: [3, 2]", "shape: [3, 2], scatter: [0, -1, 0]", "must be at least 0"),
    ("shape: [3, 2]", "shape: [3, 2], velocity: [0, 0, 1 / u]", "velocity: '1 / u': not a real number here"),
    ("of: net", "of: sun", "no lattice is called 'sun'"),
    ("stiffness: 5}", "stiffness: 5, prestretch: 0}", "must be above 0"),
    ("- newtonian_gravity", "- newtonian_gravty", "did you mean 'newtonian_gravity'"),
    ("- newtonian_gravity", "- spring: {}\n  - newtonian_gravity", "list them under springs:"),
    ("- newtonian_gravity", "- newtonian_gravity: {}\n  - newtonian_gravity", "in the list already"),
    ("- newtonian_gravity", "- ../forces/coulomb: {}\n  - newtonian_gravity", "unknown force"),
    ("- newtonian_gravity", "- _base: {}\n  - newtonian_gravity", "unknown force"),
    ("softening: 0.0", "softening: -1", "must be at least 0"),
    ("integrator: {leapfrog: {dt: 0.03}}\n", "", "missing key 'integrator'"),
    ("integrator: {leapfrog: {dt: 0.03}}", "integrator: leapfrog", "missing key 'dt'"),
    ("integrator: {leapfrog: {dt: 0.03}}", "integrator: {}", "must be one entry"),
    ("integrator: {leapfrog: {dt: 0.03}}", "integrator: {leapfrog: {}}", "missing key 'dt'"),
    ("leapfrog: {dt: 0.03}", "leapfrg: {dt: 0.03}", "did you mean 'leapfrog'"),
    ("dt: 0.03", "dt: 0", "must be above 0"),
    ("dt: 0.03", "dt: -0.03", "must be above 0"),
    ("dt: 0.03", "dt: 31", "longer than the run"),
    ("dt: 0.03", "dt: 1e-12", "steps, allowed: 1000000000"),
    ("dt: 0.03", "dt: 1e-299", "steps, allowed: 1000000000"),
    ("dt: 0.03", "dt: .nan", "not a finite number"),
    ("dt: 0.03", "dt: '0.03 s'", "neither a number nor an expression"),
    ("duration: 30", "duration: -1", "must be above 0"),
    ("duration: 30", "duration: 30, steps: 5", "has both duration and steps"),
    ("duration: 30", "steps: 2.5", "not a whole number"),
    ("duration: 30", "steps: true", "true is not a number"),
    ("duration: 30", "steps: 1e12", "steps, allowed"),
    ("duration: 30", "durration: 30", "did you mean 'duration'"),
    ("run: {duration: 30}", "run: 30", "must be a mapping"),
    ("run: {duration: 30}", "run: [30]", "must be a mapping"),
    ("run: {duration: 30}", "contacts: {}", "missing key 'hard_spheres'"),
    ("run: {duration: 30}", "contacts: {hard_spheres: {}}", "missing key 'solver'"),
    ("run: {duration: 30}", "walls: [{sphere: {center: [0, 0, 0], radius: 9}}]", "the scene must have contacts"),
    ("run: {duration: 30}", "walls: [{bx: {}}]", "unknown wall 'bx', did you mean 'box'?"),
    ("run: {duration: 30}", "inspect: [{y: sped}]", "unknown quantity 'sped', did you mean 'speed'?"),
    ("run: {duration: 30}", "inspect: [{y: [speed, {positon: {}}]}]", "unknown quantity 'positon', did you mean 'position'?"),
    ("run: {duration: 30}", "inspect: [{y: {position: {of: moon, axis: z}}}]", "no particle is called 'moon'"),
    ("run: {duration: 30}", "inspect: [{y: {speed: {of: 'net[2:9]'}}}]", "allowed: net[0] to net[5]"),
    ("run: {duration: 30}", "inspect: [{y: {position: {of: 1, axis: w}}}]", "'w' is unknown, allowed: x, y, z"),
    ("run: {duration: 30}", "inspect: [{y: position}]", "missing key 'axis'"),
    ("run: {duration: 30}", "inspect: [{y: {speed: {}, time: {}}}]", "must be one entry"),
    ("run: {duration: 30}", "inspect: [{x: time}]", "a panel needs y"),
    ("run: {duration: 30}", "inspect: [{y: }]", "a panel needs y"),
    ("run: {duration: 30}", "inspect: [{y: speed, titel: a}]", "did you mean 'title'?"),
    ("run: {duration: 30}", "inspect: [{y: speed, bins: 9}]", "belongs to a histogram"),
    ("run: {duration: 30}", "inspect: [{y: speed, theory: 2 * z}]", "z"),
    ("run: {duration: 30}", "inspect: [{y: speed, theory: maxwell_boltzmann}]", "is the theory of a histogram"),
    ("run: {duration: 30}", "inspect: [{histogram: total_energy}]", "is one number, and has no distribution"),
    ("run: {duration: 30}", "inspect: [{histogram: speed, y: time}]", "cannot be in a panel with a histogram"),
    ("run: {duration: 30}", "inspect: [{histogram: spring_length, theory: maxwell_boltzmann}]", "not of spring_length"),
    ("run: {duration: 30}", "inspect: 3", "must be a list"),
    ("record: {size", "record: {panels: left, size", "'left' is unknown, allowed: bottom, none, right"),
    (
        "run: {duration: 30}",
        "accuracy: {}",
        "must be a number, {position: number}, {energy: number} or {of: quantity, below: number}",
    ),
    ("run: {duration: 30}", "accuracy: 1e-6", "needs run.duration"),
    ("run: {duration: 30}", "run: {duration: 30}\naccuracy: 0", "must be above 0"),
    (
        "run: {duration: 30}",
        "run: {duration: 30}\naccuracy: {mass: 1e-3}",
        "{position: number}, {energy: number} or {of: quantity, below: number}",
    ),
    ("run: {duration: 30}", "run: {duration: 30}\naccuracy: {energy: 1}", "at most 0.1"),
    (
        "run: {duration: 30}",
        "run: {duration: 30}\naccuracy: {of: sped, below: 1e-3}",
        "unknown quantity 'sped', did you mean 'speed'?",
    ),
    ("run: {duration: 30}", "run: {duration: 30}\naccuracy: {of: end_velocity, below: 1e-3}", "end_velocity needs of and axis"),
    ("run: {duration: 30}", "run: {duration: 30}\naccuracy: {of: steps, below: 1e-3}", "steps is the same for every method"),
    ("run: {duration: 30}", "run: {duration: 30}\naccuracy: {of: speed, below: 2}", "accuracy.below: 2 is not allowed"),
    ("run: {duration: 30}", "run: {duration: 30}\naccuracy: {of: [speed], below: 1e-3}", "accuracy.of: must be text"),
    (
        "run: {duration: 30}",
        "run: {duration: 30}\naccuracy: {of: {speed: {of: a}}, below: 1e-3}",
        "must be a name: write of: speed, and the parameters into expect:, as in expect: {speed: {…}}",
    ),
    ("run: {duration: 30}", "rnu: {duration: 30}", "did you mean 'run'"),
    ("trails: 10", "trails: -1", "must be at least 0"),
    ("projection: perspective", "projection: fisheye", "allowed: orthographic, perspective"),
    ("position: [0, 0, 9]", "position: [0, 0, 9], look_at: [0, 0, 9]", "must be different points"),
    ("position: [0, 0, 9]", "up: [0, 0, 0]", "must not be [0, 0, 0]"),
    ("view: {camera", "view: {camrea", "did you mean 'camera'"),
    ("size: [640, 480]", "size: [640, 1e9]", "at most 8192"),
    ("fps: 30", "fps: 0", "must be above 0"),
    ("relative_energy_error_max", "relativ_energy_error_max", "did you mean 'relative_energy_error_max'"),
    ("below: {f64: 1e-6, f32: 1e-4}", "below: {f64: 1e-6}", "{f64: number, f32: number}"),
    ("below: {f64: 1e-6, f32: 1e-4}", "", "says nothing"),
    ("below: {f64: 1e-6, f32: 1e-4}", "near: 1", "near and within belong together"),
    ("below: {f64: 1e-6, f32: 1e-4}", "near: 0, within: 1", "near must not be 0"),
    ("below: {f64: 1e-6, f32: 1e-4}", "bellow: 1", "did you mean 'below'"),
    ("length: AU", "length: au", "'au' is unknown, did you mean 'AU'?"),
    ("length: AU, ", "", "missing key 'length'"),
    ("k2: 2.9584e-4", "k2: k2 + 1", "depends on itself"),
    ("k2: 2.9584e-4", "k2: half", "depends on itself: "),
    ("k2: 2.9584e-4", "k2: other", "unknown name 'other'"),
    ("k2: 2.9584e-4", "k2: [1]", "must be a number or an expression"),
    ("k2: 2.9584e-4", "k2: 2.9584e-4, sqrt: 2", "means something already"),
    ("k2: 2.9584e-4", "k2: 2.9584e-4, G: 2", "means something already"),
    ("k2: 2.9584e-4", "k2: 2.9584e-4, u: 2", "both a constant and a value of each particle"),
    ("k2: 2.9584e-4", "k2: 2.9584e-4, a-b: 2", "cannot be a name"),
    ("constants: {k2: 2.9584e-4, half: k2 / 2}", "constants: 5", "must be a mapping"),
    ("seed: 3", "seed: -1", "must be at least 0"),
    ("seed: 3", "dimensions: 4", "at most 3"),
    ("seed: 3", "dimensions: 2.5", "not a whole number"),
    ("seed: 3", "dimensions: 2\nspring_damping: sideways", "allowed: axial, full"),
    ("seed: 3", "move_to_center_of_mass: 1", "must be true or false"),
    ("seed: 3", "extends: ../other.yaml", "outside the scene's folder"),
    ("seed: 3", "extends: /etc/passwd", "outside the scene's folder"),
    ("seed: 3", "extends: missing.yaml", "there is no file"),
    ("seed: 3", "extends: mutant.yaml", "leads back to itself"),
    ("seed: 3", "extends: 5", "must be the name of a scene file"),
    ("title: Test", "title: [1]", "must be text, not a list"),
    ("title: Test", "title: Test\ntitle: Again", "here twice"),
    ("title: Test", "\ttitle: Test", "not valid YAML"),
    ("title: Test", "title: 'Test", "not valid YAML"),
    ("title: Test", "title: a: b", "not valid YAML"),
    ("title: Test", "title: Test\n---\nmore: 1", "second document"),
    ("seed: 3", "seed: 3\x00", "U+0000"),
    ("seed: 3", "seed: 3 # \x1b[31m", "U+001B"),
    ("- body: {name: sun", "- file: {path: /etc/passwd}\n  - body: {name: sun", "outside the scene's folder"),
    ("- body: {name: sun", "- file: {path: ../x.npz}\n  - body: {name: sun", "outside the scene's folder"),
    ("- body: {name: sun", "- file: {path: missing.npz}\n  - body: {name: sun", "there is no file"),
    ("- body: {name: sun", "- file: {path: mutant.yaml}\n  - body: {name: sun", "must be a .npz or .csv file"),
    ("- body: {name: sun", '- file: {path: "a\\0b"}\n  - body: {name: sun', "there is no file"),
]
LOCATED = re.compile(r"^(/[^:\n]*mutant\.yaml):(\d+):(\d+): .+$")


@pytest.mark.parametrize("number", range(len(CHANGES)))
def test_mutation_is_refused_with_place_and_reason(number, tmp_path):
    old, new, expected = CHANGES[number]
    path = tmp_path / "mutant.yaml"
    path.write_text(change(old, new))
    began = time.process_time()
    with pytest.raises((SceneError, CapacityError)) as caught:
        run_whole(path)
    assert time.process_time() - began < 5.0
    assert expected in str(caught.value)
    assert not (tmp_path / "PWNED").exists()
    if isinstance(caught.value, SceneError):
        lines = path.read_text().split("\n")
        for fault in caught.value.faults:
            place = LOCATED.match(fault)
            assert place, fault
            assert 1 <= int(place[2]) <= len(lines) and 1 <= int(place[3]) <= len(lines[int(place[2]) - 1]) + 1


def test_there_are_at_least_a_hundred_mutations():
    assert len(CHANGES) >= 100


WHOLE_FILES = {
    "empty": (b"", "is empty"),
    "only a comment": (b"# nothing\n", "is empty"),
    "scalar": (b"hello\n", "not the text 'hello'"),
    "list": (b"- a\n", "not a list"),
    "null": (b"null\n", "not the text 'null'"),
    "latin-1": ("title: Müller\n".encode("latin-1"), "mutant.yaml:1:9: the file is not UTF-8 text (byte 0xfc)"),
    "utf-16": (GOOD.encode("utf-16"), "not UTF-8"),
    "binary": (bytes(range(128)), "U+0000"),
    "nul": (b"title: a\x00b\n", "mutant.yaml:1:9"),
    "truncated": (GOOD[: GOOD.index("velocity")].encode(), "not valid YAML"),
    "too large": (b"# " + b"x" * (32 << 20), "larger than 32 MiB; put bulk particles into a .npz or .csv file"),
    "recursive alias": (b"a: &x [*x]\n", "refers to itself"),
    "anchor twice": (b"a: &x 1\nb: &x 2\n", "the anchor &x stands in line 1 already"),
    "anchor within itself": (b"a: &x [1, &x 2]\n", "the anchor &x stands in line 1 already"),
    "merge bomb": (b"a: &a {b: 1}\nc: {<<: *a}\n", "merge keys"),
}


@pytest.mark.parametrize("name", WHOLE_FILES)
def test_a_file_that_is_no_scene_is_refused(name, tmp_path):
    data, expected = WHOLE_FILES[name]
    path = tmp_path / "mutant.yaml"
    path.write_bytes(data)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert expected in str(caught.value)
    assert all("\n" not in fault for fault in caught.value.faults)


@pytest.mark.parametrize("encode", [lambda t: b"\xef\xbb\xbf" + t.encode(), lambda t: t.replace("\n", "\r\n").encode()])
def test_byte_order_mark_and_windows_line_ends_are_accepted(encode, tmp_path):
    path = tmp_path / "good.yaml"
    path.write_bytes(encode(GOOD))
    run_whole(path)


BOMBS = {
    "billion laughs": "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 12)),
    "alias chain": "".join(f"a{n}: &a{n} [[[[[[[[[[{f'*a{n - 1}' if n else 1}]]]]]]]]]]\n" for n in range(150)),
    "deep flow": "a: " + "[" * 400_000 + "\n",
    "deep closed flow": "a: " + "[" * 20_000 + "]" * 20_000 + "\n",
    "deep blocks": "".join(" " * n + "a:\n" for n in range(1200)),
    "many keys": "".join(f"k{n}: 1\n" for n in range(90_000)),
    "one key often": "k: 1\n" * 150_000,
    "long scalar": "title: " + "x" * 1_000_000 + "\n",
    "long integer": "seed: " + "1" * 200_000 + "\n",
    "long key": "x" * 500_000 + ": 1\n",
    "long expression": "constants: {a: " + "1+" * 250_000 + "1}\n",
    "many constants": "constants: {c0: 1, " + ", ".join(f"c{n}: c{n - 1}+1" for n in range(1, 9000)) + "}\n",
    "long cycle": "constants: {c0: c8999, " + ", ".join(f"c{n}: c{n - 1}+1" for n in range(1, 9000)) + "}\n",
    "bad bodies": "particles: [" + "{body: {mas: 1}}, " * 25_000 + "]\n",
    "bad names": "particles: [" + "{bdy: }, " * 25_000 + "]\n",
    "bad numbers": "particles:\n- body: {position: [" + "x, " * 150_000 + "]}\n",
    "many links": GOOD.replace("  - link:", "  - link: {between: [sun, nobody], stiffness: 1}\n" * 12_000 + "  - link:"),
}


@pytest.fixture(scope="module")
def of_bombs(tmp_path_factory):
    """What is said of each, in a process of its own that a started one forks, so that imports are paid once."""
    program = """
        import json, os, resource, sys, time
        from mpp_taichi.errors import MppError
        from mpp_taichi.scene.load import load_scene
        for path in sys.argv[1:]:
            if os.fork():
                os.wait()
                continue
            resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
            resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
            began = time.process_time()
            try:
                load_scene(path)
            except MppError as error:
                seconds = time.process_time() - began
                found = [type(error).__name__, len(error.faults), len(str(error)), seconds, "taichi" in sys.modules]
                print(json.dumps([path, found]), flush=True)
            sys.exit()
    """
    folder, paths = tmp_path_factory.mktemp("bombs"), {}
    for name, text in BOMBS.items():
        paths[name] = folder / f"{len(paths)}.yaml"
        paths[name].write_text(text)
    one_thread = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # each thread reserves address space
    command = [sys.executable, "-c", textwrap.dedent(program), *map(str, paths.values())]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200, env=one_thread)
    said = dict(json.loads(line) for line in done.stdout.splitlines())
    return {name: said.get(str(path), done.stderr[-2000:]) for name, path in paths.items()}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_in_seconds_under_a_memory_limit(name, of_bombs):
    assert isinstance(of_bombs[name], list), of_bombs[name]
    kind, faults, length, seconds, with_taichi = of_bombs[name]
    assert kind == "SceneError"
    assert faults <= 101 and length < 200_000
    assert seconds < 10.0  # some five seconds on a slow processor
    assert not with_taichi


@settings(max_examples=150, deadline=None)
@given(st.one_of(st.text(max_size=300), st.text(alphabet="[]{}:,-*&!'\"#|>%@ \nab01.e", max_size=200)))
def test_any_text_is_a_scene_or_a_fault(text):
    _load_text(text)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, len(GOOD) - 1), st.integers(0, 12), st.text(alphabet="[]{}:,-*&!'\"#|> \n\tab01.e", max_size=8))
def test_any_edit_of_a_scene_is_a_scene_or_a_fault(start, length, inserted):
    _load_text(GOOD[:start] + inserted + GOOD[start + length :])


_VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_subnormal=False), st.text(max_size=20)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=10), inner, max_size=4)),
    max_leaves=10,
)


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from(["title", "units", "constants", "particles", "springs", "forces", "integrator", "run", "view", "expect"]),
    _VALUES,
)
def test_any_value_in_a_dict_is_a_scene_or_a_fault(key, value):
    scene = {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "integrator": {"leapfrog": {"dt": 1}}}
    try:
        assert isinstance(load_scene({**scene, key: value}), SceneSpec)
    except MppError as error:
        assert all("\n" not in fault for fault in error.faults)


@settings(max_examples=150, deadline=None)
@given(st.one_of(st.text(max_size=40), st.from_regex(r"\+?[a-z]{1,9}(\.[a-z]{1,9}|\[\d\]){0,3}=.{0,12}", fullmatch=True)))
def test_any_override_is_a_scene_or_a_fault(text):
    scene = {"particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}], "integrator": {"leapfrog": {"dt": 1}}}
    try:
        assert isinstance(load_scene(scene, overrides=[text]), SceneSpec)
    except MppError as error:
        assert all("\n" not in fault for fault in error.faults)


def _load_text(text: str) -> None:
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mutant.yaml"
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        try:
            run_whole(path)
        except MppError as error:
            assert isinstance(error, (SceneError, CapacityError))
