"""Many members of three bodies: replicas beside REBOUND in a pool of processes, and a sweep beside its bare launches.

    python tools/benchmarks/benchmark_sweep.py [--members 4096] [--steps 4000] [--repeats 5] [--json FILE]

The scene is `kepler16`, leapfrog in f64, from starts at other distances and phases, without and with the derivative of each
step, as `megno` needs it; the same steps with REBOUND's leapfrog
(fixed step, no collisions) in a pool. One and two threads, or processes, in turn in one process; medians of the repeats in
nanoseconds for a step of a member. REBOUND sums the three pairs by the same formula; its set-up is not counted. Then the same
with `ias15` for the same stretch of time: each member takes steps of its own choice, and the row has the time of one of them.

Then the verb: the whole of a sweep that measures the end of each member, with reading and placing members, samples, chunks,
table and pictures, beside the time of its launches, which the first part tells; and the same command again, which finds all
chunks done and writes table and pictures: the share of the store.

At last members that are not such replicas: gases of 100 disks, and chains of 64 masses on springs of their own, by a sweep of
two processes and by processes that run one member each, two at a time, whose kernels are compiled already.
"""

import argparse
import json
import multiprocessing
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

DT = 0.1
STRETCH = 200.0  # of time, in days, for which methods with steps of their own run; some 170 steps
GAS = """
dimensions: 2
particles:
  - gas: {name: gas, count: 100, lower: [0, 0], upper: [10, 10], radius: 0.2, temperature: 1}
contacts: {hard_spheres: {solver: event_driven}}
walls:
  - box: {lower: [0, 0], upper: [10, 10]}
run: {duration: 20}
seed: 1
"""
CHAIN = """
dimensions: 2
constants: {stiffness: 100}
particles:
  - body: {mass: 1, position: [0, 0], free: false}
  - repeat: {count: 62, as: i, body: {mass: 1, position: [i + 1, 0.1 * sin(pi * (i + 1) / 63)]}}
  - body: {mass: 1, position: [63, 0], free: false}
springs:
  - repeat: {count: 63, as: i, link: {between: [i, i + 1], stiffness: stiffness, rest_length: 0.9}}
integrator: {leapfrog: {dt: 0.01}}
run: {duration: 100}
"""
OTHERS = {
    "gas of 100 disks": (GAS, "seed", "collision_count"),
    "chain of 64 masses": (CHAIN, "constants.stiffness", "kinetic_energy"),
}


def starts(members):
    """Starting snapshots, and the same as arrays: masses (3,), positions and velocities (members, 3, 3)."""
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.start.assemble import assemble

    found = []
    for distance, phase in zip(np.linspace(0.5, 1.2, members), np.linspace(0, 360 * 7, members)):
        changes = {"constants.distance": float(distance), "constants.phase": float(phase)}
        found.append(assemble(load_scene("kepler16", overrides=changes)))
    return found, found[0].mass, np.stack([each.position for each in found]), np.stack([each.velocity for each in found])


def ours(found, threads, *, tangent=False):
    """A launch of so many steps of all replicas, as a function; with the derivative of each step where `tangent`."""
    asked = {"+expect.megno.above": 0} if tangent else {}
    return launched(found, threads, asked)


def launched(found, threads, overrides):
    """A launch of so many steps of all replicas of the scene with other settings, as a function; and the simulation."""
    from mpp_taichi import Simulation

    simulation = Simulation(
        "kepler16", backend="cpu", precision="f64", replica_starts=found, threads=threads, overrides=overrides
    )
    simulation.try_steps(1, judged=False)

    def run(steps):
        simulation.try_steps(steps, judged=False)

    return run, simulation


_theirs = []


def begin_theirs(mass, position, velocity, strength, method):
    """Simulations of REBOUND in a process of the pool; those of ias15 go to the end of the first stretch of time."""
    import rebound

    for x, v in zip(position, velocity):
        simulation = rebound.Simulation()
        simulation.G, simulation.dt, simulation.integrator = strength, DT, method
        for k in range(3):
            simulation.add(m=mass[k], x=x[k][0], y=x[k][1], z=x[k][2], vx=v[k][0], vy=v[k][1], vz=v[k][2])
        if method == "ias15":
            simulation.integrate(STRETCH, exact_finish_time=0)
        _theirs.append(simulation)


