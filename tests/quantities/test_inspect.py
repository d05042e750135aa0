"""`inspect:` along a run: recorded samples, computed quantities, and panels beside the scene."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mpp_taichi.cli.main import main
from mpp_taichi.energy.energy_meter import EnergyMeter
from mpp_taichi.errors import SceneError
from mpp_taichi.plots import Curves, Samples
from mpp_taichi.plots.sheet import Sheet, letters_for
from mpp_taichi.recorders.inspection import InspectionRecorder
from mpp_taichi.recorders.inspector import Inspector
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.scene.spec import CameraSpec, RecordSpec, ViewSpec
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.views._base import Frame, View
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.panels import Division, ViewWithPanels, narrowed

OMEGA, DT, STEPS = 2.0, 0.01, 200
SCENE = f"""
constants: {{omega: {OMEGA}}}
dimensions: 2
particles:
  - body: {{name: hook, mass: 1, position: [0, 0], radius: 0.1, free: false}}
  - body: {{name: ball, mass: 1, position: [2, 0], displacement: [0.5, 0], radius: 0.1}}
springs: [{{link: {{between: [hook, ball], stiffness: omega ** 2}}}}]
integrator: {{leapfrog: {{dt: {DT}}}}}
run: {{steps: {STEPS}}}
view: {{camera: {{position: [1, 0, 5], look_at: [1, 0, 0], up: [0, 1, 0]}}, caption: false}}
record: {{size: [240, 120], fps: 5, seconds: 1, panel_share: 0.5}}
"""
PANELS = """
inspect:
  - {y: {position: {of: ball, axis: x}}, theory: 2 + 0.5 * cos(omega * t)}
  - {x: {position: {of: ball, axis: x}}, y: [{velocity: {of: ball, axis: x}}, {spring_length: {between: [hook, ball]}}]}
"""
ENERGIES = "  - {y: [kinetic_energy, total_energy, relative_energy_error]}\n"


@pytest.fixture
def scene(tmp_path: Path, monkeypatch) -> Path:
    """The oscillator, with two panels that need no energy."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE + PANELS)
    return path


def table(path: Path) -> dict[str, np.ndarray]:
    """The columns of a CSV file."""
    with open(path, encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    return {name: np.array([float(row[number]) for row in rows]) for number, name in enumerate(header)}


def test_what_is_recorded_is_the_motion_and_changes_nothing(scene: Path):
    scene.write_text(SCENE + PANELS + ENERGIES)
    with Simulation(str(scene), backend="cpu", precision="f64") as simulation:
        simulation.run()
        untouched = simulation.snapshot()
        simulation.restart()
        recorder, errors = InspectionRecorder(Inspector(simulation), every=7), TableRecorder(7)
        simulation.run(recorders=[recorder, errors])
        recorder.finish(simulation)
        errors.finish(simulation)
        assert np.array_equal(simulation.snapshot().position, untouched.position)
        recorder.save(Path("panels.csv"))
        recorder.restart()
        assert recorder.inspector.samples.count == 0
    wrong = ["inspect=[{y: {mode_amplitude: {mode: [9]}}}]"]
    with Simulation(str(scene), backend="cpu", precision="f64", overrides=wrong) as simulation:
        with pytest.raises(SceneError, match=r"inspect\[0\].y.mode_amplitude: modes: there is no mode 9"):
            Inspector(simulation)
    found = table(Path("panels.csv"))
    assert list(found) == [
        *("time", "x_of_ball", "theory_of_x_of_ball", "velocity_x_of_ball", "length_of_spring_hook_ball"),
        *("kinetic_energy", "total_energy", "relative_energy_error"),
    ]
    steps = [*range(0, STEPS, 7), STEPS]
    time = found["time"]
    assert time == pytest.approx(DT * np.array(steps), rel=1e-15)
    # Leapfrog swings with a frequency higher by (ω dt)²/24 = 1.7e-5: after 4 radians it is 7e-5 · 0.5 ahead.
    assert found["x_of_ball"] == pytest.approx(2.0 + 0.5 * np.cos(OMEGA * time), abs=5e-5)
    assert found["theory_of_x_of_ball"] == pytest.approx(2.0 + 0.5 * np.cos(OMEGA * time), abs=1e-15)
    assert np.array_equal(found["length_of_spring_hook_ball"], found["x_of_ball"])
    # A ball of mass 1; the spring's energy is ½ ω² (x − 2)².
    kinetic = 0.5 * found["velocity_x_of_ball"] ** 2
    assert found["kinetic_energy"] == pytest.approx(kinetic, rel=1e-15)
    assert found["total_energy"] == pytest.approx(kinetic + 0.5 * OMEGA**2 * (found["x_of_ball"] - 2.0) ** 2, rel=1e-14)
    assert found["relative_energy_error"].tolist() == [row["relative_energy_error"] for row in errors.rows]


def test_nothing_is_computed_that_no_panel_asks_for(scene: Path, monkeypatch):
    asked = []
    measure = EnergyMeter.potential_energy
    monkeypatch.setattr(EnergyMeter, "potential_energy", lambda *arguments: asked.append(1) or measure(*arguments))
    with Simulation(str(scene), backend="cpu", precision="f64") as simulation:
        recorder = InspectionRecorder(Inspector(simulation), every=50)
        simulation.run(recorders=[recorder], judge="off")  # the judge of a run measures its energy
        assert recorder.inspector.samples.count == 5 and not asked
    monkeypatch.setattr(Inspector, "__init__", None)
    assert main(["run", str(scene), "--headless", "--backend", "cpu", "-q"]) == 0, "nobody sees the panels"


def test_files_and_films_of_the_command_line(scene: Path):
    arguments = ["record", str(scene), "--backend", "cpu", "-q", "--frames", "film"]
    assert main([*arguments, "--every", "30", "--inspect", "a.csv", "--inspect", "b.svg", "--inspect", "c.png"]) == 0
    steps = sorted({*range(0, STEPS, 30), *range(0, STEPS + 1, 50)})  # every 30th, and those that the five frames show
    assert table(Path("a.csv"))["time"] == pytest.approx(DT * np.array(steps))
    assert Image.open("c.png").size == (960, 960) and Path("b.svg").read_text().count("<polyline") == 4
    frames = [np.asarray(Image.open(path)).astype(int) for path in sorted(Path("film").glob("*.png"))]
    assert len(frames) == 5 and frames[0].shape == (120, 240, 3)
    changed = [np.abs(frame - frames[0]).max(axis=2) > 60 for frame in frames]
    assert changed[4][:, 120:].sum() > changed[1][:, 120:].sum() > 20, "curves grow"
    assert changed[2][:, :120].any(), "and the ball moves"


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (["--inspect", "a.pdf"], "must be one of .csv, .svg, .png"),
        (["--set", "inspect=[]", "--inspect", "a.csv"], "has no inspect:"),
    ],
)
def test_what_cannot_be_written_is_refused(scene: Path, capsys, more, reason):
    assert main(["run", str(scene), "--headless", "--backend", "cpu", "-q", *more]) == 2
    assert reason in capsys.readouterr().err
    assert not list(Path().glob("a.*"))


