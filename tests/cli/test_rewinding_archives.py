"""A run that blew up goes back to the last good record of its archive, and keeps an archive of its own."""

import json
import math
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from cut_off import KILL, RECORD, cut_off, run_whole, with_scene

from mpp_taichi import Snapshot
from mpp_taichi.cli.main import main
from mpp_taichi.simulation import run_archive
from mpp_taichi.simulation.run_archive import FoundRun

# The stiff spring multiplies its swing by e^0.02 a step, (ω dt)² = 2 (1 + cosh 0.02), so that the run is far from sound after
# some hundred steps, and is led back to one of the first. At this step the two methods share the swing between place and speed
# as 1 : tanh 0.01 and the other way round, so that the spring of velocity_verlet begins a hundred times as far from rest.
START = {"leapfrog": 1.001, "velocity_verlet": 1.1}
DT = math.sqrt(2.0 * (1.0 + math.cosh(0.02)) / 50.0)
SCENE = """
title: Rewound
particles:
  - body: {{mass: 1, position: [0, 0, 0], free: false}}
  - body: {{mass: 1, position: [{start}, 0, 0]}}
  - body: {{mass: 1, position: [0, 2, 0]}}
springs:
  - link: {{between: [0, 1], stiffness: 50, rest_length: 1}}
  - link: {{between: [0, 2], stiffness: 1, rest_length: 1}}
integrator: {{{method}: {{dt: {dt!r}}}}}
run: {{duration: 60}}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, in which a run writes a record after each launch, from the first one on."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run_archive, "EVERY", 0.0)
    monkeypatch.setattr(run_archive, "SHARE", 1e9)
    return tmp_path


def blown_up(folder, method="leapfrog"):
    (folder / "s.yaml").write_text(SCENE.format(method=method, dt=DT, start=START[method]))
    assert main(["run", "s.yaml", "--headless", "--force", "--every", "5", "--precision", "f64", "-q"]) == 4
    return Snapshot.load("out/s.crash.npz")


def rewound(capsys, *words, code=0):
    capsys.readouterr()
    given = ["run", "s.yaml", "--headless", "--json", "--allow-inaccurate", "--precision", "f64", "--rewind", *words]
    assert main(given) == code
    return json.loads(capsys.readouterr().out)


def states_of(path="out/s.run"):
    found = FoundRun(Path(path), to_append=False)
    try:
        return [found.state(number) for number in range(len(found.times))], found.has_ended, found.broke_at, found.header
    finally:
        found.close()


@pytest.mark.sampled(3)
def test_a_run_goes_back_to_its_last_good_record_with_a_step_that_holds(folder, capsys):
    crash = blown_up(folder)
    states, ended, broke_at, _ = states_of()
    assert ended and broke_at == crash.step + 1
    good = states[-1]
    assert (good["step"], good["time"]) == (crash.step, crash.time), "the last good step is the last record"
    (folder / "out/s.crash.npz").unlink()  # the archive is enough
    found = rewound(capsys, "--snapshot", "end.npz")
    assert found["time"] == 60.0
    assert found["rewound"].startswith(f"{Path('out/s.run')}, t = {good['time']:.9g}, on with dt ")
    assert found["dt"] == 0.25
    states, ended, broke_at, header = states_of()
    assert ended and broke_at is None, "the rewound run has an archive of its own"
    assert header["options"]["rewound"]["step"] == good["step"]
    assert states[0]["step"] >= good["step"]
    assert main(["replay", "out/s.run", "--at", "30", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["time"] == 30.0
    assert main(["replay", "out/s.run", "--at", "0.1"]) == 2
    assert "the run was rewound, and its first record is of t = " in capsys.readouterr().err
    rewound(capsys, code=2)  # it came to its end: there is nothing to go on from


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["leapfrog", "velocity_verlet"])
def test_the_rest_has_the_bits_of_a_run_that_begins_at_the_record(folder, capsys, method):
    """Neither method remembers more than the record has, so that the same state given as a file leads to the same end."""
    blown_up(folder, method)
    _, _, broke_at, _ = states_of()
    states = states_of()[0]
    assert states[-1]["step"] == broke_at - 1
    assert main(["replay", "out/s.run", "--at", repr(states[-1]["time"]), "--snapshot", "good.npz"]) == 0
    found = rewound(capsys, "--set", f"integrator.{method}.dt=0.1", "--snapshot", "end.npz")
    assert found["dt"] == 0.1 and "as --set says" in found["rewound"]
    rewound(capsys, "good.npz", "--set", f"integrator.{method}.dt=0.1", "--snapshot", "again.npz")
    end, again = (Snapshot.load(name) for name in ("end.npz", "again.npz"))
    assert (end.time, end.step) == (again.time, again.step)
    np.testing.assert_array_equal(end.position, again.position)


def test_a_file_is_named_and_an_archive_of_another_scene_is_not_taken(folder, capsys):
    crash = blown_up(folder)
    found = rewound(capsys, "out/s.crash.npz", "--no-archive")
    assert f"{Path('out/s.crash.npz')}, t = {crash.time:.9g}" in found["rewound"]
    assert states_of()[1:3] == (True, crash.step + 1), "without an archive of its own it leaves the old one"
    text = Path("s.yaml").read_text()
    Path("s.yaml").write_text(text.replace("stiffness: 50", "stiffness: 51"))
    capsys.readouterr()
    assert main(["run", "s.yaml", "--headless", "--rewind", "out/s.run"]) == 2
    assert "out/s.run: is of another scene (springs[0].link.stiffness: 50 there, 51 here)" in capsys.readouterr().err
    assert main(["run", "s.yaml", "--headless", "--rewind", "s.yaml"]) == 5
    Path("no.run").write_text("no archive")
    assert main(["run", "s.yaml", "--headless", "--rewind", "no.run"]) == 2
    assert "no.run: is no archive of a run" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="signals of POSIX are used")
@pytest.mark.sampled(3)
def test_a_rewound_run_that_is_killed_goes_on_with_the_same_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(run_archive, "EVERY", 0.0)
        patch.setattr(run_archive, "SHARE", 1e9)
        until = blown_up(tmp_path).time + 5.0
    for name in ("whole", "cut"):
        (tmp_path / name / "out").mkdir(parents=True)
        with_scene(tmp_path / name, (tmp_path / "s.yaml").read_text())
        (tmp_path / name / "out" / "s.run").write_bytes((tmp_path / "out" / "s.run").read_bytes())
    command = [sys.executable, "-m", "mpp_taichi", "run", "s.yaml", "--headless", "--precision", "f64", "--until", repr(until)]
    command += ["--rewind", "--snapshot", "e.npz", "--diagnostics", "t.csv", "--set", "integrator.leapfrog.dt=1e-7"]
    done = run_whole(command, tmp_path / "whole")
    assert done.returncode == 0, done.stderr
    cut_off(command, tmp_path / "cut", (RECORD, KILL))
    plain = [word for word in command if word != "--rewind"]
    refused = run_whole(plain, tmp_path / "cut")
    assert refused.returncode == 2 and "options.rewound" in refused.stderr
    done = run_whole(command, tmp_path / "cut")
    assert done.returncode == 0, done.stderr
    assert "going on with out/s.run from step" in done.stderr
    whole, cut = (Snapshot.load(tmp_path / name / "e.npz") for name in ("whole", "cut"))
    np.testing.assert_array_equal(whole.position, cut.position)
    assert (tmp_path / "whole" / "t.csv").read_bytes() == (tmp_path / "cut" / "t.csv").read_bytes()
    assert not [name for name in os.listdir(tmp_path / "cut" / "out") if "part" in name or "lock" in name]
