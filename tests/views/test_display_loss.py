"""A display that goes away under a window: the state and all files are kept, one line says so, and the exit code is 3."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_window import ENVIRONMENT, display

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views import ggui_probe
from mpp_taichi.views.display_loss import a_connection_is_broken
from scenes import kepler

__all__ = ["display"]  # a fixture: it skips where no window can open
pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="X servers")
ROOT = Path(__file__).parents[2]
RUN = (
    "import sys\nfrom mpp_taichi.cli.main import main\n{before}\nsys.exit(main(['run', 's.yaml', '--backend', 'cpu', {more}]))"
)
PAUSED = """
from mpp_taichi.device import backends
backends.import_taichi()
from mpp_taichi.views.window import Window
begin = Window.run
Window.run = lambda self, simulation, *, steps_per_frame: begin(self, simulation, steps_per_frame=steps_per_frame, paused=True)
"""
FILES = "'--trajectory', 'path.npz', '--diagnostics', 'table.csv', '--log', 'log.yaml', '--json'"


class Server:
    """An X server of this test alone."""

    def __init__(self):
        reading, writing = os.pipe()
        command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x600x24", "-nolisten", "tcp", "-noreset"]
        self.process = subprocess.Popen(command, pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as pipe:
            self.name = f":{pipe.readline().strip()}"

    def end(self, number=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(number)
            self.process.wait(timeout=20)

    def has(self, title):
        found = ["xdotool", "search", "--onlyvisible", "--name", title]
        return bool(subprocess.run(found, env=ENVIRONMENT | {"DISPLAY": self.name}, capture_output=True, text=True).stdout)


@pytest.fixture
def server(display):
    made = Server()
    yield made
    made.end()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump({**kepler(dt=0.02), "title": "Two", "run": {"duration": 2000.0, "every": 1}}))
    return tmp_path


def begin(name, more="", before=""):
    program = RUN.format(more=more, before=before)
    return subprocess.Popen(
        [sys.executable, "-c", program],
        env=ENVIRONMENT | {"DISPLAY": name},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def in_window(process, server):
    deadline = time.monotonic() + 60
    while not server.has("Two"):
        assert process.poll() is None and time.monotonic() < deadline, process.stderr.read()
        time.sleep(0.05)


@pytest.mark.timeout(120)
@pytest.mark.parametrize(("number", "before"), [(signal.SIGKILL, ""), (signal.SIGTERM, ""), (signal.SIGKILL, PAUSED)])
@pytest.mark.sampled(3)
def test_a_run_whose_display_goes_away_keeps_its_state_and_its_files(server, folder, number, before):
    process = begin(server.name, FILES, before)
    in_window(process, server)
    if not before:
        length = Path("path.npz.position.part").stat
        while process.poll() is None and not length().st_size:  # the first frames are on the disk
            time.sleep(0.05)
    server.end(number)
    told, words = process.communicate(timeout=60)
    (line,) = [each for each in words.splitlines() if each.startswith("error: ")]
    state = Snapshot.load("out/s.interrupted.npz")
    assert process.returncode == 3
    assert (
        line == f"error: the display {server.name} has gone away at t = {state.time:.9g}; the state is in out/s.interrupted.npz"
    )
    assert "Traceback" not in words and "Exception" not in words
    found = json.loads(told)
    assert found["exit_code"] == 3 and f"error: {found['error']}" == line
    expected = {"out/s.interrupted.npz", "log.yaml", *(() if before else ("path.npz", "table.csv"))}
    assert expected <= set(found["files"])
    assert sorted(str(each) for each in folder.rglob("*") if each.name.startswith(".") or ".part" in each.name) == []
    if before:
        assert state.step == 0
    else:
        with np.load("path.npz") as frames:
            assert 0.0 < frames["time"][-1] <= state.time and state.step > 0
    assert np.isfinite(state.position).all()


@pytest.mark.timeout(120)
def test_a_display_that_goes_away_before_the_window_opens_is_told_in_one_line(folder):
    """GGUI would end the process without a line on standard error, and leave the locks."""
    tried = "from mpp_taichi.views import ggui_probe, window\nggui_probe.probe = window.probe = lambda *, shown: ''"
    process = begin(
        ":4711",
        "'--diagnostics', 'table.csv', '--quiet'",
        f"from mpp_taichi.device import backends\nbackends.import_taichi()\n{tried}",
    )
    _, words = process.communicate(timeout=60)
    assert (process.returncode, words) == (3, "cannot open a window: the display :4711 has gone away\n")
    assert not Path(".table.csv.lock").exists()


def test_a_broken_connection_to_a_display_is_seen(tmp_path):
    place = tmp_path / ".X11-unix"
    place.mkdir()
    with socket.socket(socket.AF_UNIX) as listens, socket.socket(socket.AF_UNIX) as ours:
        listens.bind(str(place / "X9"))
        listens.listen()
        ours.connect(str(place / "X9"))
        server, _ = listens.accept()
        assert not a_connection_is_broken()
        server.close()
        assert a_connection_is_broken()


def test_another_connection_that_ends_is_no_loss_of_the_display():
    ours, theirs = socket.socketpair()
    with ours:
        theirs.close()
        assert not a_connection_is_broken()


def test_a_trial_of_the_display_runs_in_a_folder_that_nothing_else_writes_to(monkeypatch):
    """GGUI writes a file of a known name where it runs, and would follow a link that another user has put there."""
    seen = []

    def run(command, *, cwd, **_):
        seen.append((Path(cwd), [*Path(cwd).iterdir()], Path(cwd).stat().st_mode & 0o077))
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(ggui_probe.subprocess, "run", run)
    assert ggui_probe.probe.__wrapped__(shown=False) == ""
    ((folder, there, others),) = seen
    assert not there and not others and not folder.exists()
    monkeypatch.setattr(ggui_probe.subprocess, "run", lambda *_, **__: os.stat("/nowhere"))
    assert "No such file" in ggui_probe.probe.__wrapped__(shown=False)
