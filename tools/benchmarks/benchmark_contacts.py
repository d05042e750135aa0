"""How fast time-stepped contacts are: `swept` against `pairwise`, all pairs against the cell grid, REBOUND on the same scene.

    python tools/benchmarks/benchmark_contacts.py [--counts 100000 1000000] [--crossover 64 … 2048] [--packing 0.3] [--way 0.03]
                                       [--precisions f64 f32] [--repeats 7] [--threads 2] [--json FILE]

Unit spheres in a box that repeats, at a packing fraction, with Maxwell's velocities; a step lets a sphere go `way` of its
radius on average. Contenders are interleaved; medians of the repeats and ratios of neighbouring samples, in wall-clock time and
because other programs may take the machine's time, in processor time (of all threads, over their number). REBOUND looks for
collisions along the way (`line`, all pairs) or in a tree, overlapping spheres after a step, on one core and for fewer spheres.
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

COUNTS = (100_000, 1_000_000)
CROSSOVER = (64, 128, 256, 512, 1024, 2048)
REBOUND_COUNT = 10_000
REBOUND_LINE_COUNT = 1000
WARM_STEPS = 5
STEPS_PER_SAMPLE = 12  # at least: every few of them `swept` looks for partners anew, and that belongs to the price
BARS = {"rate": 1e7, "ratio": 2.5}  # particle-steps per second of `swept` on two cores; its time over that of `pairwise`


def gas(count, packing):
    """Positions, velocities of mean 1 and the edge of the box; `count` is rounded to a cube."""
    random = np.random.default_rng(1)
    side = round(count ** (1 / 3))
    cell = (4 * np.pi / 3 / packing) ** (1 / 3)
    lattice = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3) * cell
    position = lattice + random.uniform(-0.5, 0.5, lattice.shape) * (cell - 2.0)
    velocity = random.normal(size=lattice.shape) / np.sqrt(8 / np.pi)
    return position, velocity, side * cell


class Ours:
    """One of our solvers on the scene."""

    def __init__(self, kind, scene, h, all_pairs):
        import taichi as ti

        from mpp_taichi.contacts._base import ContactSetup
        from mpp_taichi.contacts.overlap.overlaps import Overlaps
        from mpp_taichi.contacts.sweep.sweep import sweep_in_pairs
        from mpp_taichi.device.fast_taichi.large_pages import MANY_PARTICLES, use_large_pages
        from mpp_taichi.walls._base import Enclosure

        position, velocity, edge = scene
        n = len(position)
        self.h, self.sync, self.has_slots = h, ti.sync, kind == "swept"
        state = SimpleNamespace(
            position=ti.Vector.field(3, float, shape=n), velocity=ti.Vector.field(3, float, shape=n), wide=ti.f64
        )
        real = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
        state.position.from_numpy(position.astype(real))
        state.velocity.from_numpy(velocity.astype(real))
        setup = ContactSetup(
            dimensions=3,
            radius=np.ones(n),
            inverse_mass=np.ones((n, 3)),
            material=np.zeros(n, np.int32),
            restitution=np.ones((1, 1)),
            enclosure=Enclosure(period=(edge,) * 3),
            force_free=True,
        )
        if kind == "swept":
            self.solver = sweep_in_pairs(setup, state, event_limit=1_000_000, all_pairs=all_pairs)
        else:
            self.solver = Overlaps(setup, state, all_pairs=all_pairs)
        if n >= MANY_PARTICLES:
            use_large_pages()  # as a run of a scene does

    def step(self):
        """One step."""
        self.solver.drift(0.0, self.h)

    def finish(self):
        """Bring the state up to date, and wait until all is done."""
        if self.has_slots:
            self.solver.write_back()
        self.sync()

    def report(self):
        """Contacts since it was last asked, and what else is known of them."""
        found = self.solver.collect()
        return {"contacts": found.pair_count, "largest_overlap": found.largest_overlap, "unresolved": found.unresolved}

    def destroy(self):
        """Give the memory back."""
        self.solver.destroy()


class Rebound:
    """REBOUND's leapfrog without gravity, with its hard-sphere collisions."""

    def __init__(self, collision, scene, h):
        import rebound

        position, velocity, edge = scene
        self.counted = 0
        self.simulation = rebound.Simulation()
        self.simulation.integrator = "leapfrog"
        self.simulation.gravity = "none"
        self.simulation.boundary = "periodic"
        self.simulation.root_size = edge
        self.simulation.N_root_x = self.simulation.N_root_y = self.simulation.N_root_z = 1
        self.simulation.N_ghost_x = self.simulation.N_ghost_y = self.simulation.N_ghost_z = 1
        self.simulation.collision = collision
        self.simulation.collision_resolve = "hardsphere"
        self.simulation.dt = h
        half = edge / 2
        for x, v in zip(position, velocity, strict=True):
            x = (x + half) % edge - half
            self.simulation.add(m=1.0, r=1.0, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])

    def step(self):
        """One step."""
        self.simulation.steps(1)

    def finish(self):
        """It returns when it is done."""

    def report(self):
        """Contacts since it was last asked, and what else is known of them."""
        counted, self.counted = self.counted, int(self.simulation.collisions_log_n)
        return {"contacts": self.counted - counted}

    def destroy(self):
        """Give the memory back."""
        del self.simulation


