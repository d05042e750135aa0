"""Extended XYZ, H5MD and tipsy: other libraries read the written files, and faulty files are reported."""

import contextlib
import importlib.util
import io
import json
import math
import struct
import tracemalloc
import zipfile
from dataclasses import replace

import ase.io
import h5py
import numpy as np
import pytest
from MDAnalysis.coordinates.H5MD import H5MDReader

from mpp_taichi import SceneError
from mpp_taichi.cli.main import main
from mpp_taichi.importers.catalogue import import_scene
from mpp_taichi.recorders.trajectory import TrajectoryRecorder
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble

F32 = 2.0**-24  # relative rounding of a float of 32 bits: MDAnalysis and tipsy have no more
SCENE = """
title: Two
units: {length: AU, time: day, mass: Msun}
particles:
  - body: {name: the sun, mass: 1.25, position: [0.1, -0.5, 0.30000000000000004], velocity: [1e-17, 0, 2], charge: -2}
  - body: {mass: 3e-6, position: [1, 1.5, -0.25], velocity: [-0.5, 0.125, 0], radius: 0.125}
springs: [{link: {between: [0, 1], stiffness: 1}}]
forces: [{newtonian_gravity: {strength: 4, softening: 0.5}}]
integrator: {leapfrog: {dt: 0.01}}
"""
BOX = """
particles:
  - body: {mass: 1, position: [0.5, 0.25, 0.125], velocity: [3, -2, 1], radius: 0.1}
  - body: {mass: 2, position: [-0.5, -0.25, 0.75], velocity: [-1, 0.5, 0], radius: 0.2}
contacts: {hard_spheres: {solver: event_driven}}
walls: [{periodic_box: {lower: [-1, -2, 0], upper: [1, 2, 5], axes: [true, true, false]}}]
integrator: {event_driven: {dt: 0.25}}
"""


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def converted(source, target):
    assert main(["convert", str(source), str(target), "-q"]) == 0
    return target


def refused(source, target, code, capsys):
    """What is said, one line; nothing is written."""
    before = set(target.parent.iterdir())
    assert main(["convert", str(source), str(target)]) == code
    said = capsys.readouterr().err
    assert set(target.parent.iterdir()) == before and said.startswith(str(source)) and said.count("\n") == 1
    return said


class FreeFlight:
    """What a recorder asks of a simulation: bodies fly straight from where the scene has them."""

    def __init__(self, scene):
        self.spec = load_scene(scene)
        self.start = assemble(self.spec)
        self.step_count = 0

    def position(self, step):
        return self.start.position + 0.25 * step * self.start.velocity

    def snapshot(self):
        time, k = 0.25 * self.step_count, self.step_count
        return self.start.moved(position=self.position(k), velocity=self.start.velocity, time=time, step=k)


