"""The first hour of a new user, step by step: a wheel, an empty environment, an empty folder, and nothing of the repository.

    python tools/checks/first_hour.py [--keep FOLDER] [--step WORDS …]

Builds the wheel, installs it, and does what the README, the quick start and the recipes say. Each step is a function of this
file: its docstring says what a user does, its body what must be so afterwards. Prints a line for each step with its time, and
ends with 1 where a step failed. The window is opened on a virtual screen of 1280 × 800 pixels, if Xvfb and xdotool are there.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "docs" / "how_to"
FIRST_FILM = 120.0  # seconds from `pip install` to a film, as the first of all promises


class User:
    """Someone with a folder, an environment and a terminal, and without a display."""

    def __init__(self, folder):
        self.folder = folder / "home"
        self.folder.mkdir()
        self.environment = folder / "environment"
        self.bin = self.environment / ("Scripts" if os.name == "nt" else "bin")
        self.variables = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "MPP_", "DISPLAY"))}
        self.began = time.monotonic()
        self.variables |= {"PATH": f"{self.bin}{os.pathsep}{os.environ['PATH']}", "XDG_CONFIG_HOME": str(folder / "config")}

    def types(self, *words, code=0, **more):
        """Both streams of a command, which must end with this code."""
        done = subprocess.run(words, cwd=self.folder, env=self.variables | more, capture_output=True, text=True, timeout=900)
        said = done.stdout + done.stderr
        assert done.returncode == code, f"{' '.join(words)}: exit code {done.returncode} and not {code}\n{said[-2000:]}"
        assert "Traceback" not in said and "internal error:" not in said, f"{' '.join(words)}:\n{said[-2000:]}"
        return done.stdout, done.stderr

    def saves(self, name, text):
        """Write a file in the user's folder."""
        (self.folder / name).write_text(text, encoding="utf-8")


def first_film(user):
    """Types the name of a scene: a film is there within two minutes of the start of the installation."""
    _, said = user.types("mpp-taichi", "ring")
    assert (user.folder / "out" / "ring.mp4").stat().st_size > 10**5
    assert "compiling" in said or "film" in said
    took = time.monotonic() - user.began
    assert took < FIRST_FILM, f"{took:.0f} s from the start of the installation to the film"


def list_of_scenes(user):
    """Asks which scenes there are: every file of the repository's scenes has a name, a title and a topic."""
    listed, _ = user.types("mpp-taichi", "scenes")
    for file in (ROOT / "scenes").glob("*.yaml"):
        assert re.search(rf"^\s*{file.stem}\b.*\w", listed, re.M), file.stem


def help_without_a_word(user):
    """Types the bare name of the program: the answer shows how to begin."""
    told, _ = user.types("mpp-taichi")
    assert "mpp-taichi ring" in told or "mpp-taichi scenes" in told


def misspelt_scene(user):
    """Mistypes a name: one line names the nearest scene."""
    for wrong in ("rign", "scenes/rign.yaml", "double-pendulum"):
        _, said = user.types("mpp-taichi", wrong, code=2)
        assert len(said.strip().splitlines()) == 1 and ("ring" in said or "double_pendulum" in said), said


def copy_of_a_scene(user):
    """Copies a scene, changes it and runs it: comments are kept, and the file runs in the user's folder."""
    user.types("mpp-taichi", "new", "my.yaml", "--like", "double_pendulum")
    text = (user.folder / "my.yaml").read_text(encoding="utf-8")
    assert text.count("#") > 2
    user.saves("my.yaml", re.sub(r"^title: .*$", "title: Mine", text, count=1, flags=re.M))
    told, _ = user.types("mpp-taichi", "my.yaml", "--headless", "--until", "1")
    assert "Mine" in told
    user.types("mpp-taichi", "new", "my.yaml", "--like", "ring", code=2)
    assert "title: Mine" in (user.folder / "my.yaml").read_text(encoding="utf-8"), "the user's own file was overwritten"


