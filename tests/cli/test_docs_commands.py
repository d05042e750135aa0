"""Every command, Python block and scene of the README and of docs/ is run, shortened, in one process.

What is changed of a command is in `SHORTER`; what cannot be run here is checked as far as it can be, by `PARSED_ONLY` and
`without_running`, with the reason beside it. A command of a kind that is in neither fails.
"""

import ast
import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from doc_commands import ROOT, Block, blocks, pages
from pydantic import TypeAdapter, ValidationError
from test_convert import PLANETS

from mpp_taichi import MppError, component
from mpp_taichi.cli.main import VERBS, _parser, _with_verb, main
from mpp_taichi.passport.carried import carrying
from mpp_taichi.recorders.video import VideoRecorder
from mpp_taichi.scene.bare_names import expanded
from mpp_taichi.scene.document import read_text
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.fields import Context
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.model import scene_model, select
from mpp_taichi.start.assemble import assemble
from mpp_taichi.worksheets.answers import is_answers, read_answers

# What is put behind the words of a command; of an option given twice the later one counts. `None` takes a word away.
SHORTER = {
    "run": ["--headless", "--steps", "2"],  # no window, no film of its own accord
    "record": ["--steps", "2", "--size", "160x90", "--fps", "2", "--duration", "1"],
    "accuracy": ["--budget", "1s", "--out", "accuracy"],
    "convert": [],
    "info": [],
    "schema": [],
    "scenes": [],
    "new": [],
    "passport": [],
    "sweep": ["--steps", "2", "--chunk", "100", "--workers", "1"],
}
FIRST_ROUND = ["--refine", "1"]  # of a grid the first round alone
PARSED_ONLY = {
    "check": "minutes for a folder: tests/scenes/test_bundled_scenes.py runs the scenes, tests/cli/test_check.py the verb",
    "explain": "times every effect, 8 s of compiling: tests/cli/test_explain.py runs it",
    "compare": "starts a process for each backend: tests/compare/test_compare_verb.py runs it",
    "verify": "takes minutes: tests/verify/test_verify.py runs it",
}
DONE_ONCE = ("run", "record", "accuracy")
"""Verbs that are run for real once for each set of options; then the scene is loaded and placed, and a run tried dry."""
WITHOUT_A_KIND = ("--set", "--headless", "--quiet", "--budget", "--precisions", "--backends", "--integrators", "--until")
TOOLS = ("pytest", "ruff", "mypy")  # of a contributor: the files that they are given are there
LENGTHS = ("--until", "--steps")
LARGEST_PLACED = 10_000  # particles of a scene that are placed here; more take seconds


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A working directory as the pages have it: the scenes, and the files that a reader is said to have."""
    made = tmp_path_factory.mktemp("docs")
    for name in ("scenes", "docs"):  # of the pages too, since a function that is a force is read from the text of its page
        (made / name).symlink_to(ROOT / name)
    (made / "planets.txt").write_text(PLANETS, encoding="utf-8")
    (made / "out").mkdir()
    # What --rewind goes on from: a run that was broken off at its start.
    start = assemble(load_scene(ROOT / "scenes" / "double_pendulum.yaml"))
    start.save(made / "out" / "double_pendulum.crash.npz")
    # What other programs would have written.
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        assert main(["convert", "scenes/cluster.yaml", "galaxy.tipsy"]) == 0
        assert main(["convert", "scenes/sun_earth.yaml", "system.plist"]) == 0
    # A film that a run has written, with its passport.
    with carrying({"title": "Film"}), VideoRecorder(made / "film.mp4", (32, 32), 2.0) as film:
        film.write(np.zeros((32, 32, 3), np.uint8))
    return made


class Reader:
    """Does what a page says, block by block, and notes what does not work."""

    done: set[tuple] = set()  # kinds of runs that were made for real, for all pages

    def __init__(self):
        self.namespace, self.scene, self.wrong = {"__name__": "docs"}, None, []

    def follow(self, block: Block):
        try:
            {"command": self.command, "python": self.python, "yaml": self.yaml}[block.kind](block)
        except (AssertionError, MppError, SystemExit) as error:
            self.wrong.append(f"{block.place}: {' '.join(block.text.split())[:150]}: {type(error).__name__} {error}")

    # --- commands ---------------------------------------------------------------------------------------------------------

    def command(self, block: Block):
        words = block.words()
        if words[0] == "--set":
            assert self.scene or {"path=value", "…"} & set(words), "no command before it names a scene"
            words = ["mpp-taichi", "run", str(self.scene), *words]
        unquoted = re.search(r"--set [^\s\"']*\[", block.text)
        assert not unquoted, "quote what has brackets: to some shells they are a pattern of file names"
        program, rest = Path(words[0]).name, words[1:]
        if program.startswith("python") and rest[:2] == ["-m", "mpp_taichi"]:
            return self.verb(rest[2:], block.code)
        if program == "mpp-taichi":
            return self.verb(rest, block.code)
        if words == [".", ".venv/bin/activate"]:  # the environment that `python -m venv .venv` makes
            return None
        self.without_running(program, rest)

    def verb(self, words: list[str], code: int):
        if any(re.fullmatch(r"[A-Z]+|\[.*|\||path=value|…", word) for word in words):
            return synopsis(words)
        words = _with_verb(words)
        given = _parser().parse_args(words)
        if given.verb == "run" and given.scene is None:
            return  # it opens a window with a list of scenes: tests/views/test_empty_window.py
        self.scene = getattr(given, "scene", None) or self.scene
        if given.verb in PARSED_ONLY:
            scenes = getattr(given, "scenes", [getattr(given, "scene", None)])
            for scene in [each for each in scenes if each is not None]:
                assert Path(scene).exists(), f"{scene} is not there"
                if is_answers(Path(scene)):
                    read_answers(Path(scene))
                elif Path(scene).is_file():
                    place(load_scene(scene, overrides=getattr(given, "overrides", ())))
            return
        kind = (given.verb, *sorted(word for word in words if word.startswith("--") and word not in WITHOUT_A_KIND))
        again = kind in self.done
        self.done.add(kind)
        if again and given.verb in DONE_ONCE:
            place(load_scene(given.scene, overrides=given.overrides))
            if given.verb != "run":
                return
        self.expect(code, [*shortened(words), *(["--dry-run"] if again and given.verb == "run" else [])], given)

    def expect(self, code: int, words: list[str], given):
        found = main([*words, "--quiet"] if hasattr(given, "quiet") else words)
        assert found == code, f"ended with code {found} when run as {' '.join(words)}"

    def without_running(self, program: str, words: list[str]):
        """Installers, benchmarks of minutes, tests and generators: that what they name is there."""
        if words[:1] == ["-m"] and words[1].startswith("mpp_taichi."):
            assert importlib.util.find_spec(words[1]), f"{words[1]} is no module"  # tests/scene/test_scene_schema.py runs them
        elif words and words[0].startswith("tools/"):
            assert_declares(ROOT / words[0], [word for word in words[1:] if word.startswith("--")])
        elif program == "pip":
            extras = re.findall(r"\[(\w+)\]", " ".join(words))
            offered = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
            assert words[0] == "install" and all(re.search(rf"^{extra} = \[", offered, re.M) for extra in extras)
        else:
            assert words[:1] == ["-m"] and words[1] in ("venv", *TOOLS), "no test knows what to make of it"
            named = [word for word in words[2:] if words[1] in TOOLS and "/" in word]
            assert all((ROOT / word).exists() for word in named), f"one of {named} is not there"

    # --- Python and YAML --------------------------------------------------------------------------------------------------

    def python(self, block: Block):
        """Run it; blocks of a page follow each other, as cells of a notebook."""
        code = compile("\n" * (block.line - 1) + block.text, block.page, "exec")
        if name := saved_as(block):
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            Path(name).write_text(block.text, encoding="utf-8")
            return
        try:
            exec(code, self.namespace)
        except Exception as error:
            raise AssertionError(f"{type(error).__name__}: {error}") from error

    def yaml(self, block: Block):
        """Load what is a whole scene; of a part of one, know the keys."""
        scene = expanded(read_text(block.text, block.page, Faults())).plain()
        name = saved_as(block)
        if isinstance(scene, dict) and (name or {"particles", "integrator"} <= scene.keys()):
            file = Path(name or f"{Path(block.page).stem}_{block.line}.yaml")
            file.write_text(block.text, encoding="utf-8")
            place(load_scene(file))
        else:
            assert isinstance(scene, dict), "a part of a scene begins with a key of the top level, as `forces:`"
            fields = scene_model(select(scene)).model_fields
            assert not scene.keys() - fields.keys()
            wrong = {flat: wrong_values(scene, fields, flat=flat) for flat in (False, True)}
            assert not min(wrong.values(), key=len), min(wrong.values(), key=len)


def wrong_values(scene: dict, fields: dict, *, flat: bool) -> list[str]:
    """The faults of a part of a scene of three or two dimensions.

    Names, functions and files that the rest of the scene would give are no faults.
    """
    context, found = Context(dimensions=2 if flat else 3), []
    for key, value in scene.items():
        try:
            TypeAdapter(fields[key].annotation).validate_python(value, context=context)
        except ValidationError as error:
            for fault in error.errors():
                parts = fault.get("ctx", {}).get("parts", [((), None, fault["msg"])])
                found += [f"{key}: {(*fault['loc'], *below)}: {message}" for below, _, message in parts if message]
    elsewhere = ("there is no file", "unknown name", "unknown function")
    return [fault for fault in found if not any(reason in fault for reason in elsewhere)]


def saved_as(block: Block) -> str | None:
    """The file as which the line above a block tells the reader to save it."""
    page = ROOT / block.page
    lines = page.read_text(encoding="utf-8").splitlines()[: block.line - 2] if page.is_file() else []
    above = next((line for line in reversed(lines) if line.strip()), "")
    told = re.search(r"[Ss]ave (?:it|this text) as `([\w./]+\.(?:yaml|py))`", above)
    return told[1] if told else None


def synopsis(words: list[str]):
    """A command with placeholders: the options that it lists are there."""
    verb = words[0] if words[0] in VERBS else "run"
    parser = next(action for action in _parser()._actions if action.dest == "verb").choices[verb]
    known = {option for action in parser._actions for option in action.option_strings}
    listed = {option for word in words for option in re.findall(r"--[\w-]+", word)}
    assert listed <= known, f"{verb} has no {', '.join(listed - known)}"


def shortened(words: list[str]) -> list[str]:
    """The command with `SHORTER` behind it, and without the length that it gave itself."""
    kept = list(words)
    for option in LENGTHS:
        while SHORTER[words[0]] and option in kept:
            at = kept.index(option)
            del kept[at : at + 2]
    return [*kept, *SHORTER[words[0]], *(FIRST_ROUND if words[0] == "sweep" and not is_a_sample(words) else [])]


def is_a_sample(words: list[str]) -> bool:
    """Whether a sweep draws its members at random, so that there is no grid to refine."""
    if "--sample" in words:
        return True
    sweep = None if Path(words[1]).is_dir() else load_scene(words[1]).sweep
    return sweep is not None and sweep.sample is not None


def place(spec):
    """Put the particles and springs where they begin: overlaps, orbits and links are wrong or right only then."""
    from mpp_taichi.scene.estimate import estimate

    if estimate(spec).particle_count <= LARGEST_PLACED:
        assemble(spec)


def assert_declares(tool: Path, options: list[str]):
    """A script has these options, by its own source."""
    assert tool.is_file(), f"{tool.name} is not there"
    texts = {node.value for node in ast.walk(ast.parse(tool.read_text(encoding="utf-8"))) if isinstance(node, ast.Constant)}
    assert not set(options) - texts, f"{tool.name} has no {set(options) - texts}"


FIRST_PAGES = ("README.md", "CONTRIBUTING.md")
"""The pages that every run tries; the other pages are tried in turn."""


@pytest.mark.parametrize("page", FIRST_PAGES)
def test_what_a_first_page_says_works(page, folder, monkeypatch, capsys):
    assert_works(page, folder, monkeypatch, capsys)


@pytest.mark.parametrize("page", [page for page in pages() if page not in FIRST_PAGES])
@pytest.mark.sampled(3)
def test_what_a_page_says_works(page, folder, monkeypatch, capsys):
    assert_works(page, folder, monkeypatch, capsys)


def assert_works(page, folder, monkeypatch, capsys):
    """Follow all blocks of a page."""
    monkeypatch.chdir(folder)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(component, "extra_folders", [])
    monkeypatch.setenv(component.FOLDERS_VARIABLE, "")
    reader = Reader()
    for block in blocks(page):
        reader.follow(block)
    assert not reader.wrong, "\n" + "\n".join(reader.wrong) + "\n" + capsys.readouterr().err[-2000:]


def test_every_scene_is_on_the_page_of_scenes():
    named = {block.words()[-1] for block in blocks("docs/scenes.md") if block.kind == "command"}
    there = {str(path.relative_to(ROOT)) for path in (ROOT / "scenes").rglob("*.yaml")}
    assert named == there
    assert "docs/scenes.md" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_planted_faults_of_a_page_are_found(folder, monkeypatch, capsys):
    """The reader itself: faults of every kind, planted in a page."""
    monkeypatch.chdir(folder)
    page = """
