"""A round on a GPU: checks, certificates, rates beside the limits of the card, and a film, in at most eight minutes.

    python tools/gpu_round.py [--backends cuda,vulkan] [--minutes 8] [--out DIR] [--fresh] [--short] [--only rates,film]

Each stage is a process of its own with a limit of time, and its result is kept in DIR/round.json: the same command goes on with
the stages that are missing, as long as the program and the backends are the same. DIR/round.html and DIR/round.md hold the
tables. Stages come in the order of their worth, so that a round that is cut off has the most important ones. A backend that
does not start here is told and left out. --short sees that all of it works, with the smallest sizes, on any backend.
The exit code is 1 where a stage failed, 3 where no backend started.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "gpu")]

from round_page import failures, html, markdown  # noqa: E402
from stages import stages_of  # noqa: E402

from mpp_taichi.atomic_file import whole_text  # noqa: E402
from mpp_taichi.cli._study_journal import program_digest  # noqa: E402
from mpp_taichi.device.availability import availability  # noqa: E402

SHORTEST = 10.0  # seconds that must be left for a stage to begin
NOT_HERE = 3


def main(words=None):
    """Run what is missing, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--backends", default="cuda,vulkan")
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--out", type=Path, default=Path("out/gpu_round"))
    parser.add_argument("--fresh", action="store_true", help="forget an earlier round in the folder")
    parser.add_argument("--short", action="store_true", help="the smallest sizes only")
    parser.add_argument("--only", default="", help="kinds of stages: info, certificate, rates, film, verify, tests")
    options = parser.parse_args(words)
    end = time.monotonic() + 60.0 * options.minutes
    options.out.mkdir(parents=True, exist_ok=True)
    backends, missing = present(options.backends.split(","))
    known = known_results(options, backends)
    known["missing"] = missing
    only = set(filter(None, options.only.split(",")))
    for stage in stages_of(backends, options.out.resolve(), short=options.short):
        if (only and stage.kind not in only) or is_done(known["stages"].get(stage.name)):
            continue
        left = end - time.monotonic()
        if left < SHORTEST:
            print(f"no time is left for {stage.name} and what follows; the same command goes on", flush=True)
            break
        print(f"--- {stage.name} ({left:.0f} s left)", flush=True)
        known["stages"][stage.name] = run(stage, min(stage.seconds, left))
        write(options.out, known)
    write(options.out, known)
    print(markdown(known))
    print(f"wrote {options.out / 'round.json'}, {options.out / 'round.md'}, {options.out / 'round.html'}")
    return NOT_HERE if not backends else int(bool(failures(known)))


def is_done(result):
    """Whether a stage has ended by itself, or was cut off with something worth keeping; else it is run again."""
    return result is not None and (result["good"] or not result["cut_off"])


def present(names):
    """The backends that start here, and of the others why not."""
    reports = {name: availability(name) for name in names}
    here = [name for name, report in reports.items() if report["available"]]
    return here, {name: report["reason"] for name, report in reports.items() if not report["available"]}


def known_results(options, backends):
    """The results of an earlier call with the same program, backends and sizes; else none."""
    same = {"program": program_digest(), "backends": backends, "short": options.short}
    file = options.out / "round.json"
    if file.is_file() and not options.fresh:
        earlier = json.loads(file.read_text(encoding="utf-8"))
        if earlier.get("same") == same:
            return earlier
    return {"same": same, "began": time.strftime("%Y-%m-%d %H:%M"), "stages": {}}


def run(stage, seconds):
    """The result of a stage: whether it went well, its time, the end of what it printed, and the data that it wrote."""
    began = time.monotonic()
    if stage.file is not None:
        stage.file.unlink(missing_ok=True)  # what an earlier call has left is no result of this call
    child = subprocess.Popen(
        stage.command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        told, _ = child.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        stop(child)
        told, _ = child.communicate()
    except BaseException:
        stop(child)
        raise
    late = child.returncode is not None and child.returncode < 0
    data = json.loads(stage.file.read_text(encoding="utf-8")) if stage.file is not None and stage.file.is_file() else None
    good = child.returncode in stage.good_codes or (late and stage.keeps_parts and data is not None)
    return {
        "kind": stage.kind,
        "good": good,
        "code": child.returncode,
        "seconds": round(time.monotonic() - began, 1),
        "cut_off": late,
        "told": told[-1500:],
        "data": stage.chosen(data) if data is not None else None,
    }


def stop(child):
    """End a stage and the processes that it has started."""
    try:
        os.killpg(child.pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def write(folder, known):
    """Write the results and the pages, each whole."""
    for name, text in (("round.json", json.dumps(known, indent=1)), ("round.md", markdown(known)), ("round.html", html(known))):
        whole_text(folder / name, text, "the round")


if __name__ == "__main__":
    sys.exit(main())
