"""Convert between scenes, states and the files of other programs.

IN is a scene (.yaml), a state that `run --snapshot` wrote or a trajectory of `run --trajectory` (.npz), or another
program's file: a particle list of MPPhys (.plist), a universe file of Princeton's assignment (.txt), a SolarSystem.xml, or
tipsy (.tipsy, .tip, .std). OUT is a scene, for which IN must be another program's file and is checked as a scene first; or
the particles of IN (of a scene, the particles at its start) as a state (.npz), a table (.csv), a particle list, a universe
file, tipsy, extended XYZ (.xyz, .extxyz) or H5MD (.h5md, .h5). The last two hold all frames of a trajectory.
docs/formats.md says which quantities each format keeps.
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
    parser.add_argument("source", type=Path, metavar="IN", help="what to read: .yaml, .npz, .plist, .txt, .xml or .tipsy")
    parser.add_argument(
        "target",
        type=_options.output_path,
        metavar="OUT",
        help="file to write: .yaml, .npz, .csv, .plist, .txt, .tipsy, .xyz or .h5md",
    )
    _options.add_report(parser)


def execute(arguments: argparse.Namespace) -> int:
    """Read, check and write; print the names of the written files."""
    from mpp_taichi.atomic_file import whole_file
    from mpp_taichi.exporters.catalogue import export, exporters

    target: Path = arguments.target
    suffix = target.suffix.lower()
    _options.require_suffix(target, (*SCENES, STATE, *exporters()), "OUT")
    imported, source = _read(arguments.source, particles_only=suffix == STATE)
    if suffix in SCENES:
        if imported is None:
            raise UsageError(f"convert: {arguments.source} is no other program's file; only such a file becomes a scene")
        from mpp_taichi.importers._pictures import beside
        from mpp_taichi.scene.document import read_text
        from mpp_taichi.scene.faults import Faults
        from mpp_taichi.scene.write import scene_text
        from mpp_taichi.scene.yaml_limits import decode

        text = scene_text(beside(imported, arguments.source, target), f"From {arguments.source.name}.")
        written = text.encode(errors="replace")  # a name of a file may have bytes that are no letters
        read_text(decode(written, str(target)), str(target), Faults())  # refuses what could not be read back
        with whole_file(target, "the scene") as temporary:
            temporary.write_bytes(written)
    elif suffix != STATE:
        export(source, target)
    elif source.trajectory is not None:
        raise source.refuse("is a trajectory, of which no state can be made")
    else:
        source.state.save(target)
    _tell(arguments, source)
    return 0


def _tell(arguments: argparse.Namespace, source: "Source") -> None:
    """Print the name of the written file."""
    state, frames = source.state, source.frame_count
    found = {"source": str(arguments.source), "target": str(arguments.target), "particle_count": state.particle_count}
    found |= {"spring_count": len(state.springs), "time": state.time, "frame_count": frames, "status": "ok"}
    if arguments.json:
        put_json(found)
    elif not arguments.quiet:
        more = f" and {len(state.springs)} springs" if len(state.springs) else ""
        more += f" and {len(state.rods)} rods" if len(state.rods) else ""
        more += f", {frames} frames" if source.trajectory is not None else ""
        put(f"wrote {arguments.target}: {state.particle_count} particles{more}")


def _read(path: Path, *, particles_only: bool) -> tuple[dict[str, Any] | None, "Source"]:
    """The particles of a file, and a scene made from the file of another program where the output is a scene."""
    from mpp_taichi.cli._refusals import require_room
    from mpp_taichi.exporters._source import Source
    from mpp_taichi.importers.catalogue import import_particles, import_scene
    from mpp_taichi.recorders.trajectory_file import TrajectoryFile, is_trajectory
    from mpp_taichi.scene.bundled import scene_file
    from mpp_taichi.scene.load import load_resolved, load_scene
    from mpp_taichi.snapshot import Snapshot
    from mpp_taichi.start.assemble import assemble

    path = scene_file(path)
    suffix = path.suffix.lower()
    if suffix == STATE and is_trajectory(path):
        trajectory = TrajectoryFile(path)
        return None, Source(str(path), next(trajectory.frames())[0], trajectory=trajectory)
    if suffix == STATE:
        return None, Source(str(path), Snapshot.load(path))
    if particles_only and suffix not in SCENES and (state := import_particles(path)) is not None:
        return None, Source(str(path), state)
    imported = None if suffix in SCENES else import_scene(path)[1]
    spec = load_scene(path) if imported is None else load_resolved(imported, str(path))
    require_room(spec)
    return imported, Source(str(path), assemble(spec), spec)
