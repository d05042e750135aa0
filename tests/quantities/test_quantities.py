"""Quantities of panels against numbers that were computed by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from measured import MadeUpSample

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.quantities._base import NoResultError, Setting
from mpp_taichi.recorders._measured_columns import MeasuredColumns
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import ComponentSpec, Location
from mpp_taichi.start.assemble import assemble

# A 3-4-5 triangle of masses 1, 2 and 3; the first is held, the spring of the others is 1 longer than at rest.
SCENE = {
    "units": {"length": "AU", "time": "day", "mass": "Msun"},
    "particles": [
        {"body": {"name": "post", "mass": 1, "position": [0, 0, 0], "velocity": [9, 9, 9], "free": False}},
        {"body": {"name": "a", "mass": 2, "position": [3, 0, 0], "velocity": [0, 2, 0]}},
        {"body": {"name": "b", "mass": 3, "position": [3, 4, 0], "velocity": [1, 0, 2]}},
        {"lattice": {"name": "net", "shape": [1, 1, 3], "lower": [0, 0, 6], "upper": [0, 0, 8], "mass": 1}},
    ],
    "springs": [{"link": {"between": ["a", "b"], "stiffness": 1, "rest_length": 3}}],
    "integrator": {"leapfrog": {"dt": 1}},
    "run": {"steps": 1},
}


@pytest.fixture(scope="module")
def setting() -> Setting:
    spec = load_scene(SCENE)
    start = assemble(spec)
    velocity = start.velocity * start.free
    return Setting(spec, start.moved(position=start.position, velocity=velocity, time=0.0, step=0))


def named(name: str, inspect: dict):
    """The checked component of one quantity."""
    (panel,) = load_scene({**SCENE, "inspect": [{"y": {name: inspect}}]}).inspect
    return component.build("quantities", name, panel.y[0].parameters)


@pytest.mark.parametrize(
    ("name", "parameters", "expected", "label", "unit"),
    [
        ("time", {}, 7.0, "time", "day"),
        ("position", {"of": "a", "axis": "x"}, 3.0, "x of a", "AU"),
        ("position", {"of": "net", "axis": "z"}, 7.0, "z of net", "AU"),
        ("position", {"of": "net[2]", "axis": "z"}, 8.0, "z of net[2]", "AU"),
        ("position", {"of": "net[1:3]", "axis": "z"}, 7.5, "z of net[1:3]", "AU"),
        ("position", {"of": "net[:2]", "axis": "z"}, 6.5, "z of net[0:2]", "AU"),
        ("position", {"axis": "x"}, (2 * 3 + 3 * 3) / 9, "x", "AU"),
        ("velocity", {"of": 2, "axis": "z"}, 2.0, "velocity z of b", "AU/day"),
        ("speed", {"of": "b"}, math.sqrt(5), "speed of b", "AU/day"),
        ("distance", {"of": "b", "to": "post"}, 5.0, "distance of b to post", "AU"),
        ("distance", {"of": "a", "point": [0, 4, 0]}, 5.0, "distance of a to (0, 4, 0)", "AU"),
        # The centre of mass of all nine masses is at (15, 12, 21) / 9.
        ("distance", {"of": "post"}, math.sqrt(15**2 + 12**2 + 21**2) / 9, "distance of post to centre of mass", "AU"),
        ("kinetic_energy", {}, 0.5 * (2 * 4 + 3 * 5), "kinetic energy", "Msun AU²/day²"),
        ("kinetic_energy", {"of": "a"}, 4.0, "kinetic energy of a", "Msun AU²/day²"),
        ("potential_energy", {}, -1.5, "potential energy", "Msun AU²/day²"),
        ("total_energy", {}, 10.0, "total energy", "Msun AU²/day²"),
        ("momentum", {}, math.sqrt(3**2 + 4**2 + 6**2), "momentum", "Msun AU/day"),
        ("momentum", {"of": "b", "axis": "z"}, 6.0, "momentum z of b", "Msun AU/day"),
        ("angular_momentum", {"of": "a", "axis": "z"}, 2 * 3 * 2.0, "angular momentum z of a", "Msun AU²/day"),
        # (3, 4, 0) × (1, 0, 2) = (8, −6, −4), three times.
        ("angular_momentum", {"of": "b"}, 3 * math.sqrt(8**2 + 6**2 + 4**2), "angular momentum of b", "Msun AU²/day"),
        ("temperature", {"of": "b"}, 3 * 5 / 3, "temperature k T of b", "Msun AU²/day²"),
        ("spring_length", {"between": ["b", "a"]}, 4.0, "length of spring b–a", "AU"),
        ("spring_strain", {}, 1 / 3, "mean strain of springs", ""),
        ("angle", {"of": "b"}, math.atan2(4, 3), "angle of b", ""),
        ("angle", {"of": "post", "around": "a", "zero": "pi / 2"}, math.pi / 2, "angle of post around a", ""),
        ("mass", {"of": "net"}, 3.0, "mass of net", "Msun"),
        ("relative_energy_error", {}, 0.0, "relative energy error", ""),
    ],
)
def test_a_quantity_is_what_it_says(setting, name, parameters, expected, label, unit):
    quantity = named(name, parameters)
    quantity.begin(setting)
    sample = MadeUpSample(setting.start, time=7.0, potential_energy=-1.5)
    assert quantity.measure(sample) == pytest.approx(expected, rel=1e-15)
    assert quantity.label(setting) == label
    assert setting.unit(quantity.dimension) == unit


def test_what_every_particle_has_is_measured_one_by_one(setting):
    sample = MadeUpSample(setting.start)
    # Held particles are no part of a gas; their places are counted.
    assert named("speed", {}).each(sample) == pytest.approx([2, math.sqrt(5), 0, 0, 0])
    assert named("position", {"axis": "x"}).each(sample).tolist() == [0, 3, 3, 0, 0, 0]
    assert named("kinetic_energy", {"of": "b"}).each(sample).tolist() == [7.5]


def test_the_energy_error_begins_anew_with_a_phase(setting):
    quantity = named("relative_energy_error", {})
    quantity.begin(setting)

    def error(potential: float, phase: int = 0, began: float | None = None) -> float:
        return quantity.measure(MadeUpSample(setting.start, potential_energy=potential, phase_number=phase, phase_energy=began))

    # The kinetic energy is 11.5 throughout.
    assert error(-1.5) == 0.0
    assert error(-1.0) == pytest.approx(0.05)
    assert error(8.5, phase=1, began=16.0) == pytest.approx(0.25)
    quantity.restart()
    assert error(8.5) == 0.0


@pytest.mark.parametrize(
    ("name", "parameters", "reason"),
    [
        ("spring_length", {"between": ["a", "post"]}, "no spring between a and post"),
        ("distance", {"of": "a", "to": "b", "point": [0, 0, 0]}, "not both"),
        ("mode_amplitude", {"mode": [99]}, "there is no mode 99"),
        ("temperature", {"of": "post"}, "too few free particles"),
    ],
)
def test_what_is_not_defined_is_said_before_the_run(setting, name, parameters, reason):
    with pytest.raises(NoResultError, match=reason):
        named(name, parameters).begin(setting)


def test_a_merged_particle_is_nowhere(setting):
    start = setting.start
    merged = np.full(start.particle_count, -1)
    merged[2] = 1
    gone = MadeUpSample(replace(start, merged_into=merged))
    with pytest.raises(NoResultError, match="particle 2 merged into particle 1"):
        named("position", {"of": "b", "axis": "x"}).measure(gone)
    assert named("position", {"of": "a", "axis": "x"}).measure(gone) == 3.0
    columns = MeasuredColumns(setting)
    for name in ("a", "b"):
        columns.add(ComponentSpec("position", {"of": setting.layout.group(name), "axis": "x"}, Location("", 0, 0)), "y")
    assert columns.measure(gone) == pytest.approx([3.0, math.nan], nan_ok=True), "a panel has a gap there"


def test_an_unknown_quantity_is_refused_with_its_place(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("particles: [{body: {}}]\nintegrator: {leapfrog: {dt: 1}}\ninspect:\n  - {x: tme, y: speed}\n")
    with pytest.raises(SceneError, match=r"scene.yaml:4:9: inspect\[0\].x: unknown quantity 'tme', did you mean 'time'"):
        load_scene(path)
