"""The folder of a sweep: what is done is kept, the same command does the rest, and other programs read the table."""

import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.cli.main import main

SCENE = """
constants: {speed: 0.8, phase: 0, v: speed*sqrt(G)}
units: {length: AU, time: day, mass: Msun}
dimensions: 2
particles:
  - body: {name: star, mass: 1, position: [0, 0]}
  - body: {name: planet, mass: 0.001, position: [cos(phase), sin(phase)], velocity: [-v*sin(phase), v*cos(phase)]}
forces: [newtonian_gravity]
integrator: {leapfrog: {dt: 1}}
run: {duration: 500}
sweep:
  vary: {constants.speed: {from: 0.5, to: 1.3, count: 9}, constants.phase: {from: 0, to: 2*pi, count: 6, endpoint: false}}
  measure: [{distance: {between: [star, planet], when: largest}}, end_time]
"""


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(SCENE)
    return tmp_path


def sweep(*words):
    return main(["sweep", "s.yaml", "--quiet", *words])


def table(folder="out/s.sweep"):
    return Path(folder, "members.csv").read_bytes()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The table of the sweep, made without an interruption by one process."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "s.yaml").write_text(SCENE)
    before = os.getcwd()
    os.chdir(folder)
    try:
        assert sweep("--workers", "1") == 0
        yield folder / "out" / "s.sweep"
    finally:
        os.chdir(before)


