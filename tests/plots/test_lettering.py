"""Lines of text: each character in a font that has it, measured as it is drawn, and told of where no font has it."""

import logging
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageColor, ImageDraw, ImageFont, features

from mpp_taichi.plots import font_files, lettering
from mpp_taichi.plots.characters import clusters, needed, package_with
from mpp_taichi.plots.font_files import FontFile, find, holds
from mpp_taichi.plots.fonts import font_of
from mpp_taichi.plots.lettering import Lettering, Run, runs
from mpp_taichi.scene.colors import Color

WHITE, BLACK = (255, 255, 255), (0, 0, 0)
SOURCES = Path(lettering.__file__).parents[1]
CACHES = (runs, find, lettering._own_font_has, lettering._file_for, lettering.lettering, font_files._files)
GO = FontFile(font_of(20).path)


@pytest.fixture(autouse=True)
def fresh_runtime():
    """No test here needs a runtime; what is known of fonts is forgotten before and after each."""
    for cache in CACHES:
        cache.cache_clear()
    lettering._told_scripts.clear()
    yield
    for cache in CACHES:
        cache.cache_clear()


@pytest.fixture
def two_fonts(monkeypatch):
    """The program's font holds little beyond ASCII, and Go is the only font of the machine."""
    monkeypatch.setattr(lettering, "font_of", lambda height: ImageFont.load_default(size=height))
    monkeypatch.setattr(font_files, "_candidates", lambda characters: iter([(GO.path, 0)]))


def blank(width: int = 300, height: int = 60) -> Image.Image:
    return Image.new("RGB", (width, height), (40, 60, 90))


