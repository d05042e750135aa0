"""Kept pictures: what the archive of a run holds of a film gives back every picture, or one clear refusal."""

import logging
import threading
from pathlib import Path

import numpy as np
import pytest

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


@pytest.mark.parametrize("change", ["missing", "damaged", "short", "bomb"])
def test_pictures_that_are_missing_or_damaged_are_refused(change):
    import zlib

    saved, news = kept([pictures(3)])
    if change == "missing":
        del news[0][1]
        wanted = "2 of 3 pictures"
    else:
        chunk = news[0][1]
        longer = np.frombuffer(zlib.compress(bytes(40 * 30 * 3 + 1)), np.uint8)
        news[0][1] = {"damaged": chunk ^ 1, "short": chunk[:-40], "bomb": longer}[change]
        wanted = "picture 1 of film.mp4 is damaged"
    with pytest.raises(StateError, match=wanted):
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
