"""Files that cannot be written: one line with the reason, exit code 5, and neither half a file nor a lock is left."""

import contextlib
import os
from pathlib import Path

import numpy as np
import pytest
import yaml

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.cli.main import main
from mpp_taichi.errors import OutputError
from mpp_taichi.recorders._lock import OutputLock
from scenes import kepler

resource = pytest.importorskip("resource")  # POSIX
SCENE = {
    **kepler(dt=0.02),
    "run": {"duration": 1.0, "every": 1},
    "record": {"size": [64, 48], "seconds": 0.5, "fps": 10},
    "inspect": [{"x": "time", "y": "kinetic_energy"}],
}
RUN_OPTIONS = {
    "film.mp4": "--video",
    "film.gif": "--video",
    "film.webp": "--video",
    "film": "--frames",
    "still.png": "--still",
    "page.html": "--html",
    "table.csv": "--diagnostics",
    "path.npz": "--trajectory",
    "path.xyz": "--trajectory",
    "state.npz": "--snapshot",
    "panel.csv": "--inspect",
    "panel.svg": "--inspect",
}
PARTICLES = ("out.csv", "out.npz", "out.plist", "out.txt", "out.tipsy", "out.xyz", "out.h5md")


@contextlib.contextmanager
def no_room(size):
    """No file of this process or of its children grows beyond a size in bytes: writes fail as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    Path("s.yaml").write_text(yaml.safe_dump(SCENE), encoding="utf-8")
    return "s.yaml"


def command(name, scene):
    option = RUN_OPTIONS[name]
    verb = ["record", scene] if option in ("--video", "--frames", "--still", "--html") else ["run", scene, "--headless"]
    return [*verb, "--backend", "cpu", option]


def test_frames_that_the_disk_holds_whole_are_kept(scene, capsys):
    with no_room(1000):
        assert main([*command("path.xyz", scene), "path.xyz"]) == 5
    text = Path("path.xyz").read_text()
    assert len(text.splitlines()) % 4 == 0 and 500 < len(text) <= 1000  # two particles: four lines to a frame
    assert left("path.xyz") == [] and len(errors(capsys)) == 1


def errors(capsys):
    """The lines of standard error that name a fault."""
    return [line for line in capsys.readouterr().err.splitlines() if ": cannot" in line or "error:" in line or "Trace" in line]


def left(*names):
    """The files in the folder, without the scene and the files of these names."""
    return sorted(str(path) for path in Path().glob("**/*") if path.is_file() and path.name not in ("s.yaml", *names))


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", RUN_OPTIONS)
def test_a_run_without_room_for_a_file_tells_it_in_one_line(name, scene, capsys):
    with no_room(100):
        code = main([*command(name, scene), f"to/{name}"])
    (told,) = errors(capsys)
    assert code == 5 and told.startswith(f"error: to/{name}")
    parts = [path for path in left() if ".part" in path]
    assert [path for path in left() if path not in parts] == []
    assert not parts or "film" in name  # the frames so far of a film
    capsys.readouterr()
    assert main([*command(name, scene), f"to/{name}", "--quiet"]) == 0
    assert [path for path in left() if "part" in path or "lock" in path] == []


@pytest.mark.parametrize("name", PARTICLES)
def test_a_conversion_without_room_leaves_the_old_file(name, scene, capsys):
    if name.endswith("h5md"):
        pytest.importorskip("h5py")
    Path(name).write_text("old")
    with no_room(100):
        code = main(["convert", scene, name])
    told = capsys.readouterr().err.splitlines()
    assert code == 5 and len(told) == 1 and "too large" in told[0] and told[0].startswith(name)
    assert Path(name).read_text() == "old" and left() == [name]
    assert main(["convert", scene, name, "--quiet"]) == 0  # an unfinished file of HDF5 made the next one end the process


def test_a_lock_without_room_is_not_left_behind(tmp_path):
    with no_room(0), pytest.raises(OutputError, match="too large"):
        OutputLock(tmp_path / "a.csv")
    assert not list(tmp_path.iterdir())


@pytest.mark.sampled(3)
def test_a_link_at_a_temporary_name_is_not_followed(scene, tmp_path):
    """In a folder that others may write to, somebody may guess the name."""
    victim = tmp_path / "victim"
    for name in ("table.csv", "film.mp4", "path.npz", "path.xyz", "state.npz"):
        victim.write_text("mine")
        path = Path(name)
        for temporary in (
            f"{path.stem}.part{path.suffix}",
            f"{name}.part",
            f"{name}.position.part",
            f"{path.stem}.whole{path.suffix}",
        ):
            os.symlink(victim, temporary)
        assert main([*command(name, scene), name, "--quiet"]) == 0
        assert victim.read_text() == "mine" and path.is_file() and not path.is_symlink()
        for temporary in Path().glob("*.part*"):
            temporary.unlink()
        for temporary in Path().glob("*.whole*"):
            temporary.unlink()


def test_a_folder_at_a_temporary_name_is_told(tmp_path):
    (tmp_path / "a.part.csv").mkdir()
    with pytest.raises(OutputError, match="cannot write the table"), whole_file(tmp_path / "a.csv", "the table"):
        pass


def test_the_second_run_after_a_kill_clears_what_the_first_left(scene, capsys):
    Path(".path.xyz.lock").write_text("999999999")
    Path("path.xyz.part").write_text("half a")
    assert main(["run", scene, "--trajectory", "path.xyz", "--quiet", "--backend", "cpu", "--headless"]) == 0
    assert left("path.xyz") == [] and np.isfinite(os.path.getsize("path.xyz"))