@contextlib.contextmanager
def little_memory():
    """Less than 16 MiB are allocated, thousands of times less than what the files of these tests claim to hold."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


def recorded(folder, name, simulation, steps=(0, 1, 2, 5)):
    with TrajectoryRecorder(folder / name) as recorder:
        for step in steps:
            simulation.step_count = step
            recorder.record(simulation)
    return folder / name


def test_ase_reads_the_particles_of_a_scene(tmp_path):
    source = written(tmp_path, "two.yaml", SCENE)
    found, start = ase.io.read(converted(source, tmp_path / "two.xyz")), assemble(load_scene(source))
    np.testing.assert_array_equal(found.positions, start.position)
    for column, values in (("velo", start.velocity), ("mass", start.mass), ("radius", start.radius)):
        np.testing.assert_array_equal(found.arrays[column], values)
    np.testing.assert_array_equal(found.calc.results["charges"], start.charge)
    assert found.get_chemical_symbols() == ["X", "X"] and found.arrays["name"].tolist() == ["the_sun", "-"]
    assert not found.pbc.any() and not found.cell.any() and found.info == {"Time": 0.0, "Step": 0}


def test_ase_reads_every_frame_of_a_trajectory_and_the_box_that_repeats(tmp_path):
    flight = FreeFlight(written(tmp_path, "box.yaml", BOX))
    own = recorded(tmp_path, "own.xyz", flight)
    made = converted(recorded(tmp_path, "way.npz", flight), tmp_path / "made.extxyz")
    assert made.read_bytes() == own.read_bytes()
    frames = ase.io.read(made, ":")
    assert [frame.info["Step"] for frame in frames] == [0, 1, 2, 5]
    assert [frame.info["Time"] for frame in frames] == [0.0, 0.25, 0.5, 1.25]
    for frame in frames:
        np.testing.assert_array_equal(frame.positions, flight.position(frame.info["Step"]))
        np.testing.assert_array_equal(frame.cell, np.diag([2.0, 4.0, 0.0]))
        assert frame.pbc.tolist() == [True, True, False] and frame.info["Origin"].tolist() == [-1, -2, 0]


def test_mdanalysis_reads_every_frame_of_a_trajectory(tmp_path):
    flight = FreeFlight(written(tmp_path, "box.yaml", BOX))
    made = converted(recorded(tmp_path, "way.npz", flight), tmp_path / "made.h5md")
    with H5MDReader(str(made), convert_units=False) as frames:
        assert (frames.n_atoms, frames.n_frames) == (2, 4)
        for step, frame in zip((0, 1, 2, 5), frames, strict=True):
            assert frame.time == 0.25 * step and frame.data["step"] == step
            np.testing.assert_allclose(frame.positions, flight.position(step), rtol=F32, atol=0)
            np.testing.assert_allclose(frame.velocities, flight.start.velocity, rtol=F32, atol=0)
            assert frame.dimensions.tolist() == [2, 4, 0, 90, 90, 90]


def test_h5md_is_as_its_specification_says(tmp_path):
    flight = FreeFlight(written(tmp_path, "box.yaml", BOX))
    box = converted(recorded(tmp_path, "way.npz", flight), tmp_path / "box.h5md")
    two = converted(written(tmp_path, "two.yaml", SCENE), tmp_path / "two.h5")
    start = assemble(load_scene(tmp_path / "two.yaml"))
    with h5py.File(box) as file:
        group = file["particles/trajectory"]
        for element in ("velocity", "box/edges"):  # sampled together: hard links
            assert all(group[f"{element}/{key}"] == group[f"position/{key}"] for key in ("step", "time"))
        assert group["box"].attrs["boundary"].tolist() == [b"periodic", b"periodic", b"none"]
        assert group["position/value"].dtype == np.float64
        np.testing.assert_array_equal(group["position/value"][3], flight.position(5))
    with h5py.File(two) as file:
        assert file["h5md"].attrs["version"].tolist() == [1, 1]
        group = file["particles/trajectory"]
        assert group["box"].attrs["dimension"] == 3 and "edges" not in group["box"]
        texts = [(file["h5md/author"], "name"), (file["h5md/creator"], "name"), (file["h5md/creator"], "version")]
        for owner, key in [*texts, (group["box"], "boundary")]:
            kind = h5py.h5a.open(owner.id, key.encode()).get_type()
            assert isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str()
        for key in ("mass", "radius", "charge"):
            np.testing.assert_array_equal(group[key], getattr(start, key))
        assert group["name"].asstr()[:].tolist() == ["the sun", ""]
        springs = file["connectivity/springs"]
        assert springs[:].tolist() == [[0, 1]] and file[springs.attrs["particles_group"]] == group
        assert dict(file["parameters"].attrs) == {
            "title": "Two",
            "length_unit": "AU",
            "time_unit": "day",
            "mass_unit": "Msun",
        }


def test_what_has_merged_is_gone_from_its_frame_on(tmp_path):
    flight = FreeFlight(written(tmp_path, "box.yaml", BOX))
    two = replace(flight.start, merged_into=np.array([-1, -1], np.int32), charge=np.array([1.0, 2.0]))
    one = replace(
        two, mass=np.array([3.0, 0.0]), radius=np.array([0.21, 0.0]), charge=np.array([3.0, 0.0]), merged_into=np.array([-1, 0])
    )
    path = tmp_path / "way.npz"
    with TrajectoryRecorder(path) as recorder:
        for step, flight.start in enumerate((two, one)):
            flight.step_count = step
            recorder.record(flight)
    frames = ase.io.read(converted(path, tmp_path / "made.xyz"), ":")
    assert [len(frame) for frame in frames] == [2, 1]
    assert [frame.calc.results["charges"].tolist() for frame in frames] == [[1, 2], [3]]
    with h5py.File(converted(path, tmp_path / "made.h5")) as file:
        group = file["particles/trajectory"]
        assert group["id/value"][:].tolist() == [[0, 1], [0, -1]] and group["id/value"].fillvalue == -1
        assert group["mass/value"][:].tolist() == [[1, 2], [3, 0]] and group["mass/step"] == group["position/step"]


def test_without_h5py_it_is_said_how_to_get_it(tmp_path, capsys, monkeypatch):
    source = written(tmp_path, "two.yaml", SCENE)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["convert", str(source), str(tmp_path / "two.h5")]) == 3 and list(tmp_path.iterdir()) == [source]
    assert capsys.readouterr().err == "H5MD needs h5py: pip install 'mpp-taichi[formats]'; .xyz needs nothing\n"


def test_a_trajectory_goes_where_all_its_frames_have_room(tmp_path, capsys):
    path = recorded(tmp_path, "way.npz", FreeFlight(written(tmp_path, "box.yaml", BOX)))
    said = refused(path, tmp_path / "t.csv", 2, capsys)
    assert "a trajectory of 4 frames, .csv holds one; all are held by .h5md, .h5, .xyz, .extxyz" in said
    assert "of which no state can be made" in refused(path, tmp_path / "t.npz", 2, capsys)
    assert main(["convert", str(path), str(tmp_path / "t.h5"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frame_count"] == 4
    back = recorded(tmp_path, "back.npz", FreeFlight(tmp_path / "box.yaml"), steps=(0, 3, 1))
    assert "steps that increase, and frame 2 goes from 3 to 1" in refused(back, tmp_path / "b.h5", 2, capsys)


def changed_archive(path, key, change):
    """Another archive with one array changed."""
    with np.load(path) as data:
        arrays = {name: data[name] for name in data}
    arrays[key] = change(arrays[key])
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def with_nan(array):
    array = array.copy()
    array[2, 1, 0] = math.nan
    return array


@pytest.mark.parametrize(
    ("key", "change", "said"),
    [
        ("position", lambda x: x[:, :1], "velocity has the shape (4, 2, 3), must be (4, 1, 3)"),
        ("position", lambda x: x.astype("f4"), "position is float32"),
        ("position", with_nan, "position of frame 2 is not finite"),
        ("time", lambda x: x[:-1], "time has the shape (3,), must be (4,)"),
        ("name", lambda x: x[:1], "name has the shape (1,), must be (2,)"),
        ("mass", lambda x: x[0], "mass has the shape (), must be (2,)"),
        ("period", lambda x: x[:, :2], "period has the shape (4, 2), must be (4, 3)"),
    ],
)
def test_a_trajectory_that_does_not_fit_together_is_told(tmp_path, capsys, key, change, said):
    path = recorded(tmp_path, "way.npz", FreeFlight(written(tmp_path, "box.yaml", BOX)))
    path.write_bytes(changed_archive(path, key, change))
    assert said in refused(path, tmp_path / "out.xyz", 5, capsys)


def test_a_trajectory_that_claims_more_than_it_holds_is_not_believed(tmp_path, capsys):
    path = recorded(tmp_path, "way.npz", FreeFlight(written(tmp_path, "box.yaml", BOX)))
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for shape in (b"(4, 99999999999, 3)", b"(99999999999, 2, 3)", b"(4, 3, 3)", b"(4, -2, -3)"):
        with zipfile.ZipFile(path, "w") as archive:
            for name, data in members.items():
                huge = (
                    struct.pack("<H", 118)
                    + (b"{'descr': '<f8', 'fortran_order': False, 'shape': " + shape + b"}").ljust(117)
                    + b"\n"
                )
                archive.writestr(name, data[:8] + huge if name == "position.npy" else data)
        with little_memory():
            assert "position is float64 of shape" in refused(path, tmp_path / "out.xyz", 5, capsys)


def test_an_archive_that_cannot_be_read_is_told(tmp_path, capsys):
    path = recorded(tmp_path, "way.npz", FreeFlight(written(tmp_path, "box.yaml", BOX)))
    whole = path.read_bytes()
    entry = whole.index(b"PK\x01\x02")  # of its table of contents; 6 bytes on is the version that reading it takes
    newer = whole[: entry + 6] + b"\xff" + whole[entry + 7 :]
    for data, said in ((newer, "version 25.5"), (whole[:-1], "not a zip file"), (b"", "No data left")):
        path.write_bytes(data)
        assert said in refused(path, tmp_path / "out.xyz", 5, capsys)
    place = whole.index(np.float64(-2.0).tobytes())  # a velocity
    path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    assert "Bad CRC-32" in refused(path, tmp_path / "out.h5", 5, capsys)


GAS, DARK, STAR = 12, 9, 11  # floats of a particle: mass, x, y, z, vx, vy, vz, and for
EPS = {GAS: 9, DARK: 7, STAR: 9}  # gas rho, temp, eps, metals, phi; dark eps, phi; star metals, tform, eps, phi


def particles(eps=0.0, extra=0.0):
    """Two of gas, one of dark matter, two stars: floats that 32 bits hold exactly."""
    made = []
    for kind, count in ((GAS, 2), (DARK, 1), (STAR, 2)):
        table = np.full((count, kind), extra)
        table[:, :7] = (np.arange(count * 7).reshape(count, 7) + kind) / 64
        table[:, EPS[kind]] = eps
        made.append(table)
    return made


def tipsy(tables, order=">", *, pad=True, time=0.0, header=None):
    """A file, written from the format's description."""
    counts = [len(table) for table in tables]
    numbers = header or (time, sum(counts), 3, *counts)
    data = struct.pack(order + "diiiii", *numbers) + (b"\0\0\0\0" if pad else b"")
    return data + b"".join(struct.pack(f"{order}{table.size}f", *table.ravel()) for table in tables)