def ink_box(picture: Image.Image) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of what differs from the ground by more than a quarter."""
    rows, columns = np.nonzero((np.asarray(picture).astype(int) - np.asarray(blank(*picture.size))).max(axis=2) > 64)
    return columns.min(), rows.min(), columns.max(), rows.max()


def test_a_line_of_two_fonts_lies_on_about_or_below_its_place(two_fonts):
    """Capitals stand on the place, have it between their top and their bottom, or hang below it."""
    boxes = {}
    for anchor in ("ls", "lm", "la"):
        picture = blank()
        Lettering(18).write(picture, (20, 30), "HЖH", WHITE, anchor=anchor)
        boxes[anchor] = ink_box(picture)
    assert len(runs("HЖH")) == 3
    assert boxes["ls"][3] in (29, 30)  # the last row above the base line
    assert boxes["lm"][1] < 30 < boxes["lm"][3]
    assert boxes["la"][1] >= 30


@pytest.mark.parametrize("anchor", ["la", "mm", "lm", "ra"])
def test_a_line_that_the_font_has_is_drawn_as_by_pillow(anchor):
    place, text = (150.25, 20.5), "t = 1.5 d, σ Ж é"
    ours, theirs = blank(), blank()
    Lettering(18).write(ours, place, text, WHITE, anchor=anchor, outline=(2, BLACK))
    font = font_of(18)
    ImageDraw.Draw(theirs).text(place, text, WHITE, font, anchor=anchor, stroke_width=2, stroke_fill=BLACK)
    assert np.array_equal(ours, theirs)
    assert Lettering(18).width(text) == font.getlength(text)


def test_lines_stand_below_one_another_as_by_pillow():
    lines, ours, theirs = ["gas", "t = 0", "Ωy"], blank(), blank()
    Lettering(12).write_lines(ours, (6, 6), lines, WHITE, spacing=4, shadow=BLACK)
    pen, font = ImageDraw.Draw(theirs), font_of(12)
    pen.multiline_text((7, 7), "\n".join(lines), BLACK, font, spacing=4)
    pen.multiline_text((6, 6), "\n".join(lines), WHITE, font, spacing=4)
    assert np.array_equal(ours, theirs)
    assert Lettering(12).reach(lines, spacing=4) == pen.multiline_textbbox((0, 0), "\n".join(lines), font, spacing=4)[2:]


def test_each_character_is_in_a_font_that_has_it(two_fonts):
    assert runs("sun") == (Run("sun", None),)
    assert runs("a σ Ж b, Ж") == (Run("a ", None), Run("σ Ж", GO), Run(" b, ", None), Run("Ж", GO))


def test_runs_are_drawn_one_after_the_other_on_one_base_line(two_fonts):
    """The pieces of a line, drawn by Pillow at the sums of their widths, are the same picture."""
    letters, place, text = Lettering(24), (10.0, 40.0), "aσb"
    ours, theirs, x = blank(), blank(), place[0]
    letters.write(ours, place, text, WHITE, anchor="ls")
    for piece, font in (("a", ImageFont.load_default(size=24)), ("σ", GO.opened(24)), ("b", ImageFont.load_default(size=24))):
        ImageDraw.Draw(theirs).text((x, place[1]), piece, WHITE, font, anchor="ls")
        x += font.getlength(piece)
    assert np.array_equal(ours, theirs)
    assert letters.width(text) == x - place[0]
    for anchor, end in (("ls", 10.0), ("ms", 10.0 + letters.width(text) / 2.0), ("rs", 10.0 + letters.width(text))):
        again = blank()
        letters.write(again, (end, 40.0), text, WHITE, anchor=anchor)
        assert np.array_equal(again, ours)
    right, bottom = letters.reach([text], spacing=4)
    letters.write(topped := blank(), (0.0, 0.0), text, WHITE)
    box = ink_box(topped)
    assert 0 <= right - 1 - box[2] <= 1 and 0 <= bottom - 1 - box[3] <= 1, "an edge of a letter is a faint pixel"


def test_a_font_of_bitmaps_is_scaled_to_the_height_of_the_line(two_fonts, monkeypatch):
    """The letters of an outline font, drawn at a strike of 100 pixels and scaled to 25, are those drawn at 25."""
    strike = FontFile(GO.path, 0, 100)
    monkeypatch.setattr(lettering, "find", lambda characters: strike if strike.holds(characters) else None)
    letters, text = Lettering(25), "ΣЖΩ"
    assert [run.file for run in runs(text)] == [strike]
    # Advances are rounded to whole pixels of 100 and of 25 by hinting: half a pixel for each of three letters.
    assert letters.width(text) == pytest.approx(GO.opened(25).getlength(text), abs=3 * 0.5)
    ours, theirs = blank(), blank()
    letters.write(ours, (20.0, 40.0), text, WHITE, anchor="ls")
    ImageDraw.Draw(theirs).text((20.0, 40.0), text, WHITE, GO.opened(25), anchor="ls")
    # Half a pixel for the corner, half for the size, and the width above.
    assert np.abs(np.subtract(ink_box(ours), ink_box(theirs))).max() <= 2
    letters.write(more := blank(), (20.0, 40.0), f"{text}H", WHITE, anchor="ls")
    # The next run follows at the scaled width; an H has at most a fifth of its height on its right side.
    assert 0 <= 20.0 + letters.width(f"{text}H") - ink_box(more)[2] <= 25 / 5


def test_a_font_tells_what_it_has():
    assert GO.holds("aéЖΩ—")
    assert not any(GO.holds(character) for character in "中あ가\u0301☀\ue123"), "marks that the font lacks are boxes as well"


def test_marks_and_joined_pictures_stay_with_their_letter():
    family = "👨\u200d👩\u200d👧"
    assert clusters(f"x\u0301{family}👍\U0001f3fd☀\ufe0f!") == ["x\u0301", family, "👍\U0001f3fd", "☀\ufe0f", "!"]
    assert needed(f"{family}☀\ufe0f") == "👨👩👧☀"


@pytest.mark.parametrize("fontconfig", [True, False])
def test_a_character_that_no_font_has_is_told_once_for_its_script(fontconfig, caplog, monkeypatch):
    if not fontconfig:
        monkeypatch.setattr(shutil, "which", lambda name: None)
    private = "\U0010fffd", "\U0010fffc"
    if find(private[0]) or find(private[1]):
        pytest.skip("a font of this machine has characters of the private use area")
    with caplog.at_level(logging.WARNING):
        for text in (f"sun {private[0]}", f"moon {private[0]}", f"moon {private[1]}"):
            assert runs(text) == (Run(text, None),)
    assert len(caplog.records) == 1
    assert "U+10FFFD: boxes are drawn" in caplog.records[0].getMessage() and "private use" in caplog.records[0].getMessage()


@pytest.mark.parametrize("character", ["🚀", "中", "ص"])
def test_the_packages_of_fonts_have_the_names_of_their_distributions(character, monkeypatch):
    """Debian calls packages of fonts fonts-…, Fedora those of Noto google-noto-…."""
    monkeypatch.setattr(sys, "platform", "linux")
    on_linux = re.fullmatch(r"the package (\S+) has them \(Fedora: (\S+)\)", package_with(character))
    assert on_linux[1].startswith("fonts-noto-") and on_linux[2].startswith("google-noto-") and on_linux[2].endswith("-fonts")
    monkeypatch.setattr(sys, "platform", "darwin")
    assert f"on Debian the package {on_linux[1]})" in package_with(character)


def test_without_fontconfig_the_folders_of_fonts_are_searched(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(font_files, "_folders", lambda: [tmp_path])
    (tmp_path / "deeper").mkdir()
    shutil.copy(GO.path, tmp_path / "deeper" / "letters.ttf")
    (tmp_path / "a-damaged.ttf").write_bytes(b"no font")
    assert find("σЖ") == FontFile(str(tmp_path / "deeper" / "letters.ttf"))
    assert find("σ中") is None and find("中") is None


@pytest.mark.skipif(not shutil.which("fc-list"), reason="fontconfig is not installed")
def test_a_font_that_fontconfig_names_has_the_characters():
    found = {text: find(text) for text in "中가ص🚀"}
    assert all(font is None or font.holds(text) for text, font in found.items())


def test_a_line_written_from_the_right_is_in_one_font(tmp_path, monkeypatch):
    """The order of its words is known for a line in one font; here a font with two letters of Hebrew, a space and an a."""
    builder = pytest.importorskip("fontTools.fontBuilder").FontBuilder(1000)
    pen = pytest.importorskip("fontTools.pens.ttGlyphPen").TTGlyphPen(None)
    for x, y in ((100, 0), (100, 700), (500, 0)):
        (pen.lineTo if (x, y) != (100, 0) else pen.moveTo)((x, y))
    pen.closePath()
    triangle, empty = pen.glyph(), pytest.importorskip("fontTools.ttLib.tables._g_l_y_f").Glyph()
    names = [".notdef", "space", "a", "alef", "bet"]
    builder.setupGlyphOrder(names)
    builder.setupCharacterMap({0x20: "space", 0x61: "a", 0x5D0: "alef", 0x5D1: "bet"})
    builder.setupGlyf({name: triangle if name in ("alef", "bet", "a") else empty for name in names})
    widths = {".notdef": 400, "space": 300, "a": 600, "alef": 1000, "bet": 2000}
    builder.setupHorizontalMetrics({name: (width, 100) for name, width in widths.items()})
    builder.setupHorizontalHeader(ascent=800, descent=-200)
    builder.setupNameTable({"familyName": "Two letters", "styleName": "Regular"})
    builder.setupOS2()
    builder.setupPost()
    builder.save(tmp_path / "letters.ttf")
    font = FontFile(str(tmp_path / "letters.ttf"))
    monkeypatch.setattr(font_files, "_candidates", lambda characters: iter([(font.path, 0)]))
    text = "\u05d0 a\u05d1"
    assert runs(text) == (Run(text, font),)
    assert Lettering(20).width(text) == 20 * (1.0 + 0.3 + 0.6 + 2.0)
    if features.check("raqm"):
        # The first letter, one em wide, stands on the right; without it the same line begins with the widest letter.
        picture = blank()
        Lettering(20).write(picture, (10.0, 40.0), "\u05d0\u05d1", WHITE, anchor="ls")
        columns = np.flatnonzero((np.asarray(picture)[39].astype(int) - blank().getpixel((0, 0))).max(axis=1) > 64)
        assert columns.max() >= 10 + 2 * 20, "the triangle of alef is right of bet's two ems"
    assert runs("\u05d0 z\u05d1")[0].file == font, "where no font has all characters, each letter has its own"


def test_text_is_measured_and_drawn_in_one_place_alone():
    owners = {"lettering.py", "fonts.py", "font_files.py"}
    words = ("ImageFont", "getlength", "textbbox", "multiline_text", "font_of", "_pen.text(", " pen.text(", "_draw.text(")
    files = [file for file in SOURCES.rglob("*.py") if not (file.parent.name == "plots" and file.name in owners)]
    assert len(files) > 500
    assert [(file.name, word) for file in files for word in words if word in file.read_text(encoding="utf-8")] == []
    assert holds(font_of(20), "a")


def test_colors_keep_their_names_when_something_was_drawn_with_them():
    """Pillow replaces the digits of a colour by numbers, in its own table of names, when a picture is drawn with the name."""
    ImageColor.getrgb("rebeccapurple")
    assert Color().check("rebeccapurple", None) == (0x66 / 255, 0x33 / 255, 0x99 / 255)
