"""Moment: the particles of the other half at the time of a picture, sent through a pipe.

Most arrays of a frame (masses, colours, springs) never change; only arrays that differ from the moment before are sent.
"""

from dataclasses import dataclass, fields
from typing import IO, Any

import numpy as np

from mpp_taichi.beside.wire import send
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame

PLACE, PRESENT = "place", "present"
_SENT = ("time", "center", "collides", "period", "ahead")
_WORDS = (*_SENT, "title", "clock", "units", "extra", "name")
_ARRAYS = tuple(each.name for each in fields(Frame) if each.name not in _WORDS)


@dataclass(frozen=True, eq=False)
class Moment:
    """One moment of a run: the frame to draw, and the positions to compare.

    place     [length], (particle_count, 3), as the run has them: not wrapped into a periodic box
    present   False for a particle that has merged into another one, (particle_count,)
    """

    frame: Frame
    place: np.ndarray
    present: np.ndarray


class MomentSender:
    """Writes moments into a stream."""

    def __init__(self, stream: IO[bytes]) -> None:
        """No moment was sent yet."""
        self._stream = stream
        self._sent: dict[str, np.ndarray] = {}

    def add(self, snapshot: Snapshot, frame: Frame) -> None:
        """Send the arrays that have changed since the last moment; a film calls this for each frame."""
        arrays = {name: np.asarray(value) for name in _ARRAYS if (value := getattr(frame, name)) is not None}
        arrays |= {PLACE: snapshot.position, PRESENT: snapshot.present}
        changed = {name: array for name, array in arrays.items() if not _equal(self._sent.get(name), array)}
        self._sent |= changed
        gone = sorted(self._sent.keys() - arrays.keys())
        words = {"kind": "moment", "gone": gone} | {name: getattr(frame, name) for name in _SENT}
        send(self._stream, words, changed)


class MomentReceiver:
    """Rebuilds moments from messages."""

    def __init__(self) -> None:
        """No message has come yet."""
        self._known: dict[str, np.ndarray] = {}

    def moment(self, words: dict, arrays: dict[str, np.ndarray]) -> Moment:
        """The moment of a message."""
        self._known |= arrays
        given: dict[str, Any] = {
            name: array for name, array in self._known.items() if name in _ARRAYS and name not in words["gone"]
        }
        said: dict[str, Any] = {name: tuple(words[name]) if isinstance(words[name], list) else words[name] for name in _SENT}
        frame = Frame(**given, **said)
        return Moment(frame, self._known[PLACE], self._known[PRESENT])


def _equal(one: np.ndarray | None, other: np.ndarray) -> bool:
    return one is not None and one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
