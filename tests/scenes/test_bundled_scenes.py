"""Every bundled scene fulfils its `expect:` block."""

import json
from pathlib import Path

import pytest

from mpp_taichi.cli.main import main

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml"))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_bundled_scene_is_what_it_says(path, capsys):
    code = main(["check", str(path), "--backend", "cpu", "--json", "-q"])
    (found,) = json.loads(capsys.readouterr().out)["scenes"]
    assert code == 0, [row for row in found["expect"] if not row["passed"]]
    assert found["expect"]
