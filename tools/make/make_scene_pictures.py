"""A small picture of every scene, for the gallery of the site: its last frame, 480 × 270.

    python tools/make/make_scene_pictures.py [NAME …] [--into docs/pictures/gallery]

Without names: the scenes that have no picture yet, neither in that folder nor in docs/pictures.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # so that it also runs from a checkout that is not installed

from mpp_taichi.scene.bundled import bundled_scenes  # noqa: E402

LARGE, SMALL = "960x540", (480, 270)
TOO_LARGE = {"great_ring", "pile_10000"}
"""Scenes that take many minutes: a picture of their first steps is enough."""


def main():
    """Draw, and shrink."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--into", type=Path, default=ROOT / "docs" / "pictures" / "gallery")
    arguments = parser.parse_args()
    arguments.into.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or missing(arguments.into):
        with tempfile.TemporaryDirectory() as folder:
            still = Path(folder) / "still.png"
            words = [sys.executable, "-m", "mpp_taichi", "record", name, "--still", str(still), "--size", LARGE, "--quiet"]
            words += ["--no-archive", *(["--steps", "2"] if name in TOO_LARGE else [])]
            code = subprocess.run(words, cwd=folder).returncode
            if not still.is_file():
                print(f"{name}: no picture, exit code {code}", file=sys.stderr)
                continue
            picture = Image.open(still).convert("RGB").resize(SMALL, Image.Resampling.LANCZOS)
            picture.save(arguments.into / f"{name}.webp", quality=80, method=6)
            print(name, flush=True)
    return 0


def missing(folder):
    """The scenes without a picture."""
    places = ((folder, "webp"), (folder.parent, "png"))
    return [name for name in bundled_scenes() if not any((place / f"{name}.{kind}").is_file() for place, kind in places)]


if __name__ == "__main__":
    sys.exit(main())
