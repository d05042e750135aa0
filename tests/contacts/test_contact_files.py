"""Files of runs with contacts, and the messages where a file cannot be written."""

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import CameraSpec
from mpp_taichi.start.assemble import assemble
from mpp_taichi.start.contact_setup import enclosure_of
from mpp_taichi.start.overlaps import surface_depth
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.wall_outline import outline_of

GAS = {
    "dimensions": 2,
    "particles": [{"gas": {"count": 40, "lower": [0, 0], "upper": [3, 2], "radius": 0.1, "speed": 1.0}}],
    "contacts": {"hard_spheres": {"solver": "event_driven"}},
    "walls": [{"box": {"lower": [0, 0], "upper": [3, 2]}}],
    "run": {"duration": 1.0},
    "record": {"size": [160, 120], "seconds": 0.5},
}


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(**changes):
        (tmp_path / "gas.yaml").write_text(yaml.safe_dump(GAS | changes))
        return "gas.yaml"

    return write


@pytest.mark.sampled(3)
def test_collisions_speeds_and_frames_are_written(scene):
    arguments = [
        "record",
        scene(),
        "--frames",
        "frames",
        "--events",
        "events.csv",
        "--speeds",
        "speeds.npz",
        "--backend",
        "cpu",
    ]
    assert main([*arguments, "--snapshot", "end.npz", "--quiet"]) == 0
    with open("events.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    times = np.array([float(row["time"]) for row in rows])
    assert len(rows) > 20 and (np.diff(times) >= 0.0).all() and 0.0 <= times[0] and times[-1] <= 1.0
    assert {row["surface"] for row in rows} <= {
        "",
        *(f"walls[0].box, {side} {axis}" for side in ("lower", "upper") for axis in "xy"),
    }
    assert np.load("speeds.npz")["density"].sum() > 0.0
    assert len(list(Path("frames").iterdir())) == 15


def test_only_event_driven_contacts_keep_a_log(scene, capsys):
    swept = scene(contacts={"hard_spheres": {"solver": "swept"}}, integrator={"leapfrog": {"dt": 0.01}})
    assert main(["run", swept, "--headless", "--events", "events.csv", "--backend", "cpu"]) == 2
    assert "swept keeps no log of events, allowed: event_driven" in capsys.readouterr().err
    assert main(["run", swept, "--headless", "--events", "events.png"]) == 2


@pytest.mark.sampled(3)
def test_a_collapse_ends_the_run_with_the_particles_named(scene, capsys):
    """With e below 7 − 4√3 three balls meet ever faster until time stands still: McNamara & Young, Phys. Fluids A 4 (1992)."""
    balls = [
        {"body": {"name": name, "mass": 1, "radius": 0.1, "position": [x, 0], "velocity": [v, 0]}}
        for name, x, v in (("left", 0.0, 1.0), ("middle", 0.3, 0.0), ("right", 0.6, -1.0))
    ]
    contacts = {"hard_spheres": {"solver": "event_driven", "restitution": 0.05}}
    assert main(["run", scene(particles=balls, contacts=contacts, walls=[]), "--headless", "--backend", "cpu"]) == 4
    told = capsys.readouterr().err
    assert "inelastic collapse at time 0.1" in told and "('middle')" in told and "give contacts a contact_time" in told


@pytest.mark.sampled(3)
def test_a_piston_that_crushes_its_gas_ends_the_run_instead_of_hanging(scene, capsys):
    walls = [{"box": {"lower": [0, 0], "upper": [3, 2]}}, {"plane": {"point": [0, 2], "normal": [0, -1], "velocity": [0, -1]}}]
    contacts = {"hard_spheres": {"solver": "event_driven", "event_limit": 100_000}}
    assert main(["run", scene(walls=walls, contacts=contacts, run={"duration": 3}), "--headless", "--backend", "cpu"]) == 4
    assert "spheres are crushed" in capsys.readouterr().err


WALLS = [
    {"box": {"lower": [-1, -2, 0], "upper": [1, 1, 3]}},
    {"plane": {"point": [0, 0, -1], "normal": [0, 3, 4], "velocity": [0, 0.5, 0]}},
    {"cylinder": {"point": [1, 0, 0], "axis": [0, 1, 1], "radius": 4}},
    {"sphere": {"center": [0, 1, 0], "radius": 5}},
    {"segment": {"from": [1, 2, 0], "to": [-3, 1, 0], "velocity": [0, 0.5, 0]}},
    {"polygon": {"points": [[1, 2, 0], [-3, 1, 0], [0, -2, 0]]}},
]


@pytest.mark.parametrize("dimensions", [2, 3])
def test_outlines_lie_on_the_walls_and_move_with_them(dimensions):
    flat = dimensions == 2
    walls = [
        {"box": {"lower": [-1, -2], "upper": [1, 1]}},
        {"plane": {"point": [0, -9], "normal": [0, 1], "velocity": [0, 0.5]}},
    ]
    walls += [{"cylinder": {"point": [1, 0], "radius": 4}}, {"sphere": {"center": [0, 1], "radius": 5}}]
    walls += [{"segment": {"from": [1, 2], "to": [-3, 1], "velocity": [0, 0.5]}}]
    walls += [{"polygon": {"points": [[1, 2], [-3, 1], [0, -2]]}}]
    for wall in walls if flat else WALLS:
        spec = load_scene(
            GAS
            | {"dimensions": dimensions, "walls": [wall], "particles": [{"body": {"mass": 1, "position": [0] * dimensions}}]}
        )
        outline = outline_of(spec, np.zeros((1, 3)))
        for time in (0.0, 2.0):
            points = outline.at(time).reshape(-1, 3)
            depths = [surface_depth(each, points, np.zeros(len(points)), time)[0] for each in enclosure_of(spec).surfaces]
            assert len(points) >= 2 and np.abs(depths).min(axis=0).max() < 1e-12
        sides = {"box": 4 if flat else 12, "segment": 1 if flat else 4, "polygon": 3 if flat else 12}
        corners = 2 * sides.get(next(iter(wall)), len(points) // 2)
        assert len(points) == corners


BALL = {"body": {"mass": 1, "radius": 0.1, "position": [0, 0, 0]}}
TURNED = [
    {"plane": {"point": [0, -9, 0], "normal": [0, 3, 4]}},
    {"box": {"lower": [-1, -2, -3], "upper": [1, 1, 1]}},
    {"cylinder": {"point": [1, 0, 0], "axis": [1, 2, 2], "radius": 4}},
    {"sphere": {"center": [0, 1, 0], "radius": 5}},
    {"segment": {"from": [1, 2, 0], "to": [-3, 1, 0]}},
    {"polygon": {"points": [[1, 2, 0], [-3, 1, 0], [0, -2, 0]]}},
]


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("wall", TURNED, ids=[next(iter(each)) for each in TURNED])
def test_the_way_out_of_a_wall_is_the_way_on_which_its_depth_falls(wall, turns):
    """By differences over ±h, with h² times the curvature as their error, and the rounding of a depth of about 10 over h."""
    (kind, given), h, time = *wall.items(), 1e-5, 0.7
    more = {"turning": {"angle": "0.5 * t", "about": [0.5, -0.25, 0]}} if turns else {}
    solver = {"contacts": {"hard_spheres": {"solver": "swept"}}, "integrator": {"leapfrog": {"dt": 0.1}}}
    scene = GAS | solver | {"dimensions": 3, "walls": [{kind: given | more}], "particles": [BALL]}
    walls = enclosure_of(load_scene(scene)).surfaces
    place, radius = np.random.default_rng(5).uniform(-3.0, 3.0, (20, 3)), np.linspace(0.0, 1.0, 20)
    assert walls and all((surface.turning is not None) == turns for surface in walls)
    for surface in walls:
        depth, outward = surface_depth(surface, place, radius, time)
        assert depth.shape == (20,) and outward.shape == (20, 3)
        shifted = [[surface_depth(surface, place + side * h * axis, radius, time)[0] for side in (1, -1)] for axis in np.eye(3)]
        slope = np.stack([(after - before) / (2.0 * h) for after, before in shifted], axis=1)
        assert np.abs(slope + outward).max() < 1e-8


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_walls_fill_the_picture_and_all_of_them_is_seen(projection):
    spec = load_scene(GAS)
    start = assemble(spec)
    frame = Frame.of(start, walls=outline_of(spec, start.position))
    camera = Camera(CameraSpec(projection=projection), frame, aspect=16 / 9, dimensions=2)
    right, up, depth = camera.view(frame.outline.reshape(-1, 3)).T
    half = camera.height / 2 if projection == "orthographic" else depth * np.tan(np.radians(camera.field_of_view) / 2)
    assert 0.85 < max(np.abs(up / half).max(), np.abs(right / half).max() * 9 / 16) < 1.0


def test_pictures_show_the_copy_inside_a_box_that_repeats():
    spec = load_scene(GAS | {"walls": [{"periodic_box": {"lower": [1, 0], "upper": [4, 2], "axes": [True, False]}}]})
    shown = outline_of(spec, np.zeros((1, 3))).inside(np.array([[0.5, 5.0, 0.0], [4.5, -1.0, 0.0], [2.0, 1.0, 0.0]]))
    assert shown == pytest.approx(np.array([[3.5, 5.0, 0.0], [1.5, -1.0, 0.0], [2.0, 1.0, 0.0]]))
