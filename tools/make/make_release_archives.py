"""The archives of a release, which tests of all later versions read: one small run of each kind, cut off by a signal.

    python tools/make/make_release_archives.py [--into tests/archive/releases/0.1.0]

Run it once for a release, and leave the folders of earlier releases as they are. For each kind it writes KIND.yaml (the
scene), KIND.run (the archive of a run that SIGTERM has cut off), what else the run has left, and in expected.json the
command, the record, and the end of the same run where nothing cut it off.
"""

import argparse
import json
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT)]  # so that it also runs from a checkout that is not installed

from mpp_taichi.snapshot import Snapshot  # noqa: E402
from mpp_taichi.version import __version__  # noqa: E402

BODIES = """
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0], free: false}
  - body: {name: b, mass: 1, position: [1, 0, 0.3]}
  - body: {name: c, mass: 0.7, position: [1.7, 0, 0.9]}
springs: [{link: {between: [a, b], stiffness: 200}}, {link: {between: [b, c], stiffness: 80}}]
forces: [{uniform_gravity: {acceleration: [0, 0, -9.81]}}]
integrator: {leapfrog: {dt: 1e-6}}
"""
GAS = """
dimensions: 2
particles:
  - body: {mass: 1, radius: 0.6, position: [1.1, 1.2], velocity: [3, 1]}
  - body: {mass: 1.1, radius: 0.6, position: [4.1, 1.4], velocity: [-2, 2]}
  - body: {mass: 1.2, radius: 0.6, position: [3.0, 5.0], velocity: [1, -1]}
walls: [{box: {lower: [0, 0], upper: [8, 8]}}]
contacts: {hard_spheres: {solver: swept}}
integrator: {leapfrog: {dt: 5e-4}}
"""
SPAN = 12.0
SCENES = {
    "plain": f"{BODIES}inspect: [{{x: time, y: {{kinetic_energy: {{}}}}}}]\n"
    "expect: {oscillation_period: {of: c, axis: z, above: 0}}\n",
    "contacts": GAS,
    "timeline": f'{BODIES}timeline: [{{at: 1.0, set: {{"springs[0].link.stiffness": 150}}}}]\n',
    "trajectory": BODIES,
    "film": f"{BODIES}view: {{trails: 10, color_by: {{speed: {{}}}}}}\nrecord: {{fps: 10, seconds: 3, size: [96, 64]}}\n",
}
OUTPUTS = {
    "plain": ["--diagnostics", "plain.csv", "--inspect", "panels.csv"],
    "contacts": ["--speeds", "speeds.csv", "--diagnostics", "contacts.csv"],
    "timeline": ["--diagnostics", "timeline.csv"],
    "trajectory": ["--trajectory", "trajectory.npz"],
    "film": ["--frames", "pictures", "--video", "film.mp4"],
}
EVERY = {"contacts": 500}
LEFT = {"plain": "out/plain.interrupted.npz", "trajectory": "trajectory.npz"}  # other files of this release
PAUSE = 0.2  # seconds from the first steps to the signal


def command(kind):
    """The words of a run."""
    verb = ["record", f"{kind}.yaml"] if kind == "film" else ["run", f"{kind}.yaml", "--headless"]
    size = [] if kind == "film" else ["--every", str(EVERY.get(kind, 200_000))]
    device = ["--backend", "cpu", "--precision", "f64", "--plan", "serial"]
    return [*verb, *device, *size, *OUTPUTS[kind], "--snapshot", "end.npz", "--allow-inaccurate"]


def make(kind, into):
    """Write the files of one kind, and return its entry of expected.json."""
    words = command(kind)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / f"{kind}.yaml").write_text(f"title: {kind}\n{SCENES[kind].strip()}\nrun: {{duration: {SPAN}}}\n")
        call = [sys.executable, "-m", "mpp_taichi", *words]
        subprocess.run([*call, "--no-archive"], cwd=folder, check=True)
        end = Snapshot.load(folder / "end.npz")
        found = {"command": words, "time": end.time, "step": end.step}
        found |= {"position": end.position.tolist(), "velocity": end.velocity.tolist()}
        if kind == "film":
            found["frames"] = len(list((folder / "pictures").iterdir()))
        for each in OUTPUTS[kind][1::2]:
            path = folder / each
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        cut_off(call, folder)
        shutil.copy(folder / f"{kind}.yaml", into)
        shutil.copy(folder / "out" / f"{kind}.run", into)
        if kind == "film":
            shutil.copytree(folder / "pictures", into / "pictures", dirs_exist_ok=True)
        if kind in LEFT:
            shutil.copy(folder / LEFT[kind], into / LEFT[kind].rpartition("/")[2])
    return found


def cut_off(call, folder):
    """Begin a run, and end it by a signal when it has begun to step."""
    process = subprocess.Popen(call, cwd=folder, stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if "steps/s" in line:
            break
    time.sleep(PAUSE)
    process.send_signal(signal.SIGTERM)
    told = process.communicate(timeout=100)[1]
    if process.returncode != 128 + signal.SIGTERM:
        raise RuntimeError(f"the run was not cut off, but ended with {process.returncode}: {told}")


def main():
    """Make each kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--into", type=Path, default=ROOT / "tests" / "archive" / "releases" / __version__)
    into = parser.parse_args().into.resolve()
    into.mkdir(parents=True, exist_ok=True)
    expected = {}
    for kind in SCENES:
        expected[kind] = make(kind, into)
        print(f"{kind:12s} {(into / f'{kind}.run').stat().st_size:8,d} bytes")
    (into / "expected.json").write_text(json.dumps({"version": __version__, "runs": expected}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
