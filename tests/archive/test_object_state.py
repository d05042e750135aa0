"""The state of objects: taken out, and put into objects that were made anew."""

from collections import deque

import numpy as np
import pytest
from PIL import Image

from mpp_taichi.archive import object_state
from mpp_taichi.archive.values import pack, unpack
from mpp_taichi.errors import StateError
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.recorders.watchdog import EnergyWatchdog


def watched(every=3):
    table = TableRecorder(every)
    return {"table": table, "watchdog": EnergyWatchdog(table)}


def with_samples():
    found = watched()
    found["table"].rows += [{"step": 0, "momentum": np.array([1.0, 2.0, 3.0])}, {"step": 3, "momentum": np.zeros(3)}]
    found["table"]._largest["way"] = 0.5
    found["watchdog"]._seen, found["watchdog"].broken_at = 2, 1.5
    return found


def test_objects_have_the_same_numbers_and_still_share_what_they_shared():
    live = watched()
    rows = live["table"].rows
    object_state.restore(unpack(pack(object_state.captured(with_samples()))), live)
    assert live["table"].rows is rows  # a page may hold the same list
    assert [row["step"] for row in rows] == [0, 3]
    assert np.array_equal(rows[0]["momentum"], [1.0, 2.0, 3.0])
    assert live["table"]._largest["way"] == 0.5
    assert live["watchdog"].table is live["table"]
    assert (live["watchdog"]._seen, live["watchdog"].broken_at) == (2, 1.5)


@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_pictures_and_queues_have_the_same_contents(mode):
    picture = Image.frombytes(mode, (3, 2), bytes(range(6 * len(mode))))
    kept, live = with_samples(), watched()
    kept["table"].rows.append({"last": deque([1.5, [2, "b"]], 4), "drawn": picture, "again": picture})
    object_state.restore(unpack(pack(object_state.captured(kept))), live)
    row = live["table"].rows[-1]
    assert row["last"] == deque([1.5, [2, "b"]]) and row["last"].maxlen == 4
    assert (row["drawn"].mode, row["drawn"].size, row["drawn"].tobytes()) == (mode, (3, 2), picture.tobytes())
    assert row["again"] is row["drawn"] is not picture  # as before, one picture that is held twice


def test_functions_of_the_process_stay():
    live = watched()
    live["table"].validity = len
    object_state.restore(object_state.captured(with_samples() | {}), live)
    assert live["table"].validity is None  # no function was captured, but its absence was
    kept = with_samples()
    kept["table"].validity = len
    saved = object_state.captured(kept)
    live["table"].validity = max
    object_state.restore(saved, live)
    assert live["table"].validity is max


def test_what_cannot_be_captured_is_named():
    found = watched()
    found["table"].rows.append({"odd": object()})
    with pytest.raises(TypeError, match=r"table\.rows.*builtins\.object"):
        object_state.captured(found)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "name",
    [
        "os:system",
        "mpp_taichi.atomic_file:os",
        "mpp_taichi.simulation.simulation:Simulation",
        "mpp_taichi.recorders.table:nothing",
        "mpp_taichi.recorders.table:TableRecorder.rows",
        "mpp_taichi.nowhere:Thing",
        "",
    ],
)
def test_an_archive_cannot_name_other_classes(name):
    saved = object_state.captured(with_samples())
    saved["objects"].append({"class": name, "state": {}})
    saved["objects"][0]["state"]["every"] = object_state.ObjectNumber(len(saved["objects"]) - 1)
    with pytest.raises(StateError):
        object_state.restore(saved, watched())


def test_a_state_of_other_objects_is_refused():
    saved = object_state.captured(with_samples())
    with pytest.raises(StateError, match="watchdog"):
        object_state.restore(saved, {"table": TableRecorder(3)})
