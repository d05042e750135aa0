"""The rate of one family on one backend in one precision, from the smallest size to the largest that fits.

    python tools/gpu/rates.py FAMILY BACKEND PRECISION --json FILE [--seconds 40] [--sizes N]

After each size the file is written anew, so that a run that is cut off leaves what it has measured. Beside the rates stand the
limits of the device, measured in the same process: multiply–adds, bytes of a copy, the time of a launch.
"""

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]

from families import FAMILIES, REPLICA_FLOPS  # noqa: E402

from mpp_taichi import MppError, Simulation  # noqa: E402
from mpp_taichi.compare.work import FLOPS, Work  # noqa: E402

LAUNCHES = 200
BLOCK = 0.1  # seconds that a block of steps takes at least
LONGEST = 3.0  # seconds of a block of one step: larger sizes are not run
BLOCKS = 3


def main(words=None):
    """Measure, and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("family", choices=list(FAMILIES))
    parser.add_argument("backend")
    parser.add_argument("precision")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=40.0, help="no size begins later")
    parser.add_argument("--sizes", type=int, help="at most so many sizes")
    options = parser.parse_args(words)
    family, end = FAMILIES[options.family], time.monotonic() + options.seconds
    found = {"family": family.name, "unit": family.unit, "backend": options.backend, "precision": options.precision, "rows": []}
    for count in family.counts[: options.sizes]:
        if found["rows"] and (time.monotonic() > end or found["rows"][-1]["step_seconds"] > LONGEST / 4):
            break
        try:
            found["rows"].append(measured(family, count, options.backend, options.precision, found))
        except (MppError, RuntimeError, MemoryError) as error:
            found["ended"] = f"{count:,}: {' '.join(str(error).split())[:200]}"
            break
        finally:
            options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    for row in found["rows"]:
        rate = f"{row['rate']:.3g} {family.unit}"
        sys.stdout.write(f"{family.name} {options.backend} {options.precision} {row['count']:>10,} {rate}\n")
    sys.stdout.write(f"{found['ended']}\n" if "ended" in found else "")
    return 0 if found["rows"] else 1


def measured(family, count, backend, precision, found):
    """The row of one size."""
    scene = family.scene(count)
    more = {"backend": backend, "precision": precision}
    if family.copies:
        with Simulation(scene, backend="cpu", precision="f64") as one:
            start = one.snapshot()
        more["replica_starts"] = [start] * count
    began = time.perf_counter()
    with Simulation(scene, **more) as simulation:
        simulation.try_steps(1, judged=False)
        wait()
        first = time.perf_counter() - began
        steps = steps_of_a_block(simulation)
        before = taken(simulation)
        seconds = [block(simulation, steps) / steps for _ in range(BLOCKS)]
        own_steps = (taken(simulation) - before) / (BLOCKS * steps)
        if "device" not in found:
            found |= {"device": simulation.device.name, **limits(simulation.device)}
    step = statistics.median(seconds)
    amount = own_steps if family.name == "adaptive" else family.amount(count)
    row = {"count": count, "step_seconds": step, "rate": amount / step, "first_seconds": first}
    return row | {"share_of_limit": share(family, row, found, precision)}


def taken(simulation):
    """Steps that an adaptive method has taken, over all copies; 0 for other methods."""
    return simulation.phase.launcher.facts().get("step_control", {}).get("steps", 0)


def steps_of_a_block(simulation):
    """As many steps as take `BLOCK`; they are not counted."""
    steps = 1
    while (seconds := block(simulation, steps)) < BLOCK:
        steps = min(64 * steps, max(2 * steps, int(1.2 * steps * BLOCK / max(seconds, 1e-6))))
    return steps


def block(simulation, steps):
    """Seconds of some steps, until the device has done them."""
    began = time.perf_counter()
    simulation.try_steps(steps, judged=False)
    wait()
    return time.perf_counter() - began


def wait():
    """Until the device has done all that it was given."""
    import taichi

    taichi.sync()


def limits(device):
    """Multiply–adds and bytes per second, and the time of a launch that does nothing, on the device that runs."""
    import taichi as ti

    from mpp_taichi.compare.taichi_peaks import taichi_peaks

    peaks = taichi_peaks(device)

    @ti.kernel
    def nothing(n: ti.i32):
        for _ in range(n):
            pass

    nothing(1024)
    ti.sync()
    began = time.perf_counter()
    for _ in range(LAUNCHES):
        nothing(1024)
    ti.sync()
    return {"flops": peaks["flops"], "bytes": peaks["bytes"], "launch_seconds": (time.perf_counter() - began) / LAUNCHES}


def share(family, row, found, precision):
    """The part of the device's limit that the rate is; None where no limit is known.

    Pairs count 20 flops each (30 in f64), as in NVIDIA's N-body sample; a three-body step REPLICA_FLOPS; the bytes of springs
    are those of `compare`. Double-single forces are of f32, and take more operations than are counted.
    """
    kind = "f64" if precision == "f64" else "f32"
    if family.name == "pairs":
        return row["rate"] * FLOPS[kind] / found["flops"]
    if family.name == "replicas":
        return row["rate"] * REPLICA_FLOPS * FLOPS[kind] / FLOPS["f32"] / found["flops"]
    if family.name == "springs":
        springs = family.amount(row["count"])
        step = Work(row["count"], springs, interactions=0, evaluations=1, drifts=2, damped=False)  # of a leapfrog
        return step.bytes(kind) / row["step_seconds"] / found["bytes"]
    return None


if __name__ == "__main__":
    sys.exit(main())
