"""Look for inputs that a reader answers with anything but a result or an error of its own: a traceback, a hang, much memory.

    python tools/checks/fuzz.py [TARGET …] [--seconds 60] [--corpus out/fuzz]

Targets: tree (the guard of YAML), scene (the whole reader), expression, override, state (.npz), and each importer. With atheris
(pip install atheris; Linux and macOS) new inputs are led by the lines of the program that they reach; without it they are
random changes of the seeds, which finds less. Inputs that reach something new are kept in the folder of the corpus, at most
`MOST_KEPT` for a target; an input at fault is kept as crash-…, timeout-… or oom-… beside them. Exit code 1 if there is one.
An input hangs where it takes HANG_SECONDS of processor time, or ten times as long by the clock: other programs may be busy.
"""

import argparse
import faulthandler
import importlib.util
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # so that it also runs from a checkout that is not installed

HANG_SECONDS, MEMORY_MIB, LONGEST = 5, 1024, 4096
BUSY = 10  # times as long, by the clock, an input may take beside other programs
MOST_KEPT = 300  # inputs of a corpus, the smallest first
PROGRAM = "mpp_taichi"
TEXTS = {
    "expression": ["sqrt(k / 2) ** -1", "max(1, 2*k, e) % .5", "atan2(1e3, -k) // (3 - 2)"],
    "override": ["integrator.leapfrog.dt=0.1", "particles[0].body.mass=[1, 2]", "+constants.k=2*pi", "forces=[]"],
    "plist": [
        "pos 0 0 0 0 1 0 0.1 1 1 0\nvel 0 0 0 1\nvfix 0 1 1 0\nk2 2.9584e-4\ndt 0.03\n",
        "s 7 50.0 0.003 0.4 0.4 1.0\nsl 0\n",
    ],
    "princeton": ["2\n2.5e11\n1e11 0 0 2.9e4 5.9e24 earth.gif\n0 0 0 0 1.9e30 sun.gif\n"],
    "solar_system_xml": [
        "<SolarSystem><Planet name='a' radius='1'><Orbit a='1' e='.1'/><Moon name='b'/></Planet></SolarSystem>",
        "<?xml version='1.0'?><!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>",
    ],
}


def seeds(target):
    """Inputs to begin with."""
    if target in ("tree", "scene"):
        small = [path for path in sorted((ROOT / "scenes").glob("*.yaml")) if path.stat().st_size < LONGEST]
        more = "a: &x [1, *x]\n", "? [a]\n: b\n", "particles:\n" + "- body: {mass: 1, position: [1, 2, 3]}\n" * 90
        return [path.read_bytes() for path in small] + [text.encode() for text in more]
    if target == "state":
        return [bytes([number]) + content for number, content in enumerate(_members().values())]
    if target == "tipsy":
        from mpp_taichi.exporters._source import Source
        from mpp_taichi.exporters.catalogue import export

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.tipsy"
            export(Source("a", _state()), path)
            return [path.read_bytes()]
    return [text.encode() for text in TEXTS[target]]


def _state():
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.start.assemble import assemble

    return assemble(load_scene(ROOT / "scenes" / "kepler.yaml"))


