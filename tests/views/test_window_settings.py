"""The settings of a window that are kept from run to run: where, what is taken of them, and what becomes of a broken file."""

import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_window import SCREEN, Session, display
from test_window_scenes import GREEN, scene
from window_manager import WindowManager

from mpp_taichi.cli import _kept_settings
from mpp_taichi.cli._interactive import _decided
from mpp_taichi.cli._kept_settings import kept_settings, settings_file
from mpp_taichi.cli._options import FRESH, WINDOW_VARIABLE
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from mpp_taichi.views.glass import Glass
from mpp_taichi.views.window_settings import KeptChanges, WindowSettings

__all__ = ["display"]  # a fixture
WHOLE = WindowSettings("plain", (900, 600), (-20, 40), False, True, -3)
PROGRAM = """
import os
import sys
from mpp_taichi.cli.main import main

del os.environ["MPP_TAICHI_WINDOW"]
os.environ["XDG_CONFIG_HOME"] = os.path.abspath("kept")
sys.exit(main(["run", "one.yaml", "--backend", "cpu"]))
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    """The file of the settings, which is not there yet."""
    monkeypatch.delenv(WINDOW_VARIABLE)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "mpp_taichi" / "window.yaml"


def test_settings_are_kept_in_the_folder_of_the_system(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.setenv("APPDATA", str(tmp_path / "roaming"))
    for system, folder in (
        ("linux", ".config"),
        ("win32", "roaming"),
        ("darwin", "Library/Application Support"),
    ):
        monkeypatch.setattr(sys, "platform", system)
        assert settings_file() == tmp_path / folder / "mpp_taichi" / "window.yaml"
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative")
    assert settings_file() == tmp_path / ".config" / "mpp_taichi" / "window.yaml"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "own"))
    assert settings_file() == tmp_path / "own" / "mpp_taichi" / "window.yaml"


def test_what_was_changed_is_there_in_the_next_run(file):
    with kept_settings(fresh=False) as settings:
        assert settings == WindowSettings()
    assert not file.exists(), "nothing was changed"
    with kept_settings(fresh=False) as settings:
        for key, value in asdict(WHOLE).items():
            setattr(settings, key, value)
    assert yaml.safe_load(file.read_text(encoding="utf-8")) == WHOLE.as_mapping() and len(list(file.parent.iterdir())) == 1
    with kept_settings(fresh=False) as settings:
        assert settings == WHOLE
        settings.speed = 2
    before = file.read_bytes()
    with pytest.raises(KeyboardInterrupt), kept_settings(fresh=False) as settings:
        assert settings.speed == 2 and settings.size == (900, 600)
        settings.trails = False
        raise KeyboardInterrupt
    assert file.read_bytes() != before, "a run that is interrupted keeps them as well"


@pytest.mark.parametrize("by_variable", [False, True])
def test_fresh_neither_reads_nor_writes(file, monkeypatch, by_variable):
    file.parent.mkdir(parents=True)
    file.write_text("look: plain\n", encoding="utf-8")
    if by_variable:
        monkeypatch.setenv(WINDOW_VARIABLE, FRESH)
    with kept_settings(fresh=not by_variable) as settings:
        assert settings == WindowSettings()
        settings.speed = 3
    assert file.read_text(encoding="utf-8") == "look: plain\n"


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"look: pretty\n", "look cannot be 'pretty'"),
        (b"size: [10, 10]\n", "size cannot be '[10, 10]'"),
        (b"size: 900\n", "size cannot be '900'"),
        (b"place: [1.5, 2]\n", "place cannot be '[1.5, 2]'"),
        (b"panels: 1\n", "panels cannot be '1'"),
        (b"speed: true\n", "speed cannot be 'True'"),
        (b"speed: 99\n", "speed cannot be '99'"),
        (b"colour: red\n", "unknown key 'colour', allowed: look, size, place, panels, trails, speed"),
        (b"look: [plain\n", ""),
        (b"- look\n", ""),
        (b"\xff\xfe\x00", ""),
        (b"# " + 70000 * b"x", "it is larger than 65536 bytes"),
    ],
)
def test_a_broken_file_is_ignored_in_one_line_and_replaced_by_the_next_change(file, capsys, content, reason):
    file.parent.mkdir(parents=True)
    file.write_bytes(content)
    with kept_settings(fresh=False) as settings:
        assert settings == WindowSettings()
    said = capsys.readouterr().err
    assert (
        said.count("\n") == 1
        and said.startswith(f"note: the settings of the window in {file} are ignored: ")
        and reason in said
    )
    assert file.read_bytes() == content
    with kept_settings(fresh=False) as settings:
        settings.trails = True
    capsys.readouterr()
    with kept_settings(fresh=False) as settings:
        assert settings == WindowSettings(trails=True) and not capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_told_and_is_no_error(file, capsys):
    file.parent.parent.mkdir()
    file.parent.write_text("a file in the place of the folder", encoding="utf-8")
    with kept_settings(fresh=False) as settings:
        settings.speed = 1
    assert capsys.readouterr().err.startswith("note: ")


def test_only_what_is_left_open_is_taken_and_only_changes_are_kept():
    settings = WindowSettings(look="auto", panels=False, trails=False, speed=1)
    kept = KeptChanges(settings, {"trails"}, look_decided=True)
    begin = {name: kept.begin(name) for name in asdict(settings)}
    assert begin == {"look": None, "size": None, "place": None, "panels": False, "trails": None, "speed": 1}
    kept.see(WindowSettings("film", (640, 360), (1, 2), False, False, 1))
    kept.see(WindowSettings("plain", (640, 400), None, True, True, 1))
    assert settings == WindowSettings("auto", (640, 400), None, True, False, 1), "trails and look are decided, and stay"
    settings = WindowSettings()
    kept = KeptChanges(settings, (), look_decided=False)
    for now in (WHOLE, replace(WHOLE, size=None, place=None), WHOLE):  # full screen, for a while
        kept.see(now)
    assert settings == WindowSettings(), "nothing was changed"


def test_a_scene_that_names_trails_or_panels_decides_them():
    plain = {"title": "T", "particles": [{"body": {"mass": 1}}], "integrator": {"leapfrog": {"dt": 1}}}
    assert _decided(load_scene(plain)) == set()
    own = {"view": {"trails": 0}, "record": {"panels": "right"}}
    assert _decided(load_scene(plain | own)) == {"trails", "panels"}


def test_a_run_without_a_window_leaves_the_file_alone(file, tmp_path, monkeypatch, capsys):
    file.parent.mkdir(parents=True)
    file.write_text("broken", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(_kept_settings, "_write", lambda *_: pytest.fail("written"))
    (tmp_path / "one.yaml").write_text(yaml.safe_dump(scene("One", GREEN), sort_keys=False), encoding="utf-8")
    assert main(["run", "one.yaml", "--headless", "--steps", "1", "--backend", "cpu", "--quiet"]) == 0
    assert "window" not in capsys.readouterr().err


def test_full_screen_is_refused_in_words_where_there_is_no_x_display():
    glass = object.__new__(Glass)
    glass._x, glass.full = None, False
    assert "window manager of an X display" in glass.toggle_full_screen() and not glass.full


def geometry(session):
    """Left, top, width and height of the window."""
    words = session.tool("getwindowgeometry", "--shell", session.window)
    places = dict(line.split("=") for line in words.split())
    return tuple(int(places[key]) for key in ("X", "Y", "WIDTH", "HEIGHT"))


def full_screen(display, session):
    """W fills the screen and gives the old size back, where a window manager can do this; the size is not kept."""
    place, window = geometry(session), int(session.window)
    for supports in (False, True):
        manager = WindowManager(display, supports=supports)
        try:
            if not supports:
                session.press("w")
                assert geometry(session) == place
                continue
            session.press("w")
            assert manager.answer(window, (0, 0, *SCREEN), place)
            session.wait_for(lambda: geometry(session) == (0, 0, *SCREEN))
            session.wait_for(lambda: session.whole()[SCREEN[1] - 2, SCREEN[0] - 2].any(), 10)  # the picture fills the screen
            session.press("w")
            assert not manager.answer(window, (0, 0, *SCREEN), place)
            session.wait_for(lambda: geometry(session) == place)
        finally:
            manager.close()
    session.press("w")  # the window manager has gone
    assert geometry(session) == place


@pytest.mark.timeout(120)
@pytest.mark.sampled(3)
def test_a_window_opens_as_the_last_one_was_left(display, tmp_path):
    """It has the place of the file, and leaves its own place, look and pace behind; trails stay as they are."""
    (tmp_path / "one.yaml").write_text(yaml.safe_dump(scene("One", GREEN), sort_keys=False), encoding="utf-8")
    kept = tmp_path / "kept" / "mpp_taichi" / "window.yaml"
    kept.parent.mkdir(parents=True)
    kept.write_text("{size: [640, 360], place: [60, 70], trails: true}", encoding="utf-8")
    session = Session(display, tmp_path, program=PROGRAM, title="One")
    try:
        session.wait_for(lambda: (session.picture() @ np.array([-1, 1, -1]) > 20).sum() > 1000)  # the green sphere
        assert geometry(session) == (60, 70, 640, 360)
        for key in ("d", "Up"):
            session.press(key)
        session.tool("windowmove", session.window, 20, 30)
        session.press("w")  # there is no window manager, so this has no effect
        assert geometry(session)[2:] == (640, 360)
        full_screen(display, session)
        session.press("q")
        assert session.end() == 0
    finally:
        session.close()
    expected = {"look": "plain", "size": [640, 360], "place": [20, 30], "trails": True, "speed": 1}
    assert yaml.safe_load(kept.read_text(encoding="utf-8")) == expected