@pytest.mark.parametrize("order", [">", "<"])
@pytest.mark.parametrize("pad", [True, False])
def test_tipsy_is_read_in_both_byte_orders_with_and_without_padding(tmp_path, order, pad):
    tables = particles(eps=0.25)
    path = written(tmp_path, "galaxy.tipsy", tipsy(tables, order, pad=pad, time=1.5))
    name, scene = import_scene(path)
    assert name == "tipsy" and scene["forces"] == [{"newtonian_gravity": {"strength": 1.0, "softening": 0.25}}]
    state = Snapshot.load(converted(path, tmp_path / "state.npz"))
    made = assemble(load_scene(converted(path, tmp_path / "made.yaml")))
    whole = np.concatenate([table[:, :7] for table in tables])
    for found in (state, made):
        np.testing.assert_array_equal(np.column_stack([found.mass, found.position, found.velocity]), whole)
    assert state.time == 1.5 and len(np.unique(state.color, axis=0)) == 3
    np.testing.assert_array_equal(state.color, made.color)


def test_steps_of_a_tipsy_scene_are_a_hundredth_of_its_dynamical_time(tmp_path):
    table = np.zeros((2, DARK))
    table[:, 0], table[:, 1] = (1.0, 3.0), (3.0, -1.0)  # about the centre of mass at 0: R² = (1·9 + 3·1) / 4 = 3
    _, scene = import_scene(written(tmp_path, "pair.std", tipsy([np.zeros((0, GAS)), table, np.zeros((0, STAR))])))
    assert scene["integrator"]["leapfrog"]["dt"] == pytest.approx(0.01 * math.sqrt(3**1.5 / 4), rel=1e-12)


