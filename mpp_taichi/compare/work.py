"""Work: the work of a step, in the units by which backends are compared; the conventions of the table.

interactions   ordered pairs, N (N − 1) for each evaluation of the force, whatever a kernel really visits
flops          20 for each interaction in f32 and 30 in f64, as in NVIDIA's N-body sample: a convention, not a count
bytes          of a step on springs: for each evaluation every half-spring's index, stiffness, rest length and, where there
               is any, damping, and every particle's position, velocity and mass read and its velocity written; for each
               drift positions read and written and velocities read. Effects of caches are not counted.
"""

from dataclasses import dataclass

from mpp_taichi.compare.numpy_reference import pair_forces
from mpp_taichi.compare.numpy_steps import SPLITTINGS, roundings_per_step
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

FLOPS = {"f32": 20.0, "f64": 30.0}
WIDTH = {"f32": 4, "f64": 8}
INDEX = 4


@dataclass(frozen=True)
class Work:
    """The work of one step."""

    particles: int
    springs: int
    interactions: int
    evaluations: int
    drifts: int
    damped: bool

    def flops(self, precision: str) -> float:
        """Flops of the interactions; 0 without pairs."""
        return self.interactions * FLOPS[precision]

    def bytes(self, precision: str) -> float:
        """Bytes of the springs; 0 without springs."""
        width = WIDTH[precision]
        if not self.springs:
            return 0.0
        half_springs = 2 * self.springs * (INDEX + width * (2 + self.damped))
        return self.evaluations * (half_springs + self.particles * width * 10) + self.drifts * self.particles * width * 9


def work_of(spec: SceneSpec, particles: Snapshot, evaluations: int | None) -> Work:
    """The work of a step; `evaluations` of the force are reported by a backend, for a method without a NumPy text."""
    method = spec.integrator.name
    if method == "rk4":
        evaluations, drifts = 4, 4
    elif method in SPLITTINGS:
        drifts, evaluations = roundings_per_step(method)
        evaluations -= method == "velocity_verlet"  # the last of a step is the first of the next
    else:
        evaluations = evaluations or 1
        drifts = evaluations
    count = particles.particle_count
    return Work(
        particles=count,
        springs=len(particles.springs),
        interactions=evaluations * count * (count - 1) if pair_forces(spec) else 0,
        evaluations=evaluations,
        drifts=drifts,
        damped=bool(particles.springs.damping.any()),
    )
