"""The command line: finds the verb, reads its arguments, and turns errors into messages and exit codes.

Exit codes: 0 ok · 1 internal error · 2 wrong usage, an invalid scene, or a package missing ·
3 backend, device or display not available · 4 a stability or accuracy limit was broken, or an `expect` failed ·
5 input or output · 6 more than the machine has · 128 + signal when interrupted.
"""

import argparse
import gc
import importlib
import os
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from signal import SIGINT
from types import ModuleType
from typing import NoReturn

from mpp_taichi import __version__
from mpp_taichi.cli._exhausted import exhausted
from mpp_taichi.cli._signals import Interrupted, Interruption
from mpp_taichi.cli._terminal import (
    CLOSED_OUTPUT_CODE,
    ClosedOutputError,
    UsageError,
    explain_error,
    prepare_streams,
    put_failure,
    put_interruption,
    say,
    warnings_shown,
)
from mpp_taichi.component import in_own_component
from mpp_taichi.device.fast_taichi import switch
from mpp_taichi.errors import INTERNAL_ERROR_CODE, ComponentError, MppError, OutputError, SceneError
from mpp_taichi.missing_package import missing_packages_named
from mpp_taichi.scene.bundled import bundled_scenes
from mpp_taichi.scene.did_you_mean import suggestion

NAMES = (
    "run",
    "record",
    "scenes",
    "new",
    "accuracy",
    "compare",
    "sweep",
    "explain",
    "check",
    "convert",
    "replay",
    "verify",
    "passport",
    "info",
    "schema",
)
LONGEST_MESSAGE = 300
DEBUG_VARIABLE = "MPP_TAICHI_DEBUG"
OBJECTS_BETWEEN_COLLECTIONS = 200_000
"""New objects after which Python looks for cycles, not 700: hardly any object of a starting program is in a cycle."""
EPILOG = __doc__.partition("\n\n")[2]
DESCRIPTION = """Scenes of particles, compiled to just the physics they name. `mpp-taichi SCENE` runs a scene.

To begin with:
  mpp-taichi ring                     run a scene of the program; without a display it writes a film
  mpp-taichi run                      a window with a list of scenes
  mpp-taichi scenes                   list the scenes of the program
  mpp-taichi new my.yaml              begin a scene of your own"""


class _Verbs(Mapping[str, ModuleType]):
    """The modules of the verbs, each imported when it is first asked for: a verb does not wait for the others."""

    def __getitem__(self, name: str) -> ModuleType:
        if name not in NAMES:
            raise KeyError(name)
        return importlib.import_module(f"mpp_taichi.cli.{name}")

    def __iter__(self) -> Iterator[str]:
        return iter(NAMES)

    def __len__(self) -> int:
        return len(NAMES)


VERBS = _Verbs()


class _Parser(argparse.ArgumentParser):
    """Reports a fault in one line, and names the help in a second line."""

    def error(self, message: str) -> NoReturn:
        """Raise instead of ending the process."""
        raise UsageError(f"{self.prog}: {message}\n{self.prog} --help lists what there is")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    prepare_streams()
    if arguments is None:  # this process has no other program
        gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)
    words = list(sys.argv[1:] if arguments is None else arguments)
    json_wanted = "--json" in words
    code = INTERNAL_ERROR_CODE
    try:
        with warnings_shown(), missing_packages_named(), Interruption() as interruption, interruption.at_once():
            code = _dispatch(words)
    except ClosedOutputError:
        return CLOSED_OUTPUT_CODE
    except SystemExit as end:  # --help and --version
        return int(end.code or 0)
    except MppError as error:
        explain_error(error)
        code = error.exit_code
        if json_wanted:
            faults = list(error.faults) if isinstance(error, SceneError) else [str(error)]
            code = put_failure(str(error), faults, code)
    except (Interrupted, KeyboardInterrupt) as error:  # before there was anything to save
        signal = error if isinstance(error, Interrupted) else Interrupted(SIGINT)
        say(f"interrupted by {signal}")
        code = put_interruption(signal.code) if json_wanted else signal.code
    except Exception as error:
        short = exhausted(error)
        if short is not None or isinstance(error, OSError):  # for example standard output on a full disk
            told = str(short or getattr(error, "strerror", None) or error)
            say(f"error: {told}")
            code = short.exit_code if short is not None else OutputError.exit_code
            return put_failure(told, [told], code) if json_wanted else code
        text = " ".join(str(error).split())[:LONGEST_MESSAGE]
        if told := in_own_component(error):
            say(told)
            return put_failure(told, [told], ComponentError.exit_code) if json_wanted else ComponentError.exit_code
        say(f"internal error: {type(error).__name__}: {text}; please report it")
        if os.environ.get(DEBUG_VARIABLE) == "1":
            traceback.print_exc()
        else:
            say(f"with {DEBUG_VARIABLE}=1 the place is shown")
        if json_wanted:
            code = put_failure(f"internal error: {text}", None, code)
    return code


def _dispatch(words: list[str]) -> int:
    words = _with_verb(words)
    verb = words[0] if words and words[0] in NAMES else None
    parser = _parser(verb)
    chosen, unknown = parser.parse_known_args(words)
    if unknown:
        verbs = next(action for action in parser._actions if action.dest == "verb")
        options = verbs.choices[chosen.verb]._option_string_actions if chosen.verb else {}  # type: ignore[index]
        near = suggestion(unknown[0].partition("=")[0], options) if unknown[0].startswith("-") else ""
        raise UsageError(f"{parser.prog} {chosen.verb or ''}: unknown argument {' '.join(unknown)}{near}")
    if chosen.verb is None:
        parser.print_help()
        return 0
    switch.check_variable()
    if chosen.components:
        from mpp_taichi.scene.own_components import add_components

        for folder in chosen.components:
            add_components(folder)
    if chosen.verb == "sweep":  # whose script for SLURM repeats them
        chosen.words = words
    return VERBS[chosen.verb].execute(chosen)


def _parser(chosen: str | None = None) -> argparse.ArgumentParser:
    """The parser of all verbs, of which only the chosen verb has its options; without a choice, each has its own."""
    parser = _Parser(
        prog="mpp-taichi",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"mpp_taichi {__version__}")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", parser_class=_Parser)
    for name in NAMES:
        text = VERBS[name].__doc__ or "" if chosen in (None, name) else ""
        verb = verbs.add_parser(
            name,
            help=text.partition("\n")[0],
            description=text,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        if chosen in (None, name):
            VERBS[name].add_arguments(verb)
            verb.add_argument(
                "--components",
                action="append",
                default=[],
                metavar="FOLDER",
                help="a folder with components of your own, in forces/, integrators/ and so on; may be given several times",
            )
    return parser


def _with_verb(words: list[str]) -> list[str]:
    """Put `run` before a bare scene: a file, or the name of a scene of the program.

    Raises:
        UsageError: the first word is neither a verb nor a scene.
    """
    if not words or words[0] in NAMES or words[0] in ("-h", "--help", "--version"):
        return words
    first = words[0]
    is_scene = "." in first or os.sep in first or first in bundled_scenes() or os.path.exists(first)
    if not first.startswith("-") and not is_scene:
        hint = suggestion(first, [*NAMES, *bundled_scenes()])
        told = f"{first!r} is neither a verb nor a scene{hint or ';'} verbs: {', '.join(NAMES)}"
        raise UsageError(f"{told}; `mpp-taichi scenes` lists the scenes")
    return ["run", *words]