@pytest.mark.parametrize("mass", [0.0, 2.0])
def test_a_tipsy_scene_without_mass_or_extent_has_steps_of_a_hundredth(tmp_path, mass):
    table = np.zeros((2, DARK))
    table[:, 0], table[:, 1] = mass, 3.0
    if not mass:
        table[1, 1] = -3.0
    _, scene = import_scene(written(tmp_path, "pair.std", tipsy([np.zeros((0, GAS)), table, np.zeros((0, STAR))])))
    assert scene["integrator"]["leapfrog"]["dt"] == 0.01


def test_what_a_tipsy_scene_loses_is_told(tmp_path, capsys):
    tables = particles(eps=0.25, extra=7.0)
    tables[1][0, 7] = 0.5
    path = written(tmp_path, "galaxy.tipsy", tipsy(tables, time=1.5))
    converted(path, tmp_path / "made.yaml")
    lost, softening = capsys.readouterr().err.splitlines()
    assert lost == f"warning: {path}: left out: metals, phi, rho, temp, tform, time"
    assert softening == f"warning: {path}: eps goes from 0.25 to 0.5; the scene's one softening is 0.5"
    assert "softening: 0.5" in (tmp_path / "made.yaml").read_text()
    converted(path, tmp_path / "made.npz")
    assert capsys.readouterr().err == f"warning: {path}: left out: eps, metals, phi, rho, temp, tform\n"
    converted(written(tmp_path, "bare.tipsy", tipsy(particles())), tmp_path / "bare.yaml")
    assert not capsys.readouterr().err


WHOLE = tipsy(particles())
ONE = [np.zeros((0, GAS)), np.ones((1, DARK)), np.zeros((0, STAR))]
BIG = 2**31 - 1


def with_number(offset, value):
    return WHOLE[:offset] + struct.pack(">f", value) + WHOLE[offset + 4 :]


