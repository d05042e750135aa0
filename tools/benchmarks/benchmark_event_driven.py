"""How many collisions a second event-driven hard spheres make on one core, and what REBOUND makes of the same gas.

    python tools/benchmarks/benchmark_event_driven.py [--counts 1000 10000 100000] [--packing 0.35] [--repeats 7] [--json FILE]

A gas of equal spheres (disks) of unit mass in a periodic box, from a lattice with Gaussian velocities, after some collisions
of each. All sizes and contenders are interleaved in one process; medians of the repeats. Cost is by wall clock and, for
machines that others use too, by the processor's own time. `rebound` steps with its leapfrog without gravity, a tree for
collisions and its hard-sphere resolver, at a tenth of a radius per step of a typical sphere: it finds overlaps after the
fact, so its largest overlap and the share of collisions that it sees are told beside it. A bar holds if the cost by the
processor's time keeps it.
"""

import argparse
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "benchmarks")]  # so that it also runs from a checkout

from verdicts import finish  # noqa: E402

COUNTS = (1_000, 10_000, 100_000)
# Collisions: several of each sphere, so that what a turn of others has put out of the caches is soon there again.
SAMPLE = 400_000
SAMPLE_OF_EACH = 4
WARM = 0.3  # time after which every sphere has had a few
LEAST_PER_SECOND = 2e5
MOST_GROWTH = 1.3
MANY, MOST_GROWTH_OF_MANY = 300_000, 1.5  # spheres whose data are far larger than any cache
# Of a radius, that a sphere of typical speed moves in one step of REBOUND.
STEP = 0.1


def gas(count, dimensions, packing):
    """Positions, velocities, the radius and the edge of the box."""
    side = round(count ** (1 / dimensions))
    x = np.stack(np.meshgrid(*[np.arange(side) + 0.5] * dimensions, indexing="ij"), -1).reshape(-1, dimensions)
    v = np.random.default_rng(0).normal(size=x.shape)
    unit = np.pi / 6 if dimensions == 3 else np.pi / 4
    return x, v - v.mean(0), (packing / unit) ** (1 / dimensions) / 2, float(side)


def largest_overlap(position, radius, side):
    """Of any two spheres in the periodic box, in radii; by somebody else's search."""
    from scipy.spatial import cKDTree

    # In the tree's own arithmetic a position must be less than the side.
    tree = cKDTree(np.mod(np.mod(position, side), side), boxsize=side)
    pairs = tree.query_pairs(2 * radius, output_type="ndarray")
    q = position[pairs[:, 0]] - position[pairs[:, 1]]
    distance = np.linalg.norm(q - side * np.round(q / side), axis=1)
    return float((2 * radius - distance).max(initial=0.0) / radius)


class Ours:
    """The event-driven solver."""

    def __init__(self, x, v, radius, side):
        """Bind and compile."""
        import taichi as ti

        from mpp_taichi.contacts._base import ContactSetup
        from mpp_taichi.contacts.event_driven import EventDriven
        from mpp_taichi.device.fast_taichi.large_pages import MANY_PARTICLES, use_large_pages
        from mpp_taichi.walls._base import Enclosure

        n, d = x.shape
        period = (side, side, side if d == 3 else 0.0)
        setup = ContactSetup(
            d, np.full(n, radius), np.ones((n, 3)), np.zeros(n, np.int32), np.ones((1, 1)), enclosure=Enclosure(period=period)
        )
        self.state = SimpleNamespace(position=ti.Vector.field(d, float, n), velocity=ti.Vector.field(d, float, n))
        self.state.position.from_numpy(x)
        self.state.velocity.from_numpy(v)
        self.solver = EventDriven()
        self.solver.bind(setup, self.state)
        if n >= MANY_PARTICLES:
            use_large_pages()
        self.solver.prepare(0.0)
        self.time, self.overlap = 0.0, 0.0

    def advance(self, span):
        """Collisions in a span of time."""
        self.solver.advance(self.time, self.time + span)
        self.time += span
        report = self.solver.collect()
        self.overlap = max(self.overlap, report.largest_overlap)
        return report.pair_count

    def positions(self):
        """(n, d)."""
        return self.state.position.to_numpy()


