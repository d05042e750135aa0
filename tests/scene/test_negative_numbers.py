"""A negative mass, radius or stiffness is refused where it stands, whatever the way by which it comes."""

import copy
import struct
from dataclasses import replace

import pytest

from mpp_taichi import MppError, SceneError, Simulation, Snapshot, component, load_scene
from mpp_taichi.importers.catalogue import import_scene
from mpp_taichi.start.assemble import assemble

NEVER_NEGATIVE = {
    *("mass", "radius", "radius_spread", "stiffness", "damping", "rest_length", "softening", "restitution", "compliance"),
    *("inner_radius", "outer_radius", "count", "eccentricity", "temperature", "speed", "spacing", "scale_radius", "total_mass"),
}
PARAMETERS = [
    (kind, name, parameter)
    for kind in component.KINDS
    for name in component.names(kind)
    for parameter in component.declaration(kind, name).parameters
    if parameter.name in NEVER_NEGATIVE and parameter.type in ("float", "int")
]
PAIR = {
    "particles": [
        {"body": {"name": "a", "mass": 1.0, "radius": 0.1, "position": [0, 0, 0]}},
        {"body": {"name": "b", "mass": 1.0, "position": [1, 0, 0], "velocity": [0, 0.1, 0]}},
    ],
    "spring_types": {"soft": {"stiffness": 1.0, "damping": 0.1}},
    "springs": [{"link": {"between": [0, 1], "type": "soft"}}],
    "integrator": {"leapfrog": {"dt": 0.01}},
    "run": {"duration": 0.1},
}
PATHS = ("particles[0].body.mass", "particles[0].body.radius", "spring_types.soft.stiffness", "spring_types.soft.damping")


def pair(**more):
    return {**copy.deepcopy(PAIR), **more}


@pytest.mark.parametrize(("kind", "name", "parameter"), PARAMETERS, ids=lambda each: getattr(each, "name", each))
def test_every_component_refuses_a_size_below_0(kind, name, parameter):
    assert (parameter.minimum or 0.0) >= 0.0 and not (parameter.minimum is None and parameter.above is None)
    assert parameter.above is None or parameter.above >= 0.0


@pytest.mark.parametrize("path", PATHS)
def test_it_is_refused_by_set_and_by_the_timeline(path):
    key = path.rpartition(".")[2]
    for refused in (
        lambda: load_scene(pair(), overrides={path: -1.0}),
        lambda: load_scene(pair(timeline=[{"at": 0.05, "set": {path: -1.0}}])),
    ):
        with pytest.raises(SceneError, match=rf"{key}: -1 is not allowed, must be at least 0"):
            refused()


def test_it_is_refused_by_a_change_of_a_run():
    with Simulation(pair(), backend="cpu") as simulation:
        for path in PATHS:
            with pytest.raises(MppError, match="-1 is not allowed, must be at least 0"):
                simulation.set(path, -1.0)


def test_a_slider_cannot_lead_below_0():
    slider = {"set": "spring_types.soft.stiffness", "from": -1.0, "to": 1.0}
    with pytest.raises(SceneError, match=r"stiffness: -1 is not allowed.*sliders\[0\] may be moved to"):
        load_scene(pair(sliders=[slider]))


def test_it_is_refused_in_the_middle_of_a_long_list():
    bodies = [{"body": {"mass": 1.0, "position": [float(k), 0, 0]}} for k in range(300)]
    bodies[250]["body"]["mass"] = -3e-6
    with pytest.raises(SceneError, match=r"particles\[250\].body.mass: -3e-06 is not allowed"):
        load_scene(pair(particles=bodies))


FILES = {
    "mass.csv": "mass,position_x\n1,0\n-2,1\n",
    "radius.csv": "mass,radius,position_x\n1,0.1,0\n1,-2,1\n",
}


@pytest.mark.parametrize("name", FILES)
def test_it_is_refused_in_a_table_beside_the_scene(name, tmp_path):
    (tmp_path / name).write_text(FILES[name])
    scene = tmp_path / "scene.yaml"
    scene.write_text(f"particles: [file: {{path: {name}}}]\nintegrator: {{leapfrog: {{dt: 0.1}}}}\nrun: {{duration: 1}}\n")
    with pytest.raises(SceneError, match=rf"{name}: {name[:-4]} of particle 1 is -2, must be at least 0"):
        Simulation(scene, backend="cpu")


def tipsy(mass):
    """A file with one particle of dark matter."""
    return struct.pack("<d5I4x", 0.0, 1, 3, 0, 1, 0) + struct.pack("<9f", mass, *[0.0] * 8)


OTHERS = {
    "pos.plist": b"pos 0 0 0 0 -1 0 0.1 1 1 1\n",
    "radius.plist": b"pos 0 0 0 0 1 0 -1 1 1 1\n",
    "spring.plist": b"pos 0 0 0 0 1 0 0 1 1 1\ns 0 -1 0 1 1 1\n",
    "universe.txt": b"1\n1e10\n0 0 0 0 -1 sun.gif\n",
    "dark.tipsy": tipsy(-1.0),
}


@pytest.mark.parametrize("name", OTHERS)
def test_it_is_refused_in_the_file_of_another_program(name, tmp_path):
    path = tmp_path / name
    path.write_bytes(OTHERS[name])
    with pytest.raises(SceneError, match=r"must be (at least 0|a number from 0 on), not -1"):
        import_scene(path)


@pytest.mark.parametrize("key", ["mass", "radius", "stiffness"])
def test_it_is_refused_in_a_state(key, tmp_path):
    state = assemble(load_scene(pair()))
    springs = replace(state.springs, stiffness=-state.springs.stiffness)
    bad = replace(state, springs=springs) if key == "stiffness" else replace(state, **{key: getattr(state, key) - 2.0})
    bad.save(tmp_path / "bad.npz")
    with pytest.raises(MppError, match=f"{key} of (particle|spring) 0 is below 0"):
        Snapshot.load(tmp_path / "bad.npz")
    if key != "stiffness":  # the springs of a run are those of its scene
        with pytest.raises(MppError, match="a mass or a radius below 0"):
            Simulation(pair(), backend="cpu", start=bad)
