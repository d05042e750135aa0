"""A window without a scene: the list is there at once, a scene opens from it, and without a window a scene is required."""

import json
import re

import pytest
import yaml
from test_window import Session, display
from test_window_scenes import GREEN, scene, sphere

from mpp_taichi.cli.main import VERBS, main
from mpp_taichi.device import backends

__all__ = ["display"]  # a fixture
PROGRAM = """
import sys
from mpp_taichi.cli.main import main
from mpp_taichi.views.empty_window import EmptyWindow

EmptyWindow.__init__.__defaults__ = ((640, 360),)
sys.exit(main(["run", "--backend", "cpu"]))
"""


@pytest.mark.timeout(120)
@pytest.mark.sampled(3)
def test_a_scene_opens_from_a_window_that_has_none(display, tmp_path):
    (tmp_path / "a_faulty.yaml").write_text("title: Faulty\nparticle: []\n", encoding="utf-8")
    (tmp_path / "one.yaml").write_text(yaml.safe_dump(scene("One", GREEN), sort_keys=False), encoding="utf-8")
    session = Session(display, tmp_path, program=PROGRAM, title="mpp_taichi")
    try:
        for key in ("Up", "Up", "Return"):  # round the end of the list, at which the files of the folder are
            session.press(key)
        session.wait_for(lambda: "a_faulty.yaml:2:1: particle: unknown key" in session.complaints())
        assert session.process.poll() is None, "the list remains"
        session.press("Down")
        session.press("Return")
        session.wait_for(lambda: sphere(session.picture())[1] > 100)
        session.press("q")
        assert session.end() == 0
        assert re.findall(r"^  scene   (\w+):", "\n".join(session.said()), re.M) == ["One"]
    finally:
        session.close()


class ClosedWindow:
    """Stands for a window in which a file with a fault is opened, and which is then closed."""

    def __init__(self, place, title_of, open, loss, *, settings):
        self.open, self.rows = open, place.rows()

    def run(self):
        faulty = next(row.file for row in self.rows if row.name == "faulty.yaml")
        assert self.open(faulty).startswith("faulty.yaml:1:1: ")
        return False


def test_a_window_that_is_closed_without_a_scene_is_no_fault(tmp_path, monkeypatch, capsys):
    backends.import_taichi()
    from mpp_taichi.views import empty_window

    monkeypatch.chdir(tmp_path)
    (tmp_path / "faulty.yaml").write_text("particle: []", encoding="utf-8")
    monkeypatch.setattr(empty_window, "EmptyWindow", ClosedWindow)
    monkeypatch.setattr(VERBS["run"], "no_window", lambda: "")
    assert main(["run", "--backend", "cpu", "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {"status": "ok", "exit_code": 0}
    assert captured.err.count("missing key 'particles'") == 1


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "run: no screen, so a scene is required: SCENE; `mpp-taichi scenes` lists the scenes"),
        (["--backend", "cpu", "--look", "plain"], "run: no screen, so a scene is required: SCENE"),
        (["--steps", "0"], "run: with --steps a scene is required: SCENE"),
        (["--headless"], "run: with --headless a scene is required: SCENE"),
        (["--set", "run.duration=3"], "run: with --set a scene is required: SCENE"),
        (["--energy-balance", "--inspect", "a.svg"], "run: with --inspect a scene is required: SCENE"),
        (["--rewind"], "run: with --rewind a scene is required: SCENE"),
    ],
)
def test_without_a_window_or_with_more_than_a_window_a_scene_is_required(words, told, monkeypatch, capsys):
    monkeypatch.setattr(VERBS["run"], "no_window", lambda: "no screen")
    assert main(["run", *words]) == 2
    assert capsys.readouterr().err.startswith(told)
