"""Every number that an exporter writes stands in its own column: the numbers of the particles all differ."""

import csv
import itertools
import struct
from dataclasses import replace

import numpy as np
import pytest

from mpp_taichi.errors import SceneError
from mpp_taichi.exporters._source import Source
from mpp_taichi.exporters.catalogue import export
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble

SPRINGS = [
    {"link": {"between": ["a", "b"], "stiffness": 3.5, "damping": 0.25, "color": [0.5, 0.25, 0.125]}},
    {"link": {"between": ["c", "b"], "stiffness": 4.5, "damping": 0.75, "color": [0.125, 0.5, 0.25]}},
    {"link": {"between": ["a", "c"], "stiffness": 3.5, "damping": 0.25, "color": [0.5, 0.25, 0.125]}},
]
FORCES = [
    {"newtonian_gravity": {"strength": 2.5}},
    {"uniform_gravity": {"acceleration": [0.5, -1.5, 2.25]}},
    {"linear_drag": {"coefficient": 0.625}},
]


def particles(*, plane=False, small=False):
    """Three particles; no number occurs twice. `small`: spheres at rest that do not touch."""
    numbers = itertools.count(1)
    entries = []
    for name in "abc":
        position, velocity = ([next(numbers) * 1.1 for _ in range(3)] for _ in range(2))
        if plane:
            position[2], velocity[2] = 0.0, 0.0
        body = {"name": name, "position": position, "velocity": velocity}
        body |= {key: next(numbers) * 1.1 for key in ("mass", "radius", "charge")}
        if small:
            body |= {"velocity": [0, 0, 0], "radius": body["radius"] / 64}
        entries.append({"body": body | {"color": [next(numbers) / 64 for _ in range(3)]}})
    entries[1]["body"]["free"] = [True, False, True]
    entries[1]["body"]["velocity"][1] = 0.0
    return entries


def source_of(*, plane=False, small=False, scene=True, **more):
    spec = load_scene({"particles": particles(plane=plane, small=small), "integrator": {"leapfrog": {"dt": 0.375}}, **more})
    state = replace(assemble(spec), time=7.25, step=29)
    return Source("scene.yaml", state, spec if scene else None)


def written(source, folder, suffix):
    path = folder / f"out{suffix}"
    export(source, path)
    return path


