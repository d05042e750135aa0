"""The site of the documents, with a playing page of every scene that a laptop runs in half a minute.

    python tools/make/make_site.py [--play NAME …] [--all] [--into out/site]

`--play` records the pages of these scenes, `--all` those of all scenes with at most MOST_WORK particles times steps; without
either the playing pages that are there are used. The extra `docs` of the package has what the site needs.
"""

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # so that it also runs from a checkout that is not installed

from mpp_taichi.scene.bundled import bundled_scenes  # noqa: E402
from mpp_taichi.scene.estimate import estimate  # noqa: E402
from mpp_taichi.scene.load import load_scene  # noqa: E402

MOST_WORK = 2e8  # particles times steps
PAGE = ("--size", "960x540", "--fps", "25", "--duration", "16")


def small_scenes():
    """The names of the scenes whose page takes seconds."""
    return [name for name, file in bundled_scenes().items() if _work(file) <= MOST_WORK]


def _work(file):
    spec = load_scene(file)
    step = spec.integrator.parameters.get("dt") if spec.integrator else None
    steps = spec.run.duration / step if step and spec.run.duration else 1e4
    return estimate(spec).particle_count * steps


def main():
    """Record, and build."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--play", nargs="+", default=[])
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--into", type=Path, default=ROOT / "out" / "site")
    arguments = parser.parse_args()
    for name in small_scenes() if arguments.all else arguments.play:
        page = ROOT / "out" / "site_pages" / f"{name}.html"
        page.parent.mkdir(parents=True, exist_ok=True)
        words = [sys.executable, "-m", "mpp_taichi", "record", name, "--html", str(page), *PAGE, "--quiet", "--no-archive"]
        if subprocess.run(words, cwd=page.parent).returncode not in (0, 4):  # 4: a scene that shows a method's failure
            print(f"{name}: no page", file=sys.stderr)
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "-q", "-d", str(arguments.into.resolve())], cwd=ROOT
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
