"""The HTML page of a run: its data equal the run to a stated bound, and a browser draws them at the right places."""

import io
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from html_pages import read_page
from PIL import Image

from mpp_taichi.cli.main import main
from mpp_taichi.recorders._column_code import encode, grid_step
from mpp_taichi.recorders.html import HtmlRecorder
from mpp_taichi.scene.load import load_scene
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera

ROOT = Path(__file__).parents[2]

SCENE = {
    "title": "Three </script> & a spring",
    "particles": [{"body": {"mass": 1.0, "position": [0, 0, 0]}}],
    "integrator": {"leapfrog": {"dt": 0.1}},
    "run": {"duration": 1.0},
    "view": {"camera": {"position": [0, -8, 3], "look_at": [0, 0, 0]}, "background": [0, 0, 0], "trails": 3},
}
SIZE = (640, 360)
COLORS = np.eye(3)


def recorded(path, frames, scene=SCENE, names=(), rows=(), size=SIZE):
    """The page of these frames, and the page read back."""
    with HtmlRecorder(path, size, 30.0) as recorder:
        recorder.begin(load_scene(scene), names, rows, len(frames))
        for frame in frames:
            recorder.add(frame)
    return read_page(path)


def balls(count=40):
    """Three balls on circles and a fourth that grows and is gone after half of the time; a spring, then two."""
    frames = []
    for k in range(count):
        angle = 0.1 * k + np.array([0.0, 2.0, 4.0])
        place = np.stack([1.5 * np.cos(angle), 1.5 * np.sin(angle), 0.8 * np.sin(2 * angle)], axis=1)
        gone = k >= count // 2
        frames.append(
            Frame(
                position=np.vstack([place, np.full(3, np.nan) if gone else [0.3, 0.1 * k, 0.0]]),
                radius=np.array([0.12, 0.12, 0.12, 0.0 if gone else 0.1 + 0.001 * k]),
                color=np.vstack([COLORS, [0.7, 0.7, 0.7]]),
                between=np.array([[0, 1]] if k < 10 else [[0, 1], [1, 2]], np.int32),
                spring_color=np.full((1 if k < 10 else 2, 3), 0.2 + 0.01 * k),
                time=0.25 * k,
                velocity=np.vstack([np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1), [0.0, 0.4, 0.0]]),
                outline=np.array([[[-2.0, -2, 0], [2, -2, 0]]]) + [[[0, 0.01 * k, 0]]],
            )
        )
    return frames


@pytest.mark.parametrize("byte_count", [1, 2, 3])
def test_a_column_is_within_half_a_step(byte_count):
    random = np.random.default_rng(1)
    values = np.cumsum(random.normal(size=(60, 9)), axis=0) * 10.0 ** np.arange(-4, 5) + 1e3
    values[:, 1] = 7.25  # stays
    values[30:, 2] = np.nan  # goes
    values[:, 3] = np.nan  # never was
    values[::2, 4] = np.inf  # comes and goes
    values[:, 5] = np.where(np.arange(60) % 2, 1e9, -1e9)  # jumps over the whole range
    column = encode("a", values, byte_count)
    assert len(column.planes) == byte_count * values.size
    decoded = _decoded(column, 60)
    seen = np.isfinite(values)
    np.testing.assert_array_equal(np.isfinite(decoded), seen)
    # Half a step, and the roundings of float64: of the share, the product and the sum, each 2⁻⁵³ of what is no more than the
    # largest value and the range.
    bound = column.step / 2 + 2.0**-51 * np.nanmax(np.abs(np.where(seen, values, np.nan)), axis=0, initial=0.0, where=seen)
    assert (np.abs(decoded - values)[seen] <= np.broadcast_to(bound, values.shape)[seen]).all()
    assert column.step[1] == 0.0 and (decoded[:, 1] == 7.25).all()


