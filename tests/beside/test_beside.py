"""Two settings of one scene in one film: the same times, the same camera, and the distance between the same particles."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from test_video import decode

import mpp_taichi as mpp
from mpp_taichi.beside.film import ExactMoments
from mpp_taichi.beside.half_frame import MomentReceiver, MomentSender
from mpp_taichi.beside.settings import beside
from mpp_taichi.beside.view import shortened
from mpp_taichi.beside.wire import receive, send
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.right_half import as_texts
from mpp_taichi.start.assemble import assemble
from mpp_taichi.views._base import Frame
from scenes import kepler

ROOT = Path(__file__).parents[2]
DT, DURATION, FRAMES, SIZE = 0.03, 2.0, 8, (130, 96)
FILM = ["--size", f"{SIZE[0]}x{SIZE[1]}", "--fps", "4", "--duration", "2", "--quiet"]
VIEW = {"camera": {"position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0]}, "caption": False, "radius_scale": 10}


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A planet on an ellipse, in an empty working directory; changes are made to the scene."""
    monkeypatch.chdir(tmp_path)

    def write(**changes):
        content = {**kepler(dt=DT), "run": {"duration": DURATION}, "view": VIEW, **changes}
        Path("kepler.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return "kepler.yaml"

    return write


def table(path):
    """The columns of a CSV file."""
    with open(path, encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    return {name: np.array([float(row[number]) for row in rows]) for number, name in enumerate(header)}


def places(*times, **changes):
    """Positions at the ends of plain runs until these times, each from the start, (times, particle_count, 3)."""
    found = []
    with mpp.Simulation({**kepler(dt=DT), **changes}, backend="cpu", precision="f64") as simulation:
        for until in times:
            simulation.restart()
            found.append(simulation.run(until=until).snapshot().position)
    return np.array(found)


# --- what is filmed ---------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_a_film_of_two_methods_and_their_distance_is_that_of_two_plain_runs(scene, capsys):
    words = ["record", scene(), "--beside", "integrator=rk4", "--beside", "dt=0.05", "--backend", "cpu", *FILM]
    files = ["--video", "film.mp4", "--inspect", "d.csv", "--inspect", "d.png", "--snapshot", "end.npz", "--json"]
    assert main([*words, *files]) == 0
    found = json.loads(capsys.readouterr().out)
    right = found["beside"]
    assert (right["integrator"], right["dt"], right["steps"]) == ("rk4", 0.05, 40)
    distance = table("d.csv")
    assert list(distance) == ["time", "rms_distance"]
    times = distance["time"]
    np.testing.assert_allclose(times, DURATION * np.arange(FRAMES) / (FRAMES - 1), rtol=1e-15)
    plain = places(*times)
    apart = plain - places(*times, integrator={"rk4": {"dt": 0.05}})
    expected = np.sqrt(np.sum(apart**2, axis=(1, 2)) / 2)
    # The last, shorter step to a time is as long up to the rounding of the time, which moves a planet by some 1e-16.
    np.testing.assert_allclose(distance["rms_distance"], expected, rtol=0, atol=1e-14)
    assert expected[0] == 0.0 and expected[-1] > 1e-4, "they do go apart"
    assert right["rms_distance"] == distance["rms_distance"][-1]
    assert np.array_equal(mpp.Snapshot.load("end.npz").position, plain[-1]), "the film changes no bit of a run"

    frames = decode(Path("film.mp4"), SIZE).astype(int)
    assert len(frames) == FRAMES and Image.open("d.png").size == (960, 480)
    rows = 40  # of the halves alone
    left, right_half = frames[:, :rows, : SIZE[0] // 2 - 1], frames[:, :rows, SIZE[0] // 2 + 1 :]
    # H.264 keeps colours of four pixels together, and both halves begin at an even column: what is left is its quantisation.
    assert left[0].max() > 200 and np.abs(left - right_half).max() < 80, "the same camera at the same times"
    assert np.abs(left[-1] - left[0]).max() > 100, "and they move"


@pytest.mark.sampled(3)
def test_the_right_half_shows_the_other_setting_and_each_has_its_caption(scene):
    name = scene(run={"duration": 0.5})
    words = ["record", name, "--beside", "forces=[]", "--still", "two.png", "--frames", "film", "--backend", "cpu", *FILM]
    assert main([*words, "--size", "640x360"]) == 0
    picture = np.asarray(Image.open("two.png")).astype(int)
    assert np.array_equal(picture, np.asarray(Image.open(f"film/frame_{FRAMES - 1:06d}.png")))
    earlier = np.asarray(Image.open("film/frame_000002.png")).astype(int)
    assert (np.abs(picture - earlier).max(axis=2) > 60)[240:].sum() > 100, "the curve grows below"
    # The camera is 3 above the plane with a field of 45°; the height of the halves is what the panel and a caption leave.
    letters, panel = 10, round(0.35 * 360)
    rows = 360 - panel - round(letters * 2.0)
    factor = max(1.0, (640 / 360) / (319 / rows))  # the camera takes in what it would in the whole picture
    pixel = 2 * 3 * factor * np.tan(np.radians(22.5)) / rows
    start, end = places(0.0, 0.5)
    straight = places(0.5, forces=[])[0]
    np.testing.assert_allclose(straight[1] - start[1], [0, 0.5 * (1.3 / 0.7) ** 0.5 / 1.001, 0], rtol=1e-12)
    for left, place in ((0, end), (321, straight)):
        half = picture[:rows, left : left + 319].max(axis=2)
        middle = np.array([319 / 2 + place[1][0] / pixel, rows / 2 - place[1][1] / pixel])
        beside = half[round(middle[1]) - 3 : round(middle[1]) + 3, round(middle[0]) - 3 : round(middle[0]) + 3]
        assert beside.max() > 100, "the planet is where its own run is"
        caption = picture[rows : rows + 20, left : left + 319].min(axis=2) > 150
        columns = np.nonzero(caption.any(axis=0))[0]
        assert caption.sum() > 30 and abs(columns.mean() - 159) < 20, "written in the middle below the half"


@pytest.mark.sampled(3)
def test_what_has_merged_on_either_side_is_not_compared(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = {
        "particles": [
            {"body": {"mass": 1, "position": [x, 0, 0], "velocity": [v, 0, 0], "radius": 0.2}}
            for x, v in ((1.0, 1.0), (2.0, 0.0), (9.0, 0.5))
        ],
        "contacts": {"hard_spheres": {"solver": "merging"}},
        "integrator": {"leapfrog": {"dt": 0.05}},
        "run": {"duration": 4},
    }
    Path("three.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    assert main(["record", "three.yaml", "--beside", "dt=0.1", "--still", "a.png", "--inspect", "a.csv", *FILM]) == 0
    # Straight lines, and a merger that keeps the momentum whenever it is found: what is left is where it is but for how late
    # that was, by less than a step at a speed of 1.
    assert table("a.csv")["rms_distance"].max() < 0.1


def test_a_moment_is_put_together_from_what_has_changed():
    snapshot = assemble(load_scene(ROOT / "scenes" / "double_pendulum.yaml"))
    merged = replace(snapshot, merged_into=np.array([-1, -1, 1]), time=0.5, position=snapshot.position + 1.0)
    there = Frame.of(replace(snapshot, time=0.5), title="T")
    stream = io.BytesIO()
    sender, receiver = MomentSender(stream), MomentReceiver()
    frames = (Frame.of(snapshot), there, Frame.of(merged), replace(there, mass=None))
    sizes = []
    for one, frame in zip((snapshot, snapshot, merged, merged), frames):
        before = stream.tell()
        sender.add(one, frame)
        sizes.append(stream.tell() - before)
    assert sizes[1] < 200 < sizes[0], "nothing but the time has changed"
    stream.seek(0)
    for one, frame in zip((snapshot, snapshot, merged, merged), frames):
        found = receiver.moment(*receive(stream))
        assert found.frame.time == frame.time and found.frame.center == frame.center
        for name in ("position", "velocity", "radius", "color", "between", "spring_color", "rest_length", "mass", "outline"):
            sent, got = getattr(frame, name), getattr(found.frame, name)
            assert (sent is None and got is None) or np.array_equal(sent, got, equal_nan=True), name
        assert np.array_equal(found.place, one.position) and np.array_equal(found.present, one.present)


class Kept:
    """Keeps the snapshots of the frames of a film."""

    def __init__(self):
        self.snapshots = []

    def add(self, snapshot, frame):
        self.snapshots.append(snapshot)


BOUNCING = {
    "dimensions": 2,
    "particles": [{"body": {"mass": 1, "position": [1, 1], "velocity": [0.7, 0.4], "radius": 0.2}}],
    "contacts": {"hard_spheres": {"solver": "event_driven"}},
    "walls": [{"box": {"lower": [0, 0], "upper": [2, 2]}}],
    "run": {"duration": DURATION},
}
TIMELINE = [{"at": 0.77, "set": {"integrator.leapfrog.dt": 0.02, "forces.newtonian_gravity.strength": 1.1}}]


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    "content",
    [
        pytest.param(kepler(dt=0.11, integrator="hermite4"), id="a method with memory"),
        pytest.param(kepler(dt=0.11, integrator="bdf2"), id="an implicit method of two steps"),
        pytest.param(kepler(dt=0.3, integrator="adaptive_leapfrog"), id="a method that chooses its steps"),
        pytest.param({**kepler(dt=DT), "timeline": TIMELINE}, id="a timeline"),
        pytest.param(BOUNCING, id="flights between collisions"),
    ],
)
def test_moments_are_the_ends_of_plain_runs_and_change_no_bit(content):
    with mpp.Simulation(content, backend="cpu", precision="f64") as simulation:
        simulation.sample_at_multiples_of(DURATION / (FRAMES - 1))  # as films do
        plain = []
        for number in range(FRAMES):
            simulation.restart()
            plain.append(simulation.run(until=DURATION * number / (FRAMES - 1)).snapshot())
        simulation.restart()
        kept = Kept()
        given = {"moments": [kept], "between": ExactMoments(), "stopwatch": lambda _: nullcontext()}
        film = FilmRecorder(None, (), FRAMES, DURATION, **given)
        simulation.run(until=DURATION, recorders=[film])
        film.finish(simulation)
        end = simulation.snapshot()
    assert np.array_equal(end.position, plain[-1].position) and np.array_equal(end.velocity, plain[-1].velocity)
    for found, expected in zip(kept.snapshots, plain, strict=True):
        # The same steps, but for the last digit of the length of the last one.
        np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=1e-13)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("setting", ["precision=f32", "backend=vulkan"])
def test_another_device_is_another_process_that_says_what_it_is(scene, capsys, setting, request):
    if setting == "backend=vulkan":
        request.getfixturevalue("software_vulkan")
    words = ["record", scene(), "--beside", setting, "--still", "a.png", "--inspect", "a.csv", "--backend", "cpu"]
    assert main([*words, "--json", *FILM]) == 0
    right = json.loads(capsys.readouterr().out)["beside"]
    assert (right["backend"], right["precision"]) == (("vulkan" if "vulkan" in setting else "cpu"), "f32")
    distance = table("a.csv")["rms_distance"]
    # Rounding to 24 bits, at each of 67 steps on an orbit of size 1: not nothing, and no more than steps × ε × a growth of 100.
    assert 1e-9 < distance[-1] < 67 * 2.0**-24 * 100


@pytest.mark.sampled(3)
def test_halves_of_one_motion_have_no_distance_and_a_panel_without_a_curve(scene):
    words = ["record", scene(), "--beside", "threads=1", "--still", "a.png", "--inspect", "a.csv", "--backend", "cpu", *FILM]
    assert main(words) == 0
    assert not table("a.csv")["rms_distance"].any(), "bit for bit the same, also between two steps"


@pytest.mark.sampled(3)
def test_halves_of_different_particles_have_no_panel_and_no_table(scene, capsys):
    words = ["record", scene(), "--beside", "particles=[{body: {mass: 1, position: [0, 0, 0]}}]", "--beside", "forces=[]"]
    assert main([*words, "--still", "a.png", "--size", "128x96", "--fps", "4", "--duration", "1"]) == 0
    assert "note: 2 particles on the left and 1 on the right have no distance to be plotted" in capsys.readouterr().err
    assert main([*words, "--still", "a.png", "--inspect", "a.csv", *FILM]) == 2
    assert capsys.readouterr().err == "--inspect a.csv: 2 particles on the left and 1 on the right have no distance to write\n"


# --- captions ---------------------------------------------------------------------------------------------------------------


def test_captions_say_what_either_half_has(scene):
    left = load_scene(scene(forces=[{"newtonian_gravity": {}}, {"linear_drag": {"coefficient": 0.1}}], constants={"k": 2}))
    said = ["integrator=rk4", "dt=0.1", "forces.linear_drag.coefficient=0.2", "constants.k=3", "backend=vulkan"]
    right = beside(left, said, "kepler.yaml", [])
    assert right.device == {"backend": "vulkan"} and right.scene.integrator.parameters["dt"] == 0.1
    assert right.captions(left, {"backend": "cpu"}, {"backend": "vulkan"}) == (
        ["leapfrog, dt 0.03", "forces.linear_drag.coefficient: 0.1", "constants.k: 2", "backend: cpu"],
        ["rk4, dt 0.1", "forces.linear_drag.coefficient: 0.2", "constants.k: 3", "backend: vulkan"],
    )
    right = beside(left, ["forces=[]", "+springs=[{link: {between: [0, 1], stiffness: 1}}]"], "kepler.yaml", [])
    lines = right.captions(left, {}, {})
    assert lines == (["forces: newtonian_gravity, linear_drag", "springs: none"], ["forces: none", "springs: link"])
    assert shortened("springs none", lambda text: len(text) <= 8) == "springs…"


# --- the scene's own right half ---------------------------------------------------------------------------------------------

OTHER = {"record": {"beside": {"dt": 0.05, "integrator": "rk4"}}}


def test_the_text_of_a_repeat_differs_in_the_right_half():
    body = {"mass": "1 + i", "position": ["i", 0, 0]}
    source = {"particles": [{"repeat": {"count": 3, "body": body}}], "integrator": {"leapfrog": {"dt": 0.1}}}
    left = load_scene(source)
    right = beside(left, ["particles.repeat.body.mass=5", "particles[1].body.radius=0.1"], source, [])
    assert [entry.parameters["mass"] for entry in right.scene.particles] == [5.0, 5.0, 5.0]
    assert right.scene.particles[1].parameters["radius"] == 0.1
    lines = right.captions(left, {}, {})
    assert [found[0] for found in lines] == ["particles.repeat.body.mass: as written", "particles.repeat.body.mass: 5"]
    with pytest.raises(mpp.SceneError) as caught:
        beside(left, ["particles.repeat.body.mass=-i"], source, [])
    assert caught.value.faults[0].startswith(
        "--beside particles.repeat.body.mass=-i (i = 1): particles[1].body.mass: -1 is not"
    )


@pytest.mark.sampled(3)
def test_a_scene_says_itself_what_is_beside_it(scene, capsys):
    words = ["--inspect", "d.csv", "--still", "a.png", "--backend", "cpu", "--json", *FILM]
    assert main(["record", scene(**OTHER), *words]) == 0
    own, first = json.loads(capsys.readouterr().out)["beside"], table("d.csv")["rms_distance"]
    assert main(["record", scene(), *words, "--beside", "integrator=rk4", "--beside", "dt=0.05"]) == 0
    flagged = json.loads(capsys.readouterr().out)["beside"]
    assert np.array_equal(first, table("d.csv")["rms_distance"]) and first[-1] > 1e-4
    assert own == flagged and own["settings"] == ["integrator=rk4", "dt=0.05"], "the method goes before its step"
    assert main(["record", scene(**OTHER), *words, "--beside", "integrator=euler"]) == 0
    won = json.loads(capsys.readouterr().out)["beside"]
    assert (won["settings"], won["integrator"], won["dt"]) == (["integrator=euler"], "euler", DT), "the option alone holds"
    assert main(["record", scene(**OTHER), "--still", "a.png", "--set", "record.beside=", "--backend", "cpu", *FILM]) == 0
    assert main(["record", scene(**OTHER), *words, "--set", "record.beside={}"]) == 2
    assert "has no inspect:, so there are no panels to write" in capsys.readouterr().err, "one picture, as without it"


def test_what_is_beside_takes_devices_lists_and_what_set_takes(scene):
    beside_it = {
        "forces": [],
        "threads": 1,
        "precision": "f32",
        "+springs": [{"link": {"between": [0, 1], "stiffness": "2 * 3"}}],
    }
    left = load_scene(scene(record={"beside": beside_it}))
    right = beside(left, as_texts(left.record.beside), "kepler.yaml", [])
    assert right.device == {"threads": 1, "precision": "f32"} and right.scene.forces == ()
    assert right.scene.springs[0].parameters["stiffness"] == 6.0 and right.scene.record.beside is None
    assert load_scene(right.scene.resolved).record.beside is None, "as the other process reads it"


def test_a_page_holds_one_run_whatever_is_beside_it(scene, capsys):
    assert (
        main(["record", scene(**OTHER), "--html", "a.html", *[word for word in FILM if word != "--quiet"], "--steps", "5"]) == 0
    )
    assert "note: --html a.html holds one run: record.beside is left out" in capsys.readouterr().err
    assert Path("a.html").exists()


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("said", "fault"),
    [
        ("{integrator: rk5}", "2:24: integrator.rk5: unknown integrator 'rk5', did you mean 'rk4'? "),
        ("{dt: fast}", "2:16: integrator.leapfrog.dt: unknown name 'fast'"),
        (
            "{integrator: rk4, dt: -1}",
            "2:33: integrator.rk4.dt: -1 is not allowed, must be above 0 (in the right half, record.beside)",
        ),
        ("{dt: 0.05, threads: 0}", "2:31: record.beside.threads: must be a whole number from 1 on"),
        ("{backend: opencl}", "2:21: record.beside.backend: 'opencl' is none of auto, cpu, cuda, vulkan, metal"),
        ("{view.trails: 3}", "2:25: record.beside.view.trails: both halves have the same view"),
        ("{forces.coulomb.softening: 3}", "2:38: forces has no entry 'coulomb'"),
        ("{a b..c: 3}", "2:12: record.beside.a b..c: 'a b..c' is no path"),
        ("rk4", "2:11: record.beside: must be a mapping of paths to values, not 'rk4'"),
    ],
)
def test_what_the_scenes_right_half_cannot_be_is_told_at_its_place(scene, capsys, said, fault):
    name = scene()
    text = Path(name).read_text(encoding="utf-8")
    Path(name).write_text(f"record:\n  beside: {said}\n{text}", encoding="utf-8")
    for command in (["record", name, "--still", "a.png", *FILM], ["run", name, "--headless", "--dry-run"]):
        assert main(command) == 2
        first = capsys.readouterr().err.splitlines()[0]
        assert first.removeprefix("error: ").startswith(f"{name}:{fault}"), first


# --- errors -----------------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("setting", "code", "message"),
    [
        ("integrator=rk5", 2, "--beside integrator=rk5: integrator.rk5: unknown integrator 'rk5', did you mean 'rk4'?"),
        ("dt=fast", 2, "--beside dt=fast: integrator.leapfrog.dt: unknown name 'fast'"),
        ("speed", 2, "--beside speed: must be path=value, as in integrator=rk4"),
        ("view.trails=3", 2, "--beside view.trails=3: both halves have the same view: set it with --set"),
        ("backend=opencl", 2, "--beside backend=opencl: 'opencl' is none of auto, cpu, cuda, vulkan, metal"),
        ("threads=0", 2, "--beside threads=0: must be a whole number from 1 on"),
        ("backend=metal", 3, "the right half (backend=metal): backend metal does not start here"),
    ],
)
def test_what_the_right_half_cannot_be_is_one_line(scene, capsys, setting, code, message):
    if setting == "backend=metal" and sys.platform == "darwin":
        pytest.skip("it starts there")
    assert main(["record", scene(), "--beside", setting, "--still", "a.png", *FILM]) == code
    said = capsys.readouterr().err
    assert said.startswith(message) and said.count("\n") == 1 and not Path("a.png").exists()


def test_a_page_of_two_runs_is_refused(scene, capsys):
    assert main(["record", scene(), "--beside", "dt=0.01", "--html", "a.html", *FILM]) == 2
    assert "--html a.html holds one run" in capsys.readouterr().err


@pytest.mark.sampled(3)
def test_a_right_half_that_blows_up_leaves_the_film_until_then_and_one_line(tmp_path, monkeypatch, capsys):
    """ω dt = 4: each step of leapfrog multiplies the displacement by 14, and f32 ends at 3e38, after 34 steps."""
    monkeypatch.chdir(tmp_path)
    content = {
        "particles": [
            {"body": {"mass": 1, "position": [0, 0, 0], "free": False}},
            {"body": {"mass": 1, "position": [1, 0, 0], "displacement": [0.1, 0, 0]}},
        ],
        "springs": [{"link": {"between": [0, 1], "stiffness": 4}}],
        "integrator": {"leapfrog": {"dt": 0.02}},
        "run": {"duration": 140},
    }
    Path("spring.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    words = ["record", "spring.yaml", "--beside", "dt=2", "--beside", "precision=f32", "--force", "--video", "a.mp4"]
    assert main([*words, "--inspect", "a.csv", "--backend", "cpu", *FILM]) == 4
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("warning: ")]
    assert len(said) == 1 and said[0].startswith("error: the right half (dt=2, precision=f32): "), said
    count = len(table("a.csv")["time"])
    assert 2 <= count <= FRAMES // 2 + 1, "34 of 70 steps"
    assert len(decode(Path("a.mp4"), SIZE)) == count


@pytest.mark.sampled(3)
def test_what_is_found_in_the_right_half_is_told_once_as_a_warning_of_it(scene, capsys):
    """In f32, steps of 3·10⁻⁵ are lost beside a place of 10⁵, whose last bit is 0.008; the left half keeps them."""
    content = {"particles": [{"body": {"mass": 1, "position": [1e5, 0, 0], "velocity": [1e-3, 0, 0]}}], "forces": []}
    content["move_to_center_of_mass"] = False
    camera = {"position": [1e5, 0, 3], "look_at": [1e5, 0, 0], "up": [0, 1, 0]}
    words = ["record", scene(**content, view=VIEW | {"camera": camera}), "--beside", "precision=f32", "--precision", "f64"]
    assert main([*words, "--video", "a.mp4", "--backend", "cpu", *FILM]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert len(said) == 1 and said[0].startswith("warning: the right half (precision=f32): "), said


def children(process):
    """Numbers of a process's own children."""
    return [int(number) for number in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def is_right_half(number):
    """Whether a process is the worker of a film of two."""
    try:
        return "mpp_taichi.beside.worker" in Path(f"/proc/{number}/cmdline").read_text()
    except FileNotFoundError:
        return False


@pytest.mark.sampled(2)
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are looked up in /proc")
@pytest.mark.parametrize("end", ["interrupt", "death of the right half"])
def test_both_halves_end_together(scene, end):
    name = scene(run={"duration": 1e5})
    command = [sys.executable, "-m", "mpp_taichi", "record", name, "--beside", "dt=0.02", "--frames", "film"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [*command, "--size", "64x48", "--duration", "1000"], stderr=subprocess.PIPE, text=True, env=environment
    )
    deadline = time.monotonic() + 60
    while (
        not Path("film/frame_000000.png").exists() and time.monotonic() < deadline
    ):  # whole, and not the picture that is written
        time.sleep(0.1)
    (right,) = [number for number in children(process) if is_right_half(number)]
    os.kill(*((process.pid, signal.SIGINT) if end == "interrupt" else (right, signal.SIGKILL)))
    _, said = process.communicate(timeout=60)
    assert "Traceback" not in said
    if end == "interrupt":
        assert process.returncode == 130 and Path("out/kepler.interrupted.npz").exists()
    else:
        assert process.returncode == 1
        assert "error: the right half (dt=0.02): its process ended with status -9" in said
    assert not is_right_half(right)
    Image.open("film/frame_000000.png").load()


def test_what_is_cut_off_in_a_pipe_is_no_message():
    stream = io.BytesIO()
    given = {"a": np.arange(6.0).reshape(2, 3), "none": np.zeros((0, 3)), "flags": np.array([True, False])}
    send(stream, {"kind": "moment", "time": 0.1}, given)
    whole = stream.getvalue()
    words, arrays = receive(io.BytesIO(whole))
    assert words == {"kind": "moment", "time": 0.1} and arrays.keys() == given.keys()
    assert all(np.array_equal(arrays[name], given[name]) and arrays[name].dtype == given[name].dtype for name in given)
    for length in (0, 5, len(whole) - 1):
        assert receive(io.BytesIO(whole[:length])) is None
    assert receive(io.BytesIO(b"Taichi says hello\n")) is None
