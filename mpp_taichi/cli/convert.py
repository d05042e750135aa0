"""Convert between scenes, states and the files of other programs.

IN is a scene (.yaml), a state that `run --snapshot` wrote (.npz), a particle list of MPPhys (.plist), a universe file of
Princeton's assignment (.txt) or a SolarSystem.xml. OUT is a scene, for which IN must be another program's file and is checked
as a scene first; or the particles of IN, of a scene those that it begins with, as a state, a table (.csv), a particle list or
a universe file.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import UsageError, put, put_json

if TYPE_CHECKING:
    from mpp_taichi.exporters._source import Source

SCENES, STATE = (".yaml", ".yml"), ".npz"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("source", type=Path, metavar="IN", help="what to read: .yaml, .npz, .plist, .txt or .xml")
    parser.add_argument("target", type=_options.output_path, metavar="OUT", help="what to write: the same, or .csv")
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Read, check, write, and say what was written."""
    from mpp_taichi.exporters.catalogue import exporters
    from mpp_taichi.whole_file import whole_file

    target: Path = arguments.target
    _options.require_suffix(target, (*SCENES, STATE, *exporters()), "OUT")
    imported, source = _read(arguments.source)
    if target.suffix in SCENES:
        if imported is None:
            raise UsageError(f"convert: {arguments.source} is no other program's file, of which alone a scene can be made")
        from mpp_taichi.scene.write import scene_text

        text = scene_text(imported, f"From {arguments.source.name}.")
    elif target.suffix != STATE:
        text = exporters()[target.suffix].text(source)
    if target.suffix == STATE:
        source.state.save(target)
    else:
        with whole_file(target, "the particles") as temporary:
            temporary.write_text(text, encoding="utf-8")
    state = source.state
    found = {"source": str(arguments.source), "target": str(target), "particle_count": state.particle_count}
    found |= {"spring_count": len(state.springs), "time": state.time, "status": "ok"}
    if arguments.json:
        put_json(found)
    elif not arguments.quiet:
        springs = f" and {len(state.springs)} springs" if len(state.springs) else ""
        put(f"wrote {target}: {state.particle_count} particles{springs}")
    return 0


def _read(path: Path) -> tuple[dict[str, Any] | None, "Source"]:
    """A scene made of another program's file, if it is one; and the particles."""
    from mpp_taichi.assemble import assemble
    from mpp_taichi.exporters._source import Source
    from mpp_taichi.importers.catalogue import import_scene
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.snapshot import Snapshot

    if path.suffix == STATE:
        state = Snapshot.load(path)
        return None, Source(str(path), state)
    imported = None if path.suffix in SCENES else import_scene(path)[1]
    spec = load_scene(path if imported is None else imported)
    return imported, Source(str(path), assemble(spec), spec)
