"""Convert what another program wrote into a scene file: particle lists of MPPhys, universe files of Princeton's assignment.

The scene is checked before it is written. Which program a file is from is known by its suffix and its beginning.
"""

import argparse
from pathlib import Path

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import put, put_json

SUFFIXES = (".yaml", ".yml")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("source", type=Path, metavar="IN", help="a .plist of MPPhys, or a universe file (.txt)")
    parser.add_argument("target", type=_options.output_path, metavar="OUT", help="the scene file to write (.yaml)")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Read, check, write, and say what was written."""
    from mpp_taichi.assemble import assemble
    from mpp_taichi.importers.catalogue import import_scene
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.scene.write import scene_text
    from mpp_taichi.whole_file import whole_file

    _options.require_suffix(arguments.target, SUFFIXES, "OUT")
    importer, scene = import_scene(arguments.source)
    start = assemble(load_scene(scene))
    with whole_file(arguments.target, "the scene") as temporary:
        temporary.write_text(scene_text(scene, f"From {arguments.source.name} ({importer})."), encoding="utf-8")
    found = {
        "source": str(arguments.source),
        "importer": importer,
        "scene": str(arguments.target),
        "particle_count": start.particle_count,
        "spring_count": len(start.springs),
        "status": "ok",
    }
    if arguments.json:
        put_json(found)
    elif not arguments.quiet:
        springs = f" and {len(start.springs)} springs" if len(start.springs) else ""
        put(f"wrote {arguments.target}: {start.particle_count} particles{springs}, as {importer} has them")
    return 0
