"""Archives that are cut, damaged, or of another version: each is read as far as it is whole, or refused in one line."""

import json
import random
import shutil
from pathlib import Path

import pytest
from remade_archives import remade, with_header

from mpp_taichi.archive import object_state
from mpp_taichi.archive.record_file import STATE
from mpp_taichi.archive.values import unpack
from mpp_taichi.cli.main import main
from mpp_taichi.errors import MppError
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.simulation.moment import go_to
from mpp_taichi.simulation.resume import resume
from mpp_taichi.simulation.run_archive import FORMAT, FoundRun

RELEASES = sorted(path for path in (Path(__file__).parent / "releases").iterdir() if path.is_dir())
ARCHIVES = [path for release in RELEASES for path in sorted(release.glob("*.run"))]
IDS = [f"{path.parent.name} {path.stem}" for path in ARCHIVES]


def read_all(path):
    """Everything that an archive holds, read; returns the times of its states."""
    found = FoundRun(path, to_append=False)
    try:
        if found.has_ended:
            return []
        times = found.times
        for name in found.state()["outputs"]:
            for _ in found.news(name):
                pass
        return times
    finally:
        found.close()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("path", ARCHIVES, ids=IDS)
def test_a_cut_archive_keeps_its_whole_records(path, tmp_path):
    data, wanted, cut = path.read_bytes(), read_all(path), tmp_path / "cut.run"
    stride = max(1, len(data) // 150)
    counts = set()
    for length in (*range(len(data) % stride, len(data), stride), *range(40), len(data) - 1):
        cut.write_bytes(data[:length])
        try:
            found = read_all(cut)
        except MppError as error:
            assert length < 8, error
            continue
        assert found == wanted[: len(found)]
        counts.add(len(found))
    assert counts == set(range(len(wanted)))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("path", ARCHIVES, ids=IDS)
def test_a_changed_byte_is_found(path, tmp_path):
    data, wanted, changed, seed = path.read_bytes(), read_all(path), tmp_path / "changed.run", random.randrange(2**32)
    chosen = random.Random(seed)
    for _ in range(150):
        place, flip = chosen.randrange(len(data)), chosen.randrange(1, 256)
        changed.write_bytes(data[:place] + bytes([data[place] ^ flip]) + data[place + 1 :])
        try:
            found = read_all(changed)
        except MppError as error:
            assert place < 8, (seed, place, flip, error)
            continue
        assert found == wanted[: len(found)], (seed, place, flip)


@pytest.mark.parametrize("kind", ["plain", "contacts"])
@pytest.mark.sampled(3)
def test_a_state_of_wrong_values_is_refused_in_words(kind, tmp_path):
    """Checksums that are right, around bytes that are wrong: in the text with the structure, where a value counts most."""
    path, seed = RELEASES[-1] / f"{kind}.run", random.randrange(2**32)
    chosen, found = random.Random(seed), FoundRun(path, to_append=False)
    data = found.file.read(found.file.last(STATE))
    found.close()
    text = 8 + int.from_bytes(data[:8], "little")
    refused = 0
    with resume(path) as simulation:
        for number in range(300):
            place = chosen.randrange(text if number % 4 else len(data))
            changed = data[:place] + bytes([chosen.choice(b'0159-"[]{},e.nN\x00\xff')]) + data[place + 1 :]
            try:
                state = unpack(changed)
                go_to(simulation, state["moment"])
                table = TableRecorder(10)
                samples = state["samples"]
                object_state.restore(samples | {"roots": {"T": samples["roots"]["TableRecorder"]}}, {"T": table})
            except MppError as error:
                refused += 1
                assert "\n" not in str(error), (seed, number)
            except KeyError as error:  # of the test's own look at the names
                assert error.args[0] in ("moment", "samples", "roots", "TableRecorder"), (seed, number, error)
            except BaseException as error:
                raise AssertionError(f"seed {seed}, number {number}: {error!r}") from error
        go_to(simulation, unpack(data)["moment"])
    assert refused > 100


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"format": FORMAT + 1, "versions": {"mpp_taichi": "0.9.3"}}, "was written by mpp_taichi 0.9.3 in format"),
        ({"format": "new"}, "its header is damaged"),
        ({"versions": None}, "its header is damaged"),
        ({"scene": None}, "its header"),
        ({"scene": {"particles": 7}}, "particles"),
        ({"backend": "abacus"}, "abacus"),
        ({"precision": "f65"}, "f65"),
        ({"precision": 7}, "its header is damaged: it has no precision"),
        ({"plan": []}, "its header is damaged: it has no plan"),
        ({"source": 3}, "its header"),
        ({"options": 3}, "its header"),
    ],
)
def test_a_header_that_cannot_be_used_is_refused_in_words(changes, told, tmp_path, capsys, monkeypatch):
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    release = RELEASES[-1]
    shutil.copy(release / "plain.yaml", tmp_path)
    before = with_header(release / "plain.run", tmp_path / "out" / "plain.run", **changes).read_bytes()
    words = json.loads((release / "expected.json").read_text())["runs"]["plain"]["command"]
    for command in (["replay", "out/plain.run"], words):
        code = main(command)
        said = capsys.readouterr().err
        assert code in (2, 3), said
        assert "Traceback" not in said
        assert command == words or told in said, said
        assert (tmp_path / "out" / "plain.run").read_bytes() == before


def test_a_run_of_another_version_with_fewer_options_goes_on(tmp_path, capsys, monkeypatch):
    """A later version has options that an earlier one did not know; their defaults are what the run had."""
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    release = RELEASES[-1]
    shutil.copy(release / "timeline.yaml", tmp_path)
    found = FoundRun(release / "timeline.run", to_append=False)
    header = found.header
    found.close()
    options = {key: value for key, value in header["options"].items() if key != "energy_balance"}
    versions = header["versions"] | {"mpp_taichi": "0.0.9"}
    with_header(release / "timeline.run", tmp_path / "out" / "timeline.run", options=options, versions=versions)
    words = json.loads((release / "expected.json").read_text())["runs"]["timeline"]["command"]
    assert main(words) == 0
    told = capsys.readouterr().err
    assert "going on with out/timeline.run" in told
    assert "written with another mpp_taichi: '0.0.9' there" in told


def test_a_record_without_a_part_is_refused(tmp_path, capsys):
    path = remade(
        RELEASES[-1] / "plain.run", tmp_path / "a.run", lambda kind, data: data if kind != STATE else b"\x02" + bytes(7) + b"{}"
    )
    assert main(["replay", str(path)]) == 2
    assert "Traceback" not in capsys.readouterr().err