class Rebound:
    """REBOUND's hard spheres."""

    def __init__(self, x, v, radius, side):
        """The same gas in its box around the origin."""
        import rebound

        self.side, self.overlap = side, 0.0
        self.simulation = rebound.Simulation()
        s = self.simulation
        s.integrator, s.gravity, s.boundary = "leapfrog", "none", "periodic"
        s.root_size, s.N_root_x, s.N_root_y, s.N_root_z = side, 1, 1, 1
        s.N_ghost_x, s.N_ghost_y, s.N_ghost_z = 1, 1, int(x.shape[1] == 3)
        s.collision, s.collision_resolve, s.dt = "tree", "hardsphere", STEP * radius
        x, v = (np.pad(a, ((0, 0), (0, 3 - a.shape[1]))) for a in (x - side / 2, v))
        for (a, b, c), (p, q, r) in zip(x, v):
            s.add(m=1.0, r=radius, x=a, y=b, z=c, vx=p, vy=q, vz=r)
        self.dimensions = 3 if v[:, 2].any() else 2

    def advance(self, span):
        """Collisions in a span of time, made of whole steps."""
        s = self.simulation
        before = s.collisions_log_n
        s.steps(max(round(span / s.dt), 1))
        return s.collisions_log_n - before

    def positions(self):
        """(n, d)."""
        return np.array([p.xyz for p in self.simulation.particles])[:, : self.dimensions] + self.side / 2


def prepare(counts, dimensions, packing):
    """Every contender of every size, warm."""
    cases = []
    for count in counts:
        x, v, radius, side = gas(count, dimensions, packing)
        row = {"count": len(x), "dimensions": dimensions, "radius": radius, "side": side, "contenders": {}}
        ours = Ours(x, v, radius, side)
        span = max(SAMPLE, SAMPLE_OF_EACH * len(x)) * WARM / ours.advance(WARM)
        row["contenders"]["ours"] = {"run": ours, "span": span, "wall": [], "cpu": [], "rate": []}
        try:
            other = Rebound(x, v, radius, side)
            other.advance(WARM)
            span = max(min(span / 8, 4 * other.simulation.dt), other.simulation.dt)
            row["contenders"]["rebound"] = {"run": other, "span": span, "wall": [], "cpu": [], "rate": []}
        except ImportError:
            pass
        cases.append(row)
    return cases


def sample(contender):
    """One more measurement: cost of a collision, and collisions per time of the gas."""
    run, span = contender["run"], contender["span"]
    wall, cpu = time.perf_counter(), time.process_time()
    collisions = max(run.advance(span), 1)
    contender["wall"].append((time.perf_counter() - wall) / collisions)
    contender["cpu"].append((time.process_time() - cpu) / collisions)
    contender["rate"].append(collisions / span)


def table(cases):
    """Medians, printed; as plain numbers for the file."""
    results = []
    print(f"\n{'':24}{'collisions/s':>14}{'by processor':>14}{'cost, first = 1':>17}{'largest overlap':>17}{'sees':>8}")
    for name in ("ours", "rebound"):
        first = None
        for case in cases:
            if name not in case["contenders"]:
                continue
            contender = case["contenders"][name]
            cost, wall = float(np.median(contender["cpu"])), float(np.median(contender["wall"]))
            first = first or cost
            overlap = max(contender["run"].overlap, largest_overlap(contender["run"].positions(), case["radius"], case["side"]))
            seen = float(np.median(contender["rate"]) / np.median(case["contenders"]["ours"]["rate"]))
            label = f"{name}, {case['dimensions']}D, N = {case['count']}"
            print(f"{label:24}{1 / wall:14.3g}{1 / cost:14.3g}{cost / first:17.2f}{overlap:17.1e}{seen:8.2f}", flush=True)
            results.append(
                {"contender": name, "dimensions": case["dimensions"], "count": case["count"], "collisions_per_second": 1 / wall,
                 "per_processor_second": 1 / cost, "growth": cost / first, "largest_overlap": overlap, "share_seen": seen,
                 "wall": contender["wall"], "cpu": contender["cpu"]}
            )  # fmt: skip
    return results


def main():
    """Run, print, write; exit code 1 when a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--dimensions", type=int, nargs="+", choices=(2, 3), default=(3, 2))
    parser.add_argument("--packing", type=float, default=0.35)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    from mpp_taichi.device import backends

    device = backends.start("cpu", "f64")
    results = []
    for dimensions in arguments.dimensions:
        cases = prepare(arguments.counts, dimensions, arguments.packing)
        for _ in range(arguments.repeats):
            for case in cases:
                for contender in case["contenders"].values():
                    sample(contender)
        results += table(cases)
    verdicts = []
    for row in (row for row in results if row["contender"] == "ours"):
        where, rate = f"{row['dimensions']}D, {row['count']} spheres", row["per_processor_second"]
        growth = MOST_GROWTH if row["count"] < MANY else MOST_GROWTH_OF_MANY
        verdicts.append((f"{where}: collisions/s, at least", rate, LEAST_PER_SECOND, rate >= LEAST_PER_SECOND))
        verdicts.append((f"{where}: growth of the cost, at most", row["growth"], growth, row["growth"] <= growth))
    return finish(verdicts, results, arguments.json, processor=device.name, packing=arguments.packing)


if __name__ == "__main__":
    sys.exit(main())