def test_a_histogram_is_that_of_theory(tmp_path: Path):
    """A gas whose velocities are drawn from the distribution: bins scatter by √n."""
    count = 4000
    scene = {
        "particles": [
            {"gas": {"count": count, "lower": [0, 0, 0], "upper": [9, 9, 9], "radius": 0, "temperature": 2, "mass": 3}}
        ],
        "integrator": {"leapfrog": {"dt": 1}},
        "run": {"steps": 2},
        "inspect": [
            {"histogram": "speed", "theory": "maxwell_boltzmann", "bins": 20},
            {"histogram": {"velocity": {"axis": "x"}}, "theory": "maxwell_boltzmann", "bins": 20, "after": 1},
        ],
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        recorder = InspectionRecorder(Inspector(simulation), every=1)
        simulation.run(recorders=[recorder])
    variance = 2.0 / 3.0  # of each component, k T / m
    for plot, exact in zip(
        recorder.inspector.plots,
        (
            lambda v: math.sqrt(2.0 / math.pi) * v**2 / variance**1.5 * np.exp(-(v**2) / (2.0 * variance)),
            lambda v: np.exp(-(v**2) / (2.0 * variance)) / math.sqrt(2.0 * math.pi * variance),
        ),
    ):
        width = np.diff(plot.edges)
        assert plot.density @ width == pytest.approx(1.0, rel=1e-12)
        # The measured temperature is within √(2 / 3n) = 1.3 % of 2, of which 4; the curve goes with it.
        assert plot.theory == pytest.approx(exact(plot.curve), abs=0.05 * exact(np.linspace(0, 3, 99)).max())
        middle = 0.5 * (plot.edges[1:] + plot.edges[:-1])
        expected = np.interp(middle, plot.curve, plot.theory)
        # Five standard deviations of a bin's count, and what the curve bends within a bin.
        error = 5.0 * np.sqrt(expected * width / count + 1.0 / count**2) / width + 0.02
        assert np.all(np.abs(plot.density - expected) < error)


def test_a_histogram_has_the_density_of_a_formula(tmp_path):
    """A density over the quantity and the time; where it has no value, as 1/x at 0, nothing is drawn."""
    bodies = [{"body": {"mass": 1, "position": [k, 0, 0], "velocity": [1, 0, 0]}} for k in range(5)]
    scene = {
        "particles": bodies,
        "integrator": {"leapfrog": {"dt": 1}},
        "constants": {"wide": 0.5},
        "inspect": [{"histogram": {"position": {"axis": "x"}}, "bins": 4, "theory": "exp(-wide*(x - t)) + 1/(x - 1)"}],
    }
    with Simulation(scene, backend="cpu") as simulation:
        recorder = InspectionRecorder(Inspector(simulation), every=1)
        simulation.run(steps=2, recorders=[recorder])
        (plot,) = recorder.inspector.plots
        recorder.save(tmp_path / "bins.csv")
    x = plot.curve
    assert x[0] < 2.0 and x[-1] > 6.0
    assert plot.theory == pytest.approx(np.exp(-0.5 * (x - 2.0)) + 1.0 / (x - 1.0), rel=1e-12)


def test_of_a_histogram_several_formulas_are_refused():
    scene = {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}],
        "integrator": {"leapfrog": {"dt": 1}},
        "inspect": [{"histogram": "speed", "theory": ["x", "t"]}],
    }
    with pytest.raises(SceneError, match="of a histogram it must be maxwell_boltzmann, or one formula, not 2"):
        Simulation(scene, backend="cpu")


