"""Print the passport of a file: the scene, versions, machine and verdict of `verify` that it came from.

Films, pictures, pages, states, trajectories and tables in .npz have one inside; a table in .csv has no room for one.
"""

import argparse
from pathlib import Path
from typing import Any

from mpp_taichi.cli._terminal import UsageError, put, put_json
from mpp_taichi.errors import OutputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a file that run, record or replay has written")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")


def execute(arguments: argparse.Namespace) -> int:
    """Read and print."""
    from mpp_taichi.passport.formats import FORMATS, passport_of

    path: Path = arguments.file
    try:
        found = passport_of(path)
    except KeyError:
        raise UsageError(f"passport: {path}: files of this kind have none; {', '.join(FORMATS)} have") from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise OutputError(f"{path}: is damaged: {error}") from None
    if found is None:
        raise OutputError(f"{path}: has no passport: another program wrote it, or an earlier version of this program")
    if arguments.json:
        put_json(found)
    else:
        put("\n".join(f"{key.replace('_', ' '):14} {_told(value)}" for key, value in found.items()))
    return 0


def _told(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_told(each)}" for key, each in value.items())
    return str(value)
