"""The journal of a study: what was finished before a kill is there afterwards, and nothing else."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

from mpp_taichi.archive import record_file
from mpp_taichi.archive.journal import Journal
from mpp_taichi.archive.record_file import MAGIC, STATE, RecordFile
from mpp_taichi.errors import OutputError

KNOWN = {"version": "1", "budget": 60.0}
RESULTS = {"a": 1.5, "b": {"end": np.arange(6.0).reshape(2, 3), "seconds": [0.1, None]}, "c": "text"}


def written(path, results=RESULTS):
    """A journal with a record for each result, as a study leaves it that was cut off."""
    journal = Journal(path, KNOWN, after=0.0)
    for key, result in results.items():
        journal.put(key, result)
        journal.flush()
    journal.close()


def test_a_study_takes_what_an_unfinished_one_has_finished(tmp_path):
    written(tmp_path / "journal")
    with Journal(tmp_path / "journal", KNOWN) as again:
        assert again.holds == 3 and again.taken == set()
        assert again.get("a") == 1.5 and again.get("c") == "text" and again.get("d") is None
        np.testing.assert_array_equal(again.get("b")["end"], RESULTS["b"]["end"])
        again.put("d", 4)
        assert again.get("d") is None, "only an earlier process counts"
        assert again.taken == {"a", "b", "c"}
    assert Journal(tmp_path / "journal", KNOWN).get("d") == 4


def test_the_last_result_of_a_key_counts(tmp_path):
    written(tmp_path / "journal", {"a": 1})
    with Journal(tmp_path / "journal", KNOWN) as again:
        again.put("a", lambda: 2)
    assert Journal(tmp_path / "journal", KNOWN).get("a") == 2


def test_a_journal_that_ends_anywhere_keeps_every_result_that_was_written_whole(tmp_path):
    written(tmp_path / "whole")
    data = (tmp_path / "whole").read_bytes()
    file = RecordFile.open(tmp_path / "whole", to_append=False)
    ends = [record.end for record in file.records if record.kind == STATE]
    file.close()
    for length in range(len(MAGIC), len(data) + 1):
        (tmp_path / "cut").write_bytes(data[:length])
        with Journal(tmp_path / "cut", KNOWN) as again:
            assert again.holds == sum(end <= length for end in ends)
            if again.holds:
                assert again.torn == length - max(end for end in ends if end <= length)


def test_a_short_study_leaves_no_file_and_a_study_that_ended_well_neither(tmp_path):
    with Journal(tmp_path / "short", KNOWN) as journal:
        journal.put("a", 1)
    assert not (tmp_path / "short").exists()
    written(tmp_path / "long")
    journal = Journal(tmp_path / "long", KNOWN)
    journal.put("d", 1)
    journal.end()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("change", [{"budget": 20.0}, {"more": 1}])
def test_a_study_with_other_options_begins_anew_and_says_why(tmp_path, change):
    written(tmp_path / "journal")
    told = []
    with Journal(tmp_path / "journal", KNOWN | change, tell=told.append) as again:
        assert again.holds == 0
    assert len(told) == 1 and "is of another study" in told[0] and next(iter(change)) in told[0]
    assert not (tmp_path / "journal").exists()


def test_a_fresh_start_takes_nothing(tmp_path):
    written(tmp_path / "journal")
    told = []
    assert Journal(tmp_path / "journal", KNOWN, fresh=True, tell=told.append).holds == 0
    assert told == [] and not (tmp_path / "journal").exists()


def test_a_file_of_something_else_is_replaced_with_one_line(tmp_path):
    (tmp_path / "journal").write_bytes(b"no journal")
    told = []
    assert Journal(tmp_path / "journal", KNOWN, tell=told.append).holds == 0
    assert len(told) == 1 and not (tmp_path / "journal").exists()


@pytest.mark.skipif(record_file.fcntl is None, reason="Windows has no locks of this kind")
@pytest.mark.parametrize("fresh", [False, True])
def test_a_journal_has_one_writer(tmp_path, fresh):
    written(tmp_path / "journal")
    with Journal(tmp_path / "journal", KNOWN), pytest.raises(OutputError, match="another process is writing"):
        Journal(tmp_path / "journal", KNOWN, fresh=fresh)
    assert Journal(tmp_path / "journal", KNOWN).holds == 3


def test_a_folder_that_cannot_be_written_is_told_once_and_the_study_goes_on(tmp_path, caplog):
    (tmp_path / "file").touch()
    with Journal(tmp_path / "file" / "journal", KNOWN, after=0.0) as journal:
        for key in "abc":
            journal.put(key, 1)
            journal.flush()
    assert caplog.text.count("goes on without a journal") == 1


KILLED = """
import os, signal, sys, time
from mpp_taichi.archive.journal import Journal
journal = Journal(__import__("pathlib").Path(sys.argv[1]), {}, after=0.0)
for number in range(1000):
    journal.put(str(number), number)
    print(number, flush=True)
    time.sleep(0.02)
"""


@pytest.mark.sampled(3)
def test_a_killed_study_loses_less_than_a_second(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path / "journal")], stdout=subprocess.PIPE, text=True)
    done = [int(process.stdout.readline()) for _ in range(100)]
    time.sleep(1.0)
    process.kill()
    process.wait()
    process.stdout.close()
    with Journal(tmp_path / "journal", {}) as again:
        assert [again.get(str(number)) for number in done] == done
    assert os.listdir(tmp_path) == ["journal"]