def run_theirs(steps):
    """Take so many steps of all simulations of this process; those of ias15 take steps until a stretch of time is over.

    Returns the number of steps of a simulation, a mean.
    """
    before = sum(simulation.steps_done for simulation in _theirs)
    for simulation in _theirs:
        if simulation.integrator == "ias15":
            simulation.integrate(STRETCH * (1 + simulation.t // STRETCH), exact_finish_time=0)
        else:
            simulation.steps(steps)
    return (sum(simulation.steps_done for simulation in _theirs) - before) / len(_theirs)


def serve(connection, *start):
    """A process of REBOUND."""
    begin_theirs(*start)
    connection.send(True)
    while (steps := connection.recv()) is not None:
        connection.send(run_theirs(steps))


class Pool:
    """Processes of REBOUND that share the members."""

    def __init__(self, count, mass, position, velocity, strength, method="leapfrog"):
        """Start, and wait until all are set up."""
        context = multiprocessing.get_context("spawn")
        self.ends, self.processes = [], []
        for part in range(count):
            mine, other = context.Pipe()
            arguments = (other, mass, position[part::count], velocity[part::count], strength, method)
            self.processes.append(context.Process(target=serve, args=arguments, daemon=True))
            self.processes[-1].start()
            self.ends.append(mine)
        for end in self.ends:
            end.recv()

    def run(self, steps):
        """Take the steps, all processes at once; the number of steps of a simulation."""
        for end in self.ends:
            end.send(steps)
        return float(np.mean([end.recv() for end in self.ends]))

    def close(self):
        """End the processes."""
        for end in self.ends:
            end.send(None)
        for process in self.processes:
            process.join()


def measure_steps(members, steps, repeats):
    """Median nanoseconds for a step of a member, by contender."""
    from mpp_taichi.scene.load import load_scene

    found, mass, position, velocity = starts(members)
    strength = load_scene("kepler16").gravity
    rows = {}
    for count in (1, 2):
        run, simulation = ours(found, count)
        with_tangent, other = ours(found, count, tangent=True)
        pool = Pool(count, mass, position, velocity, strength)
        named = (f"members, {count} threads", f"members with the tangent, {count} threads", f"REBOUND, {count} processes")
        times = {name: [] for name in named}
        for _ in range(repeats):
            for name, do in zip(times, (run, with_tangent, pool.run)):
                began = time.perf_counter()
                do(steps)
                times[name].append((time.perf_counter() - began) / steps / members * 1e9)
        rows |= {name: float(np.median(each)) for name, each in times.items()}
        pool.close()
        simulation.close()
        other.close()
    return rows


def measure_adaptive(members, repeats):
    """Median nanoseconds for a step of a member that chooses its steps, by contender, and the ratio of their times."""
    from mpp_taichi.scene.load import load_scene

    found, mass, position, velocity = starts(members)
    strength = load_scene("kepler16").gravity
    rows, ratios = {}, {}
    for count in (1, 2):
        run, simulation = launched(found, count, {"integrator": {"ias15": {"dt": STRETCH}}})
        pool = Pool(count, mass, position, velocity, strength, "ias15")
        theirs, mine, shares = [], [], []
        for _ in range(repeats):
            before = simulation.phase.launcher.facts()["step_control"]["steps"]
            began = time.perf_counter()
            run(1)
            seconds = time.perf_counter() - began
            mine.append(seconds / (simulation.phase.launcher.facts()["step_control"]["steps"] - before) * 1e9)
            began = time.perf_counter()
            taken = pool.run(0)
            other = time.perf_counter() - began
            theirs.append(other / taken / members * 1e9)
            shares.append(other / seconds)
        named = {f"members, ias15, {count} threads": mine, f"REBOUND, ias15, {count} processes": theirs}
        rows |= {name: float(np.median(each)) for name, each in named.items()}
        ratios[count] = float(np.median(shares))
        pool.close()
        simulation.close()
    return rows, ratios


def measure_verb(members, steps):
    """Seconds of a whole sweep of so many members with two processes."""
    from mpp_taichi.cli.main import main

    side = int(np.sqrt(members))
    with tempfile.TemporaryDirectory() as folder:
        words = ["sweep", "kepler16", "--quiet", "--steps", str(steps), "--workers", "2", "--out", folder + "/x.sweep"]
        words += ["--vary", f"constants.distance=0.5:1.2:{side}", "--vary", f"constants.phase=0:360:{side}"]
        words += ["--measure", "end_time", "--measure", "position: {of: planet, axis: x}"]
        times = []
        for _ in range(2):
            began = time.perf_counter()
            if main(words):
                raise SystemExit("the sweep failed")
            times.append(time.perf_counter() - began)
        return side * side, *times


def measure_others(members, runs):
    """For each kind of scene the seconds of a member in a sweep, and in a process of its own."""
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, (text, key, measure) in OTHERS.items():
            path = Path(folder) / f"{name.split()[0]}.yaml"
            path.write_text(text, encoding="utf-8")
            command = [sys.executable, "-m", "mpp_taichi"]
            sweep = [*command, "sweep", str(path), "--vary", f"{key}=1:{members}:{members}", "--measure", measure]
            times = []
            for k in range(2):  # the first compiles
                began = time.perf_counter()
                subprocess.run([*sweep, "--workers", "2", "--quiet", "--out", f"{folder}/{k}.sweep"], check=True)
                times.append((time.perf_counter() - began) / members)
            alone = [[*command, "run", str(path), "--headless", "--quiet", "--set", f"{key}={k + 1}"] for k in range(runs)]
            subprocess.run(alone[0], check=True, capture_output=True)
            began = time.perf_counter()
            for k in range(0, runs, 2):
                pair = [subprocess.Popen(words, stderr=subprocess.DEVNULL) for words in alone[k : k + 2]]
                if any([each.wait() for each in pair]):
                    raise SystemExit(f"a run of the {name} failed")
            rows[name] = {"sweep": times[1], "processes": (time.perf_counter() - began) / runs}
    return rows


def main():
    """Measure, print the table, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--members", type=int, default=4096)
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--others", type=int, default=200, help="members of the scenes that are not three bodies")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = measure_steps(options.members, options.steps, options.repeats)
    adaptive, of_adaptive = measure_adaptive(options.members // 8, options.repeats)
    rows |= adaptive
    print(f"{'contender':38} {'ns for a step of a member':>26}")
    for name, value in rows.items():
        print(f"{name:38} {value:26.1f}")
    scaling = rows["members, 1 threads"] / rows["members, 2 threads"] / 2
    ratio = rows["REBOUND, 2 processes"] / rows["members, 2 threads"]
    print(f"\nREBOUND's time ÷ ours, two processes: {ratio:.2f}; scaling over two threads: {scaling:.2f} of ideal")
    print(f"REBOUND's time ÷ ours with ias15: {of_adaptive[1]:.2f} of one process, {of_adaptive[2]:.2f} of two")
    steps = 10 * options.steps
    members, seconds, again = measure_verb(options.members, steps)
    launches = members * steps * rows["members, 2 threads"] * 1e-9
    share = 1.0 - launches / seconds
    print(f"a sweep of {members:,} members of {steps:,} steps: {seconds:.1f} s")
    print(
        f"its launches: {launches:.1f} s; all else: {share:.0%}; the same command again, for table and pictures: {again:.2f} s"
    )
    others = measure_others(options.others, 8)
    print(f"\n{'scene':24} {'s of a member in a sweep':>26} {'in a process of its own':>26}")
    for name, row in others.items():
        print(f"{name:24} {row['sweep']:26.3f} {row['processes']:26.3f}")
    if options.json:
        found = {"members": options.members, "steps": options.steps, "ns": rows, "scaling": scaling, "ratio": ratio}
        found |= {"ratio_of_ias15": of_adaptive}
        found |= {"verb": {"members": members, "steps": steps, "seconds": seconds, "launches": launches, "again": again}}
        found |= {"seconds_of_a_member": others}
        options.json.write_text(json.dumps(found, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
