"""Pictures of README.md and docs/scenes.md: films of ten seconds and stills of eight scenes in 1920 × 1080, without a display.

    python tools/make/make_gallery.py [--scenes ring …] [--into out/gallery] [--pictures docs/pictures]

Writes FOLDER/NAME.mp4 and FOLDER/NAME.png, and a smaller copy of each still beside the other pictures of the docs.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[2]
SCENES = (
    *("ring", "membrane", "newtons_cradle", "maxwell_boltzmann", "solar_system_moons", "pendulum_wave"),
    *("galton", "hourglass"),
)
FILM = ("--size", "1920x1080", "--fps", "30", "--duration", "10")
SMALL = (960, 540)
UNTIL = {"galton": 12, "hourglass": 1.7}  # times of the last frames, where the end shows less


def main():
    """Record, and shrink."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--into", type=Path, default=ROOT / "out" / "gallery")
    parser.add_argument("--pictures", type=Path, default=ROOT / "docs" / "pictures")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        film, still = arguments.into / f"{name}.mp4", arguments.into / f"{name}.png"
        command = [sys.executable, "-m", "mpp_taichi", "record", f"scenes/{name}.yaml"]
        if name in UNTIL:
            command += ["--set", f"run.duration={UNTIL[name]}"]
        subprocess.run([*command, "--video", str(film), "--still", str(still), *FILM, "--quiet"], cwd=ROOT, check=True)
        picture = Image.open(still).resize(SMALL, Image.Resampling.LANCZOS)
        picture.save(arguments.pictures / f"{name}.png", optimize=True)
        print(f"{film}  {still}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