@pytest.mark.sampled(3)
def test_the_table_has_a_row_for_each_member_with_all_digits(whole):
    rows = list(csv.DictReader(table(whole).decode().splitlines()))
    results = mpp.open_sweep(whole)
    assert results.count == len(rows) == 54 and results.shape == (9, 6)
    for number, row in enumerate(rows):
        assert int(row["member"]) == number
        assert float(row["constants.speed"]) == results.axes["constants.speed"][number // 6]
        assert float(row["constants.phase"]) == results.axes["constants.phase"][number % 6]
        assert float(row["distance"]) == results["distance"][number // 6, number % 6]
        assert row["status"] == results["status"].ravel()[number] == "ok"
        assert float(row["end_time"]) == 500.0 and int(row["steps_done"]) == 500 and int(row["particle"]) == -1
    assert results.counts() == {"ok": 54} and results.units == {"distance": "AU", "end_time": "day"}


def test_a_member_of_the_table_is_the_scene_by_itself(whole):
    results = mpp.open_sweep(whole)
    spec = results.member(31)
    assert results.values_of(31) == {"constants.speed": 1.0, "constants.phase": np.pi / 3}
    largest = 0.0
    with mpp.Simulation(spec, backend="cpu") as simulation:
        for _ in range(500):
            simulation.run(steps=1)
            place = simulation.snapshot().position
            largest = max(largest, float(np.linalg.norm(place[1] - place[0])))
    # The largest distance lies within half a step of a step's end: (ω dt)²/8 = 4e-5 of the distance's change, 2e-3, is less.
    assert largest == pytest.approx(results["distance"].ravel()[31], rel=4e-5 * 2e-3)
    with pytest.raises(mpp.ArgumentError, match="0 to 53"):
        results.member(54)


@pytest.mark.sampled(3)
def test_processes_parts_and_chunks_give_the_same_table(scene, whole):
    assert sweep("--workers", "2", "--chunk", "5", "--out", "a") == 0
    assert table("a") == table(whole)
    for part in ("2/3", "3/3", "1/3"):
        assert sweep("--part", part, "--out", "b") == 0
    assert table("b") == table(whole)


@pytest.mark.sampled(3)
def test_parts_that_are_missing_are_told(scene, capsys):
    assert main(["sweep", "s.yaml", "--part", "1/2"]) == 0
    assert "missing" in capsys.readouterr().out and not Path("out/s.sweep/members.csv").exists()
    assert main(["sweep", "s.yaml"]) == 0
    assert table()


@pytest.mark.sampled(3)
def test_the_same_command_does_only_what_is_missing(scene, capsys):
    assert main(["sweep", "s.yaml", "--json", "--chunk", "9"]) == 0
    first = json.loads(capsys.readouterr().out)
    chunks = sorted(Path("out/s.sweep/chunks").iterdir())
    assert first["ran"] == 54 and len(chunks) == 6 and first["statuses"] == {"ok": 54}
    before = table()
    chunks[2].unlink()
    chunks[4].write_bytes(chunks[4].read_bytes()[:-40])  # cut off, as by a full disk
    times = {path: path.stat().st_mtime_ns for path in chunks if path.exists()}
    assert main(["sweep", "s.yaml", "--json", "--chunk", "9"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["ran"] == 18 and table() == before
    kept = [path for path in chunks if path not in (chunks[2], chunks[4])]
    assert all(path.stat().st_mtime_ns == times[path] for path in kept)


def test_fresh_removes_nothing_where_the_backend_is_missing(scene, capsys):
    assert sweep("--chunk", "54", "--workers", "1") == 0
    chunks = sorted(Path("out/s.sweep/chunks").iterdir())
    assert sweep("--fresh", "--backend", "cuda" if sys.platform == "darwin" else "metal") == 3
    assert sorted(Path("out/s.sweep/chunks").iterdir()) == chunks


@pytest.mark.sampled(3)
def test_another_sweep_in_the_folder_begins_anew_and_keeps_what_it_shares(scene, capsys):
    assert sweep() == 0
    before = table()
    assert sweep("--set", "run.duration=400") == 0
    assert table() != before
    assert main(["sweep", "s.yaml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ran"] == 0 and table() == before
    assert main(["sweep", "s.yaml", "--json", "--fresh"]) == 0
    assert json.loads(capsys.readouterr().out)["ran"] == 54 and table() == before


@pytest.mark.sampled(3)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sweep_that_was_killed_goes_on_to_the_same_bits(scene, whole, seed):
    words = [sys.executable, "-m", "mpp_taichi", "sweep", "s.yaml", "--quiet", "--chunk", "2", "--workers", "2"]
    wait = random.Random(seed).uniform(1.0, 5.0)
    process = subprocess.Popen(words, start_new_session=True)
    time.sleep(wait)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert subprocess.run(words, timeout=120).returncode == 0
    assert table() == table(whole)
    assert not [path for path in Path("out/s.sweep/chunks").iterdir() if path.suffix not in (".npz", ".part")]


@pytest.mark.sampled(3)
def test_an_interruption_ends_within_two_seconds_and_keeps_what_is_done(scene, whole):
    words = [
        sys.executable,
        "-m",
        "mpp_taichi",
        "sweep",
        "s.yaml",
        "--chunk",
        "2",
        "--workers",
        "1",
        "--set",
        "run.duration=20000",
    ]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60.0
    while not list(Path("out").glob("s.sweep/chunks/*.npz")):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    _, said = process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGINT and "the same command goes on" in said and "Traceback" not in said
    assert time.monotonic() - began < 10.0  # two seconds on a machine that does nothing else
    assert Path("out/s.sweep/picture.png").exists()


def test_other_programs_read_the_table(whole):
    xarray = pytest.importorskip("xarray")
    h5py = pytest.importorskip("h5py")
    results = mpp.open_sweep(whole)
    dataset = results.to_xarray()
    assert dataset.sizes == {"constants.speed": 9, "constants.phase": 6}
    assert np.array_equal(dataset["distance"].values, results["distance"]) and dataset["distance"].attrs["units"] == "AU"
    assert dataset["distance"].sel({"constants.speed": 1.0}, method="nearest").shape == (6,)
    with h5py.File(whole / "sweep.nc") as file:
        assert np.array_equal(file["distance"][()], results["distance"])
        assert file["distance"].attrs["units"] == "AU" and "planet" in file["distance"].attrs["long_name"]
        assert file["distance"].dims[0][0][()].tolist() == results.axes["constants.speed"].tolist()
        assert file["status"].asstr()[0, 0] == "ok"
    if "h5netcdf" in xarray.backends.list_engines() or "netcdf4" in xarray.backends.list_engines():
        with xarray.open_dataset(whole / "sweep.nc") as read:
            assert np.array_equal(read["distance"].values, results["distance"])
            assert np.array_equal(read["constants.speed"].values, results.axes["constants.speed"])


def test_a_name_that_the_sweep_lacks_and_a_folder_without_a_sweep_are_refused(whole, tmp_path):
    with pytest.raises(mpp.ArgumentError, match="distance, end_time"):
        mpp.open_sweep(whole)["distanc"]
    with pytest.raises(mpp.MppError, match="no sweep"):
        mpp.open_sweep(tmp_path)
    shutil.copytree(whole, tmp_path / "x")
    (tmp_path / "x" / "sweep.json").write_text("{")
    with pytest.raises(mpp.MppError, match="cannot be read"):
        mpp.open_sweep(tmp_path / "x")


@pytest.mark.sampled(3)
def test_workers_of_dask_give_the_same_table(scene, whole):
    pytest.importorskip("distributed")
    words = [sys.executable, "-m", "mpp_taichi", "sweep", "s.yaml", "--quiet", "--chunk", "6", "--dask", "local:2"]
    done = subprocess.run(words, timeout=180, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert table() == table(whole)


@pytest.mark.sampled(3)
def test_the_script_for_slurm_runs_every_part(scene, whole, capfd):
    assert main(["sweep", "s.yaml", "--slurm", "3", "--quiet"]) == 0
    script = capfd.readouterr().out
    assert "#SBATCH --array=1-3" in script and not Path("out").exists()
    for job in (2, 1, 3):
        subprocess.run(
            ["sh"], input=script, text=True, env={**os.environ, "SLURM_ARRAY_TASK_ID": str(job)}, check=True, timeout=120
        )
    assert table() == table(whole)


def test_the_page_has_every_member_and_the_command_that_repeats_it(whole):
    text = (whole / "index.html").read_text(encoding="utf-8")
    data = json.loads(text.partition('id="data">')[2].partition("</script>")[0].replace("<\\/", "</"))
    results = mpp.open_sweep(whole)
    assert data["names"] == results.names and data["shape"] == [9, 6]
    for number in (0, 17, 53):
        values = results.values_of(number)
        assert [column[number] for column in data["varied"]] == pytest.approx(list(values.values()), rel=1e-8)
        assert data["values"][0][number] == pytest.approx(results["distance"].ravel()[number], rel=1e-8)
        assert data["words"][data["status"][number]] == "ok"
    assert data["command"].endswith("s.sweep --member ") and text.count("data-map") >= 2


def test_parquet_has_the_rows_of_the_table(whole):
    parquet = pytest.importorskip("pyarrow.parquet")
    read = parquet.read_table(whole / "members.parquet").to_pydict()
    rows = list(csv.DictReader(table(whole).decode().splitlines()))
    assert [float(row["distance"]) for row in rows] == read["distance"] and [row["status"] for row in rows] == read["status"]


@pytest.mark.sampled(3)
def test_parts_that_run_at_the_same_time_disturb_each_other_not(scene, whole):
    words = [sys.executable, "-m", "mpp_taichi", "sweep", "s.yaml", "--quiet", "--workers", "1", "--chunk", "6"]
    parts = [subprocess.Popen([*words, "--part", f"{k}/3"], stderr=subprocess.PIPE, text=True) for k in (1, 2, 3)]
    said = [part.communicate(timeout=180)[1] for part in parts]
    assert [part.returncode for part in parts] == [0, 0, 0], said
    assert table() == table(whole)
    assert not [path for path in Path("out/s.sweep").rglob("*") if path.suffix in (".part", ".lock")]


def test_a_worker_answers_before_taichi_prints_its_banner():
    code = "import sys, mpp_taichi.sweep.worker, mpp_taichi.cli.sweep; sys.exit('taichi' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0