def schema_of_an_editor(user):
    """Asks for the schema: the path exists and holds what the scene's first line names."""
    told, _ = user.types("mpp-taichi", "schema", "--path")
    named = json.loads(Path(told.strip()).read_text(encoding="utf-8"))["$id"]
    version, _ = user.types("mpp-taichi", "--version")
    assert named.startswith("urn:mpp-taichi:") and version.split()[1] in named, named


def results_and_progress(user):
    """Redirects a run: the file holds verdict, files and promises; of progress it holds nothing."""
    told, _ = user.types("mpp-taichi", "sun_earth", "--headless")
    lines = told.splitlines()
    assert any(line.split()[:2] == ["expect", "pass"] for line in lines) and "\r" not in told
    assert not re.search(r"^ *(plan|device)", told, re.M), f"device and plan belong to --verbose:\n{told}"
    told, _ = user.types("mpp-taichi", "sun_earth", "--headless", "--json")
    assert json.loads(told)


def changed_value(user):
    """Changes a value of the scene as the quick start does: the promise of a year fails, and the exit code says so."""
    told, _ = user.types("mpp-taichi", "sun_earth", "--headless", "--set", "particles[0].body.mass=0.5", code=4)
    assert "FAIL" in told


def scene_of_the_quick_start(user):
    """Writes the scene of the quick start and films it."""
    text = (ROOT / "docs" / "quick_start.md").read_text(encoding="utf-8")
    user.saves("fall.yaml", _block(text))
    user.types("mpp-taichi", "record", "fall.yaml", "--video", "fall.mp4", "--size", "640x360")
    assert (user.folder / "fall.mp4").stat().st_size > 10**4


def trampoline(user):
    """Writes the trampoline of the recipe: what it promises holds."""
    _recipe(user, "trampoline")


def pendulum_wave(user):
    """Writes the pendulum wave of the recipe: what it promises holds."""
    _recipe(user, "pendulum_wave")


def galton_board(user):
    """Writes the Galton board of the recipe: what it promises holds."""
    _recipe(user, "galton_board")


def earth_moon_satellite(user):
    """Writes Earth, Moon and satellite of the recipe: what it promises holds, with a still with names."""
    _recipe(user, "earth_moon_satellite")


def _recipe(user, name):
    page = (RECIPES / f"{name}.md").read_text(encoding="utf-8")
    if scene := _block(page):
        user.saves(f"{name}.yaml", scene)
    else:  # the recipe begins with a scene of the program
        user.types("mpp-taichi", "new", f"{name}.yaml", "--like", re.search(r"--like (\w+)", page)[1])
    told, _ = user.types("mpp-taichi", "check", f"{name}.yaml")
    assert "pass" in told
    user.types("mpp-taichi", "record", f"{name}.yaml", "--still", f"{name}.png", "--size", "960x540")
    assert (user.folder / f"{name}.png").stat().st_size > 10**4


def _block(page):
    """The first scene of a page of the documents; nothing where it has none."""
    found = re.search(r"^```yaml\n(.*?)^```$", page, re.M | re.S)
    return found[1] if found else ""


