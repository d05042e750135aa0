"""Another scene in the same window: chosen from a list by keys or a click; after a faulty choice the old scene continues."""

import json
import re
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_window import CORNER, WINDOW, Session, changed, display

from mpp_taichi import component
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._shelves import PROGRAM as OWN
from mpp_taichi.cli._shelves import Folder
from mpp_taichi.cli._window_desk import title_of
from mpp_taichi.cli.main import VERBS, main
from mpp_taichi.device import backends
from mpp_taichi.scene.bundled import bundled_scenes
from mpp_taichi.views.scene_list import HEAD, LINE, MESSAGE_LINES, ROW, TEXT_LINES, ListRow, SceneList

__all__ = ["display"]  # a fixture
PROGRAM = """
import sys
from mpp_taichi.cli.main import main
from mpp_taichi.views.window import Window

Window.__init__.__defaults__ = ((640, 360),)
sys.exit(main(["run", "one.yaml", "--backend", "cpu", "--diagnostics", "one.csv", "--verbose"]))
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


@dataclass(frozen=True)
class Shelf:
    """A place with scenes, a way out and a way in."""

    name: str
    count: int = 40

    def rows(self):
        if self.name == "locked":
            raise PermissionError(13, "Permission denied")
        files = [ListRow(f"scene_{number:02d}.yaml", Path(f"scene_{number:02d}.yaml")) for number in range(self.count)]
        if self.name == "inside":
            return [ListRow("..", place=Shelf("home", 2)), ListRow("locked", place=Shelf("locked")), *files]
        return [*([ListRow("inside", place=Shelf("inside", 3))] if self.count == 2 else []), *files]


def test_a_list_is_walked_by_arrows_and_chosen_from_by_enter_or_a_click():
    listed = SceneList(Shelf("home"), Path("scene_05.yaml"))
    assert not listed.press("Down") and listed.take() is None, "keys are the window's while nothing is shown"
    listed.toggle()
    for key in ("Down", "Down", "Up", "Return"):
        assert listed.press(key)
    assert listed.take() == Path("scene_06.yaml") and listed.take() is None
    assert not listed.press("space") and listed.press("Left") and listed.press("Right") and listed.take() is None
    hand = Hand()
    listed.draw(hand, 360)
    count = len(listed.visible(360))
    assert len(hand.buttons) == count == (360 - 16 - HEAD - LINE * TEXT_LINES) // ROW
    assert "> scene_06.yaml" in hand.buttons and "  scene_05.yaml  (runs)" in hand.buttons
    for _ in range(7):
        listed.press("Up")
    assert listed.marked == 39, "round the end"
    assert list(listed.visible(360)) == list(range(40 - count, 40))
    listed.draw(Hand("scene_35"), 360)
    assert listed.take() == Path("scene_35.yaml") and listed.marked == 35
    listed.message = "one.yaml:3:1: unknown key " + "long " * 200
    listed.draw(hand := Hand(), 360)
    assert len(hand.lines) == 2 + MESSAGE_LINES and hand.lines[0] == "home"
    assert listed.press("Escape") and not listed.shown
    left, top, width, height = listed.box((640, 360))
    assert left > 0.0 and top > 0.0 and left + width < 1.0 and top + height < 1.0, "all in the window"


def test_a_list_shows_titles_and_scrolls_to_its_ends():
    listed = SceneList(Shelf("home"), Path("scene_00.yaml"), lambda file: f"Title – {file.name[6:8]}")
    listed.toggle()
    listed.draw(hand := Hand(), 360)
    count = len(listed.visible(360))
    assert hand.buttons[0] == "> Title – 00   scene_00.yaml  (runs)" and hand.lines[1].startswith(f"1 to {count} of 40")
    listed.scroll(-3)
    assert listed.marked == 0
    listed.scroll(1000)
    listed.draw(hand := Hand(), 360)
    assert listed.marked == 39 and hand.lines[1].startswith(f"{41 - count} to 40 of 40")


def test_places_are_walked_through_by_enter_arrows_and_clicks():
    listed = SceneList(Shelf("home", 2), Path("scene_01.yaml"))
    listed.toggle()
    listed.draw(hand := Hand("inside/"), 720)
    assert hand.buttons == ["  inside/", "  scene_00.yaml", "> scene_01.yaml  (runs)"]
    assert listed.place == Shelf("inside", 3) and listed.take() is None, "a click on a place opens no scene"
    listed.draw(hand := Hand(), 720)
    assert hand.lines[0] == "inside" and hand.buttons[:2] == ["> ../", "  locked/"]
    for key in ("Down", "Return"):
        listed.press(key)
    assert listed.place.name == "inside" and listed.message == "locked: cannot be read: Permission denied"
    listed.press("Left")
    assert listed.place == Shelf("home", 2) and listed.message == ""
    listed = SceneList(Shelf("home", 2))
    listed.toggle()
    for key, place in (("Right", "inside"), ("Right", "home"), ("Down", "home"), ("Right", "home")):
        listed.press(key)
        assert listed.place.name == place
    assert listed.take() is None, "the right arrow opens places only"


def test_titles_of_files_are_read_without_reading_the_files(tmp_path):
    content = {
        "plain": "title: A – b  # why",
        "quoted": 'x: 1\ntitle: "Two: ü"',
        "none": "particles: []",
        "block": "title: >\n  A",
    }
    for name, text in content.items():
        (tmp_path / f"{name}.yaml").write_text(text + "\nparticles: [", encoding="utf-8")
    (tmp_path / "state.npz").write_text("title: no scene", encoding="utf-8")
    names = [*(f"{name}.yaml" for name in (*content, "absent")), "state.npz"]
    assert [title_of(tmp_path / name) for name in names] == ["A – b", "Two: ü", "", "", "", ""]


def test_a_folder_without_scenes_is_said():
    listed = SceneList(None)
    listed.toggle()
    for key in ("Up", "Down", "Left", "Right", "Return"):
        assert listed.press(key)
    listed.draw(hand := Hand(), 720)
    assert not hand.buttons and hand.lines == ["", "there is no scene in a file here"] and listed.take() is None


def walked(place, *names):
    """The place to which the rows with these names lead, one after the other."""
    for name in names:
        (row,) = [row for row in place.rows() if row.name == name]
        place = row.place
    return place


def test_a_folder_shows_files_that_convert_reads_and_leads_to_the_scenes_of_the_program(tmp_path, monkeypatch):
    (tmp_path / "in").mkdir()
    (tmp_path / ".hidden").mkdir()
    for name in ("a.yaml", "empty.npz", "g.csv", "h.py", ".i.yaml", "empty.plist"):
        (tmp_path / name).touch()
    (tmp_path / "b.plist").write_text("# springs\npos 0 0 0 0 1 0 0.1 1 1 1\n", encoding="utf-8")
    (tmp_path / "c.TXT").write_text("3\n1e12\n", encoding="utf-8")
    (tmp_path / "d.xml").write_text("<SolarSystem>", encoding="utf-8")
    (tmp_path / "e.tipsy").write_bytes(struct.pack(">d6i", 0.0, 0, 3, 0, 0, 0, 0))
    (tmp_path / "notes.txt").write_text("3 wishes", encoding="utf-8")
    (tmp_path / "page.xml").write_text("<html>", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert main(["convert", "b.plist", "f.npz", "--quiet"]) == 0
    np.savez("table.npz", time=[0.0])
    folder = Folder.of(Path("in"))
    outside = walked(folder, "..")
    files = ["a.yaml", "b.plist", "c.TXT", "d.xml", "e.tipsy", "f.npz"]
    assert [row.name for row in outside.rows()] == ["..", OWN, "in", *files]
    assert outside.rows()[3].file == Path("a.yaml"), "as a user would write it"
    assert walked(outside, "in") == folder == walked(outside, OWN, "..", "in")
    topics = walked(outside, OWN).rows()
    shown = {row.name: row.file for topic in topics[1:] for row in topic.place.rows()[1:]}
    assert [row.name for row in topics] == ["..", "Gravity", "Springs", "Hard spheres", "Other forces"]
    assert shown == bundled_scenes() and walked(topics[1].place, "..") == walked(outside, OWN)
    root = Folder(Path(tmp_path.anchor))
    assert [row.name for row in root.rows()][0] == OWN, "there is no way out of the whole disk"


# --- a real window ----------------------------------------------------------------------------------------------------------


@pytest.mark.timeout(120)
@pytest.mark.sampled(3)
def test_another_scene_opens_in_the_same_window_and_a_faulty_one_does_not(display, tmp_path):
    faulty = scene("Faulty", RED)
    faulty["particles"][0]["body"]["radus"] = 1
    spring = scene("Loose", RED)  # sound as a text, but its step is beyond what its spring allows
    spring["particles"].append({"body": {"mass": 1, "position": [1, 0, 0]}})
    spring |= {"springs": [{"link": {"between": [0, 1], "stiffness": 1e6}}]}
    for name, content in {"a_faulty": faulty, "loose": spring, "one": scene("One", GREEN), "two": scene("Two", RED)}.items():
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    (tmp_path / "more").mkdir()
    ball = "pos 0 -2.5 -1.5 0 1 0 0.5 0.1 0.1 0.9\n"  # blue, in the middle of its picture
    (tmp_path / "more" / "ball.plist").write_text(ball, encoding="utf-8")
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
        message_top = 8 + HEAD + 7 * ROW + 2 * LINE  # below the name of the folder, seven rows and the hint
        lines = slice(message_top, message_top + LINE * MESSAGE_LINES), slice(WINDOW[0] - 410, None)
        session.wait_for(lambda: (session.picture()[lines].min(axis=2) > 180).sum() > 500)  # the same line stands in the list
        assert sphere(session.picture())[1] > 100 and not (tmp_path / "one.csv").exists(), "the old scene goes on"

        rows = [8 + HEAD + LINE + (number + 0.5) * ROW for number in range(7)]
        session.tool("mousemove", CORNER[0] + WINDOW[0] - 380, CORNER[1] + round(rows[6]) - 4)
        session.press()
        session.tool("mousedown", 1)
        session.press()
        session.tool("mouseup", 1)
        session.wait_for(lambda: (color := sphere(session.picture()))[0] > 100 and color[1] < 60)
        assert (tmp_path / "one.csv").read_text(encoding="utf-8").count("\n") > 2, "what was asked of the first is written"
        assert session.said().count("  status  ok") == 1 and "  scene   One: 1 particle" in "\n".join(session.said())
        session.wait_for(lambda: session.tool("search", "--onlyvisible", "--name", "^Two$").split() == [session.window])
        session.press("n")
        for key in ("Down", "Down", "Down", "Right", "Down", "Down", "Return"):  # round the end, and into the folder
            session.press(key)
        blue = np.array([-1, -1, 1])  # of more than both other colours together
        session.wait_for(lambda: (session.picture() @ blue > 20).sum() > 1000)
        session.press("a")
        for key in ("Down", "Left", "Return"):  # the integrator after this one, with half the step
            session.press(key)
        session.wait_for(lambda: session.complaints().count("compiling ball") == 2)
        session.wait_for(lambda: (session.picture() @ blue > 20).sum() > 1000)
        session.press("Escape")
        assert session.end() == 0
        told = re.findall(r"^  scene   (\w+):", "\n".join(session.said()), re.M)
        assert told == ["One", "Two", "ball", "ball"] and session.said().count("  status  ok") == 4
        methods = re.findall(r"^  method  (\w+), dt ([^\s,]+)", "\n".join(session.said()), re.M)
        names = component.names("integrators")
        after = names[names.index(methods[2][0]) + 1]
        assert methods[3] == (after, f"{0.5 * float(methods[2][1]):g}")
    finally:
        session.close()


class LeavingWindow:
    """Stands for a window that is left for another scene, two.yaml, and closed there."""

    def __init__(self, spec, *, title="", dimensions=3, panels=None, desk=None, glass=None, settings=None, **more):
        assert settings is not None and set(more) == {"loss", "look", "decided"}
        self.title, self.desk, self.glass, self.handed_on = title, desk, glass or object(), False
        self.windows.append(self)

    def run(self, simulation, *, steps_per_frame=1, paused=False):
        simulation.advance(3)
        if self.title == "One":
            assert self.desk.place == Folder.of(Path("one.yaml")) and self.desk.present == Path("one.yaml")
            message = self.desk.open(Path("a_faulty.yaml"))
            assert message.startswith("a_faulty.yaml:") and "unknown key 'radus'" in message
            assert simulation.frame().time == 0.03, "it goes on"
            assert self.desk.open(Path("two.yaml")) == ""
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
