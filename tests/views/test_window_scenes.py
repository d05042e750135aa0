"""Another scene in the same window: chosen from a list by keys or a click; after a faulty choice the old scene continues."""

import json
import re
from pathlib import Path

import pytest
import yaml
from test_window import CORNER, WINDOW, Session, changed, display

from mpp_taichi.cli._request import Request
from mpp_taichi.cli._window_desk import SessionDesk
from mpp_taichi.cli.main import VERBS, main
from mpp_taichi.device import backends
from mpp_taichi.views.scene_list import HEAD, LINE, MESSAGE_LINES, ROW, SceneList

__all__ = ["display"]  # a fixture
PROGRAM = """
import sys
from mpp_taichi.cli.main import main
from mpp_taichi.views.window import Window

Window.__init__.__defaults__ = ((640, 360),)
sys.exit(main(["run", "one.yaml", "--backend", "cpu", "--diagnostics", "one.csv"]))
"""
GREEN, RED = (0.1, 0.9, 0.2), (0.9, 0.1, 0.1)


def scene(title, color, **changes):
    """A sphere at rest, in the lower left part of the picture."""
    return {
        "title": title,
        "particles": [{"body": {"mass": 1, "position": [-2.5, -1.5, 0], "radius": 0.5, "color": list(color)}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 100},
        "view": {"camera": {"position": [0, 0, 8], "look_at": [0, 0, 0], "up": [0, 1, 0]}},
        **changes,
    }


def sphere(picture):
    """The colour of the sphere, whose middle is at column 184 and row 261 by the geometry of the camera."""
    return picture[255:268, 178:190].mean(axis=(0, 1))


# --- the list ---------------------------------------------------------------------------------------------------------------


class Hand:
    """A stand-in for GGUI's panel that clicks the button with a name."""

    def __init__(self, name=None):
        self.name, self.buttons, self.lines = name, [], []

    def button(self, text):
        self.buttons.append(text)
        return self.name is not None and self.name in text

    def text(self, text):
        self.lines.append(text)


def test_a_list_is_walked_by_arrows_and_chosen_from_by_enter_or_a_click():
    names = [f"scene_{number:02d}.yaml" for number in range(40)]
    listed = SceneList(lambda: names, "scene_05.yaml")
    assert not listed.press("Down") and listed.take() is None, "keys are the window's while nothing is shown"
    listed.toggle()
    for key in ("Down", "Down", "Up", "Return"):
        assert listed.press(key)
    assert listed.take() == "scene_06.yaml" and listed.take() is None
    assert not listed.press("Right") and not listed.press("space")
    hand = Hand()
    listed.draw(hand, 360)
    rows = listed.rows(360)
    assert len(hand.buttons) == rows == (360 - 16 - HEAD - LINE * (MESSAGE_LINES + 1)) // ROW
    assert "> scene_06.yaml" in hand.buttons and "  scene_05.yaml  (runs)" in hand.buttons
    for _ in range(7):
        listed.press("Up")
    assert listed.names[listed.marked] == "scene_39.yaml", "round the end"
    assert list(listed.visible(360)) == names[-rows:]
    listed.draw(Hand("scene_35"), 360)
    assert listed.take() == "scene_35.yaml" and listed.names[listed.marked] == "scene_35.yaml"
    listed.message = "one.yaml:3:1: unknown key " + "long " * 200
    listed.draw(hand := Hand(), 360)
    assert len(hand.lines) == 1 + MESSAGE_LINES
    assert listed.press("Escape") and not listed.shown
    left, top, width, height = listed.box((640, 360))
    assert left > 0.0 and top > 0.0 and left + width < 1.0 and top + height < 1.0, "all in the window"


def test_a_list_shows_titles_and_scrolls_to_its_ends():
    names = [f"scene_{number:02d}.yaml" for number in range(40)]
    listed = SceneList(lambda: names, names[0], lambda name: f"Title – {name[6:8]}")
    listed.toggle()
    listed.draw(hand := Hand(), 360)
    rows = listed.rows(360)
    assert hand.buttons[0] == "> Title – 00   scene_00.yaml  (runs)" and hand.lines[0].startswith(f"1 to {rows} of 40")
    listed.scroll(-3)
    assert listed.marked == 0
    listed.scroll(1000)
    listed.draw(hand := Hand(), 360)
    assert listed.marked == 39 and hand.lines[0].startswith(f"{41 - rows} to 40 of 40")


def test_titles_of_files_are_read_without_reading_the_files(tmp_path):
    content = {
        "plain": "title: A – b  # why",
        "quoted": 'x: 1\ntitle: "Two: ü"',
        "none": "particles: []",
        "block": "title: >\n  A",
    }
    for name, text in content.items():
        (tmp_path / f"{name}.yaml").write_text(text + "\nparticles: [", encoding="utf-8")
    desk = object.__new__(SessionDesk)
    desk._file = tmp_path / "plain.yaml"
    titles = {name: desk.title_of(f"{name}.yaml") for name in (*content, "absent")}
    assert titles == {
        "plain": "A – b",
        "quoted": "Two: ü",
        "none": "none.yaml",
        "block": "block.yaml",
        "absent": "absent.yaml",
    }


def test_a_folder_without_scenes_is_said():
    listed = SceneList(tuple, "")
    listed.toggle()
    for key in ("Up", "Down", "Return"):
        assert listed.press(key)
    listed.draw(hand := Hand(), 720)
    assert not hand.buttons and hand.lines == ["there is no scene in a file here"] and listed.take() is None


# --- a real window ----------------------------------------------------------------------------------------------------------


@pytest.mark.timeout(120)
def test_another_scene_opens_in_the_same_window_and_a_faulty_one_does_not(display, tmp_path):
    faulty = scene("Faulty", RED)
    faulty["particles"][0]["body"]["radus"] = 1
    spring = scene("Loose", RED)  # sound as a text, but its step is beyond what its spring allows
    spring["particles"].append({"body": {"mass": 1, "position": [1, 0, 0]}})
    spring |= {"springs": [{"link": {"between": [0, 1], "stiffness": 1e6}}]}
    for name, content in {"a_faulty": faulty, "loose": spring, "one": scene("One", GREEN), "two": scene("Two", RED)}.items():
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    session = Session(display, tmp_path, program=PROGRAM, title="One")
    try:
        session.wait_for(lambda: sphere(session.picture())[1] > 100)
        plain = session.picture()
        session.press("n")
        session.wait_for(lambda: changed(plain, session.picture()) > 3000)
        session.press("Up")
        session.press("Return")
        session.wait_for(lambda: "integrator.leapfrog.dt = 0.01 is beyond" in session.complaints())
        session.press("Up")
        session.press("Return")
        where = re.compile(
            r"^a_faulty\.yaml:\d+:\d+: particles\[0\]\.body\.radus: unknown key 'radus', did you mean 'radius'", re.M
        )
        session.wait_for(lambda: where.search(session.complaints()))
        message_top = 8 + HEAD + 4 * ROW + LINE
        lines = slice(message_top, message_top + LINE * MESSAGE_LINES), slice(WINDOW[0] - 410, None)
        session.wait_for(lambda: (session.picture()[lines].min(axis=2) > 180).sum() > 500)  # the same line stands in the list
        assert sphere(session.picture())[1] > 100 and not (tmp_path / "one.csv").exists(), "the old scene goes on"

        rows = [8 + HEAD + (number + 0.5) * ROW for number in range(4)]
        session.tool("mousemove", CORNER[0] + WINDOW[0] - 380, CORNER[1] + round(rows[3]) - 4)
        session.press()
        session.tool("mousedown", 1)
        session.press()
        session.tool("mouseup", 1)
        session.wait_for(lambda: (color := sphere(session.picture()))[0] > 100 and color[1] < 60)
        assert (tmp_path / "one.csv").read_text(encoding="utf-8").count("\n") > 2, "what was asked of the first is written"
        assert session.said().count("  status  ok") == 1 and "  scene   One: 1 particle" in "\n".join(session.said())
        session.wait_for(lambda: session.tool("search", "--onlyvisible", "--name", "^Two$").split() == [session.window])
        session.press("n")
        session.press("Up")
        session.press("Return")
        session.wait_for(lambda: (color := sphere(session.picture()))[1] > 100 and color[0] < 60)
        session.press("Escape")
        assert session.end() == 0
        told = re.findall(r"^  scene   (\w+):", "\n".join(session.said()), re.M)
        assert told == ["One", "Two", "One"] and session.said().count("  status  ok") == 3
    finally:
        session.close()


class LeavingWindow:
    """Stands for a window that is left for another scene, two.yaml, and closed there."""

    def __init__(self, spec, *, title="", dimensions=3, panels=None, desk=None, glass=None, loss=None, look=""):
        self.title, self.desk, self.glass, self.handed_on = title, desk, glass or object(), False
        self.windows.append(self)

    def run(self, simulation, *, steps_per_frame=1, paused=False):
        simulation.advance(3)
        if self.title == "One":
            assert list(self.desk.scenes()) == ["a_faulty.yaml", "one.yaml", "two.yaml"] and self.desk.present == "one.yaml"
            message = self.desk.open("a_faulty.yaml")
            assert message.startswith("a_faulty.yaml:") and "unknown key 'radus'" in message
            assert simulation.frame().time == 0.03, "it goes on"
            assert self.desk.open("two.yaml") == ""
            self.handed_on = True


def test_each_scene_of_a_window_is_told_and_none_writes_into_the_files_of_another(tmp_path, monkeypatch, capsys):
    backends.import_taichi()
    from mpp_taichi.views import window

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(window, "Window", LeavingWindow)
    monkeypatch.setattr(LeavingWindow, "windows", [], raising=False)
    monkeypatch.setattr(VERBS["run"], "no_window", lambda: "")
    faulty = scene("Faulty", RED)
    faulty["particles"][0]["body"]["radus"] = 1
    for name, content in {"a_faulty": faulty, "one": scene("One", GREEN), "two": scene("Two", RED)}.items():
        Path(f"{name}.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    Path("notes.txt").write_text("no scene", encoding="utf-8")
    assert main(["run", "one.yaml", "--backend", "cpu", "--until", "50", "--snapshot", "one.npz", "--json"]) == 0
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    (before,) = found["scenes_before"]
    assert (before["title"], before["steps"], before["files"]) == ("One", 3, ["one.npz"])
    assert (found["title"], found["steps"], found["files"]) == ("Two", 3, [])
    first, second = LeavingWindow.windows
    assert second.glass is first.glass and not second.handed_on
    assert captured.err.count("unknown key 'radus'") == 1, "the terminal is told as well"
    assert not backends.is_alive(second.desk.open.__self__.simulation.device), "both have given their memory back"


def test_what_is_asked_of_one_scene_is_not_asked_of_the_next():
    asked = Request(
        backend="cpu", window=True, look="film", until=3.0, log=Path("a.yaml"), diagnostics=Path("a.csv"), quiet=True
    )
    assert asked.for_another_scene() == Request(backend="cpu", window=True, look="film", quiet=True)
