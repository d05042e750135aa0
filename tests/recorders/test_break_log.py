"""The log of springs that broke: its columns, its files, and what it is refused for."""

import csv
import json

import numpy as np
import pytest
import yaml

from mpp_taichi import OutputError
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.break_log import BreakLog

SCENE = {  # three springs, of which the second and the first break, in this order, and the third yields
    "dimensions": 2,
    "particles": [
        {"body": {"name": name, "mass": 1, "position": [k, 0, 0], "velocity": [0.5 * k, 0, 0]}} for k, name in enumerate("abcd")
    ],
    "springs": [
        {"link": {"between": ["a", "b"], "stiffness": 1, "breaks_at": 0.3}},
        {"link": {"between": ["b", "c"], "stiffness": 1, "breaks_at": 0.2, "yields_at": 0.1}},
        {"link": {"between": ["c", "d"], "stiffness": 4, "yields_at": 0.1}},
    ],
    "integrator": {"leapfrog": {"dt": 0.001}},
    "run": {"duration": 2},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("breaks")
    (found / "chain.yaml").write_text(yaml.safe_dump(SCENE), encoding="utf-8")
    return found


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_the_log_has_the_springs_in_the_order_in_which_they_broke(folder, capsys, suffix):
    out = folder / f"breaks{suffix}"
    assert (
        main(["run", str(folder / "chain.yaml"), "--headless", "--backend", "cpu", "--events", str(out), "--json", "--quiet"])
        == 0
    )
    facts = json.loads(capsys.readouterr().out)["spring_limits"]
    if suffix == ".csv":
        rows = list(csv.DictReader(out.open(encoding="utf-8")))
        found = {name: np.array([float(row[name]) for row in rows]) for name in ("time", "i", "j", "energy")}
    else:
        with np.load(out) as archive:
            found = {name: archive[name] for name in archive.files}
    assert found["i"].tolist() == [1, 0] and found["j"].tolist() == [2, 1]
    assert found["time"][0] == facts["first_break"] < found["time"][1] < 2.0
    assert facts["broken_count"] == 2 and facts["yielded_count"] == 2
    # The first loses ½ D (0.3)² or a step more; the second D·0.1 over its plastic way of 0.1 and then ½ D (0.1)².
    assert found["energy"] == pytest.approx([0.1 * 0.1 + 0.5 * 0.1**2, 0.5 * 0.3**2], rel=1e-2)
    assert found["energy"].sum() < facts["lost_energy"]


def test_a_run_without_springs_that_break_has_no_such_log(folder, capsys):
    (folder / "plain.yaml").write_text(
        yaml.safe_dump(SCENE | {"springs": SCENE["springs"][2:]}).replace("yields_at: 0.1", "damping: 0")
    )
    assert main(["run", str(folder / "plain.yaml"), "--headless", "--events", str(folder / "none.csv"), "--quiet"]) == 2
    assert "there are neither contacts nor springs that break" in capsys.readouterr().err


def test_a_file_of_another_kind_is_refused(tmp_path):
    with pytest.raises(OutputError, match="none of .csv, .npz"):
        BreakLog().save(tmp_path / "breaks.json")
