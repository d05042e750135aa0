"""Files whose names have bytes that are no letters, such as names in Latin-1 where names are in UTF-8, are read and written."""

import os
import sys

import pytest
import yaml

from mpp_taichi.cli.main import main
from scenes import kepler

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
WORD = os.fsdecode(b"sc\xe8ne")


@pytest.fixture
def name(tmp_path, monkeypatch):
    """A scene with such a name, in the working folder."""
    monkeypatch.chdir(tmp_path)
    text = yaml.safe_dump({**kepler(), "run": {"duration": 0.1}, "record": {"size": [64, 48], "seconds": 0.1}})
    (tmp_path / f"{WORD}.yaml").write_text(text, encoding="utf-8")
    return f"{WORD}.yaml"


@pytest.mark.parametrize(
    "words",
    [
        ["check", "--quiet"],
        ["run", "--headless", "--quiet", "--diagnostics", f"{WORD}.csv", "--json"],
        ["record", "--quiet", "--html", f"{WORD}.html"],
    ],
    ids=lambda words: words[0],
)
def test_a_verb_takes_such_a_name(name, words, tmp_path, capfd):
    code = main([words[0], name, *words[1:]])
    said = capfd.readouterr()
    assert code == 0 and "internal error" not in said.err, said.err
    for word in words:
        assert not word.startswith(WORD) or (tmp_path / word).exists()


def test_a_property_list_of_such_a_name_becomes_a_scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / f"{WORD}.plist").write_text("pos 0 0 0 0 1 0 0.1 1 1 0\nvel 0 0 0 1\nvfix 0 1 1 0\nk2 2.9584e-4\ndt 0.03\n")
    assert main(["convert", f"{WORD}.plist", "made.yaml"]) == 0
    assert (tmp_path / "made.yaml").read_text().startswith("# From sc?ne.plist.")