def _members():
    """The files within a state file, by name."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.npz"
        _state().save(path)
        with zipfile.ZipFile(path) as archive:
            return {name: archive.read(name) for name in sorted(archive.namelist())}


def reader(target):
    """A function that reads bytes, and raises for a fault of the program only."""
    from mpp_taichi.errors import MppError
    from mpp_taichi.importers.catalogue import importers
    from mpp_taichi.scene import document, expressions, load, yaml_limits
    from mpp_taichi.scene.faults import Faults
    from mpp_taichi.snapshot import Snapshot

    here = Path("/dev/shm") if Path("/dev/shm").is_dir() else Path("/tmp")
    file = here / f"fuzz-{target}-{random.Random().getrandbits(32)}"

    whole = _members() if target == "state" else {}

    def tree(data):
        document.read_text(yaml_limits.decode(data, "f"), "f", Faults()).plain()

    def scene(data):
        file.write_bytes(data)
        load.load_scene(file)

    def expression(data):
        found = expressions.parse(data.decode("utf-8", "replace"))
        found.number({"k": 2.0})
        found.array({"k": 2.0})

    def override(data):
        load.load_scene(ROOT / "scenes" / "kepler.yaml", overrides=[data.decode("utf-8", "replace")])

    def state(data):
        members = dict(whole)
        if data:
            members[[*members][data[0] % len(members)]] = data[1:]
        with zipfile.ZipFile(file, "w") as archive:
            for name, content in members.items():
                archive.writestr(name, content)
        Snapshot.load(file)

    own = {"tree": tree, "scene": scene, "expression": expression, "override": override, "state": state}

    def imported(data):
        known = importers()[target]
        content = data if getattr(known, "BINARY", False) else data.decode("utf-8", "replace")
        load.load_scene(known.read(content, "f"))

    read = own.get(target, imported)

    def run(data):
        began = time.process_time()
        try:
            read(data)
        except (MppError, expressions.ExpressionError):
            pass
        finally:
            file.unlink(missing_ok=True)
        if (taken := time.process_time() - began) > HANG_SECONDS:
            raise TimeoutError(f"{taken:.1f} s of processor time for one input")

    return run


def targets():
    """Every target."""
    from mpp_taichi.importers.catalogue import importers

    return ["tree", "scene", "expression", "override", "state", *importers()]


def run_guided(target, corpus, seconds):
    """Fuzz one target in this process, led by atheris; never returns."""
    import atheris

    with atheris.instrument_imports(include=[PROGRAM]):
        read = reader(target)
    limits = [
        f"-max_total_time={seconds}",
        f"-timeout={BUSY * HANG_SECONDS}",
        f"-rss_limit_mb={MEMORY_MIB}",
        f"-max_len={LONGEST}",
    ]
    atheris.Setup([target, *limits, f"-artifact_prefix={corpus}/", "-print_final_stats=1", "-verbosity=0", str(corpus)], read)
    atheris.Fuzz()


def run_random(target, corpus, seconds):
    """Fuzz one target in this process by random changes."""
    resource.setrlimit(resource.RLIMIT_AS, (4 * MEMORY_MIB << 20, resource.RLIM_INFINITY))
    read, given, chance = reader(target), [path.read_bytes() for path in sorted(corpus.iterdir())], random.Random(1)
    end, count = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        data = changed(given, chance)
        (corpus / "latest").write_bytes(data)
        faulthandler.dump_traceback_later(BUSY * HANG_SECONDS, exit=True)
        try:
            read(data)
        except BaseException:
            (corpus / f"crash-{count}").write_bytes(data)
            raise
        finally:
            faulthandler.cancel_dump_traceback_later()
        count += 1
    (corpus / "latest").unlink(missing_ok=True)
    sys.stderr.write(f"stat::number_of_executed_units: {count}\n")


def changed(given, chance):
    """An input: pieces of the given ones, with some bytes changed, left out, repeated or put in."""
    data = bytearray(chance.choice(given))
    for _ in range(chance.randint(1, 6)):
        at, length = chance.randint(0, len(data)), chance.randint(0, 16)
        other = chance.choice(given)
        begin = chance.randint(0, len(other))
        piece = other[begin : begin + length] if chance.random() < 0.5 else chance.randbytes(chance.randint(0, 4))
        data[at : at + chance.choice((0, length))] = piece
    return bytes(data[:LONGEST])


def tidy(corpus):
    """Keep the smallest inputs of a corpus, and every input at fault; returns those at fault."""
    kept = [path for path in corpus.iterdir() if path.is_file()]
    at_fault = [path for path in kept if path.name.startswith(("crash-", "timeout-", "oom-", "latest"))]
    others = sorted((path for path in kept if path not in at_fault), key=lambda path: path.stat().st_size)
    for path in others[MOST_KEPT:]:
        path.unlink()
    return at_fault


def main():
    """Fuzz each target in a process of its own; 1 if an input is at fault."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument("--corpus", type=Path, default=Path("out/fuzz"))
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    guided = importlib.util.find_spec("atheris") is not None
    if arguments.child:
        (target,) = arguments.targets
        (run_guided if guided else run_random)(target, arguments.corpus / target, arguments.seconds)
        return 0
    known, found = targets(), []
    if unknown := [name for name in arguments.targets if name not in known]:
        parser.error(f"unknown target {unknown[0]!r}, allowed: {', '.join(known)}")
    for target in arguments.targets or known:
        corpus = arguments.corpus / target
        corpus.mkdir(parents=True, exist_ok=True)
        for number, data in enumerate(seeds(target)):
            (corpus / f"seed-{number}").write_bytes(data)
        words = [sys.executable, __file__, target, "--seconds", str(arguments.seconds), "--corpus", str(arguments.corpus)]
        done = subprocess.run([*words, "--child"], capture_output=True, text=True, errors="replace", check=False)
        at_fault = tidy(corpus)
        count = re.findall(r"number_of_executed_units: *(\d+)", done.stderr)
        way = "led by coverage" if guided else "at random"
        sys.stdout.write(f"{target}: {count[-1] if count else 'an unknown number of'} inputs {way}, {len(at_fault)} at fault\n")
        sys.stdout.flush()
        if at_fault or done.returncode:
            sys.stdout.write("\n".join(f"    {line}" for line in (done.stderr + done.stdout).strip().splitlines()[-25:]) + "\n")
            found.append(target)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