def test_a_histogram_from_a_time_on_is_empty_before_it(tmp_path):
    """Samples of the times 0, 1, 2 and 3; from 2 on they are added up."""
    scene = {
        "particles": [{"body": {"mass": 1, "position": [k, 0, 0], "velocity": [0.1 * k, 0, 0]}} for k in range(5)],
        "integrator": {"leapfrog": {"dt": 1}},
        "inspect": [{"histogram": {"velocity": {"axis": "x"}}, "bins": 4, "after": 2}],
    }
    with Simulation(scene, backend="cpu") as simulation:
        recorder = InspectionRecorder(Inspector(simulation), every=1)
        (plot,) = recorder.inspector.plots
        simulation.run(steps=1, recorders=[recorder])
        assert not len(plot.edges) and not len(plot.density)
        for name in ("early.csv", "early.svg"):
            recorder.save(tmp_path / name)
        simulation.run(steps=1, recorders=[recorder])
        assert plot.density @ np.diff(plot.edges) == pytest.approx(1.0, rel=1e-12)
        simulation.run(steps=1, recorders=[recorder])
        assert recorder.inspector._histograms[0]._seen == 10


def test_a_narrower_picture_shows_all_that_the_wide_one_did():
    view = ViewSpec(camera=CameraSpec(position=(0, 0, 5), look_at=(0, 0, 0), up=(0, 1, 0)))
    frame = Frame(position=np.array([[3.0, 1.9, 0.0]]), radius=np.ones(1), color=np.ones((1, 3)))

    def place(spec: ViewSpec, size: tuple[int, int]) -> np.ndarray:
        """Of the particle in the picture, from its middle, in pixels."""
        camera = Camera(spec.camera, frame, aspect=size[0] / size[1])
        seen = camera.view(frame.position)
        return seen[0, :2] / camera.length_per_pixel(seen[:, 2], size[1])

    size = (1280, 720)
    for panels in ("right", "bottom"):
        division = Division.of(size, RecordSpec(panels=panels, panel_share=0.4))
        (width, height), (wide, high) = division.scene, division.panels
        assert (width + wide, height) == size or (width, height + high) == size
        assert (wide, high) == {"right": (512, 720), "bottom": (1280, 288)}[panels]  # 0.4 of the side that is divided
        before, after = place(view, size), place(narrowed(view, size, division.scene), division.scene)
        scale = min(width / size[0], height / size[1])
        assert after == pytest.approx(scale * before, rel=1e-9)
    assert Division.of(size, RecordSpec(panels="none")) is None
    chosen = ViewSpec()
    assert narrowed(chosen, size, (600, 720)) is chosen, "a camera that chooses its place is left to it"


class Colored(View):
    """A view of one colour."""

    def __init__(self, size):
        self.shape = (size[1], size[0], 3)

    def draw(self, frame):
        return np.full(self.shape, (10, 20, 30), np.uint8)

    def close(self):
        pass


@pytest.mark.parametrize("panels", ["right", "bottom"])
def test_a_picture_with_panels_is_the_view_and_the_panels_side_by_side(panels):
    size, samples = (300, 200), Samples()
    samples.open(2)
    division = Division.of(size, RecordSpec(panels=panels, panel_share=0.5))
    plots = [Curves("", "x", "", ("y",), "", samples, 0, (1,))]
    view = ViewWithPanels(Colored(division.scene), plots, division, caption=False)
    frame = Frame(position=np.zeros((1, 3)), radius=np.ones(1), color=np.ones((1, 3)))
    for row in ((0.0, 1.0), (1.0, 3.0)):
        samples.add(np.array(row))
        picture = view.draw(frame)
        assert picture.shape == (200, 300, 3)
        parts = (picture[:, :150], picture[:, 150:]) if panels == "right" else (picture[:100], picture[100:])
        assert (parts[0] == (10, 20, 30)).all()
        assert np.array_equal(parts[1], Sheet(plots, division.panels, letters_for(200)).picture())
