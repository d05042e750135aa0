"""The environment variables that Taichi reads, hidden while this package imports or starts Taichi.

Taichi lets variables such as TI_ARCH override the arguments of `ti.init`. A run of a scene takes its settings from the scene
and the command line, so the user's variables are hidden from Taichi for the import and for each start by this package. They are
restored afterwards, because the user's own Taichi code may need them.
"""

import functools
import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

log = logging.getLogger(__name__)

OURS = {
    "TI_SKIP_VERSION_CHECK": "ON",  # the check calls a server
    "ENABLE_TAICHI_HEADER_PRINT": "False",
    "TI_ENABLE_PYBUF": "0",  # in a notebook it copies the output after each kernel, and says so in red
}


@contextmanager
def user_variables_hidden() -> Iterator[None]:
    """Within this context Taichi sees none of the user's TI_* variables; each of them is named in one warning."""
    before = {name: value for name, value in os.environ.items() if _is_read_by_taichi(name)}
    for name, value in before.items():
        if name not in OURS:
            _warn_once(name, value)
        del os.environ[name]
    os.environ.update(OURS)
    try:
        yield
    finally:
        for name in OURS:
            os.environ.pop(name, None)
        os.environ.update(before)


def without_user_variables(environment: Mapping[str, str]) -> dict[str, str]:
    """An environment for a child process that starts Taichi by itself."""
    return {name: value for name, value in environment.items() if not _is_read_by_taichi(name)} | OURS


def _is_read_by_taichi(name: str) -> bool:
    return name.startswith("TI_") or name in OURS


@functools.cache
def _warn_once(name: str, value: str) -> None:
    log.warning("ignoring %s=%s: settings come from the scene and the command line", name, value)
