"""The columns of a table that a scene names hold the quantities of panels and particles."""

import csv

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.table import TableRecorder, asked_columns
from mpp_taichi.scene.load import load_scene
from scenes import kepler

SCENE = """
particles:
  - body: {name: sun, mass: 1, position: [0, 0, 0], velocity: [0, 0, 0]}
  - body: {name: earth, mass: 1.0e-3, position: [1, 0, 0], velocity: [0, 1, 0]}
forces: [{newtonian_gravity: {strength: 1}}]
integrator: {leapfrog: {dt: 0.01}}
run: {steps: 40, every: 10}
record: {table: {columns: [time, {position: {of: earth, axis: x}}, total_energy, {distance: {between: [sun, earth]}}, time]}}
"""


def test_a_table_has_the_columns_that_the_scene_names(tmp_path):
    scene, found = tmp_path / "orbit.yaml", tmp_path / "orbit.csv"
    scene.write_text(SCENE)
    assert main(["run", str(scene), "--headless", "--backend", "cpu", "--quiet", "--diagnostics", str(found)]) == 0
    with open(found, encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    assert header == ["time", "x_of_earth", "total_energy", "distance_of_sun_to_earth"]
    table = np.array(rows, float)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for row in table:
            simulation.run(until=row[0])
            position = simulation.snapshot().position
            expected = [
                row[0],
                position[1, 0],
                simulation.diagnostics()["total_energy"],
                np.linalg.norm(position[1] - position[0]),
            ]
            assert row.tolist() == expected
    assert len(table) == 5


def test_the_columns_of_every_table_are_the_quantities_of_the_same_names():
    axes = [(name, axis) for name in ("momentum", "angular_momentum") for axis in "xyz"]
    plain = ("time", "kinetic_energy", "potential_energy", "total_energy", "relative_energy_error")
    asked = [*plain, *({name: {"axis": axis}} for name, axis in axes)]
    scene = {**kepler(0.3), "record": {"table": {"columns": asked}}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        table = TableRecorder(5, asked_columns(simulation))
        simulation.run(steps=40, recorders=[table])
    measured = np.array([row["asked"] for row in table.rows])
    fixed = [[row[name] for name in plain] + [row[name]["xyz".index(axis)] for name, axis in axes] for row in table.rows]
    assert measured.tolist() == np.array(fixed).tolist()
    assert np.ptp(measured[:, 4]) > 0.0


def test_a_table_without_named_columns_measures_no_quantity():
    with Simulation(kepler(0.3), backend="cpu", precision="f64") as simulation:
        assert asked_columns(simulation) is None
        table = TableRecorder(1)
        table.record(simulation)
        assert "momentum_error" in table.columns() and "asked" not in table.rows[0]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ("[tiem]", r"scene.yaml:7:28: record.table.columns\[0\]: unknown quantity 'tiem', did you mean 'time'"),
        (
            "[{position: {of: moon, axis: x}}]",
            r"yaml:7:44: record.table.columns\[0\].position.of: no particle is called",
        ),
        ("[]", r"scene.yaml:7:27: record.table.columns: must be a list with one entry at least"),
    ],
)
def test_a_wrong_column_is_refused_at_its_place(tmp_path, columns, message):
    path = tmp_path / "scene.yaml"
    lines = SCENE.strip().splitlines()
    path.write_text("\n".join([*lines[:-1], f"record: {{table: {{columns: {columns}}}}}"]) + "\n")
    with pytest.raises(SceneError, match=message):
        load_scene(path)


def test_a_column_that_the_scene_cannot_have_is_refused_before_the_run(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("[time, {position", "[spring_length, {position"))
    with Simulation(path, backend="cpu") as simulation:
        with pytest.raises(SceneError, match=r"scene.yaml:8:28: record.table.columns\[0\].spring_length: there is no spring"):
            asked_columns(simulation)


@pytest.mark.sampled(3)
def test_the_header_has_units_where_the_scene_asks_for_them(tmp_path):
    columns = "[time, {position: {of: earth, axis: x}}, total_energy, {speed: {of: earth}}, relative_energy_error]"
    lines = SCENE.replace("{strength: 1}", "{}").strip().splitlines()
    text = "\n".join([*lines[:-1], f"record: {{table: {{columns: {columns}, units: true}}}}"])
    scene, found = tmp_path / "orbit.yaml", tmp_path / "orbit.csv"
    scene.write_text("units: {length: AU, time: day, mass: Msun}\n" + text)
    assert main(["run", str(scene), "--headless", "--backend", "cpu", "--quiet", "--diagnostics", str(found)]) == 0
    header = found.read_text(encoding="utf-8").splitlines()[0].split(",")
    energy = "total_energy [Msun AU²/day²]"
    assert header == ["time [day]", "x_of_earth [AU]", energy, "speed_of_earth [AU/day]", "relative_energy_error"]
    scene.write_text(text)
    with (
        Simulation(scene, backend="cpu") as simulation,
        pytest.raises(SceneError, match=r"yaml:7:10: record.table.units: the scene names no"),
    ):
        asked_columns(simulation)
