"""The file of records: a torn end costs no more than the record that was being written."""

import os

import pytest

from mpp_taichi.archive import record_file
from mpp_taichi.archive.record_file import END, HEADER, MAGIC, OUTPUT, STATE, RecordFile
from mpp_taichi.errors import OutputError, StateError

PAYLOADS = [(HEADER, b"what the run is"), (STATE, b""), (STATE, b"x" * 100), (END, b"{}")]


def written(path):
    """A file with PAYLOADS; returns its bytes and the offsets at which its records end."""
    file = RecordFile.create(path)
    for kind, payload in PAYLOADS:
        file.append(kind, payload)
    ends = [record.end for record in file.records]
    file.close()
    return path.read_bytes(), ends


def test_records_are_read_as_they_were_written(tmp_path):
    written(tmp_path / "a.run")
    file = RecordFile.open(tmp_path / "a.run")
    assert [(record.kind, file.read(record)) for record in file.records] == PAYLOADS
    assert file.torn == 0
    assert file.read(file.last(STATE)) == b"x" * 100


def test_a_file_that_ends_anywhere_keeps_every_whole_record_and_can_be_appended_to(tmp_path):
    data, ends = written(tmp_path / "a.run")
    for length in range(len(MAGIC), len(data) + 1):
        path = tmp_path / "cut.run"
        path.write_bytes(data[:length])
        file = RecordFile.open(path)
        whole = sum(end <= length for end in ends)
        assert len(file.records) == whole
        assert file.torn == length - ([len(MAGIC), *ends][whole])
        file.append(STATE, b"more")
        file.close()
        again = RecordFile.open(path)
        assert [again.read(record) for record in again.records] == [payload for _, payload in PAYLOADS[:whole]] + [b"more"]
        again.close()


def test_a_changed_byte_ends_the_records_there(tmp_path):
    data, ends = written(tmp_path / "a.run")
    for place in range(len(MAGIC), len(data)):
        path = tmp_path / "changed.run"
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x40]) + data[place + 1 :])
        file = RecordFile.open(path)
        before = sum(end <= place for end in ends)
        assert len(file.records) == before
        file.close()


def test_other_files_are_refused(tmp_path):
    (tmp_path / "a.run").write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(StateError, match="is no archive of a run"):
        RecordFile.open(tmp_path / "a.run")


@pytest.mark.skipif(record_file.fcntl is None, reason="Windows has no locks of this kind")
def test_a_file_has_one_writer(tmp_path):
    file = RecordFile.create(tmp_path / "a.run")
    for second in (RecordFile.create, RecordFile.open):
        with pytest.raises(OutputError, match="another process is writing"):
            second(tmp_path / "a.run")
    file.close()
    RecordFile.open(tmp_path / "a.run").close()


def test_a_symbolic_link_at_the_name_is_not_followed(tmp_path):
    """The program chooses the names of archives and journals, so in a shared folder another user may guess them."""
    victim, path = tmp_path / "victim", tmp_path / "a.run"
    victim.write_text("mine")
    path.symlink_to(victim)
    file = RecordFile.create(path)
    file.append(STATE, b"state")
    file.append(OUTPUT, b"picture")
    path.with_name("a.run.part").symlink_to(victim)
    file.drop_outputs()
    file.close()
    assert victim.read_text() == "mine" and path.is_file() and not path.is_symlink()
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["a.run", "victim"]


def test_a_large_file_loses_every_second_state_and_never_the_last(tmp_path, monkeypatch):
    monkeypatch.setattr(record_file, "MOST_BYTES", 1000)
    file = RecordFile.create(tmp_path / "a.run")
    file.append(HEADER, b"header")
    for number in range(40):
        file.append(STATE, b"%03d" % number * 20)
        file.thin_out()
        assert file.records[-1].end <= 1000
        assert file.read(file.last(STATE))[:3] == b"%03d" % number
    kept = [int(file.read(record)[:3]) for record in file.records if record.kind == STATE]
    file.close()
    again = RecordFile.open(tmp_path / "a.run")
    assert again.read(again.records[0]) == b"header"
    assert [int(again.read(record)[:3]) for record in again.records[1:]] == kept == sorted(kept)
    assert [path.name for path in tmp_path.iterdir()] == ["a.run"]


def test_a_full_disk_takes_back_the_part_of_a_record(tmp_path, monkeypatch):
    file = RecordFile.create(tmp_path / "a.run")
    file.append(STATE, b"first")

    def full(_descriptor):
        raise OSError(28, os.strerror(28))

    with monkeypatch.context() as patch:
        patch.setattr(record_file.os, "fsync", full)
        with pytest.raises(OutputError, match="No space left"):
            file.append(STATE, b"second")
    file.append(STATE, b"third")
    file.close()
    again = RecordFile.open(tmp_path / "a.run")
    assert [again.read(record) for record in again.records] == [b"first", b"third"]


def test_a_file_without_room_for_a_record_keeps_the_others_and_can_be_closed(tmp_path):
    """A run goes on without its archive, so no step of giving it up may raise."""
    resource = pytest.importorskip("resource")  # POSIX
    path = tmp_path / "a.run"
    file = RecordFile.create(path)
    file.append(STATE, b"first")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, before[1]))  # writes beyond it fail as on a full disk
    try:
        with pytest.raises(OutputError, match="cannot be written"):
            file.append(STATE, b"x" * 1000)
        file.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    again = RecordFile.open(path)
    assert [again.read(record) for record in again.records] == [b"first"]
    again.close()


def test_outputs_are_never_thinned_out_and_do_not_count(tmp_path, monkeypatch):
    monkeypatch.setattr(record_file, "MOST_BYTES", 1000)
    file = RecordFile.create(tmp_path / "a.run")
    for number in range(40):
        file.append(record_file.OUTPUT, b"%03d" % number * 100)
        file.append(STATE, b"%03d" % number * 20)
        file.thin_out()
    outputs = [file.read(record)[:3] for record in file.records if record.kind == record_file.OUTPUT]
    states = [int(file.read(record)[:3]) for record in file.records if record.kind == STATE]
    assert outputs == [b"%03d" % number for number in range(40)]
    assert 2 < len(states) < 40
    assert states[-1] == 39
    file.cut_behind(file.records[0])
    file.close()
    again = RecordFile.open(tmp_path / "a.run")
    assert (len(again.records), again.torn) == (1, 0)


def test_the_outputs_of_a_run_that_has_ended_are_removed_and_its_states_stay(tmp_path):
    path = tmp_path / "a.run"
    file = record_file.RecordFile.create(path)
    for number in range(5):
        file.append(record_file.OUTPUT, b"o" * 1000)
        file.append(record_file.STATE, b"%d" % number)
    file.append(record_file.END, b"")
    before = path.stat().st_size
    file.drop_outputs()
    file.close()
    assert path.stat().st_size < before - 5000 and not path.with_name("a.run.part").exists()
    found = record_file.RecordFile.open(path)
    kinds = [record.kind for record in found.records]
    assert kinds == [record_file.STATE] * 5 + [record_file.END]
    assert [found.read(record) for record in found.records[:5]] == [b"%d" % number for number in range(5)]
    found.close()