@pytest.mark.parametrize("scene", [True, False], ids=["scene", "state"])
def test_each_column_of_a_table_of_particles_is_what_its_name_says(tmp_path, scene):
    source = source_of(scene=scene)
    state = source.state
    with open(written(source, tmp_path, ".csv"), encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    expected = {"name": list(state.name), "mass": state.mass, "radius": state.radius, "charge": state.charge}
    for key, letters in (("position", "xyz"), ("velocity", "xyz"), ("free", "xyz"), ("color", "rgb")):
        expected |= {f"{key}_{letter}": getattr(state, key)[:, k] for k, letter in enumerate(letters)}
    assert list(rows[0]) == list(expected)
    for name, values in expected.items():
        found = [row[name] for row in rows]
        assert (
            found == list(values) if name == "name" else np.array(found, float).tolist() == np.asarray(values, float).tolist()
        )


def test_each_column_of_extended_xyz_is_what_its_header_says(tmp_path):
    source = source_of()
    state = source.state
    count, header, *rows = written(source, tmp_path, ".xyz").read_text(encoding="utf-8").splitlines()
    properties = header[header.index("Properties=") + 11 :].split()[0].split(":")
    cells = [row.split() for row in rows]
    assert int(count) == len(rows) == 3 and "Time=7.25 Step=29" in header
    expected = {key: getattr(state, key) for key in ("mass", "radius", "charge")}
    expected |= {"pos": state.position, "velo": state.velocity}
    column = 0
    for name, kind, width in zip(properties[::3], properties[1::3], map(int, properties[2::3]), strict=True):
        found = [row[column : column + width] for row in cells]
        column += width
        if kind == "R":
            assert np.array(found, float).tolist() == expected.pop(name).reshape(3, -1).tolist()
        else:
            assert [word for (word,) in found] == {"species": ["X"] * 3, "name": list(state.name)}[name]
    assert not expected and all(len(row) == column for row in cells)


@pytest.mark.parametrize("scene", [True, False], ids=["scene", "state"])
def test_each_number_of_a_tipsy_file_is_in_its_place(tmp_path, scene):
    gravity = [{"newtonian_gravity": {"strength": 2.5, "softening": 0.375}}]
    source = source_of(scene=scene, forces=gravity)
    state, raw = source.state, written(source, tmp_path, ".tipsy").read_bytes()
    assert struct.unpack(">d6I", raw[:32]) == (7.25, 3, 3, 0, 3, 0, 0)
    rows = np.frombuffer(raw[32:], ">f4").reshape(3, 9)
    strength, softening = (2.5, 0.375) if scene else (1.0, 0.0)
    numbers = [strength * state.mass[:, None], state.position, state.velocity, np.full((3, 1), softening), np.zeros((3, 1))]
    assert rows.tolist() == np.hstack(numbers).astype("f4").tolist()


def test_a_scene_without_gravity_keeps_its_masses_in_tipsy(tmp_path):
    for forces in ([], [{"newtonian_gravity": {"strength": 0.0}}]):
        source = source_of(forces=forces)
        rows = np.frombuffer(written(source, tmp_path, ".tipsy").read_bytes()[32:], ">f4").reshape(3, 9)
        assert rows[:, 0].tolist() == source.state.mass.astype("f4").tolist() and not rows[:, 7:].any()


@pytest.mark.parametrize("scene", [True, False], ids=["scene", "state"])
def test_each_line_of_a_particle_list_has_its_numbers(tmp_path, scene):
    source = source_of(scene=scene, springs=SPRINGS, forces=FORCES)
    state = source.state
    lines = [line.split() for line in written(source, tmp_path, ".plist").read_text(encoding="utf-8").splitlines()]
    lines = [line for line in lines if not line[0].startswith("#")]
    found = {command: [np.array(line[1:], float).tolist() for line in lines if line[0] == command] for command, *_ in lines}
    columns = zip(state.position, state.mass, state.charge, state.radius, state.color, strict=True)
    assert found["pos"] == [[k, *x, m, c, r, *color] for k, (x, m, c, r, color) in enumerate(columns)]
    assert found["vel"] == [[k, *v] for k, v in enumerate(state.velocity.tolist())]
    assert found["vfix"] == [[1, 1, 0, 1]]
    # Two types of springs, in the order in which they come; a spring is its ends and its type.
    assert found["s"] == [[0, 3.5, 0.25, 0.5, 0.25, 0.125], [1, 4.5, 0.75, 0.125, 0.5, 0.25]]
    assert found["sl"] == [[*ends, kind] for ends, kind in zip(state.springs.between.tolist(), (0, 1, 0), strict=True)]
    of_scene = {"k2": [[2.5]], "grav": [[0.5, -1.5, 2.25]], "damp": [[0.625]], "dt": [[0.375]]}
    assert {key: found.get(key) for key in of_scene} == (of_scene if scene else dict.fromkeys(of_scene))
    assert "dis" not in found


@pytest.mark.parametrize(
    "more, reason",
    [
        ({"forces": [{"coulomb": {}}]}, "has no coulomb"),
        ({"forces": [{"newtonian_gravity": {"softening": 0.5}}]}, "has no softening"),
        ({"contacts": {"hard_spheres": {"solver": "swept"}}}, "has no contacts"),
        ({"springs": [{"link": {"between": ["a", "b"], "stiffness": 1, "rest_length": 0.5}}]}, "between 0 and 1 is not"),
        ({"springs": [{"rod": {"between": ["a", "c"]}}]}, "and no rods"),
    ],
)
def test_a_particle_list_refuses_each_part_that_it_has_no_command_for(tmp_path, more, reason):
    source = source_of(small=True, **more)
    with pytest.raises(SceneError, match=reason):
        export(source, tmp_path / "out.plist")


@pytest.mark.parametrize("radius", [None, 99.0])
def test_each_column_of_a_universe_file_is_in_its_place(tmp_path, radius):
    """Numbers have five digits; R is the constant of the scene, or the distance of the farthest coordinate."""
    source = source_of(plane=True, **({} if radius is None else {"constants": {"universe_radius": radius}}))
    state = source.state
    count, size, *rows = written(source, tmp_path, ".txt").read_text(encoding="utf-8").splitlines()
    assert int(count) == 3 and float(size) == pytest.approx(
        np.abs(state.position).max() if radius is None else radius, rel=5e-3
    )
    for row, x, v, m, name in zip(rows, state.position, state.velocity, state.mass, state.name, strict=True):
        *numbers, picture = row.split()
        assert np.array(numbers, float) == pytest.approx([x[0], x[1], v[0], v[1], m], rel=5e-5)
        assert picture == f"{name}.gif"


@pytest.mark.parametrize("key, column", [("position", 2), ("velocity", 2)])
def test_a_body_beside_the_plane_has_no_universe_file(tmp_path, key, column):
    source = source_of(plane=True)
    values = getattr(source.state, key).copy()
    values[2, column] = 1e-3
    with pytest.raises(SceneError, match="a particle is not in it"):
        export(replace(source, state=replace(source.state, **{key: values})), tmp_path / "out.txt")


@pytest.mark.parametrize("merged", [False, True])
def test_each_element_of_h5md_is_what_its_name_says(tmp_path, merged):
    h5py = pytest.importorskip("h5py")
    units = {"length": "AU", "time": "day", "mass": "Msun"}
    source = source_of(springs=SPRINGS, units=units, title="three")
    state: Snapshot = source.state
    if merged:
        state = replace(state, merged_into=np.array([-1, -1, 0]))
        source = replace(source, state=state)
    with h5py.File(written(source, tmp_path, ".h5md")) as file:
        group = file["particles/trajectory"]
        for key in ("position", "velocity", *(("mass", "radius", "charge") if merged else ())):
            assert group[key]["value"][()].tolist() == [getattr(state, key).tolist()]
            assert group[key]["step"][()].tolist() == [29] and group[key]["time"][()].tolist() == [7.25]
        if merged:
            assert group["id"]["value"][()].tolist() == [[0, 1, -1]]
        else:
            for key in ("mass", "radius", "charge"):
                assert group[key][()].tolist() == getattr(state, key).tolist()
            assert "id" not in group
        assert [name.decode() for name in group["name"][()]] == list(state.name)
        assert group["box"].attrs["dimension"] == 3 and group["box"].attrs["boundary"].tolist() == [b"none"] * 3
        assert file["connectivity/springs"][()].tolist() == state.springs.between.tolist()
        assert file[file["connectivity/springs"].attrs["particles_group"]] == group
        assert dict(file["parameters"].attrs) == {"title": "three"} | {f"{key}_unit": unit for key, unit in units.items()}
        assert file["h5md"].attrs["version"].tolist() == [1, 1]
