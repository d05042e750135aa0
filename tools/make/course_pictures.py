"""Make the pictures of docs/course/ again, by the commands that the pages name below them.

Below a picture stands either "Frame N of `python -m mpp_taichi record … --frames frames …`", or "File `F`", where F is what a
command or the Python of a page writes. Run from the repository: python tools/make/course_pictures.py [PAGE …]
"""

import argparse
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[2]
COURSE, PICTURES = ROOT / "docs" / "course", ROOT / "docs" / "pictures"
FIGURE = re.compile(
    r"!\[[^\]]*\]\(\.\./pictures/(?P<picture>\w+\.png)\)\s+"
    r"(?:Frame (?P<number>\d+) of `(?P<command>[^`]+)`|File `(?P<file>[\w.]+)`)"
)
PYTHON = re.compile(r"^```python\n(.*?)^```$", re.M | re.S)
COLORS = 128  # of a picture's palette: smooth enough, and a third of the size


def make(page: Path) -> None:
    """Make every picture of a page in a folder of its own."""
    text = page.read_text(encoding="utf-8")
    for figure in FIGURE.finditer(text):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "scenes").symlink_to(ROOT / "scenes")
            if figure["command"]:
                run(shlex.split(figure["command"]), folder)
                made = folder / "frames" / f"frame_{int(figure['number']):06d}.png"
            else:
                write(figure["file"], text, folder)
                made = folder / figure["file"]
            with Image.open(made) as picture:
                small = picture.convert("RGB").quantize(COLORS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
            small.save(PICTURES / figure["picture"], optimize=True)
        print(f"{page.name}: {figure['picture']}, {(PICTURES / figure['picture']).stat().st_size // 1024} kB", flush=True)


def write(file: str, text: str, folder: Path) -> None:
    """Have a page's own command write a file, or else the Python of the course's last page."""
    command = re.search(rf"^python -m mpp_taichi .*\b{re.escape(file)}$", text, re.M)
    if command:
        run(shlex.split(command[0]), folder)
    else:
        cells = "\n".join(PYTHON.findall((COURSE / "15_python.md").read_text(encoding="utf-8")))
        run(["python", "-c", cells], folder)


def run(words: list[str], folder: Path) -> None:
    """A command, by this Python; a scene's unmet expectations are no failure here."""
    done = subprocess.run([sys.executable, *words[1:]], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 4):
        raise SystemExit(f"{shlex.join(words)[:200]} ended with code {done.returncode}:\n{done.stderr[-1000:]}")


def main() -> None:
    """Make the pictures of the pages named, or of all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("pages", nargs="*", type=Path, default=sorted(COURSE.glob("*.md")), metavar="PAGE")
    for page in parser.parse_args().pages:
        make(page)


if __name__ == "__main__":
    main()
