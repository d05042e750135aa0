"""Begin a scene of your own: copy a scene of the program, with its comments, into a new file.

With `--sheet` a worksheet of the course is written instead, to be filled in with predictions and given to `check`.

The first line of the copy tells an editor where the schema of scenes is. With `redhat.vscode-yaml` or another editor that
has the YAML language server, keys are then completed and checked while you write.
"""

import argparse
import re
from pathlib import Path

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import UsageError, put

FIRST = "sun_earth"
SCHEMA_LINE = re.compile(r"^# yaml-language-server: \$schema=.*$", re.M)
EXTENDED = re.compile(r"^extends: *([\w-]+)\.ya?ml *$", re.M)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("target", type=_options.output_path, metavar="FILE.yaml", help="file to write; it must not exist yet")
    parser.add_argument("--like", default=FIRST, metavar="NAME", help=f"scene of the program to copy; {FIRST} when absent")
    parser.add_argument(
        "--sheet", metavar="CHAPTER", help="in place of a scene, the worksheet of a chapter of the course: two_bodies"
    )


def execute(arguments: argparse.Namespace) -> int:
    """Write the copy."""
    from mpp_taichi.atomic_file import whole_text
    from mpp_taichi.scene.bundled import bundled_scenes
    from mpp_taichi.scene.did_you_mean import suggestion

    target: Path = arguments.target
    _options.require_suffix(target, (".yaml", ".yml"), "FILE.yaml")
    if target.exists() or target.is_symlink():
        raise UsageError(f"new: {target} exists already; choose another name")
    if arguments.sheet is not None:
        return _write_sheet(arguments.sheet, target)
    known = bundled_scenes()
    name = Path(arguments.like).stem
    if name not in known:
        raise UsageError(f"new: the program has no scene {name!r}{suggestion(name, known)}; `mpp-taichi scenes` lists them")
    whole_text(target, copied(known[name].read_text(encoding="utf-8")), "the scene")
    put(f"wrote {target}, a copy of {name}; run it: mpp-taichi {target}")
    return 0


def _write_sheet(name: str, target: Path) -> int:
    from mpp_taichi.atomic_file import whole_text
    from mpp_taichi.errors import MppError
    from mpp_taichi.worksheets.answers import template
    from mpp_taichi.worksheets.worksheet import load_worksheet

    try:
        sheet = load_worksheet(name)
    except MppError as error:
        raise UsageError(f"new: {error}") from None
    whole_text(target, template(sheet), "the worksheet")
    put(f"wrote {target}, {len(sheet.questions)} questions; write your predictions into it, then: mpp-taichi check {target}")
    return 0


def copied(text: str) -> str:
    """The text of a bundled scene for another folder: the schema by its address, and the scene that it extends by its name."""
    from mpp_taichi.scene.schema import SCHEMA_FILE

    line = f"# yaml-language-server: $schema={SCHEMA_FILE.as_uri()}"
    text = SCHEMA_LINE.sub(lambda _: line, text, count=1)
    return EXTENDED.sub(r"extends: \1", text)
