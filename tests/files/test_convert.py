"""Conversion of files of other programs: every digit is kept, and faults are reported with line and column."""

import json
import zipfile

import numpy as np
import pytest

from mpp_taichi import OutputError, SceneError, Simulation
from mpp_taichi.cli.main import main
from mpp_taichi.importers.catalogue import import_scene, importers
from mpp_taichi.scene.body_view_spec import BodyLightSpec
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.write import scene_text
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble

PLANETS = """5
2.50e11
1.496e11 0.000e00 0.000e00 2.980e04 5.974e24 earth.gif
2.279e11 0.000e00 0.000e00 2.410e04 6.419e23 mars.gif
5.790e10 0.000e00 0.000e00 4.790e04 3.302e23 mercury.gif
0.000e00 0.000e00 0.000e00 0.000e00 1.989e30 sun.gif
1.082e11 0.000e00 0.000e00 3.500e04 4.869e24 venus.gif
"""
# What the assignment's own program prints for `157788000 25000`.
FIVE_YEARS = {
    "earth": "1.4925e+11 -1.0467e+10 2.0872e+03 2.9723e+04",
    "mars": "-1.1055e+11 -1.9868e+11 2.1060e+04 -1.1827e+04",
    "mercury": "-1.1708e+10 -5.7384e+10 4.6276e+04 -9.9541e+03",
    "sun": "2.1709e+05 3.0029e+07 4.5087e-02 5.1823e-02",
    "venus": "6.9283e+10 8.2658e+10 -2.6894e+04 2.2585e+04",
}
ODD = """  3 1.0E+2

  0.5e0 0 0 -1e-1 2.5E1 anti.gif"  1 1 0 0 4 anti.gif
-1 0 0
0 1e0 'sun.gif'   "Antimatter", drawn by somebody in 1999: 3 bodies.
4 5 6
"""
PAPER = """# filename: data.plist
#---- ID x y z m c r color (rgb)
pos 0 0.0 0.0 0.0 1.0 0.0 0.1 1.0 1.0 0.0
pos 1 1.0 0.0 0.0 3e-6 0.0 0.03 0.3 0.3 1.0
#---- ID vx vy vz
vel 0 0.0 0.0 0.0
vel 1 0.0 0.0172 0.0
#---- ID x y z // fixed=0, free=1
vfix 0 1 1 0
vfix 1 1 1 0
k2 2.9584e-4
dt 0.03
"""
SPRINGS = """// ID x y z m c r R G B
pos 0 0 0 0 1.0 0 0.1 1 0 0
pos 1 1 0 0 2.0 0.5 0.1 1 0 0  // the one that swings
vfix 0 0 0 0
s 7 50.0 0.003 0.4 0.4 1.0
sl 0 1 7
dis 1 0 0 0.25
grav 0 0 -9.81
damp 0.1
dt 1e-2"""


def written(folder, name, text):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_the_planets_of_the_assignment_are_where_its_program_has_them(tmp_path):
    name, scene = import_scene(written(tmp_path, "planets.txt", PLANETS))
    assert name == "princeton"
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=simulation.spec.run.steps)
        found = simulation.snapshot()
    lines = {
        name: f"{x[0]:.4e} {x[1]:.4e} {v[0]:.4e} {v[1]:.4e}"
        for name, x, v in zip(found.name, found.position, found.velocity, strict=True)
    }
    assert lines == FIVE_YEARS


def test_the_radius_of_a_universe_is_kept_when_it_is_written_again(tmp_path):
    """R is far beyond the last body here; without it, the picture of the assignment's program would be another."""
    text = PLANETS.replace("2.50e11", "7.50e+11").replace("2.50e+11", "7.50e+11")
    names = [written(tmp_path, "planets.txt", text), tmp_path / "planets.yaml", tmp_path / "again.txt"]
    for source, target in zip(names, names[1:]):
        assert main(["convert", str(source), str(target), "--quiet"]) == 0
    assert names[2].read_text().split()[:2] == [PLANETS.split()[0], "7.50e+11"]


