"""Bitcode that is kept with its sources was made from them."""

import hashlib
from pathlib import Path

import pytest

from mpp_taichi import bitcode, worker_threads
from mpp_taichi.neighbors import lane_arithmetic


@pytest.mark.parametrize("source", [lane_arithmetic.SOURCE, worker_threads.SOURCE], ids=lambda source: source.name)
def test_the_bitcode_is_that_of_the_source_beside_it(source):
    digest = hashlib.sha256(source.read_bytes()).hexdigest()[:8]
    assert [path.name for path in source.parent.glob("*.bc")] == [f"{source.stem}_{digest}.bc"]
    assert Path(bitcode.bitcode(source)).read_bytes()[:4] == b"BC\xc0\xde"