Inline `python -m mpp_taichi scenes/kepler.yaml --set constants.exc=0.5`, then `--set integrator.leapfrog.dt=fast`, and

```sh
python -m mpp_taichi run scenes/no_such.yaml --headless
python -m mpp_taichi run scenes/kepler.yaml --headles   # a word behind it
python -m mpp_taichi run scenes/kepler.yaml --headless --steps 3 && python -m mpp_taichi explode scenes/kepler.yaml
python tools/benchmarks/benchmark_steps.py --no-such-option
mpp-taichi scenes/sun_earth.yaml --set particles[1].body.mass=1
pip install 'mpp-taichi[nothing]'
rm -r scenes
```

    python -m mpp_taichi accuracy SCENE [--budjet 3s]

```python
import mpp_taichi as mpp
mpp.Simulatoin("scenes/kepler.yaml")
```

```yaml
particels: []
```

```
$ python -m mpp_taichi run scenes/double_pendulum.yaml --set integrator.leapfrog.dt=0.0285   # exit code 2
what it printed
```
"""
    reader = Reader()
    found = blocks("page.md", page)
    for block in found:
        reader.follow(block)
    lines = [int(wrong.split(":")[1]) for wrong in reader.wrong]
    assert lines == [2, 2, 5, 6, 7, 8, 9, 10, 11, 14, 17, 22, 26], reader.wrong
    assert len(found) == 14  # one of them works
