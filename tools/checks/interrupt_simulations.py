"""KeyboardInterrupt at random places of construction and run: does the next Simulation work, with the same bits?

    python tools/checks/interrupt_simulations.py [--count 200] [--seed 1] [--scene NAME]

A place is a call of a Python function, of all that the construction, a run of 20 steps and a snapshot make. Prints the places
after which the next Simulation failed or had other bits; 1 where there are any.
"""

import argparse
import random
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]  # so that it also runs from a checkout that is not installed

from interrupts import calls, interrupt, speed  # noqa: E402

from scenes import cluster, kepler  # noqa: E402

SCENES = {"kepler": kepler(0.5), "implicit": kepler(0.5, integrator="implicit_midpoint"), "cluster": cluster(20)}


def main():
    """Interrupt so many times; 1 where a later Simulation was not as before."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scene", choices=SCENES, default="kepler")
    options = parser.parse_args()
    scene, places, wrong, ended = SCENES[options.scene], random.Random(options.seed), 0, 0
    right = speed(scene)
    every = calls(lambda: speed(scene))
    for _ in range(options.count):
        place = places.randrange(1, every)
        ended += interrupt(lambda: speed(scene), place)
        try:
            found = speed(scene)
        except Exception as error:
            found = f"{type(error).__name__}: {error}"
        if found != right:
            wrong += 1
            print(f"call {place} of {every}: then {found} instead of {right}", flush=True)
    print(f"{options.count} interrupts, {ended} of them ended the Simulation; {wrong} left something wrong behind")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
