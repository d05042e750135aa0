"""Kept pictures: what the archive of a run holds of a film gives back every picture, or one clear refusal."""

import logging
import threading
import zlib
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi.archive import changed_words
from mpp_taichi.errors import StateError
from mpp_taichi.recorders.kept_pictures import KeptPictures
from mpp_taichi.simulation import run_archive
from mpp_taichi.simulation.run_archive import FoundRun, RunArchive, header_of
from mpp_taichi.simulation.simulation import Simulation

SCENE = Path(__file__).parents[2] / "scenes" / "kepler.yaml"


class Film:
    """A film in memory."""

    path, size = Path("film.mp4"), (40, 30)

    def __init__(self):
        self.pictures = []

    def write(self, picture):
        self.pictures.append(picture.copy())


def pictures(count, seed=0):
    random = np.random.default_rng(seed)
    return [random.integers(0, 256, (30, 40, 3), dtype=np.uint8) for _ in range(count)]


def kept(parts):
    """The film, its last value and its news after some pictures in each record."""
    film = Film()
    recorder = KeptPictures(film)
    recorder.begin_anew()
    news = []
    for part in parts:
        for picture in part:
            recorder.write(picture)
        news.append(recorder.news())
        assert recorder.pending == 0
    saved = recorder.at_record()
    recorder.stop()
    return saved, news


def test_every_picture_comes_back_and_later_ones_follow():
    first, second, third = pictures(3, 1), pictures(9, 2), pictures(2, 3)
    saved, news = kept([first, [], second])
    film = Film()
    again = KeptPictures(film)
    again.go_on(None, saved, iter(news))
    for picture in third:
        again.write(picture)
    news.append(again.news())
    again.stop()
    assert np.array_equal(film.pictures, [*first, *second, *third])
    once_more = KeptPictures(Film())
    once_more.go_on(None, {"frame_count": 14}, iter(news))
    once_more.stop()
    assert np.array_equal(once_more.film.pictures, film.pictures)
    assert not [thread for thread in threading.enumerate() if "archive" in thread.name]


def test_pictures_of_a_film_in_which_little_changes_take_few_bytes():
    still = pictures(1)[0]
    moved = still.copy()
    moved[7, 5:8] ^= 9
    _, news = kept([[still], [still], [moved]])
    sizes = [sum(part.nbytes for part in chunk) for (chunk,) in news]
    assert sizes[0] > still.nbytes
    assert sizes[1] == 0
    assert sizes[2] < 40


def test_many_changes_are_compressed(monkeypatch):
    monkeypatch.setattr(changed_words, "MOST_PLAIN", 100)
    grey = np.full((30, 40, 3), 90, np.uint8)
    saved, news = kept([[grey, grey // 2]])
    assert sum(part.nbytes for chunk in news[0] for part in chunk) < 500
    again = KeptPictures(Film())
    again.go_on(None, saved, iter(news))
    again.stop()
    assert np.array_equal(again.film.pictures, [grey, grey // 2])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("length", [1, 63, 64, 65, 3600])
def test_a_difference_of_any_length_gives_the_array_back(length):
    random = np.random.default_rng(length)
    before, now = (random.integers(0, 2, length, np.uint8) for _ in range(2))
    words = changed_words.words_of(before).copy()
    changed_words.change(words, changed_words.difference(changed_words.words_of(now), words))
    assert words.view(np.uint8)[:length].tobytes() == now.tobytes()


def damages(chunk):
    blocks, words, values = chunk
    longer = np.frombuffer(zlib.compress(bytes(40 * 30 * 3 + 1)), np.uint8)
    return {
        "another number of blocks": [blocks[:-1], words, values],
        "another block": [blocks & 127, words, values],
        "another word": [blocks, words ^ 1, values],
        "fewer values": [blocks, words, values[:-1]],
        "values of another type": [blocks, words, values.astype(float)],
        "compressed values": [blocks, words, longer],
        "no list": 3,
        "two arrays": [blocks, words],
        "texts": ["a", "b", "c"],
        "format 1, damaged": longer ^ 1,
        "format 1, short": longer[:-40],
        "format 1, a bomb": longer,
    }


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", damages([np.zeros(1, np.uint8)] * 3))
def test_pictures_that_are_damaged_are_refused(name):
    saved, news = kept([pictures(3)])
    news[0][1] = damages(news[0][1])[name]
    with pytest.raises(StateError, match="picture 1 of film.mp4 is damaged"):
        KeptPictures(Film()).go_on(None, saved, iter(news))


def test_pictures_that_are_missing_are_refused():
    saved, news = kept([pictures(3)])
    del news[0][1]
    with pytest.raises(StateError, match="2 of 3 pictures"):
        KeptPictures(Film()).go_on(None, saved, iter(news))


def test_a_film_beyond_the_limit_ends_the_records_with_one_note(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(run_archive, "MOST_OUTPUT", 3 * 3600)
    film = KeptPictures(Film())
    film.begin_anew()
    with Simulation(SCENE, backend="cpu") as simulation, caplog.at_level(logging.WARNING):
        archive = RunArchive(tmp_path / "a.run", header_of(simulation), {}, every=0.0, outputs={"film": film})
        for picture in pictures(10):
            film.write(picture)
            simulation.run(steps=1)
            archive.record(simulation)
        assert archive.steps_until_due(simulation) > 2**30
        archive.close()
    assert [record.message.count("keeps no more; if the run is cut off later") for record in caplog.records] == [1]
    found = FoundRun(tmp_path / "a.run")
    again = KeptPictures(Film())
    again.go_on(None, found.state()["outputs"]["film"], found.news("film"))
    again.stop()
    found.close()
    assert 3 <= len(again.film.pictures) <= 4
