"""The bitcode files were compiled from the source files beside them."""

import sys
from pathlib import Path

import pytest
from conftest import ROOT

from mpp_taichi.device.fast_taichi import bitcode, lane_arithmetic, prefetch, series_walk, spring_lanes, worker_threads

sys.path[:0] = [str(ROOT / "tools" / "make")]

from assemble_bitcode import target  # noqa: E402

SOURCES = (lane_arithmetic.SOURCE, prefetch.SOURCE, spring_lanes.SOURCE, worker_threads.SOURCE, *series_walk.SOURCES)


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.name)
def test_the_bitcode_is_that_of_the_source_beside_it(source):
    assert [path.name for path in source.parent.glob(f"{source.stem}_*.bc")] == [target(source).name]
    assert Path(bitcode.bitcode(source)).read_bytes()[:4] == b"BC\xc0\xde"


def test_no_bitcode_is_without_a_source():
    kept = {path.name for path in Path(bitcode.__file__).parent.rglob("*.bc")}
    assert kept == {Path(bitcode.bitcode(source)).name for source in SOURCES}