def measure(contenders, count, repeats, threads):
    """Seconds per step of each, interleaved: {name: row}."""
    loops = max(STEPS_PER_SAMPLE, round(20_000 / count))
    for contender in contenders.values():
        for _ in range(WARM_STEPS):
            contender.step()
        contender.finish()
        contender.report()
    wall = {name: [] for name in contenders}
    processor = {name: [] for name in contenders}
    for _ in range(repeats):
        for name, contender in contenders.items():
            began, used = time.perf_counter(), time.process_time()
            for _ in range(loops):
                contender.step()
            contender.finish()
            wall[name].append((time.perf_counter() - began) / loops)
            cores = 1 if name.startswith("rebound") else threads
            processor[name].append((time.process_time() - used) / loops / cores)
    rows = {}
    for name, contender in contenders.items():
        rows[name] = {
            "seconds": float(np.median(wall[name])),
            "fastest": min(wall[name]),
            "processor_seconds": float(np.median(processor[name])),
            "particle_steps_per_second": count / float(np.median(wall[name])),
            "steps_per_report": repeats * loops,
            "samples": wall[name],
            **contender.report(),
        }
        contender.destroy()
    return rows


def show(title, count, rows):
    """One table."""
    print(f"\n{title}, {count} spheres")
    print(f"{'':22}{'ms a step':>12}{'fastest':>12}{'processor':>12}{'M spheres/s':>14}{'contacts/step':>16}{'overlap':>12}")
    for name, row in rows.items():
        contacts = row["contacts"] / row["steps_per_report"]
        overlap = f"{row['largest_overlap']:.1e}" if "largest_overlap" in row else ""
        print(
            f"{name:22}{1e3 * row['seconds']:12.3f}{1e3 * row['fastest']:12.3f}{1e3 * row['processor_seconds']:12.3f}"
            f"{row['particle_steps_per_second'] / 1e6:14.3f}{contacts:16.1f}{overlap:>12}",
            flush=True,
        )


def ratio(rows, over, under):
    """Median ratio of neighbouring samples."""
    return float(np.median(np.divide(rows[over]["samples"], rows[under]["samples"])))


def main():
    """Run, print, write; exit code 1 when a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--counts", type=int, nargs="*", default=COUNTS)
    parser.add_argument("--crossover", type=int, nargs="*", default=CROSSOVER)
    parser.add_argument("--packing", type=float, default=0.3)
    parser.add_argument("--way", type=float, default=0.03, help="mean way in a step, in radii")
    parser.add_argument("--precisions", nargs="+", choices=("f32", "f64"), default=("f64",))
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--no-rebound", action="store_true")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    from mpp_taichi.device import backends

    results, verdicts = [], []
    for precision in options.precisions:
        device = backends.start("cpu", precision, threads=options.threads)
        print(f"{device.name}, {options.threads} threads, {precision}; packing {options.packing}, {options.way} radii a step")
        for count in options.counts:
            scene = gas(count, options.packing)
            n = len(scene[0])
            rows = measure(
                {kind: Ours(kind, scene, options.way, False) for kind in ("swept", "pairwise")},
                n,
                options.repeats,
                options.threads,
            )
            show(f"cell grid, {precision}", n, rows)
            results.append({"spheres": n, "precision": precision, "rows": rows})
            where = f"{n} spheres, {precision}"
            rate, price = rows["swept"]["particle_steps_per_second"], ratio(rows, "swept", "pairwise")
            verdicts.append((f"{where}: particle-steps/s of swept, at least", rate, BARS["rate"], rate >= BARS["rate"]))
            verdicts.append((f"{where}: swept ÷ pairwise, at most", price, BARS["ratio"], price <= BARS["ratio"]))
        for count in options.crossover:
            scene = gas(count, options.packing)
            n = len(scene[0])
            contenders = {
                f"{kind}, {'all pairs' if all_pairs else 'grid'}": Ours(kind, scene, options.way, all_pairs)
                for kind in ("swept", "pairwise")
                for all_pairs in (True, False)
            }
            rows = measure(contenders, n, options.repeats, options.threads)
            show(f"crossover, {precision}", n, rows)
            results.append({"spheres": n, "precision": precision, "rows": rows})
        if not options.no_rebound and precision == "f64":
            for collision, count in (("tree", REBOUND_COUNT), ("line", REBOUND_LINE_COUNT)):
                scene = gas(count, options.packing)
                n = len(scene[0])
                contenders = {"swept": Ours("swept", scene, options.way, None)}
                contenders[f"rebound, {collision}"] = Rebound(collision, scene, options.way)
                rows = measure(contenders, n, options.repeats, options.threads)
                show("beside REBOUND", n, rows)
                results.append({"spheres": n, "precision": precision, "rows": rows})
        backends.stop()
    return finish(verdicts, results, options.json, processor=device.name, threads=options.threads)


if __name__ == "__main__":
    sys.exit(main())
