"""The verb compare: rows, missing backends, exit codes, and the HTML page."""

import json
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import pytest
import yaml
from PIL import Image

from mpp_taichi.cli.main import main
from mpp_taichi.compare import scaling, table
from mpp_taichi.compare.numpy_reference import NumpyForces
from mpp_taichi.compare.process import WorkerError, WorkerProcess
from mpp_taichi.errors import BackendError
from scenes import cluster, kepler

KEYS = {"scene", "integrator", "particle_count", "rows", "crossovers", "warnings", "known", "sentence", "status"}
ROW_KEYS = {
    *(
        "label",
        "backend",
        "variant",
        "precision",
        "status",
        "reason",
        "verdict",
        "decided_by",
        "findings",
        "energy_change",
        "momentum_change",
    ),
    *("cold_compile_seconds", "warm_compile_seconds", "step_seconds", "step_spread", "launches_per_step", "copy_seconds"),
    *("rates", "peaks", "device", "scaling"),
}


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Kepler's problem on the CPU, on NumPy, and on a backend that no machine has beside them."""
    folder = tmp_path_factory.mktemp("compare")
    scene = folder / "kepler.yaml"
    scene.write_text(yaml.safe_dump({**kepler(dt=0.01), "run": {"duration": 5.0}}), encoding="utf-8")
    out = folder / "out"
    words = ["compare", str(scene), "--backends", "cpu,metal,numpy", "--precisions", "f32,f64", "--budget", "10s", "--quiet"]
    code = main([*words, "--out", str(out)])
    found = json.loads((out / "compare.json").read_text(encoding="utf-8"))
    return SimpleNamespace(code=code, scene=scene, out=out, found=found, rows=found["rows"])


@pytest.mark.sampled(3)
def test_backends_that_agree_end_with_0(compared):
    assert compared.code == 0 and compared.found["status"] == "ok"
    assert "agree to rounding" in compared.found["sentence"]
    ok = [row for row in compared.rows if row["status"] == "ok"]
    assert [(row["backend"], row["precision"], row["verdict"]) for row in ok] == [
        ("cpu", "f32", "rounding"),
        ("cpu", "f64", "rounding"),
        ("numpy", "f64", "rounding"),
    ]


def test_a_missing_backend_is_a_row_with_the_reason(compared):
    import sys

    if sys.platform == "darwin":
        pytest.skip("Metal is here")
    (row,) = (row for row in compared.rows if row["backend"] == "metal")
    assert row["status"] == "missing" and "macOS" in row["reason"] and row["step_seconds"] is None
    assert any("macOS" in line and "missing" in line for line in table.lines(compared.rows))


def test_the_energy_of_a_step_is_a_column_where_a_machine_counts_it(compared):
    first, *others = compared.rows
    silent = [{**row, "step_joules": None} for row in compared.rows]
    assert table.head(silent)[3:5] == ("GFLOP/s", "of peak") and table.JOULES not in table.head(silent)
    counted = [{**first, "status": "ok", "step_joules": 2.5e-4}, *others]
    columns = table.head(counted)
    assert table.cells(counted[0], columns)[columns.index("J / step")] == "0.00025"
    head, line, *_ = table.lines(counted)
    end = head.index("J / step") + len("J / step")
    assert line[:end].endswith(" 0.00025")


def test_the_numbers_are_there_and_fit_together(compared):
    found = compared.found
    assert found.keys() >= KEYS and 1 <= found["steps_compared"] <= 500
    for row in compared.rows:
        if row["status"] != "ok":
            continue
        assert row.keys() >= ROW_KEYS
        assert row["step_seconds"] == sorted(row["step_samples"])[len(row["step_samples"]) // 2]
        pairs = 2 / row["step_seconds"]  # two bodies, one evaluation a step
        assert row["rates"]["interactions_per_second"] == pytest.approx(pairs)
        flops = {"f32": 20, "f64": 30}[row["precision"]] * pairs
        assert row["rates"]["flops"] == pytest.approx(flops)
        best = max(each["peaks"]["flops"] for each in compared.rows if each["precision"] == row["precision"])
        assert row["rates"]["share_of_peak_flops"] == pytest.approx(flops / best)
        # Leapfrog at e = 0.3 and ω dt = 0.01 wobbles by (ω dt)² times a number of the order of one; f32 adds its rounding.
        assert abs(row["energy_change"]) < 1e-4 and row["momentum_change"] < 1e-4
        assert row["backend"] == "numpy" or row["cold_compile_seconds"] > 0.0


@pytest.mark.sampled(3)
def test_a_bug_ends_with_4(compared, monkeypatch, capfd):
    """The reference is made wrong in this process; the worker is sound, but they cannot agree."""
    steady = NumpyForces.steady
    monkeypatch.setattr(NumpyForces, "steady", lambda self, *rest: -steady(self, *rest))
    monkeypatch.setattr(scaling, "COUNTS", (2, 8))
    words = ["compare", str(compared.scene), "--backends", "numpy", "--budget", "30s", "--json", "--steps", "10", "--scaling"]
    assert main([*words, "--out", str(compared.out.parent / "bug")]) == 4
    found = json.loads(capfd.readouterr().out)
    (row,) = found["rows"]
    assert found["status"] == row["verdict"] == "bug" and row["decided_by"]["ratio"] > 1e6
    assert "numpy f64: bug" in found["sentence"]
    assert [point["particle_count"] for point in row["scaling"]] == [2, 8]


@pytest.mark.sampled(3)
def test_contacts_that_one_backend_has_alone_are_not_judged_and_it_is_said_why(request, tmp_path):
    scene = request.config.root_folder / "scenes" / "maxwell_boltzmann.yaml"
    words = ["--backends", "cpu", "--budget", "8s", "--quiet", "--out", str(tmp_path)]
    assert main(["compare", str(scene), *words]) == 0
    found = json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))
    assert [row["verdict"] for row in found["rows"]] == ["not judged"] * 2
    assert all("only the CPU has event_driven contacts" in json.dumps(row) for row in found["rows"])


