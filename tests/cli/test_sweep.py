"""The verb sweep on the command line: what it says before it runs, and what it refuses."""

import json
from pathlib import Path

import pytest

from mpp_taichi.cli.main import main

PLAIN = """
constants: {speed: 1}
particles: [{body: {name: ball, mass: 1, position: [0, 0, 0], velocity: [speed, 0, 0]}}]
integrator: {leapfrog: {dt: 0.25}}
run: {duration: 4}
"""


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(PLAIN)
    return "s.yaml"


VARY = ("--vary", "constants.speed=1:3:5", "--measure", "position: {of: ball, axis: x}")


def test_options_make_the_sweep_of_a_scene_without_one(scene, capsys):
    assert main(["sweep", scene, *VARY, "--measure", "end_time", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["members"] == 5 and found["measures"] == ["position", "end_time"] and found["statuses"] == {"ok": 5}
    lines = Path(found["folder"], "members.csv").read_text().splitlines()
    # A free ball is at x = v t: 4, 6, … 12, which need no rounding.
    assert [line.split(",")[:4] for line in lines[1:]] == [
        [str(k), repr(1 + k / 2), repr(4.0 + 2 * k), "4.0"] for k in range(5)
    ]
    assert all(Path(file).is_file() for file in found["files"])


@pytest.mark.parametrize(
    ("vary", "values"),
    [
        ("log:1:100:3", [1.0, 10.0, 100.0]),
        ("[1, 2, 2*pi]", [1, 2, 6.283185307179586]),
        ("pi:2*pi:2", [3.141592653589793, 6.283185307179586]),
    ],
)
@pytest.mark.sampled(3)
def test_values_are_written_as_ranges_and_lists(scene, capsys, vary, values):
    assert main(["sweep", scene, "--vary", f"constants.speed={vary}", "--measure", "end_time", "--json"]) == 0
    folder = json.loads(capsys.readouterr().out)["folder"]
    rows = Path(folder, "members.csv").read_text().splitlines()[1:]
    assert [float(row.split(",")[1]) for row in rows] == pytest.approx(values, rel=1e-15)


def test_a_dry_run_tells_members_chunks_time_and_memory_and_writes_nothing(scene, capsys):
    words = ["sweep", scene, "--vary", "constants.speed=0:1:1000", "--measure", "end_time", "--dry-run"]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["members"] == 1000 and found["chunks"] * found["members_per_chunk"] >= 1000 > 0
    assert found["seconds"] > 0 and found["bytes"] > 0 and found["side_by_side"]
    assert main(words) == 0
    assert "1,000 members" in capsys.readouterr().out
    assert [each.name for each in Path().iterdir()] == [scene]


@pytest.mark.sampled(3)
def test_a_member_is_run_by_its_number(scene, capsys):
    assert main(["sweep", scene, *VARY, "--quiet"]) == 0
    words = ["run", "out/s.sweep", "--member", "3", "--headless", "--json", "--snapshot", "end.npz", "--no-archive"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "ok"
    assert main(["out/s.sweep", "--member", "3", "--headless", "--quiet", "--set", "run.duration=1"]) == 0
    for words, said in (
        (["run", "out/s.sweep", "--headless"], "--member N"),
        (["run", "out/s.sweep", "--member", "5", "--headless"], "0 to 4"),
        (["run", scene, "--member", "5", "--headless"], "no folder of a sweep"),
    ):
        assert main(words) == 2
        assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "--vary PATH=A:B:N"),
        (["--vary", "constants.speed"], "PATH=A:B:N"),
        (["--vary", "constants.speed=1:2"], "PATH=A:B:N"),
        (["--vary", "constants.speed=1:2:3:4"], "PATH=A:B:N"),
        (["--vary", "constants.speed=1:2:x", "--measure", "end_time"], "count"),
        (["--vary", "constants.sped=1:2:3", "--measure", "end_time"], "sped"),
        (["--vary", "constants.speed=1:2:3"], "measure"),
        (["--vary", "constants.speed=1:2:3", "--measure", "distanse"], "did you mean 'distance'"),
        (["--vary", "constants.speed=1:2:3", "--measure", "speed: {of: bal}"], "ball"),
        (["--vary", "constants.speed=1:2:3", "--measure", "speed: {of"], "--measure"),
        (["--vary", "constants.speed=1:2", "--sample", "halton:4", "--measure", "end_time"], "sobol"),
        (["--vary", "constants.speed=1:2:3", "--sample", "random:4", "--measure", "end_time"], "PATH=A:B with --sample"),
        (["--vary", "constants.speed=1:2:3", "--measure", "end_time", "--seed", "3"], "--seed"),
        (["--vary", "constants.speed=1:2:3", "--measure", "end_time", "--stop", "speed"], "bounds"),
        (["--vary", "constants.speed=1:2:3", "--measure", "end_time", "--part", "3/2"], "k/n"),
        (["--vary", "constants.speed=-1:-2:3", "--measure", "end_time", "--set", "integrator.leapfrog.dt=-1"], "above 0"),
    ],
)
def test_wrong_usage_is_one_line_and_code_2(scene, capsys, words, said):
    assert main(["sweep", scene, *words]) == 2
    captured = capsys.readouterr()
    assert said in captured.err and "Traceback" not in captured.err and captured.out == ""
    assert [each.name for each in Path().iterdir()] == [scene]


@pytest.mark.sampled(3)
def test_a_scene_without_an_end_asks_for_one(scene, capsys):
    Path(scene).write_text(PLAIN.replace("run: {duration: 4}", ""))
    assert main(["sweep", scene, *VARY]) == 2
    assert "--until" in capsys.readouterr().err
    assert main(["sweep", scene, *VARY, "--steps", "8", "--quiet"]) == 0
    assert main(["sweep", scene, *VARY, "--until", "2", "--quiet"]) == 0


def test_members_that_break_down_are_counted_and_the_code_is_0(scene, capsys):
    Path(scene).write_text(PLAIN + "forces: [{linear_drag: {coefficient: speed}}]\n")
    words = ["--vary", "constants.speed=[1, -1, 2]", "--measure", "speed"]
    assert main(["sweep", scene, *words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["statuses"] == {"ok": 2, "refused": 1}


@pytest.mark.parametrize("address", ["local", "local:0", "local:x", "host:1", "tcp://"])
def test_an_address_that_is_none_is_refused(scene, capsys, address):
    assert main(["sweep", scene, *VARY, "--dask", address]) == 2
    assert "tcp://HOST:PORT" in capsys.readouterr().err


def test_no_cluster_at_an_address_is_code_3(scene, capsys, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("mpp_taichi.sweep.dask_carrier.CONNECT_SECONDS", 1)
    assert main(["sweep", scene, *VARY, "--dask", "tcp://127.0.0.1:9", "--quiet"]) == 3
    assert "no Dask cluster at tcp://127.0.0.1:9" in capsys.readouterr().err
