"""The key `functions`: curves through points of a scene or of a file, and each fault in one located line."""

import json

import jsonschema
import numpy as np
import pytest
from told_faults import told

from mpp_taichi import Simulation, resume
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.schema import scene_schema

TEXT = """\
constants: {{T: 2}}
functions:
  f: {function}
particles:
  - body: {{mass: 1, name: hand, path: ["{formula}", "0", "0"]}}
  - body: {{mass: 1, name: ball, position: [0, 1, 0]}}
springs:
  - link: {{between: [hand, ball], stiffness: 2}}
integrator: {{leapfrog: {{dt: 0.01}}}}
run: {{duration: 2}}
"""
CURVE = "{points: [[0, 0], [1, 0.5], [T, 0]]}"


def written(tmp_path, function=CURVE, formula="f(t)"):
    file = tmp_path / "scene.yaml"
    file.write_text(TEXT.format(function=function, formula=formula))
    return str(file)


@pytest.mark.parametrize(
    ("function", "place", "message"),
    [
        ("{points: [[0, 0]]}", "3:15: functions.f", "has 1 points, allowed: 2 to 100000"),
        ("{points: []}", "3:15: functions.f", "has 0 points"),
        ("{points: [[0, 0], [1, 1], [1, 2]]}", "3:15: functions.f", "x = 1 of point 2 follows 1"),
        ("{points: [[0, 0], [2, 1], [1, 2]]}", "3:15: functions.f", "x must ascend"),
        ("{points: [[0, 0], [1, 1]], repeats: true}", "3:15: functions.f", "must end with the y that it begins with, 0, not"),
        ("{points: [[0, 0], [1, 1]], file: a.csv}", "3:39: functions.f.file", "there is no file 'a.csv' beside the scene"),
        ("{file: ../a.csv}", "3:13: functions.f.file", "outside the scene's folder"),
        ("{}", "3:3: functions.f", "must have points or a file"),
        ("{points: [[0, 0], [1, 1]], columns: [a, b]}", "3:15: functions.f", "columns are those of a file"),
        ("{points: [[0, 0], [1]]}", "3:24: functions.f.points[1]", "must be a list of 2 numbers"),
        ("{points: [[0, 0], [1, S]]}", "3:28: functions.f.points[1][1]", "unknown name 'S'"),
        ("{points: 5}", "3:15: functions.f.points", "must be a list of points [x, y], not 5"),
        ("{points: [[0, 0], [1.0e-300, 1]]}", "3:15: functions.f", "for a curve with finite slopes"),
        ("{pointz: [[0, 0], [1, 1]]}", "3:7: functions.f.pointz", "did you mean 'points'"),
        ("5", "3:6: functions.f", "must"),
    ],
)
def test_a_function_at_fault_is_told_once_with_its_place(tmp_path, function, place, message):
    (fault,) = told(written(tmp_path, function))
    assert fault.startswith(place) and message in fault


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("g(t)", "unknown function 'g'"),
        ("f", "f is a function, write f(…)"),
        ("f(t, t)", "f takes 1 number(s), not 2"),
        ("f()", "f takes 1 number(s), not 0"),
        ("f(5)", "'f(5)': not a number, for the points of f reach from 0 to 2"),
        ("f(2*t)", "x is no finite number at t = 1.002, must be one at all times; the points of f reach from 0 to 2"),
        ("f(x)", "unknown name 'x'"),
    ],
)
def test_a_formula_that_calls_it_wrongly_is_told(tmp_path, formula, message):
    (fault,) = told(written(tmp_path, formula=formula))
    assert fault.startswith("5:") and message in fault


@pytest.mark.parametrize("name", ["sin", "pi", "T", "2f", "for"])
def test_a_name_with_a_meaning_is_refused(tmp_path, name):
    file = tmp_path / "scene.yaml"
    file.write_text(TEXT.format(function=CURVE, formula="0").replace("  f:", f"  {name}:"))
    (fault,) = told(str(file))
    assert fault.startswith("3:3: functions") and "name" in fault


