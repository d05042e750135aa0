"""The site of the documents is built without a warning, fetches nothing from elsewhere, and has every scene and public name."""

import os
import re
import subprocess
import sys

import pytest
from doc_commands import ROOT

import mpp_taichi
from mpp_taichi.scene.bundled import bundled_scenes

LOADED = re.compile(r"""<(?:script|img|link|iframe|source)\b[^>]*?\b(?:src|href)=["']?(https?:)?//[^>]*>""")
"""What a browser fetches by itself when a page opens; a link that a reader may follow is none of it."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


@pytest.mark.sampled(3)
def test_no_page_and_no_style_fetches_from_another_place(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 150
    assert [page.name for page in pages if LOADED.search(page.read_text(encoding="utf-8"))] == []
    styles = [
        path
        for path in site.rglob("*.css")
        if re.search(r"(?:url\(|@import )[\"']?(?:https?:)?//", path.read_text(encoding="utf-8"))
    ]
    assert styles == []


def test_what_is_looked_for_would_be_found():
    assert LOADED.search('<link href="https://fonts.example/css" rel="stylesheet">')
    assert LOADED.search('<script async src="//example.org/a.js"></script>')
    assert not LOADED.search('<a href="https://example.org">there</a>')


def test_every_scene_has_a_page_with_its_source(site):
    for name, file in bundled_scenes().items():
        page = (site / "gallery" / f"{name}.html").read_text(encoding="utf-8")
        assert f"mpp-taichi new my.yaml --like {name}" in re.sub(r"<[^>]+>", "", page)
        first_key = re.search(r"^(\w+):", file.read_text(encoding="utf-8"), re.M)[1]
        assert first_key in page
        assert f'href="{name}.html"' in (site / "gallery" / "index.html").read_text(encoding="utf-8")


def test_every_public_name_is_described(site):
    page = (site / "api.html").read_text(encoding="utf-8")
    for name in mpp_taichi.__all__:
        assert name == "__version__" or re.search(rf'id="mpp_taichi\.[\w.]*\b{name}"', page), name


def test_equations_of_the_course_are_typeset(site):
    displayed = 0
    for chapter in (site / "course").glob("*.html"):
        text = chapter.read_text(encoding="utf-8")
        assert "arithmatex" not in text and "$$" not in text and r"\frac" not in text
        displayed += text.count('<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">')
    written = sum(
        text.count("\n$$\n") for text in (path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "course").glob("*.md"))
    )
    assert displayed == written // 2 >= 10


def test_the_scene_reference_is_a_page_for_each_topic_to_which_links_lead(site):
    assert not (site / "scene.html").exists()
    text = (site / "springs.html").read_text(encoding="utf-8")
    leads = re.findall(r'href="(reference/\w+\.html)(?:#([\w-]+))?"', text)
    assert leads
    for page, anchor in leads:
        assert not anchor or f'id="{anchor}"' in (site / page).read_text(encoding="utf-8")
