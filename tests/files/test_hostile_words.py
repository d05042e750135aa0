"""Hostile words: titles, names, labels and file names that would be code elsewhere are words in every page, plot and line."""

import csv
import io
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from mpp_taichi.cli.main import main
from scenes import kepler

ROOT = Path(__file__).parents[2]
SCRIPT = "hacked = 1"
WORDS = (
    f"</script><script>{SCRIPT}</script><img src=x onerror='{SCRIPT}'>\"><svg onload={SCRIPT}>]]>--><b>{{{{}}}}`${{{SCRIPT}}}`"
)
ESCAPES = "\\e]0;owned\\a\\e[31m\\u009b31m\\u202e"  # in YAML's spelling, within double quotes
NODES = "img, iframe, object, embed, base, form:not([method=dialog]), script[src], b, [onerror], [onload], [onclick]"
FOREIGN = f'[...document.querySelectorAll("{NODES}")].map(node => node.outerHTML)'


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    made = {**kepler(dt=0.02), "title": WORDS, "description": WORDS, "run": {"duration": 0.4, "every": 1}}
    made["particles"][0]["body"]["name"] = WORDS.replace("[", "(")
    made["particles"][1]["body"]["name"] = "=1+cmd|' /C calc'!A0"
    made["inspect"] = [{"x": "time", "y": [{"speed": {"of": 0}}], "title": WORDS}]
    made["record"] = {"size": [64, 48], "seconds": 0.2, "fps": 10}
    made["expect"] = {"relative_energy_error": {"below": 1.0}}
    name = "a<img src=x onerror=hacked=1>&quot;'.yaml"
    Path(name).write_text(yaml.safe_dump(made), encoding="utf-8")
    return name


COMMANDS = {
    "page.html": ["record", "--html", "page.html", "--quiet"],
    "to/accuracy.html": ["accuracy", "--out", "to", "--budget", "2", "--quiet", "--integrators", "leapfrog"],
    "to/compare.html": ["compare", "--out", "to", "--budget", "5", "--quiet"],
}


@pytest.mark.parametrize("page", COMMANDS)
@pytest.mark.sampled(3)
def test_a_page_runs_no_script_and_has_no_node_of_a_scene(page, scene, browser):
    verb, *options = COMMANDS[page]
    assert main([verb, scene, *options]) in (0, 4)
    browser.ask("Page.navigate", url=Path(page).absolute().as_uri())
    browser.wait_for("location.href.endsWith('html') && document.readyState == 'complete'")
    assert browser.evaluate("typeof hacked") == "undefined"
    assert browser.evaluate(FOREIGN) == []
    assert "hacked = 1" in browser.evaluate("document.documentElement.textContent") + browser.evaluate("document.title")


def test_plots_hold_words_as_words(scene, capsys):
    assert main(["run", scene, "--headless", "--quiet", "--inspect", "p.svg"]) == 0
    tags = [node.tag.rpartition("}")[2] for node in ElementTree.parse("p.svg").iter()]
    assert not {"script", "img", "image", "foreignObject", "a", "b"} & set(tags)
    assert not [key for node in ElementTree.parse("p.svg").iter() for key in node.attrib if key.startswith("on")]


def test_no_cell_of_a_table_is_a_formula(scene):
    assert main(["convert", scene, "p.csv", "--quiet"]) == 0
    rows = list(csv.reader(io.StringIO(Path("p.csv").read_text(encoding="utf-8"))))
    words = [cell for row in rows for cell in row if not re.fullmatch(r"[-+]?[0-9.e+-]+|[-+]?(nan|inf)", cell)]
    assert any("cmd|" in cell for cell in words) and not any(cell[:1] in ("=", "+", "-", "@", "\t", "\r") for cell in words)
    Path("again.yaml").write_text(
        "particles:\n  - file: {path: p.csv}\nintegrator:\n  leapfrog: {dt: 0.1}\nrun: {duration: 1}\n", encoding="utf-8"
    )
    assert main(["convert", "again.yaml", "q.csv", "--quiet"]) == 0
    assert Path("q.csv").read_text() == Path("p.csv").read_text()


@pytest.mark.parametrize("verb", [["run", "--headless"], ["explain"], ["check"], ["record", "--html", "p.html"]])
@pytest.mark.sampled(3)
def test_no_escape_sequence_reaches_a_terminal(verb, scene, capsys):
    made = yaml.safe_load(Path(scene).read_text(encoding="utf-8"))
    text = yaml.safe_dump({**made, "title": "TITLE", "description": "TITLE"}).replace("TITLE", f'"{ESCAPES}"')
    Path("b.yaml").write_text(text, encoding="utf-8")
    main([verb[0], "b.yaml", *verb[1:]])
    told = capsys.readouterr()
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", told.out + told.err)