@pytest.mark.parametrize(
    ("text", "given", "message"),
    [
        ("", "", "a.csv: is empty"),
        ("t,x\n0,0\n1,hello\n", "", "a.csv: line 3: 'hello' is not a finite number"),
        ("t,x\n0,0\n1,nan\n", "", "a.csv: line 3: 'nan' is not a finite number"),
        ("t,x\n0,0\n1\n", "", "a.csv: line 3 has 1 entries, the header 2"),
        ("t,x,y\n0,0,1\n1,1,1\n", "", "a.csv: has 3 columns, t, x, y; say with columns: which two are x and y"),
        ("t,x,y\n0,0,1\n1,1,1\n", ", columns: [t, z]", "a.csv: has no single column 'z', found: t, x, y"),
        ("t,x\n0,0\n", "", "has 1 points"),
        ("t,x\n1,0\n0,1\n", "", "x must ascend"),
    ],
)
def test_a_file_at_fault_is_told_with_its_line(tmp_path, text, given, message):
    (tmp_path / "a.csv").write_text(text)
    (fault,) = told(written(tmp_path, f"{{file: a.csv{given}}}"))
    assert fault.startswith("3:13: functions.f") and message in fault


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ("t,x\n0,0\n1,0.5\n2,0\n", ""),
        ("0,0\n1,0.5\n2,0\n", ""),
        ("# measured by hand\n\nt, y, x\n0, 9, 0\n1, 9, 0.5\n2, 9, 0\n", ", columns: [t, x]"),
        ("\ufefft,x\r\n0,0\r\n1,5e-1\r\n2,0\r\n", ""),
    ],
)
def test_a_file_gives_the_same_motion_as_its_points(tmp_path, text, given):
    (tmp_path / "a.csv").write_text(text, encoding="utf-8", newline="")
    ends = []
    for function in (f"{{file: a.csv{given}}}", CURVE):
        with Simulation(written(tmp_path, function), backend="cpu") as simulation:
            ends.append(simulation.run().snapshot().position)
    assert np.array_equal(*ends) and abs(ends[0][1, 0]) > 0.01


def test_a_run_goes_on_with_the_points_that_it_began_with(tmp_path):
    """The archive holds the points, whatever becomes of the file."""
    table = "t,x\n0,0\n1,0.5\n2,0\n"
    (tmp_path / "a.csv").write_text(table)
    scene = written(tmp_path, "{file: a.csv}")
    with Simulation(scene, backend="cpu") as simulation:
        simulation.checkpoint(tmp_path / "run.archive", every=1000.0)
        simulation.run(steps=50)
        assert simulation.spec.resolved["functions"]["f"] == {"points": [[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]]}
    (tmp_path / "a.csv").write_text(table.replace("0.5", "0.9"))
    with resume(tmp_path / "run.archive") as simulation:
        end = simulation.run(steps=50).snapshot().position
    (tmp_path / "a.csv").write_text(table)
    with Simulation(scene, backend="cpu") as simulation:
        assert np.array_equal(simulation.run(steps=100).snapshot().position, end)


def test_a_function_that_no_formula_calls_changes_nothing(tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(TEXT.format(function=CURVE, formula="0.3*t"))
    text = file.read_text()
    with Simulation(str(file), backend="cpu") as simulation:
        with_function = simulation.run().snapshot().position
    file.write_text(text.replace(f"functions:\n  f: {CURVE}\n", ""))
    with Simulation(str(file), backend="cpu") as simulation:
        assert np.array_equal(with_function, simulation.run().snapshot().position)


def test_points_may_be_set_from_the_command_line_and_functions_added(tmp_path):
    scene = written(tmp_path)
    changed = load_scene(scene, overrides=["functions.f.points[1][1]=0.7"])
    (_number, hand), *_ = changed.driven_entries
    assert hand.parameters["path"][0].constants["f"].y.tolist() == [0.0, 0.7, 0.0]
    added = load_scene(scene, overrides=["+functions.g={points: [[0, 1], [2, 3]]}", 'particles[0].body.path=["g(t)", 0, 0]'])
    (_number, hand), *_ = added.driven_entries
    assert hand.parameters["path"][0].constants["g"].at(1.0) == 2.0


def test_the_schema_knows_functions(tmp_path):
    schema = json.loads(json.dumps(scene_schema()))
    scene = load_scene(written(tmp_path)).resolved
    jsonschema.validate(scene, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**scene, "functions": {"f": {"pointz": []}}}, schema)