def test_a_worker_that_dies_or_cannot_says_why(tmp_path):
    worker = WorkerProcess(tmp_path, tmp_path, lambda: None)
    with pytest.raises(WorkerError, match="no scene was built"):
        worker.ask("time", 60.0)
    worker.kill()
    with pytest.raises(WorkerError, match="its process ended with status"):
        worker.ask("time", 60.0)


def test_the_folder_of_the_command_need_not_be_that_of_the_scene(compared, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["compare", str(compared.scene), "--backends", "cpu,numpy", "--precisions", "f64", "--budget", "4s", "--quiet"]
    assert main(words) == 0
    found = json.loads((tmp_path / "out" / "kepler.compare" / "compare.json").read_text(encoding="utf-8"))
    assert [row["verdict"] for row in found["rows"]] == ["rounding", "rounding"]


def test_a_comparison_of_which_nothing_runs_is_a_failure(tmp_path, monkeypatch, compared):
    monkeypatch.chdir(tmp_path)
    text = compared.scene.read_text(encoding="utf-8").replace("leapfrog", "taylor")
    (tmp_path / "other.yaml").write_text(text, encoding="utf-8")
    assert main(["compare", "other.yaml", "--backends", "numpy", "--budget", "4s", "--quiet"]) == BackendError.exit_code


@pytest.fixture(scope="module")
def ladder(tmp_path_factory, opencl):
    """Forty bodies, each way to sum over their pairs."""
    folder = tmp_path_factory.mktemp("ladder")
    scene = folder / "cluster.yaml"
    scene.write_text(yaml.safe_dump({**cluster(40), "run": {"duration": 0.1}}), encoding="utf-8")
    words = ["--backends", "cpu,opencl", "--precisions", "f64", "--ladder", "--budget", "8s", "--quiet"]
    assert main(["compare", str(scene), *words, "--out", str(folder / "out")]) == 0
    return json.loads((folder / "out" / "compare.json").read_text(encoding="utf-8"))["rows"]


@pytest.mark.sampled(6)
def test_each_rung_of_the_ladder_is_a_row_that_is_judged_and_timed(ladder):
    rungs = {row["label"]: row["plan"] for row in ladder}
    assert list(rungs)[:3] == ["cpu", "cpu serial", "cpu parallel"] and rungs["cpu serial"] == "serial"
    for name in ("naive", "tiled", "vectors", "third_law"):
        assert rungs[f"opencl {name}"].startswith(f"pairs: {name}")
    assert {row["verdict"] for row in ladder} == {"rounding"} and all(row["step_seconds"] > 0 for row in ladder)
    assert any(line.startswith("opencl third_law") for line in table.lines(ladder))


def test_a_ladder_needs_pairs(tmp_path, capsys):
    scene = tmp_path / "falling.yaml"
    falling = {**kepler(), "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}]}
    scene.write_text(yaml.safe_dump(falling), encoding="utf-8")
    assert main(["compare", str(scene), "--ladder"]) == 2
    assert "no force between all particles" in capsys.readouterr().err


@pytest.mark.parametrize("words", [("--backends", "abacus"), ("--precisions", "f16"), ("--budget", "never")])
def test_wrong_words_are_wrong_usage(compared, words):
    assert main(["compare", str(compared.scene), *words]) == 2


def test_the_page_is_whole_and_opens_in_a_browser(compared, tmp_path):
    page = compared.out / "compare.html"
    text = page.read_text(encoding="utf-8")
    tree = ElementTree.fromstring(text)  # as strict as XML
    tags = [element.tag.rpartition("}")[2] for element in tree.iter()]
    assert "script" not in tags and tags.count("table") == 2 and "url(" not in text
    assert not [element for element in tree.iter() for name in element.attrib if name in ("src", "href")]
    words = " ".join(tree.itertext())
    assert compared.found["sentence"][1:] in words and "macOS" in words and compared.found["known"]["cpu"] in words
    browser = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no browser here: chromium is not installed")
    picture = tmp_path / "page.png"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1000,1400", f"--user-data-dir={tmp_path / 'p'}"]
    command = [browser, *options, "--virtual-time-budget=1000", f"--screenshot={picture}", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert picture.is_file(), done.stderr
    colors = Image.open(picture).convert("RGB").getcolors(maxcolors=2**24)
    ink = {color for count, color in colors if count >= 20}
    # Paper, and the lines of the first backend and of the third (the second is missing).
    assert {(255, 255, 255), (0x2A, 0x6F, 0xCF), (0xB9, 0x7A, 0x00)} <= ink
