"""The round on a GPU, on the backends of a CPU: stages, what is kept of them, and a second call that goes on."""

import json
import sys

import pytest
from conftest import ROOT

sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "tools" / "gpu")]

import gpu_round  # noqa: E402
from families import FAMILIES  # noqa: E402
from rates import share  # noqa: E402
from round_page import html, markdown  # noqa: E402
from stages import Stage, stages_of  # noqa: E402


@pytest.mark.sampled(3)
def test_a_short_round_and_its_second_call(tmp_path, capsys):
    words = ["--backends", "cpu,metal", "--short", "--only", "info,rates", "--out", str(tmp_path)]
    assert gpu_round.main(words) == 0
    first = json.loads((tmp_path / "round.json").read_text(encoding="utf-8"))
    rates = {stage["data"]["family"]: stage["data"] for stage in first["stages"].values() if stage["kind"] == "rates"}
    assert set(rates) == set(FAMILIES) and list(first["missing"]) == ["metal"]
    for name, found in rates.items():
        (row,) = found["rows"]
        assert row["count"] == FAMILIES[name].counts[0] and row["step_seconds"] > 0.0
        assert found["flops"] > 1e8 and found["bytes"] > 1e8 and found["launch_seconds"] < 0.1
        if name != "adaptive":
            assert row["rate"] == pytest.approx(FAMILIES[name].amount(row["count"]) / row["step_seconds"])
    told = (tmp_path / "round.md").read_text(encoding="utf-8")
    assert "metal does not start here" in told and "| 1,024 | cpu | f64 |" in told
    assert "<table>" in (tmp_path / "round.html").read_text(encoding="utf-8")
    capsys.readouterr()
    assert gpu_round.main(words) == 0
    assert "---" not in capsys.readouterr().out.split("# GPU round")[0]
    assert json.loads((tmp_path / "round.json").read_text(encoding="utf-8"))["stages"] == first["stages"]


@pytest.mark.sampled(3)
def test_rates_on_software_vulkan(tmp_path, software_vulkan):
    (stage,) = (each for each in stages_of(["vulkan"], tmp_path, short=True) if each.name == "adaptive on vulkan in f64")
    result = gpu_round.run(stage, stage.seconds)
    assert result["good"], result["told"]
    assert result["data"]["backend"] == "vulkan" and result["data"]["rows"][0]["rate"] > 0.0


def test_a_stage_that_takes_too_long_is_ended_and_keeps_what_it_wrote(tmp_path):
    file = tmp_path / "part.json"
    code = f"import json, time; open({str(file)!r}, 'w').write(json.dumps([1])); print('begun', flush=True); time.sleep(60)"
    command = (sys.executable, "-c", code)
    kept = gpu_round.run(Stage("long", "rates", command, 60.0, file, keeps_parts=True), 3.0)
    lost = gpu_round.run(Stage("long", "film", command, 60.0, file), 3.0)
    assert kept["good"] and kept["cut_off"] and kept["data"] == [1] and kept["seconds"] < 30.0
    assert not lost["good"] and lost["cut_off"] and lost["told"] == "begun\n"
    assert gpu_round.is_done(kept) and not gpu_round.is_done(lost) and not gpu_round.is_done(None)


def test_a_file_of_an_earlier_call_is_no_result(tmp_path):
    """A stage that is cut off before it writes anything has not measured what an earlier program left in the folder."""
    file = tmp_path / "part.json"
    file.write_text("[2]", encoding="utf-8")
    command = (sys.executable, "-c", "import time; time.sleep(60)")
    result = gpu_round.run(Stage("long", "rates", command, 60.0, file, keeps_parts=True), 1.0)
    assert result["data"] is None and not result["good"]


def test_a_stage_that_fails_is_told(tmp_path):
    result = gpu_round.run(Stage("broken", "film", (sys.executable, "-c", "print('no'); raise SystemExit(7)"), 60.0), 30.0)
    known = {"began": "now", "stages": {"broken": result}, "missing": {"cuda": "no driver"}}
    assert not result["good"] and result["code"] == 7
    for page in (markdown(known), html(known)):
        assert "broken, exit code 7: no" in page and "cuda does not start here: no driver" in page


def test_another_program_or_other_backends_begin_anew(tmp_path):
    """A kept result stands for the program and the backends that gave it."""
    from types import SimpleNamespace

    options = SimpleNamespace(out=tmp_path, fresh=False, short=True)
    known = gpu_round.known_results(options, ["cpu"])
    known["stages"]["one"] = {
        "kind": "info",
        "good": True,
        "code": 0,
        "seconds": 1.0,
        "cut_off": False,
        "told": "",
        "data": None,
    }
    gpu_round.write(tmp_path, known)
    assert gpu_round.known_results(options, ["cpu"])["stages"]
    assert not gpu_round.known_results(options, ["cpu", "vulkan"])["stages"]
    assert not gpu_round.known_results(SimpleNamespace(out=tmp_path, fresh=True, short=True), ["cpu"])["stages"]


def test_the_part_of_the_limit():
    """1,000² pairs of 20 flops in a second are a tenth of 2e8 flops a second; in f64 a pair counts 30."""
    row, limits = {"count": 1000, "step_seconds": 1.0, "rate": 1e6}, {"flops": 2e8, "bytes": 1e6}
    assert share(FAMILIES["pairs"], row, limits, "f32") == pytest.approx(0.1)
    assert share(FAMILIES["pairs"], row, limits, "f64") == pytest.approx(0.15)
    # 32² masses: 1,984 springs of 2 · (4 + 2 · 4) bytes, and 28 numbers of 4 bytes for each mass.
    springs = {"count": 1024, "step_seconds": 1.0, "rate": 1984.0}
    assert share(FAMILIES["springs"], springs, limits, "f32") == pytest.approx((1984 * 24 + 1024 * 112) / 1e6)
    assert share(FAMILIES["tree"], row, limits, "f32") is None
