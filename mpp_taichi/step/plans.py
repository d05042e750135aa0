"""Execution plans: how one step is run, and which plan suits a scene.

serial     one thread advances the whole system by many steps in one launch: small systems on the CPU
parallel   one launch per step, every loop over particles parallel: large systems
replicas   one thread per independent copy, many steps in one launch: ensembles of a small system
"""

from mpp_taichi import component
from mpp_taichi.scene.pair_forces import is_pair_force
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.tree_checks import VISITS_OF_A_TREE, tree_of

PLANS = ("serial", "parallel", "replicas")
# Work per step above which the parallel plan is faster on a CPU, in units of one pair interaction of the serial plan
# (3 ns, or 0.9 ns in explicit vectors); measured by tools/benchmarks/benchmark_plans.py on two cores. The number is fixed, and
# not timed at run time, so that a scene always takes the same plan and gives the same bits.
CROSSOVER_WORK = 130_000
WORK_PER_PARTICLE = 4
WORK_PER_HALF_SPRING = 4


def step_work(spec: SceneSpec, particle_count: int, spring_count: int) -> int:
    """Work of one step in the units of CROSSOVER_WORK, estimated before any force of the scene is imported."""
    has_pairs = any(is_pair_force(force.name) for force in spec.forces)
    pairs = particle_count * (particle_count - 1) // 2 if has_pairs else 0
    if tree_of(spec) is not None:
        pairs = min(pairs, VISITS_OF_A_TREE * particle_count)
    evaluations: int = component.flag("integrators", spec.integrator.name, "typical_evaluations", 1)
    return evaluations * (pairs + WORK_PER_HALF_SPRING * 2 * spring_count + WORK_PER_PARTICLE * particle_count)


def choose(work: int, *, on_cpu: bool, replica_count: int) -> str:
    """The plan for a scene, by its work per step and the device."""
    if replica_count > 1:
        return "replicas"
    return "serial" if on_cpu and work < CROSSOVER_WORK else "parallel"