def _decoded(column, frames):
    """By whole numbers of Python, apart from the reader of pages."""
    entries, bits = len(column.origin), 8 * column.byte_count
    planes = np.frombuffer(column.planes, np.uint8).reshape(column.byte_count, frames, entries)
    found = np.empty((frames, entries))
    for i in range(entries):
        codes = [sum(int(planes[b, k, i]) << 8 * b for b in range(column.byte_count)) for k in range(frames)]
        codes = [-(code + 1) // 2 if code & 1 else code // 2 for code in codes]
        for _ in range(column.order):
            codes = [sum(codes[: k + 1]) for k in range(frames)]
        codes = [code % (1 << bits) for code in codes]
        found[:, i] = [math.nan if code == (1 << bits) - 1 else column.origin[i] + column.step[i] * code for code in codes]
    return found


def test_the_bytes_of_a_column_do_not_depend_on_the_order_of_its_array_in_memory():
    values = np.random.default_rng(3).normal(size=(7, 3))
    assert encode("a", np.asfortranarray(values), 2).packed() == encode("a", values, 2).packed()


def test_a_smooth_motion_takes_few_bits():
    """A circle in 300 frames: third differences of 2¹⁶ (2π/300)³/2 = 0.3 steps beside √20 roundings of up to half a step."""
    angle = np.linspace(0, 2 * np.pi, 300)[:, None] + np.arange(50)
    column = encode("x", np.cos(angle), 2)
    residual = np.frombuffer(column.planes, np.uint8)[300 * 50 :]
    assert column.order in (2, 3) and np.count_nonzero(residual) < 0.02 * residual.size


def test_the_page_holds_the_run(tmp_path):
    frames = balls()
    rows = [
        {"time": 0.5 * k, "total_energy": -1.0, "kinetic_energy": 1.0 + k, "potential_energy": -2.0 - k}
        | {"relative_energy_error": math.nan if k == 2 else 1e-9 * k, "conserves_energy": True}
        for k in range(20)
    ]
    header, columns, steps, springs = recorded(tmp_path / "run.html", frames, names=("a", "b", "", "d"), rows=rows)
    assert header["title"] == SCENE["title"] and header["names"] == ["a", "b", "", "d"]
    assert header["times"] == [frame.time for frame in frames]
    place = np.stack([frame.position for frame in frames])
    for axis, name in enumerate("xyz"):
        np.testing.assert_array_equal(np.isnan(columns[name]), np.isnan(place[:, :, axis]))
        error = np.nan_to_num(np.abs(columns[name] - place[:, :, axis]))
        assert (error <= steps[name] / 2 + 1e-15).all()
    np.testing.assert_allclose(columns["radius"], [frame.radius for frame in frames], atol=0.12 / 65000)
    np.testing.assert_allclose(columns["speed"][:, :3], 1.0, rtol=1e-4)
    np.testing.assert_array_equal(columns["color"], np.tile(frames[0].color.ravel(), (40, 1)))
    np.testing.assert_allclose(columns["walls"][7].reshape(1, 2, 3), frames[7].outline, atol=1e-5)
    assert [(first, between.tolist()) for first, between, _ in springs] == [(0, [[0, 1]]), (10, [[0, 1], [1, 2]])]
    np.testing.assert_allclose(springs[1][2][5], 0.35, atol=0.3 / 254 / 2)
    errors = next(curve["values"] for curve in header["series"]["curves"] if curve["label"] == "relative energy error")
    assert header["series"]["times"] == [row["time"] for row in rows]
    assert errors == [None if k == 2 else row["relative_energy_error"] for k, row in enumerate(rows)]
    text = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "<title>Three &lt;/script&gt; &amp; a spring</title>" in text and "@@" not in text
    assert "default-src 'none'" in text and "http" not in text.replace("http-equiv", "")
    assert [each.name for each in tmp_path.iterdir()] == ["run.html"]  # no lock, no part


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_no_particle_is_drawn_a_pixel_beside_its_place(tmp_path, projection):
    """One that leaves for 2000 heights of the picture gets finer grids, and what the page says of its error holds."""
    scene = SCENE | {"view": {"camera": SCENE["view"]["camera"] | {"projection": projection}}}
    way = np.linspace(0, 1, 50)[:, None] ** 3
    frames = [
        Frame(position=np.vstack([way[k] * [9e3, 5e3, 0] - [0, 4, 0], [1, 0, 0.1 * k]]), radius=np.ones(2), color=COLORS[:2])
        for k in range(50)
    ]
    header, columns, steps, _ = recorded(tmp_path / "far.html", frames, scene)
    half = grid_step(np.stack([frame.position[:, 0] for frame in frames]), 2).max() / 2
    assert half > 2 * 8 / 360  # 16 bits would miss by two pixels of a picture that is 8 high
    camera = Camera(load_scene(scene).view.camera, frames[0], aspect=16 / 9)
    told = float(next(note for note in header["notes"] if "pixels" in note).split(" pixels")[0].rsplit(" ", 1)[1])
    shown = np.stack([columns[name] for name in "xyz"], axis=2)
    shifts = []
    for k, frame in enumerate(frames):
        true, drawn = (_on_screen(camera, place, SIZE) for place in (frame.position, shown[k]))
        inside = (np.abs(true - np.array(SIZE) / 2) < np.array(SIZE) / 2).all(axis=1)
        shifts += np.linalg.norm(true - drawn, axis=1)[inside].tolist()
    assert len(shifts) > 30
    # The bound is told in two digits; a grid's error is somewhere between nothing and the bound.
    assert told <= 0.25 and told / 30 < max(shifts) <= 1.05 * told


def _on_screen(camera, places, size, rows=None):
    """Pixels from the upper left of a picture in which the field of view spans so many rows."""
    right, up, depth = camera.view(places).T
    rows = size[1] if rows is None else rows
    scale = rows / camera.height if camera.orthographic else rows / 2 / math.tan(math.radians(camera.field_of_view) / 2) / depth
    return np.stack([size[0] / 2 + right * scale, size[1] / 2 - up * scale], axis=1)


def test_the_page_has_display_scales_and_colors_by_quantity_and_says_so(tmp_path):
    bodies = [
        {"body": {"name": name, "mass": 1.0, "position": [x, 0, 0]}} for name, x in (("sun", 0), ("earth", 4), ("moon", 5))
    ]
    moon = {"around": "earth", "distance_scale": 3, "radius_scale": 2}
    scene = SCENE | {"particles": bodies, "view": SCENE["view"] | {"bodies": {"moon": moon}, "color_by": {"speed": {}}}}
    place = np.array([[0.0, 0, 0], [4, 0, 0], [5, 0, 0]])
    frames = [
        Frame(position=place, radius=np.full(3, 0.1), color=np.ones((3, 3)), velocity=(k + 1) * place, time=float(k))
        for k in range(3)
    ]
    header, columns, _, _ = recorded(tmp_path / "moon.html", frames, scene)
    np.testing.assert_allclose(columns["x"][0], [0, 4, 7], atol=1e-9)
    np.testing.assert_allclose(columns["radius"][0], [0.1, 0.1, 0.2], atol=1e-4)
    violet, yellow = np.array([68, 1, 84]) / 255, np.array([253, 231, 37]) / 255  # the ends of viridis
    np.testing.assert_allclose(columns["color"][-1].reshape(3, 3)[[0, 2]], [violet, yellow], atol=1 / 255)
    notes = " ".join(header["notes"])
    assert "Legend: speed: 0 ... 15 (viridis)." in notes and "drawn farther out" in notes


def test_the_page_of_the_ring_is_below_ten_megabytes(tmp_path):
    """As many bodies and frames as the ring has, on orbits like its own: Kepler's, slightly eccentric and inclined."""
    random = np.random.default_rng(2)
    radius, phase = np.sqrt(random.uniform(4, 6.25, 3073)), random.uniform(0, 2 * np.pi, 3073)
    rate, wobble = 0.0172 * radius**-1.5, random.normal(0, 1e-3, (2, 3073))
    frames = []
    for time in np.linspace(0, 1000, 300):
        angle = phase + rate * time
        distance = radius * (1 + wobble[0] * np.cos(angle))
        place = np.stack([distance * np.cos(angle), distance * np.sin(angle), wobble[1] * np.sin(angle)], axis=1)
        speed = np.stack([-radius * rate * (1 + wobble[0] * np.sin(angle)), 0 * angle, 0 * angle], axis=1)
        frames.append(Frame(place, np.full(3073, 0.008), np.full((3073, 3), 0.8), time=time, velocity=speed))
    header, columns, steps, _ = recorded(tmp_path / "ring.html", frames, ROOT / "scenes" / "ring.yaml", size=(1280, 720))
    assert (tmp_path / "ring.html").stat().st_size < 10e6
    assert np.abs(columns["x"][200] - frames[200].position[:, 0]).max() <= steps["x"].max() / 2 + 1e-15


@pytest.mark.sampled(3)
def test_record_writes_a_page_beside_other_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = str(ROOT / "scenes" / "sun_earth.yaml")
    words = ["record", scene, "--html", "new/eight.html", "--frames", "f", "--size", "64x48", "--fps", "5", "--duration", "1"]
    assert main([*words, "--until", "30", "-q"]) == 0
    header, columns, steps, _ = read_page("new/eight.html")
    assert len(list(Path("f").glob("*.png"))) == 5 and header["fps"] == 5
    np.testing.assert_allclose(header["times"], np.linspace(0, 30, 5), rtol=1e-12)
    # A circle about the centre of mass at Gauss's rate; the leapfrog of dt = 0.03 and the film's x + v δ are off by 1e-6.
    angle = 0.0172 * np.array(header["times"])
    np.testing.assert_allclose(columns["x"][:, 1], np.cos(angle), atol=1e-5)
    np.testing.assert_allclose(columns["speed"][:, 1], 0.0172, rtol=1e-4)
    assert header["names"] == ["sun", "earth"] and header["series"]["times"][-1] == 30


def test_what_cannot_be_a_page_is_said_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scene = str(ROOT / "scenes" / "sun_earth.yaml")
    Path("file").write_text("in the way")
    cases = [
        (["--html", "page.mp4"], 2, "--html page.mp4: the suffix must be one of .html"),
        (["--html", "file/page.html"], 5, "file/page.html"),
        (["--html", "page.html", "--fps", "1000", "--duration", "20000"], 6, "20,000,000 frames, allowed: 1,000,000"),
    ]
    for words, code, said in cases:
        assert main(["record", scene, *words, "-q"]) == code
        assert said in capsys.readouterr().err
    ring = ["record", str(ROOT / "scenes" / "ring.yaml"), "--html", "page.html", "--fps", "100", "--duration", "600", "-q"]
    assert main(ring) == 6  # 20 million places of particles are allowed
    assert "60,000 frames of 3,073 particles are more than a page can hold, allowed: 6,508" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


@pytest.mark.sampled(3)
def test_a_browser_draws_particles_where_the_camera_sees_them(tmp_path, browser):
    frames = balls()
    _, columns, _, _ = recorded(tmp_path / "run.html", frames)
    places = np.stack([columns[name] for name in "xyz"], axis=2)
    camera = Camera(load_scene(SCENE).view.camera, frames[0], aspect=SIZE[0] / SIZE[1])
    browser.open(tmp_path / "run.html", "#frame=12")
    browser.press("p")  # the inspector would hide some
    browser.press("t")  # and trails have their colours
    size = browser.evaluate("[player.canvas.clientWidth, player.canvas.clientHeight]")
    rows = min(size[1], size[0] * SIZE[1] / SIZE[0])

    def check(frame):
        browser.settle()
        assert browser.evaluate("player.frame") == frame
        picture = np.asarray(Image.open(io.BytesIO(browser.picture())).convert("RGB")).astype(int)[: size[1]]
        for particle, expected in enumerate(_on_screen(camera, places[frame, :3], size, rows)):
            others = np.delete(picture, particle, axis=2).max(axis=2)
            down, across = np.nonzero(picture[:, :, particle] - others > 60)
            # A pixel counts from 60 levels on: on the lit side of a disc where a quarter of it is covered, on the dark side,
            # which shows 97 levels, where it is six tenths. That moves the middle by up to 0.2 along each axis.
            assert np.hypot(*(np.array([across.mean(), down.mean()]) + 0.5 - expected)) < 0.5, (frame, particle)

    check(12)
    for _ in range(3):
        browser.press("ArrowRight")
    check(15)
    browser.press("ArrowLeft")
    browser.drag((300, 200), (360, 170))
    camera.rotate(60 / rows, 30 / rows)
    browser.drag((300, 200), (180, 240), modifiers=8)
    camera.pan(-120 / rows, -40 / rows)
    browser.press("i")
    camera.zoom(1.15)
    check(14)
    x, y = _on_screen(camera, places[14, 1:2], size, rows)[0]
    browser.drag((x, y), (x, y))
    assert browser.evaluate("player.inspector.particle") == 1
    x, y = _on_screen(camera, places[14, 2:3], size, rows)[0]
    browser.drag((x, y), (x, y), modifiers=8)
    plotted = browser.evaluate("player.inspector.curves()[0].values")
    np.testing.assert_allclose(plotted, np.linalg.norm(places[:, 1] - places[:, 2], axis=1), rtol=1e-12)
    browser.press("r")
    camera.reset()
    check(14)
    browser.press("ArrowRight", shift=True)  # 50 frames on: the end
    check(39)
    # The browser reads the same numbers, to the bit; what is gone is not there.
    found = browser.evaluate("player.run.times.map((_, frame) => [0, 1, 2, 3].map((i) => player.run.place(frame, i)))")
    np.testing.assert_array_equal(np.array(found, dtype=float), places)
    assert np.isnan(places[39, 3]).all() and browser.evaluate("player.drawing.size[3]") == 0
    browser.press(" ")
    browser.wait_for("player.frame > 3 && player.frame < 39")  # it begins again, and plays
    browser.press(" ")
    assert browser.evaluate("player.playing") is False


FLAT = {"camera": {"position": [0, 0, 6], "look_at": [0, 0, 0], "up": [0, 1, 0], "projection": "orthographic", "height": 4}}
# Both ends of every line, as the picture has them: to the right and up, in lengths.
LINES = """(() => {
  const { count, stride, data } = player.drawing.lines, { distance } = player.camera, ends = [];
  for (let n = 0; n < count; n++) for (const k of [0, 4]) ends.push([0, 1].map((c) => distance * data[n * stride + k + c]));
  return ends;
})()"""


def turning(turns, count=12, samples=12):
    """A body on the unit circle that turns so many times from frame to frame, with samples between the frames."""
    step = 2 * math.pi * turns
    for k in range(count):
        angles = step * (k - 1 + np.arange(1, samples) / samples)
        paths = np.stack([np.cos(angles), np.sin(angles), 0 * angles, -np.sin(angles), np.cos(angles), 0 * angles], axis=1)
        path = {"path_index": np.array([0]), "path_time": angles, "path": paths[:, None]} if k and turns > 0.03 else {}
        at = np.array([[math.cos(step * k), math.sin(step * k), 0.0]])
        speed = np.array([[-at[0, 1], at[0, 0], 0.0]])
        yield Frame(at, np.full(1, 0.01), COLORS[:1], time=step * k, velocity=speed, **path)


@pytest.mark.parametrize("turns", [0.93, 0.2, 1 / 30])
def test_a_browser_draws_trails_along_the_path_and_not_from_frame_to_frame(tmp_path, browser, turns):
    header, columns, _, _ = recorded(tmp_path / "run.html", list(turning(turns)), SCENE | {"view": FLAT | {"trails": 9}})
    assert (header["path"] is not None) == (turns > 0.1), "at 12° the places of the frames are enough"
    if turns > 0.1:
        assert header["path"]["particles"] == [0] and len(columns["path_x"]) == 11 * header["path"]["pieces"] + 1
        place = np.stack([columns[f"path_{name}"][:, 0] for name in "xy"], axis=1)
        assert np.abs(np.linalg.norm(place, axis=1) - 1).max() < 1e-3
    browser.open(tmp_path / "run.html", "#frame=11")
    browser.settle()
    ends = np.array(browser.evaluate(LINES), dtype=float).reshape(-1, 2, 2)
    # Half a pixel of the page at SIZE, 4/360 of a length each, for the recorded path and as much for straight pieces.
    middles = ends.mean(axis=1)
    away = np.abs(np.linalg.norm(np.concatenate([ends[:, 0], middles]), axis=1) - 1)
    assert away.max() < 4 / 360
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    assert length == pytest.approx(9 * 2 * math.pi * turns, rel=0.01)


def test_the_trail_of_a_bouncing_ball_stays_in_its_box_in_a_browser(tmp_path, browser):
    time = 0.17 * np.arange(60)
    fold = np.abs((time + 0.37) % 2 - 1)  # between 0 and 1, there and back
    frames = [
        Frame(np.array([[0.1 * t - 1, y, 0]]), np.full(1, 0.01), COLORS[:1], time=t, velocity=np.zeros((1, 3)), collides=True)
        for t, y in zip(time, fold, strict=True)
    ]
    contacts = {"hard_spheres": {"solver": "swept"}}
    recorded(tmp_path / "run.html", frames, SCENE | {"view": FLAT | {"trails": 50}, "contacts": contacts})
    browser.open(tmp_path / "run.html", "#frame=55")
    browser.settle()
    ends = np.array(browser.evaluate(LINES), dtype=float)
    assert len(ends) >= 100
    assert ends[:, 1].min() > -1e-4 and ends[:, 1].max() < 1 + 1e-4, "a grid step and single precision"


def test_a_browser_has_names_and_a_scale_bar_where_a_film_has_them(tmp_path, browser):
    units = {"length": "AU", "time": "s", "mass": "Msun"}
    view = SCENE["view"] | {"labels": True, "scale_bar": True}
    frames = [replace(frame, name=("a", "Überß", "", "d")) for frame in balls()]
    recorded(tmp_path / "run.html", frames, SCENE | {"view": view, "units": units}, names=("a", "Überß", "", "d"))
    browser.open(tmp_path / "run.html", "#frame=12")
    browser.press("p")
    browser.settle()
    size = browser.evaluate("[player.canvas.clientWidth, player.canvas.clientHeight]")
    rows = min(size[1], size[0] * SIZE[1] / SIZE[0])
    camera = Camera(load_scene(SCENE).view.camera, frames[0], aspect=SIZE[0] / SIZE[1])
    found = {tag["name"]: tag for tag in browser.evaluate("player.overlay.names")}
    assert set(found) == {"a", "Überß", "d"}
    for name, particle in (("a", 0), ("Überß", 1)):
        across, down = _on_screen(camera, frames[12].position[particle : particle + 1], size, rows)[0]
        # Coordinates are on a grid whose step moves nothing by more than a quarter of a pixel.
        assert found[name]["top"] == pytest.approx(down, abs=0.5)
        assert across < found[name]["left"] < across + 30
    bar = browser.evaluate("player.overlay.bar")
    assert bar["text"] == "2 AU" and bar["pixels"] == pytest.approx(2.0 / camera.visible_height * rows, rel=1e-9)
    letters = "(() => { const { canvas } = player.overlay; return canvas.getContext('2d').getImageData(0, 0, canvas.width, "
    assert browser.evaluate(letters + "canvas.height).data.filter((value, n) => n % 4 === 0 && value > 200).length; })()") > 100
    # The run ends at 9.75 s: every frame has two decimals.
    assert browser.evaluate("[0, 3.5, 9.75].map((time) => player.run.clockText(time))") == ["0.00 s", "3.50 s", "9.75 s"]


WITHOUT_WEBGL = """{
  const real = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return kind === "webgl2" ? null : real.call(this, kind, ...more);
  };
}"""
# Pixels of the plot in the colour of its first curve, whatever the browser makes of that colour.
CURVE_PIXELS = """(() => {
  const { canvas, context, palette } = player.inspector.plot, probe = document.createElement("canvas").getContext("2d");
  probe.fillStyle = palette[0];
  probe.fillRect(0, 0, 1, 1);
  const wanted = probe.getImageData(0, 0, 1, 1).data.join(), { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let n = 0; n < data.length; n += 4) count += data.slice(n, n + 4).join() === wanted;
  return count;
})()"""


def test_without_webgl_the_page_says_so_and_still_plots(tmp_path, browser):
    names = ("total_energy", "kinetic_energy", "potential_energy")
    rows = [{"time": k / 2, "conserves_energy": False} | dict.fromkeys(names, k) for k in range(20)]
    recorded(tmp_path / "run.html", balls(), rows=rows)
    script = browser.ask("Page.addScriptToEvaluateOnNewDocument", source=WITHOUT_WEBGL)["identifier"]
    try:
        browser.open(tmp_path / "run.html", "#frame=20")
    finally:
        browser.ask("Page.removeScriptToEvaluateOnNewDocument", identifier=script)
    browser.wait_for("player !== null && player.shownCount > 0")
    assert "WebGL 2" in browser.evaluate("element('message').textContent")
    # Frame 20 is at t = 5, where the energy that grows by 1 in each 0.5 is 10.
    assert browser.evaluate("player.inspector.plot.curves.map((curve) => interpolated(curve, player.run.times[20]))") == [10]
    assert browser.evaluate(CURVE_PIXELS) > 100  # of a line of 250 points, whose edges are mixed with what is below
