"""The file with the settings of a window in the user's folder of settings: read before a window opens, written at the end."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from mpp_taichi.atomic_file import whole_text
from mpp_taichi.cli._options import FRESH, WINDOW_VARIABLE
from mpp_taichi.cli._terminal import say
from mpp_taichi.errors import OutputError, SceneError
from mpp_taichi.scene.document import read_text
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.yaml_limits import decode
from mpp_taichi.views.window_settings import WindowSettings

NAME = Path("mpp_taichi", "window.yaml")
MOST_BYTES = 1 << 16
HEAD = "# What was changed in the window of mpp_taichi; a file that is removed is made anew.\n"


@contextmanager
def kept_settings(*, fresh: bool) -> Iterator[WindowSettings]:
    """The settings of the last run, which are written at the end of the block where they have changed.

    A file that cannot be read or written is told in one line, and is no error. `fresh` leaves the file alone.
    """
    path = None if fresh or os.environ.get(WINDOW_VARIABLE) == FRESH else settings_file()
    settings = WindowSettings() if path is None else _read(path)
    before = replace(settings)
    try:
        yield settings
    finally:
        if path is not None and settings != before:
            _write(path, settings)


def settings_file() -> Path | None:
    """Where the settings are kept; None where the user has no folder for them."""
    try:
        home = Path.home()
    except RuntimeError:
        return None
    if sys.platform == "win32":
        folder = os.environ.get("APPDATA", "") or home / "AppData" / "Roaming"
    elif sys.platform == "darwin":
        folder = home / "Library" / "Application Support"
    else:
        named = os.environ.get("XDG_CONFIG_HOME", "")
        folder = named if os.path.isabs(named) else home / ".config"  # a relative path is to be ignored [XDG 0.8]
    return Path(folder) / NAME


def _read(path: Path) -> WindowSettings:
    try:
        with open(path, "rb") as stream:
            data = stream.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise ValueError(f"it is larger than {MOST_BYTES} bytes")
        faults = Faults()
        tree = read_text(decode(data, str(path)), str(path), faults)
        faults.raise_if_any()
        return WindowSettings.of(tree.plain())
    except FileNotFoundError:
        return WindowSettings()
    except SceneError as error:
        reason = str(error).splitlines()[0].removeprefix(f"{path}:")
    except (OSError, ValueError) as error:
        reason = str(getattr(error, "strerror", None) or error)
    say(f"note: the settings of the window in {path} are ignored: {reason}")
    return WindowSettings()


def _write(path: Path, settings: WindowSettings) -> None:
    given = settings.as_mapping().items()
    lines = [f"{key}: {str(value).lower() if isinstance(value, bool) else value}\n" for key, value in given]
    try:
        whole_text(path, HEAD + "".join(lines), "the settings of the window")
    except OutputError as error:
        say(f"note: {error}")
