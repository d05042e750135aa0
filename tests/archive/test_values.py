"""Values of an archive: what is written is read, and damaged or hostile bytes are refused without running anything."""

import math
from collections import deque

import numpy as np
import pytest

from mpp_taichi.archive.values import KEPT, ObjectNumber, pack, unpack
from mpp_taichi.errors import StateError

VALUE = {
    "nothing": None,
    "numbers": [1, -(2**70), 0.1, 2.2250738585072014e-308, -0.0, math.inf, True],
    "text": "Мя́ч \x1b[31m",
    "!": "a key that the format uses itself",
    "table": {3: "three", (1, 2): {"!": 1}},
    "several": (1, (2, [3])),
    "recent": deque([1, 2], 5),
    "known": {4, 5},
    "arrays": [np.arange(6.0).reshape(2, 3), np.zeros((0, 3), np.float32), np.array(["a", "bcd"])],
    "number": np.float32(0.1),
    "part": ObjectNumber(7),
}


def test_a_value_is_read_as_it_was_written():
    found = unpack(pack(VALUE))
    assert {key: each for key, each in found.items() if key != "arrays"} == {
        key: each for key, each in VALUE.items() if key != "arrays"
    }
    for array, wanted in zip(found["arrays"], VALUE["arrays"]):
        assert array.dtype == wanted.dtype
        assert np.array_equal(array, wanted)
    assert math.copysign(1.0, found["numbers"][4]) == -1.0
    assert found["number"].dtype == np.float32
    assert found["recent"].maxlen == 5
    assert unpack(pack([KEPT]))[0] is KEPT
    assert math.isnan(unpack(pack(math.nan)))


def test_what_could_run_code_is_not_written():
    for each in (object(), print, np.array([object()])):
        with pytest.raises(TypeError):
            pack([each])


def test_bytes_that_end_anywhere_are_refused():
    data = pack(VALUE)
    for end in range(len(data)):
        with pytest.raises(StateError):
            unpack(data[:end])


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "text",
    [
        '{"value": 1}',
        '{"value": {"!": "array", "v": 3}, "arrays": []}',
        '{"value": {"!": "unknown", "v": []}, "arrays": []}',
        '{"value": 1, "arrays": [["|O", [1]]]}',
        '{"value": 1, "arrays": [["<f8", [-1]]]}',
        '{"value": 1, "arrays": [["<f8", [99999999999]]]}',
        '{"value": ' + "[" * 100_000 + "]" * 100_000 + ', "arrays": []}',
    ],
)
def test_hostile_texts_are_refused(text):
    with pytest.raises(StateError):
        unpack(len(text).to_bytes(8, "little") + text.encode())
