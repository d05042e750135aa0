"""The command line: its output, its files, its exit codes, and the files that remain after an error."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi import Snapshot
from mpp_taichi.cli import _session
from mpp_taichi.cli.main import VERBS, main
from mpp_taichi.device import backends
from mpp_taichi.recorders.video import check_encoder
from mpp_taichi.simulation import run_loop
from scenes import kepler

ROOT = Path(__file__).parents[2]
FIXED_KEYS = (
    "scene, backend, device, precision, plan, integrator, effects, particle_count, spring_count, steps, time, wall_seconds, "
    "compile_seconds, steps_per_second, total_energy_initial, total_energy_final, relative_energy_error_max, "
    "momentum_error_max, status"
).split(", ")


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """Write scenes into an empty working directory, and run there."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)

    def write(name="kepler.yaml", content=None, **changes):
        content = {**(content or kepler(dt=0.02)), "run": {"duration": 2.0}, **changes}
        content = {key: value for key, value in content.items() if value is not None}
        (tmp_path / name).write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return name

    return write


def run_json(capsys, *words):
    code = main([*words, "--json"])
    captured = capsys.readouterr()
    assert captured.out.startswith("{"), captured.out
    return code, json.loads(captured.out), captured.err


def start(*words, **options):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **options.pop("environment", {})}
    return subprocess.Popen(
        [sys.executable, "-m", "mpp_taichi", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, **options
    )


def frames_in(path):
    """Decoded frames, counted by FFmpeg itself."""
    done = subprocess.run(
        [check_encoder(), "-hide_banner", "-i", str(path), "-f", "null", "-"], capture_output=True, text=True, check=True
    )
    return int(done.stderr.rsplit("frame=", 1)[1].split()[0])


# --- the run -----------------------------------------------------------------------------------------------------------------


def test_json_has_every_promised_key_and_ends_at_the_duration(scene, capsys):
    code, found, _ = run_json(capsys, scene(), "--headless")
    assert code == 0 and found["exit_code"] == 0 and found["status"] == "ok"
    assert set(FIXED_KEYS) <= set(found)
    assert (found["steps"], found["time"]) == (100, 2.0)
    assert found["effects"] == ["newtonian_gravity"] and found["particle_count"] == 2 and found["plan"] == "serial"
    assert 0.0 < found["relative_energy_error_max"] < 1e-3
    assert found["files"] == [] and not Path("out").exists()


def test_a_bare_scene_is_run(scene, capsys):
    name = scene()
    bare, verb = run_json(capsys, name, "--headless"), run_json(capsys, "run", name, "--headless")
    assert bare[0] == verb[0] == 0
    assert bare[1]["total_energy_final"] == verb[1]["total_energy_final"]


@pytest.mark.parametrize(("length", "steps", "end"), [(["--steps", "7"], 7, 0.14), (["--until", "0.05"], 3, 0.05)])
def test_length_can_be_asked_for(scene, capsys, length, steps, end):
    _, found, _ = run_json(capsys, scene(), "--headless", *length)
    assert found["steps"] == steps and found["time"] == pytest.approx(end, abs=1e-15)


def test_options_reach_the_simulation(scene, capsys):
    words = ["--headless", "--precision", "f32", "--plan", "parallel", "--threads", "1", "--set", "integrator.leapfrog.dt=0.01"]
    _, found, _ = run_json(capsys, scene(), *words)
    assert (found["precision"], found["plan"], found["threads"], found["steps"]) == ("f32", "parallel", 1, 200)
    assert found["plan_reason"] == "asked for" and found["launches_per_step"] == 1  # the sum alone


def test_every_output_is_written_and_named(scene, capsys):
    words = ["--trajectory", "t.npz", "--snapshot", "deep/s.npz", "--diagnostics", "d.csv", "--every", "10"]
    code, found, _ = run_json(capsys, scene(), "--headless", *words)
    assert code == 0 and found["files"] == ["t.npz", "d.csv", "deep/s.npz"]
    assert Snapshot.load("deep/s.npz").time == 2.0
    with np.load("t.npz") as data:
        np.testing.assert_array_equal(data["position"][-1], Snapshot.load("deep/s.npz").position)
        assert data["step"].tolist() == list(range(0, 101, 10))
    assert len(Path("d.csv").read_text(encoding="utf-8").splitlines()) == 12
    assert sorted(entry.name for entry in Path().iterdir()) == ["d.csv", "deep", "kepler.yaml", "t.npz"]


def test_quiet_says_nothing(scene, capsys):
    assert main([scene(), "--headless", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


DETAILS = ("setup", "compile", "newtonian_gravity", "serial: work of a step", "f64", "in the steps alone")


def test_the_closing_summary_begins_with_the_verdict_and_tells_details_when_asked(scene, capsys):
    """Results are on standard output, and nothing but results."""
    words = [scene(expect={"steps": {"above": 1}}), "--headless", "--diagnostics", "d.csv"]
    assert main(words) == 0
    out = capsys.readouterr().out
    heads = [line.split()[0] for line in out.splitlines()]
    assert heads[:5] == ["status", "wrote", "expect", "scene", "reached"] and heads[-1] == "time"
    assert out.startswith("  status  ok\n  wrote   d.csv\n  expect  pass  ") and "steps/s with samples" in out
    assert not any(word in out for word in DETAILS)
    assert main([*words, "-v"]) == 0
    out = capsys.readouterr().out
    assert all(word in out for word in DETAILS)


def test_with_json_the_summary_is_on_standard_error(scene, capsys):
    assert main([scene(), "--headless", "--json", "--verbose"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["status"] == "ok"
    assert "  status  ok\n" in captured.err and all(word in captured.err for word in DETAILS)
    assert main([scene(), "--headless", "--json", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_a_status_other_than_ok_says_why(scene, capsys):
    """The reason is in the file to which standard output goes, too."""
    assert main([scene(expect={"steps": {"below": 1}}), "--headless"]) == 4
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["  status  failed", "  because 1 of 1 expectations not met"]
    assert lines[2].startswith("  expect  FAIL  steps = ")


@pytest.mark.sampled(3)
def test_a_reader_that_leaves_does_not_hide_that_the_run_failed(scene):
    """Standard output is a pipe that its reader has closed."""
    for expect, code in (({"steps": {"below": 1}}, 4), ({"steps": {"above": 1}}, 141)):
        read, write = os.pipe()
        os.close(read)
        command = [sys.executable, "-m", "mpp_taichi", scene(expect=expect), "--headless"]
        done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
        os.close(write)
        assert done.returncode == code and "Traceback" not in done.stderr, done.stderr


def test_a_dry_run_starts_no_device(scene):
    program = (
        "import sys; from mpp_taichi.cli.main import main; code = main(sys.argv[1:]); "
        "assert 'taichi' not in sys.modules, 'Taichi was imported'; sys.exit(code)"
    )
    words = [sys.executable, "-c", program, "run", scene(), "--dry-run", "--json", "--headless", "--video", "a.mp4"]
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["steps"] == 100 and found["particle_count"] == 2 and found["files"] == ["a.mp4"]
    assert found["resolved"]["run"] == {"duration": 2.0} and not Path("a.mp4").exists()


# --- films -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
@pytest.mark.sampled(3)
def test_record_makes_exactly_the_frames_asked_for(scene, suffix):
    film = f"film{suffix}"
    words = ["record", scene(), "--video", film, "--size", "64x48", "--fps", "12", "--duration", "1.75", "-q"]
    assert main(words) == 0
    assert frames_in(film) == 21


def test_record_frames_needs_no_encoder(scene, monkeypatch):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/nonexistent/ffmpeg")
    words = ["--frames", "pictures", "--still", "new/still.png", "--size", "64x48", "--fps", "3", "--duration", "1", "-q"]
    assert main(["record", scene(), *words]) == 0
    assert Path("new/still.png").read_bytes() == Path("pictures/frame_000002.png").read_bytes()  # the last one
    assert sorted(entry.name for entry in Path("pictures").iterdir()) == [f"frame_{k:06d}.png" for k in range(3)]


@pytest.mark.sampled(3)
def test_a_still_of_a_film_of_one_frame_shows_the_end(scene):
    size = ["--size", "64x48", "--fps", "10", "-q", "--no-archive"]
    assert main(["record", scene(), "--still", "one.png", "--duration", "0.1", *size]) == 0
    assert main(["record", scene(), "--still", "two.png", "--duration", "0.2", *size]) == 0
    assert main(["record", scene(), "--frames", "start", "--duration", "0.1", *size]) == 0
    assert Path("one.png").read_bytes() == Path("two.png").read_bytes() != Path("start/frame_000000.png").read_bytes()


def test_without_a_display_a_run_becomes_a_film_and_says_so(scene, capsys):
    name = scene(record={"size": [64, 48], "fps": 5, "seconds": 1})
    assert main([name]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "making a film instead" in line]
    assert said == [f"there is no display: making a film instead, {Path('out/kepler.mp4')}"]
    assert frames_in("out/kepler.mp4") == 5


def test_a_missing_encoder_is_found_before_anything_is_computed(scene, capsys, monkeypatch):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/nonexistent/ffmpeg")
    began = time.perf_counter()
    assert main(["record", scene(), "--video", "film.mp4"]) == 5
    assert time.perf_counter() - began < 0.3 and "--frames" in capsys.readouterr().err
    assert not Path("film.mp4").exists()


@pytest.mark.skipif(os.name == "nt", reason="the false encoder is a shell script")
def test_an_encoder_that_dies_costs_the_film_and_not_the_data(scene, capsys, monkeypatch):
    fake = Path("ffmpeg").absolute()
    fake.write_text(
        '#!/bin/sh\n[ "$1" = -version ] && exit 0\nhead -c 20000 > /dev/null\necho broken lens >&2\nexit 1\n', encoding="utf-8"
    )
    fake.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(fake))
    words = [
        "record",
        scene(),
        "--video",
        "film.mp4",
        "--size",
        "64x48",
        "--fps",
        "60",
        "--duration",
        "2",
        "--diagnostics",
        "d.csv",
    ]
    code, found, err = run_json(capsys, *words)
    assert code == 5 and found["status"] == "failed" and "broken lens" in found["error"]
    assert found["files"] == ["d.csv"] and Path("d.csv").exists() and not Path("film.mp4").exists()
    assert "Traceback" not in err


# --- exit codes --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nothing.yaml"], "no such file"),
        (["rnu"], "did you mean 'run'"),
        (["run"], "required: SCENE"),
        (["kepler.yaml", "--headless", "--steps", "1", "--until", "2"], "not allowed with"),
        (["kepler.yaml", "--headless", "--steps", "-3"], "whole number"),
        (["kepler.yaml", "--headless", "--until", "nan"], "finite"),
        (["kepler.yaml", "--headless", "--bakend", "cpu"], "--bakend"),
        (["kepler.yaml", "--headless", "--backend", "opengl"], "cuda"),
        (["kepler.yaml", "--headless", "--video", "film.avi"], ".mp4, .gif, .webp"),
        (["kepler.yaml", "--headless", "--video", "rtmp://host/film.mp4"], "address"),
        (["kepler.yaml", "--headless", "--video", "a\nb.mp4"], "no name of a file"),
        (["kepler.yaml", "--headless", "--snapshot", "x" * 5000 + ".npz"], "longer"),
        (["kepler.yaml", "--headless", "--diagnostics", "table.xls"], ".csv, .npz"),
        (["kepler.yaml", "--headless", "--set", "integrator.leapfrog.dt=0"], "above 0"),
        (["record", "kepler.yaml"], "--frames"),
        (["record", "kepler.yaml", "--frames", "f", "--size", "10"], "WIDTHxHEIGHT"),
        (["record", "kepler.yaml", "--frames", "f", "--fps", "1", "--duration", "0.1"], "no frame"),
        (["sweep", "kepler.yaml"], "--vary"),
    ],
)
def test_wrong_usage_is_code_2_in_one_line(scene, capsys, words, said):
    scene()
    assert main(words) == 2
    captured = capsys.readouterr()
    assert said in captured.err and "Traceback" not in captured.err and len(captured.err) < 1000
    assert captured.out == ""
    assert [entry.name for entry in Path().iterdir()] == ["kepler.yaml"]


def test_a_run_without_an_end_asks_for_one(scene, capsys):
    assert main([scene(run=None), "--headless"]) == 2
    assert "--until" in capsys.readouterr().err


def test_faults_of_a_scene_are_all_told_with_their_lines(scene, capsys):
    name = scene(forces=[{"newtonian_gravty": {}}], integrator={"leapfrog": {"dt": -1}})
    code, found, err = run_json(capsys, name, "--headless")
    assert code == 2 and found["status"] == "failed" and len(found["faults"]) == 2
    assert all(fault.startswith(f"{name}:") for fault in found["faults"])
    assert "did you mean 'newtonian_gravity'" in err and "above 0" in err


def test_a_missing_backend_is_code_3(scene, capsys):
    missing = "metal" if sys.platform != "darwin" else "cuda"
    code, found, _ = run_json(capsys, scene(), "--headless", "--backend", missing)
    assert code == 3 and f"backend {missing} does not start here" in found["error"]


def test_too_many_steps_are_code_6(scene, capsys):
    assert main([scene(), "--headless", "--until", "1e12"]) == 6
    assert "allowed: 1,000,000,000" in capsys.readouterr().err


def test_an_unwritable_file_is_code_5(scene, capsys):
    scene()
    Path("file").write_text("", encoding="utf-8")
    assert main(["kepler.yaml", "--headless", "--snapshot", "file/s.npz"]) == 5
    assert "file" in capsys.readouterr().err


def test_an_internal_error_is_code_1_and_asks_for_a_report(scene, capsys, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("a bug\nin two lines")

    monkeypatch.setattr(VERBS["run"], "execute", broken)
    monkeypatch.delenv("MPP_TAICHI_DEBUG", raising=False)
    code, found, err = run_json(capsys, scene())
    assert code == 1 and found["exit_code"] == 1
    assert "internal error: ZeroDivisionError: a bug in two lines; please report it" in err and "Traceback" not in err
    monkeypatch.setenv("MPP_TAICHI_DEBUG", "1")
    assert main(["kepler.yaml"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_lost_energy_is_code_4_unless_allowed(scene, capsys):
    name = scene(content=kepler(eccentricity=0.5, dt=0.2, integrator="euler"))
    code, found, err = run_json(capsys, name, "--headless")
    assert code == 4 and found["status"] == "inaccurate" and "not accurate" in err
    code, found, _ = run_json(capsys, name, "--headless", "--allow-inaccurate")
    assert code == 0 and found["status"] == "inaccurate"


def test_nan_is_code_4_and_leaves_the_last_good_state(scene, capsys):
    # Two bodies that meet exactly at the origin in step 5 (see test_stability).
    bodies = [
        {"body": {"name": "left", "mass": 1, "position": [-1.125, 0, 0], "velocity": [1, 0, 0]}},
        {"body": {"name": "right", "mass": 1, "position": [1.125, 0, 0], "velocity": [-1, 0, 0]}},
    ]
    force = [{"newtonian_gravity": {"strength": 1e-300}}]
    content = {"particles": bodies, "forces": force, "integrator": {"leapfrog": {"dt": 0.25}}, "run": {"duration": 10}}
    scene(content=content)
    words = ["kepler.yaml", "--headless", "--diagnostics", "d.csv", "--video", "f.mp4", "--set", "record.size=[64,48]"]
    code, found, err = run_json(capsys, *words)
    assert code == 4 and found["status"] == "failed" and "left" in found["error"]
    state = Snapshot.load(Path("out/kepler.crash.npz"))
    assert state.step == 4 and np.isfinite(state.position).all()
    assert set(found["files"]) == {"d.csv", "f.mp4", str(Path("out/kepler.crash.npz"))}
    assert frames_in("f.mp4") > 1 and "Traceback" not in err


# --- streams and signals -----------------------------------------------------------------------------------------------------


def test_json_stands_alone_on_standard_output(scene):
    done = start(scene(), "--headless", "--json", environment={"TI_LOG_LEVEL": "trace", "LC_ALL": "C", "PYTHONUTF8": "0"})
    out, err = done.communicate(timeout=60)
    assert done.returncode == 0 and json.loads(out)["status"] == "ok" and b"status" in err


def test_what_libraries_print_does_not_reach_standard_output():
    program = (
        "import os; from mpp_taichi.cli._terminal import output_reserved, put_json\n"
        "with output_reserved(True):\n    os.write(1, b'[I] noise from C')\n    print(' and from Python')\n"
        "put_json({'a': float('nan')})"
    )
    words = [sys.executable, "-c", program]
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)
    assert json.loads(done.stdout) == {"a": None} and done.stderr == "[I] noise from C and from Python\n"


def test_no_character_ends_the_program_in_a_poor_locale(scene):
    environment = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = start(scene(title="Šuvakov's butterfly ☄"), "--headless", environment=environment)
    out, err = done.communicate(timeout=60)
    assert done.returncode == 0 and b"\\u0160uvakov" in out and b"Traceback" not in err


@pytest.mark.skipif(os.name == "nt", reason="needs a shell of Unix")
@pytest.mark.parametrize(
    ("redirection", "code"), [("| head -c 0; exit ${PIPESTATUS[0]}", 141), ("> /dev/full", 5), (">&-", 0), ("2>&-", 0)]
)
@pytest.mark.sampled(3)
def test_a_closed_or_full_output_ends_quietly(scene, redirection, code):
    command = f'"{sys.executable}" -m mpp_taichi schema {redirection}'
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False
    )
    assert done.returncode == code and "Traceback" not in done.stderr and "Exception" not in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.sampled(3)
def test_a_signal_saves_what_there_is(scene, number):
    name = scene(run={"duration": 4e6}, record={"size": [64, 48], "seconds": 1000})
    program = start(name, "--video", "f.mp4", "--diagnostics", "d.csv", "--trajectory", "t.npz", "--json", "--every", "1000")
    wait_for(Path("t.npz.position.part"), program, size=1)  # a buffer full of samples: steps were made
    program.send_signal(number)
    out, err = program.communicate(timeout=30)
    found = json.loads(out)
    assert program.returncode == 128 + number == found["exit_code"] and found["status"] == "interrupted"
    state = Snapshot.load(Path("out/kepler.interrupted.npz"))
    assert state.step == found["steps"] > 0
    assert frames_in("f.mp4") > 0 and b"Traceback" not in err
    with np.load("t.npz") as data:
        assert data["step"][-1] == state.step
    assert not list(Path().glob("*.part*")) and not list(Path().glob(".*.lock"))


def wait_for(path, program, size=0):
    for _ in range(1200):
        if path.exists() and path.stat().st_size >= size:
            return
        assert program.poll() is None, program.communicate()
        time.sleep(0.05)
    raise AssertionError(f"{path} did not appear")


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
def test_a_signal_before_the_first_step_is_answered_in_json(scene, monkeypatch, capsys):
    def interrupted(*_, **__):
        signal.raise_signal(signal.SIGTERM)

    name = scene(integrator={"adaptive_dop853": {"tolerance": 1e-6}})
    monkeypatch.setattr(run_loop.RunLoop, "run", interrupted)
    assert main(["run", name, "--headless", "--json"]) == 143
    found = json.loads(capsys.readouterr().out)
    assert (found["status"], found["steps"], found["exit_code"]) == ("interrupted", 0, 143)
    assert Snapshot.load(Path("out/kepler.interrupted.npz")).step == 0
    monkeypatch.setattr(_session, "start", interrupted)
    assert main(["run", name, "--headless", "--json"]) == 143
    assert json.loads(capsys.readouterr().out) == {"status": "interrupted", "exit_code": 143}


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
def test_a_second_signal_ends_at_once():
    program = (
        "import time; from mpp_taichi.cli._signals import Interruption\n"
        "with Interruption():\n    print('ready', flush=True)\n    time.sleep(30)\n    time.sleep(30)"
    )
    # A parent that ignores SIGINT hands that on to its children; the handlers must be installed all the same.
    command = f'trap \'\' INT; exec "{sys.executable}" -c "$0"'
    running = subprocess.Popen(
        ["bash", "-c", command, program], stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert running.stdout.readline() == b"ready\n"
    running.send_signal(signal.SIGINT)
    time.sleep(0.3)
    assert running.poll() is None
    running.send_signal(signal.SIGTERM)
    assert running.wait(timeout=5) == 128 + signal.SIGTERM
    running.stdout.close()


def test_two_runs_do_not_write_one_file(scene, capsys):
    name = scene(run={"duration": 4e6})
    first = start(name, "--headless", "--snapshot", "s.npz")
    try:
        wait_for(Path(".s.npz.lock"), first)
        assert main([name, "--headless", "--snapshot", "s.npz"]) == 5
        assert f"process {first.pid} is writing it" in capsys.readouterr().err
    finally:
        first.kill()
        first.communicate()


def test_a_bad_scene_fails_before_taichi_is_imported(scene):
    program = (
        "import sys; from mpp_taichi.cli.main import main; code = main(sys.argv[1:]); "
        "assert not {'taichi', 'PIL'} & set(sys.modules); sys.exit(code)"
    )
    words = [sys.executable, "-c", program, scene(integrator={"leapfrg": {"dt": 1}})]
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False)
    assert done.returncode == 2 and "did you mean 'leapfrog'" in done.stderr


# --- windows -----------------------------------------------------------------------------------------------------------------


class ScriptedWindow:
    """Stands for a window: runs to the end, goes back, runs a part, and is closed."""

    def __init__(self, spec, size=(0, 0), *, title="", panels=None, desk=None, glass=None, **more):
        self.title, self.panels, self.desk, self.glass, self.handed_on = title, panels, desk, glass, False

    def run(self, simulation, *, steps_per_frame=1, paused=False):
        while not simulation.finished:
            simulation.advance(max(1, round(steps_per_frame)))
        end = simulation.frame()
        assert end.time == self.end and end.title == "Kepler"
        (plot,) = self.panels.plots
        assert plot.x[-1] == self.end
        assert self.panels.export() == "saved out/kepler_0000.csv, out/kepler_0000.svg"
        assert self.panels.export() == "saved out/kepler_0001.csv, out/kepler_0001.svg"
        simulation.advance(1)  # a single step beyond the end
        assert simulation.frame().time > self.end
        simulation.restart()
        assert simulation.frame().time == 0.0 and not simulation.finished
        assert plot.x.tolist() == [0.0]
        simulation.advance(3)


@pytest.mark.parametrize("end", [2.0, 0.05])
def test_a_window_runs_to_the_end_exactly_and_may_start_again(scene, capsys, monkeypatch, end):
    backends.import_taichi()
    from mpp_taichi.views import window

    monkeypatch.setattr(window, "Window", ScriptedWindow)
    monkeypatch.setattr(ScriptedWindow, "end", end, raising=False)
    monkeypatch.setattr(VERBS["run"], "no_window", lambda: "")
    code, found, _ = run_json(
        capsys, scene(run={"duration": end}, inspect=[{"y": "speed"}]), "--diagnostics", "d.npz", "--every", "1"
    )
    assert code == 0 and found["steps"] == 3 and found["status"] == "ok"
    with np.load("d.npz") as table:
        assert table["step"].tolist() == [0, 1, 2, 3]  # of the second start alone


def test_a_window_that_cannot_open_is_said_in_one_line(scene, capsys, monkeypatch):
    monkeypatch.setattr(VERBS["run"], "no_window", lambda: "GGUI does not start (code -6): no Vulkan")
    assert main([scene(record={"size": [64, 48], "fps": 5, "seconds": 1})]) == 0
    assert capsys.readouterr().err.splitlines()[0].startswith("GGUI does not start (code -6): no Vulkan: making a film instead")


# --- the other verbs ---------------------------------------------------------------------------------------------------------


def test_schema_is_json(capsys):
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "Scene"


def test_info_says_what_starts_and_why_the_rest_does_not(capsys):
    code, found, _ = run_json(capsys, "info")
    assert code == 0 and found["backends"]["cpu"]["available"] and found["backends"]["cpu"]["probes"]["finds_nan"]
    assert all(report["available"] or report["reason"] for report in found["backends"].values())
    assert found["packages"]["taichi"] == "1.7.4"
    assert isinstance(found["opencl_devices"]["devices"], list)
    assert main(["info"]) == 0
    assert "backends" in capsys.readouterr().out


def test_a_broken_opencl_driver_does_not_end_info():
    from mpp_taichi.cli.info import _ask_child

    found = _ask_child("import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    assert found == {"devices": [], "problem": "it ended with status -9"} or os.name == "nt"


@pytest.mark.parametrize("verb", list(VERBS))
def test_every_verb_has_help(verb, capsys):
    assert main([verb, "--help"]) == 0
    assert verb in capsys.readouterr().out
