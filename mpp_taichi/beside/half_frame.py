"""Moment: the particles of the other half at the time of a picture, and how they go through a pipe.

Most arrays of a frame (masses, colours, springs) never change; only what differs from the moment before is sent.
"""

from dataclasses import dataclass, fields
from typing import IO, Any

import numpy as np

from mpp_taichi.beside.wire import send
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame

PLACE, PRESENT = "place", "present"
_WORDS = ("time", "title", "extra", "center", "name")
_ARRAYS = tuple(each.name for each in fields(Frame) if each.name not in _WORDS)


@dataclass(frozen=True, eq=False)
class Moment:
    """What is drawn, and what is compared.

    place     [length], (particle_count, 3), as the run has it: not led back into a box that repeats
    present   False for what has merged into another, (particle_count,)
    """

    frame: Frame
    place: np.ndarray
    present: np.ndarray


class MomentSender:
    """Writes moments into a stream."""

    def __init__(self, stream: IO[bytes]) -> None:
        """Nothing was sent yet."""
        self._stream = stream
        self._sent: dict[str, np.ndarray] = {}

    def add(self, snapshot: Snapshot, frame: Frame) -> None:
        """Send what is new since the last moment; a film calls this for each frame."""
        arrays = {name: np.asarray(value) for name in _ARRAYS if (value := getattr(frame, name)) is not None}
        arrays |= {PLACE: snapshot.position, PRESENT: snapshot.present}
        changed = {name: array for name, array in arrays.items() if not _equal(self._sent.get(name), array)}
        self._sent |= changed
        gone = sorted(self._sent.keys() - arrays.keys())
        send(self._stream, {"kind": "moment", "time": frame.time, "center": frame.center, "gone": gone}, changed)


class MomentReceiver:
    """Puts moments together again."""

    def __init__(self) -> None:
        """Nothing has come yet."""
        self._known: dict[str, np.ndarray] = {}

    def moment(self, words: dict, arrays: dict[str, np.ndarray]) -> Moment:
        """The moment of a message."""
        self._known |= arrays
        given: dict[str, Any] = {
            name: array for name, array in self._known.items() if name in _ARRAYS and name not in words["gone"]
        }
        center = words["center"]
        frame = Frame(**given, time=words["time"], center=None if center is None else tuple(center))
        return Moment(frame, self._known[PLACE], self._known[PRESENT])


def _equal(one: np.ndarray | None, other: np.ndarray) -> bool:
    return one is not None and one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