def page_for_a_browser(user):
    """Records a page: it asks no other place for anything."""
    user.types("mpp-taichi", "record", "kepler", "--html", "kepler.html")
    page = (user.folder / "kepler.html").read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)=["']?https?:|@import|fetch\(["']http""", page)


def from_python(user):
    """Uses Python: a table, the elements of an orbit, a body by its name, a page and a run without a step."""
    user.types("python", "-m", "pip", "install", "-q", "pandas", "xarray")
    user.saves("notebook.py", PYTHON)
    told, _ = user.types("python", "notebook.py")
    assert told.split()[-1] == "done", told


PYTHON = """
import mpp_taichi as mpp

simulation = mpp.Simulation("kepler", backend="cpu")
seen = []
simulation.run(until=5, every=1, call=lambda now: seen.append(now.time))
assert len(seen) == 5, seen
assert simulation.particles[0].position.shape == (3,)
assert 0.59 < simulation.orbits()["planet"].eccentricity < 0.61
assert not [name for name in dir(simulation) if name.startswith("_")]
result = mpp.run("kepler", samples=20)
assert len(result.to_pandas()) > 20
assert "energy" in str(result.to_xarray())
assert "<iframe" in result._repr_html_() or "<iframe" in str(result.page())
print("done")
"""


def python_without_packages(user):
    """Uses a Python that has none of the packages: one line says so, and what to use."""
    lonely = user.folder.parent / "lonely"
    venv.create(lonely, with_pip=False)
    python = lonely / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    _, said = user.types(str(python), "-m", "mpp_taichi", "ring", code=2, PYTHONPATH=str(ROOT))
    assert re.search(r"this Python, .* does not have the packages", said), said


def window(user):
    """Opens the window on a screen of 1280 × 800: it lies within the screen, and leaves nothing but `out` behind."""
    if not (shutil.which("Xvfb") and shutil.which("xdotool")):
        return print("     no Xvfb or no xdotool here: the window is left out")
    folder = user.folder.parent / "desk"
    folder.mkdir()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "1280x800x24"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    variables = user.variables | {"DISPLAY": f":{server.stdout.readline().strip()}"}
    shown = subprocess.Popen(
        ["mpp-taichi", "ring"], cwd=folder, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        found = _when_there(lambda: _xdotool(variables, "search", "--name", "Planetary ring"))
        place = dict(line.split("=") for line in _xdotool(variables, "getwindowgeometry", "--shell", found.split()[0]).split())
        x, y, width, height = (int(place[key]) for key in ("X", "Y", "WIDTH", "HEIGHT"))
        assert x >= 0 and y >= 0 and x + width <= 1280 and y + height <= 800, place
        time.sleep(20)
        _xdotool(variables, "key", "--window", found.split()[0], "q")
        said, _ = shown.communicate(timeout=60)
        assert shown.returncode == 0 and "Traceback" not in said, said
        assert {file.name for file in folder.iterdir()} <= {"out"}, list(folder.iterdir())
    finally:
        shown.kill()
        server.kill()


def _when_there(ask, patience=90):
    """The first answer that is not empty."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if found := ask():
            return found
        time.sleep(0.5)
    raise AssertionError(f"no window after {patience} s")


def _xdotool(variables, *words):
    return subprocess.run(["xdotool", *words], env=variables, capture_output=True, text=True).stdout.strip()


STEPS = (
    first_film, list_of_scenes, help_without_a_word, misspelt_scene, copy_of_a_scene, schema_of_an_editor, results_and_progress,
    changed_value, scene_of_the_quick_start, trampoline, pendulum_wave, galton_board, earth_moon_satellite, page_for_a_browser,
    from_python, python_without_packages, window,
)  # fmt: skip


def main():
    """1 where a step failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", type=Path, help="leave the user's folder here")
    parser.add_argument("--step", nargs="+", help="only the steps of these names")
    options = parser.parse_args()
    folder = options.keep or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    pip = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(folder), str(ROOT)]
    subprocess.run(pip, check=True)
    user = User(folder)
    venv.create(user.environment, with_pip=True)
    user.types("python", "-m", "pip", "install", "-q", str(next(folder.glob("*.whl"))))
    print(f"ok   {time.monotonic() - user.began:6.1f} s  the wheel is installed", flush=True)
    failed = 0
    for step in STEPS:
        if options.step and step.__name__ not in options.step:
            continue
        began = time.monotonic()
        try:
            step(user)
            print(f"ok   {time.monotonic() - began:6.1f} s  {step.__doc__}", flush=True)
        except (AssertionError, subprocess.TimeoutExpired) as error:
            failed += 1
            print(f"FAIL {time.monotonic() - began:6.1f} s  {step.__doc__}\n     {error}", flush=True)
    if not options.keep:
        shutil.rmtree(folder)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