# Where particles begin: gas at 32, dark matter at 32 + 2·48 = 128, stars at 128 + 36 = 164, the end at 164 + 2·44 = 252.
FAULTS = {
    "empty": (b"", "byte 0: the file ends within its header of 28 bytes"),
    "header": (WHOLE[:27], "byte 27: the file ends within its header"),
    "no_particle": (WHOLE[:32], "byte 32: the file ends within gas particle 0 of 2"),
    "last_byte": (WHOLE[:-1], "byte 251: the file ends within star particle 1 of 2"),
    "four_bytes": (WHOLE[:-4], "byte 248: the file ends within star particle 1 of 2"),
    "dark": (WHOLE[:140], "byte 140: the file ends within dark particle 0 of 1"),
    "more": (WHOLE + b"12345", "byte 252: 5 bytes follow the last of 5 particles"),
    "dimensions": (tipsy(ONE, header=(0.0, 1, 2, 0, 1, 0)), "byte 12: ndim must be 3, in either byte order, not 00 00 00 02"),
    "text": (b"5\n2.50e11\n" * 9, "byte 12: ndim must be 3, in either byte order, not 32 2e 35 30"),
    "sum": (
        tipsy(ONE, header=(0.0, 2, 3, 0, 1, 0)),
        "byte 8: nbodies must be nsph + ndark + nstar and at least 1: 2 is not 0 + 1 + 0",
    ),
    "none": (tipsy(ONE, header=(0.0, 0, 3, 0, 0, 0)), "byte 8: nbodies must be nsph + ndark + nstar and at least 1: 0 is not"),
    "negative": (tipsy(ONE, header=(0.0, 1, 3, -1, 1, 1)), "byte 8: nbodies must be"),
    "absurd": (tipsy(ONE, header=(0.0, BIG, 3, 0, BIG, 0)), "byte 68: the file ends within dark particle 1 of 2,147,483,647"),
    "time": (tipsy(ONE, time=math.nan), "byte 0: time must be a finite number, not nan"),
    "mass": (with_number(32 + 48, math.inf), "byte 80: mass of gas particle 1 must be a finite number, not inf"),
    "mass_below_zero": (with_number(32 + 48, -2.0), "byte 80: mass of gas particle 1 must be a number from 0 on, not -2"),
    "velocity": (with_number(164 + 24, math.nan), "byte 188: vz of star particle 0 must be a finite number, not nan"),
    "softening": (with_number(128 + 28, -1.0), "byte 156: eps of dark particle 0 must be a number from 0 on, not -1"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_wrong_in_a_tipsy_file_has_its_byte(tmp_path, fault, capsys):
    data, said = FAULTS[fault]
    path = written(tmp_path, "bad.tipsy", data)
    with little_memory():
        for target in ("out.yaml", "out.npz"):
            told = refused(path, tmp_path / target, 2, capsys)
            assert said in told and told.startswith(f"{path}: byte ")


def test_every_file_cut_short_is_told(tmp_path, capsys):
    for length in range(len(WHOLE)):
        path = written(tmp_path, "bad.tipsy", WHOLE[:length])
        with pytest.raises(SceneError, match=f"byte {length}: the file ends within"):
            import_scene(path)


def test_tipsy_is_written_big_endian_with_gravity_of_one(tmp_path, capsys):
    source = written(tmp_path, "two.yaml", SCENE)
    data = converted(source, tmp_path / "two.tipsy").read_bytes()
    start = assemble(load_scene(source))
    assert struct.unpack(">diiiiii", data[:32]) == (0.0, 2, 3, 0, 2, 0, 0) and len(data) == 32 + 2 * 36
    table = np.array(struct.unpack(">18f", data[32:])).reshape(2, 9)
    np.testing.assert_allclose(table[:, 0], 4.0 * start.mass, rtol=F32, atol=0)  # G m
    np.testing.assert_allclose(table[:, 1:4], start.position, rtol=F32, atol=0)
    np.testing.assert_allclose(table[:, 4:7], start.velocity, rtol=F32, atol=0)
    np.testing.assert_array_equal(table[:, 7:], [[0.5, 0.0]] * 2)
    again = converted(converted(tmp_path / "two.tipsy", tmp_path / "again.yaml"), tmp_path / "again.std")
    assert again.read_bytes() == data
    for change, said in (
        ("mass: 3e-6", "mass: 1e39"),
        ("position: [1, 1.5", "position: [1, 1e-60"),
        ("strength: 4", "strength: -4"),
    ):
        bad = written(tmp_path, "bad.yaml", SCENE.replace(change, said))
        told = refused(bad, tmp_path / "bad.tipsy", 2, capsys)
        expected = {
            "m": "mass of particle 1, 4e+39, is beyond",
            "p": "y of particle 1, 1e-60, is beyond",
            "s": "gravity that attracts",
        }
        assert expected[said[0]] in told


def test_suffixes_may_be_capital(tmp_path):
    source = written(tmp_path, "TWO.YAML", SCENE)
    for suffix in (".XYZ", ".CSV", ".TIPSY", ".NPZ"):
        assert converted(source, tmp_path / f"made{suffix}").stat().st_size > 0