@pytest.mark.parametrize("verb", ["run", "check"])
def test_a_verb_that_takes_scenes_names_the_conversion_of_a_file_of_another_program(tmp_path, verb, capsys):
    path = written(tmp_path, "planets.txt", PLANETS)
    assert main([verb, str(path)]) == 2
    told = capsys.readouterr()
    assert f"`mpp-taichi convert {path} planets.yaml` makes a scene" in told.out + told.err
    assert main(["run", "-"]) == 2 and "no scene is read from standard input" in capsys.readouterr().err


def test_quirks_of_universe_files_are_read(tmp_path):
    _, scene = import_scene(written(tmp_path, "odd.txt", ODD))
    bodies = [entry["body"] for entry in scene["particles"]]
    assert [body["name"] for body in bodies] == ["anti", "anti_2", "sun"]
    assert [body["mass"] for body in bodies] == [25.0, 4.0, 1.0]
    assert bodies[0]["position"] == [0.5, 0.0, 0.0] and bodies[0]["velocity"] == [0.0, -0.1, 0.0]
    assert assemble(load_scene(scene)).particle_count == 3


def test_the_list_of_the_paper_runs_to_its_end(tmp_path):
    name, scene = import_scene(written(tmp_path, "data.plist", PAPER))
    assert name == "plist" and scene["integrator"] == {"leapfrog": {"dt": 0.03}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert not simulation.start.free[:, 2].any()
        before = simulation.diagnostics()["total_energy"]
        simulation.run(until=50_000.0)
        assert simulation.step_count == 1_666_667
        # An orbit of e = 1e-3 at most, in steps of 5e-4 of its angle: leapfrog's error is (ω dt)² e / 12, rounding less.
        assert simulation.diagnostics()["total_energy"] == pytest.approx(before, rel=1e-9)


def test_every_command_of_a_particle_list_comes_over(tmp_path):
    _, scene = import_scene(written(tmp_path, "springs.plist", SPRINGS))
    start = assemble(load_scene(scene))
    np.testing.assert_array_equal(start.position, [[0, 0, 0], [1, 0, 0.25]])
    np.testing.assert_array_equal(start.free, [[False] * 3, [True] * 3])
    assert start.charge[1] == 0.5 and start.springs.stiffness[0] == 50.0 and start.springs.damping[0] == 0.003
    assert start.springs.rest_length[0] == 1.0  # that of rest, not that of the displacement
    assert scene["spring_damping"] == "full"
    assert [next(iter(entry)) for entry in scene["forces"]] == ["uniform_gravity", "linear_drag"]


@pytest.mark.parametrize(("name", "text"), [("planets.txt", PLANETS), ("springs.plist", SPRINGS), ("odd.txt", ODD)])
def test_what_is_written_reads_back_to_the_last_digit(tmp_path, name, text, capsys):
    source, target = written(tmp_path, name, text), tmp_path / "made.yaml"
    assert main(["convert", str(source), str(target), "--json", "-q"]) == 0
    told = json.loads(capsys.readouterr().out)
    direct, again = (assemble(load_scene(each)) for each in (import_scene(source)[1], target))
    assert told["particle_count"] == direct.particle_count and told["spring_count"] == len(direct.springs)
    for key in ("position", "velocity", "mass", "radius", "charge", "free", "color"):
        np.testing.assert_array_equal(getattr(again, key), getattr(direct, key))
    assert again.name == direct.name


def test_numbers_keep_all_their_digits_in_yaml(tmp_path):
    numbers = [1e-05, 1.5e300, 0.1 + 0.2, 2.0**-1022, -3.0, 1e22, 123456789.123456789]
    path = written(tmp_path, "n.yaml", scene_text({"particles": [{"body": {"mass": 1.0, "position": numbers[:3]}}]}))
    import yaml

    assert yaml.safe_load(path.read_text())["particles"][0]["body"]["position"] == numbers[:3]
    assert yaml.safe_load(scene_text({"x": numbers}))["x"] == numbers


SOLAR = """<?xml version="1.0" encoding="ISO-8859-1" ?>
<SolarSystem TimeStep="120">
    <Body Name="Sun" Radius="696342000" Mass="1.98855E30" IsSun="yes" R="255" G="255" B="128" skin="sun.jpg" Scale="50"/>
    <Body Name="J\u00e9" Mass="5.97237E24" XPosition="149598023000" YVelocity="29780" R="0" G="0" Tilt="23.44"/>
</SolarSystem>"""


def test_scales_spins_and_the_light_of_a_solar_system_are_for_the_picture_alone(tmp_path):
    moon = (
        '<Body Name="Moon" Mass="7.342E22" XPosition="149982422000" YVelocity="30802" Radius="1737400" IsMoon="Yes"'
        ' Scale="1000" ScaleDistance="45" Tilt="6.687" RotationPeriod="27.321661"/></SolarSystem>'
    )
    path = tmp_path / "SolarSystem.xml"
    path.write_bytes(SOLAR.replace("</SolarSystem>", moon).encode("latin-1"))
    spec = load_scene(import_scene(path)[1])
    sun, satellite = spec.view.bodies[0, 1], spec.view.bodies[2, 1]
    assert (sun.light, sun.radius_scale, sun.spin) == (BodyLightSpec(), 50.0, None)
    assert (satellite.around, satellite.distance_scale, satellite.radius_scale) == (1, 45.0, 1000.0)
    assert satellite.spin.period == 27.321661 * 86400.0
    np.testing.assert_allclose(satellite.spin.axis, [0.0, np.sin(np.radians(6.687)), np.cos(np.radians(6.687))])
    assert assemble(spec).position[2, 0] == 149982422000.0 and assemble(spec).radius[2] == 1737400.0


def test_a_solar_system_goes_around_once_in_a_year(tmp_path):
    path = tmp_path / "SolarSystem.xml"
    path.write_bytes(SOLAR.encode("latin-1"))
    name, scene = import_scene(path)
    assert name == "solar_system_xml" and scene["integrator"] == {"velocity_verlet": {"dt": 120.0}}
    start = assemble(load_scene(scene))
    assert start.name == ("Sun", "J\u00e9") and start.radius.tolist() == [696342000.0, 0.0]
    np.testing.assert_allclose(start.color, [[1, 1, 128 / 255], [0, 0, 1]], rtol=1e-15)
    x, v, mu = start.position[1, 0], start.velocity[1, 1], 6.67408e-11 * start.mass.sum()
    period = 2 * np.pi * np.sqrt((1 / (2 / x - v * v / mu)) ** 3 / mu)
    assert period == pytest.approx(365.25 * 86400, rel=2e-3)  # mean speed and mean distance, as the file has them


FAULTS = {
    ("q.xml", SOLAR.replace('Mass="5.97237E24"', 'Mass="heavy"')): ":4:5: Mass must be a number, not 'heavy'",
    ("r.xml", SOLAR.replace("<Body", "<Planet", 1)): ":3:5: <Planet> stands where only <Body> may",
    ("s.xml", SOLAR.replace("/>", ">", 1)): ":4:5: <Body> stands where only",
    ("t.xml", SOLAR[:-6]): ":5:1",
    ("u.xml", SOLAR.replace("<Solar", '<!DOCTYPE a [<!ENTITY b "c">]>\n<Solar', 1)): "a document type is not read",
    ("v.xml", "<SolarSystem/>"): "has no <Body>",
    ("w.xml", SOLAR.replace("J\u00e9", "Sun")): ":4:5: two bodies are called 'Sun'",
    ("x.xml", SOLAR.replace('"120"', '"0"')): ":2:1: TimeStep must be above 0",
    ("y.xml", SOLAR.replace(' Mass="5.97237E24"', "")): ":4:5: the body has no Mass",
    ("z.xml", SOLAR.replace('Mass="5.97237E24"', 'Mass="-1"')): ":4:5: Mass must be at least 0, not -1",
    ("aa.xml", SOLAR.replace('Radius="696342000"', 'Radius="-1"')): ":3:5: Radius must be at least 0, not -1",
    ("ab.txt", "1 1e11\n0 0 0 0 -2.5E1 anti.gif"): ":2:9: mass of body 0 must be at least 0, not -25",
    ("ac.plist", "pos 0 0 0 0 -1 0 1 1 1 1"): ":1:13: m must be at least 0, not -1",
    ("a.txt", "5\n2.5e11\n1 2 3 4 five earth.gif"): ":3:9: mass of body 0 must be a number, not 'five'",
    ("b.txt", PLANETS.replace("5\n", "6\n", 1)): ":7:46: the file ends where x of body 5 should follow",
    ("c.txt", "2 1e11\n0 0 0 0 1 2 3 4 5 6"): ":2:11: body 0 has no picture",
    ("d.txt", "0 1"): ":1:1: the number of bodies must be a whole number from 1",
    ("e.txt", "1 -2 0 0 0 0 1 a"): ":1:3: the radius of the universe must be above 0",
    ("f.txt", "nan 1"): ":1:1: the number of bodies must be a whole number from 1",
    ("g.plist", PAPER + "pod 2"): ":13:1: 'pod' is no command, allowed: pos,",
    (
        "h.plist",
        "pos 0 0 0 0 1 0 1 1 1 1\nvel 1 0 0 0",
    ): ":2:5: a particle's number must be a whole number from 0 to 0, not '1'",
    ("i.plist", "pos 1 0 0 0 1 0 1 1 1 1"): ":1:5: particles are numbered from 0 on: 0 comes next, not 1",
    ("j.plist", "pos 0 0 0 0 1 0 1 1 1"): ":1:1: pos has too few values, 9; it takes ID x y z m c r R G B",
    ("k.plist", SPRINGS.replace("sl 0 1 7", "sl 0 1 3")): ":6:8: no type of springs has the number 3",
    ("l.plist", SPRINGS.replace("sl 0 1 7", "sl 1 1 7")): ":6:6: a spring needs two different ends",
    ("m.plist", "# nothing\n"): "the list has no particle",
    ("n.plist", PAPER.replace("dt 0.03", "dt 0")): ":12:4: dt must be above 0",
    ("o.plist", PAPER.replace("k2 2.9584e-4", "k2 1e999")): ":11:4: k2 must be a number, not '1e999'",
    ("p.obj", "v 1 2 3"): "cannot be read, allowed: .yaml, .npz, .plist, .std, .tip, .tipsy, .txt, .xml",
}


@pytest.mark.parametrize(("name", "text"), FAULTS)
def test_what_is_wrong_has_its_place(tmp_path, name, text, capsys):
    path = written(tmp_path, name, text)
    with pytest.raises(SceneError) as error:
        import_scene(path)
    assert FAULTS[name, text] in str(error.value) and str(error.value).startswith(str(path)) and "\n" not in str(error.value)
    assert main(["convert", str(path), str(tmp_path / "out.yaml")]) == 2 and not (tmp_path / "out.yaml").exists()


def test_every_importer_says_what_it_reads():
    assert {"plist", "princeton"} <= set(importers())
    for importer in importers().values():
        assert importer.SUFFIXES and all(suffix.startswith(".") for suffix in importer.SUFFIXES)
        assert not importer.recognises("") and importer.__doc__


def test_files_that_are_no_text_or_not_there_are_told(tmp_path):
    path = tmp_path / "binary.txt"
    path.write_bytes(b"5 \xff\xfe 1")
    assert main(["convert", str(path), str(tmp_path / "a.yaml")]) == 2
    assert main(["convert", str(tmp_path / "none.txt"), str(tmp_path / "a.yaml")]) == 5
    assert main(["convert", str(written(tmp_path, "p.txt", PLANETS)), str(tmp_path / "a.json")]) == 2


def converted(source, target):
    assert main(["convert", str(source), str(target), "-q"]) == 0
    return target


@pytest.mark.parametrize(("name", "text"), [("planets.txt", PLANETS), ("springs.plist", SPRINGS), ("data.plist", PAPER)])
def test_particles_go_round_through_every_format_that_can_hold_them(tmp_path, name, text):
    scene = converted(written(tmp_path, name, text), tmp_path / "scene.yaml")
    start = assemble(load_scene(scene))
    state = Snapshot.load(converted(scene, tmp_path / "state.npz"))
    table = converted(tmp_path / "state.npz", tmp_path / "table.csv")
    read = assemble(load_scene(written(tmp_path, "read.yaml", READ.format(table.name))))
    for found in (state, read):
        for key in ("position", "velocity", "mass", "radius", "charge", "free", "color"):
            np.testing.assert_array_equal(getattr(found, key), getattr(start, key))
        assert found.name == start.name
    if name.endswith(".plist"):
        again = import_scene(converted(scene, tmp_path / "again.plist"))[1]
        first = import_scene(tmp_path / name)[1]
        assert [again.get(key) for key in ("springs", "forces", "integrator")] == [
            first.get(key) for key in ("springs", "forces", "integrator")
        ]
        for key in ("position", "velocity", "free"):
            np.testing.assert_array_equal(getattr(assemble(load_scene(again)), key), getattr(start, key))
    else:
        again = import_scene(converted(tmp_path / "state.npz", tmp_path / "again.txt"))[1]
        np.testing.assert_array_equal(assemble(load_scene(again)).position, start.position)  # five digits hold all of these


READ = "particles: [{{file: {{path: {}}}}}]\nintegrator: {{leapfrog: {{dt: 1}}}}\n"


@pytest.mark.parametrize(
    ("changed", "to", "said"),
    [
        (", -0.5, 0]", ", -0.5, 0.1]", "of the plane z = 0"),
        ("softening: 0", "softening: 0.1", "has no softening"),
        ("rest_length: 1}", "rest_length: 2}", "that between 0 and 1 is not"),
        ("linear_drag", "coulomb", "has no coulomb, only"),
        ("name: left", "name: left one", "no name with white space in it, like 'left one'"),
    ],
)
def test_what_a_format_cannot_hold_is_told(tmp_path, capsys, changed, to, said):
    scene = """
particles:
  - body: {name: left, mass: 1, position: [0, -0.5, 0]}
  - body: {mass: 1, position: [1, -0.5, 0], charge: 1}
springs: [{link: {between: [0, 1], stiffness: 1, rest_length: 1}}]
forces: [{newtonian_gravity: {strength: 1, softening: 0}}, {linear_drag: {coefficient: 1}}]
integrator: {leapfrog: {dt: 0.01}}
"""
    if "coulomb" in to:
        scene = scene.replace("linear_drag: {coefficient: 1}", "coulomb: {}")
    path = written(tmp_path, "scene.yaml", scene.replace(changed, to, 1))
    target = tmp_path / ("out.txt" if "plane" in said or "name" in said else "out.plist")
    assert main(["convert", str(path), str(target)]) == 2 and not target.exists()
    assert said in capsys.readouterr().err
    assert main(["convert", str(path), str(tmp_path / "other.yaml")]) == 2  # of a scene no scene is made


def test_a_state_whose_arrays_are_described_wrongly_is_refused(tmp_path):
    """NumPy reads the description of an array with Python's tokenizer, which has errors of its own."""
    whole, broken, scene = tmp_path / "whole.npz", tmp_path / "broken.npz", tmp_path / "s.yaml"
    end = "integrator:\n  leapfrog: {dt: 0.1}\n"
    scene.write_text("particles:\n  - body: {position: [0, 0, 0], mass: 1}\n" + end, encoding="utf-8")
    assemble(load_scene(scene)).save(whole)
    with zipfile.ZipFile(whole) as given, zipfile.ZipFile(broken, "w") as made:
        for name in given.namelist():
            content = given.read(name)
            made.writestr(name, content.replace(b"}", b"(") if name == "mass.npy" else content)
    with pytest.raises(OutputError, match="not a snapshot"):
        Snapshot.load(broken)
    scene.write_text("particles:\n  - file: {path: broken.npz}\n" + end, encoding="utf-8")
    with pytest.raises(SceneError, match=r"broken.npz"):
        load_scene(scene)
