"""Cost: the work of a sweep before its start, and how many members a chunk has."""

from dataclasses import dataclass

from mpp_taichi import component
from mpp_taichi.scene.estimate import estimate
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.step.plans import step_work
from mpp_taichi.sweep.gauges import SAMPLES

CHUNK_SECONDS = 30.0
PAIR_SECONDS = 3e-9
"""Of a unit of `step_work` in one thread."""
ADAPTIVE_STEPS = 20
"""Steps of a method that chooses its own, between two samples, roughly."""
MEMBER_SECONDS = 2e-3
"""To read the scene of a member and to place its particles."""
SAMPLE_SECONDS = 1e-3
"""To sample all members of a launch."""
FEWEST, MOST = 8, 4096
"""Members of a chunk."""
SIDE_BY_SIDE = 2048
"""Members in one launch at most."""
PARTS = 100
"""Chunks of a sweep at least, so that a picture exists after one per cent of the work."""
ROW_BYTES = 200
PARTICLE_BYTES = 700


@dataclass(frozen=True)
class Cost:
    """An estimate, good to a factor of some three.

    seconds   of one process for all members
    bytes     of one process
    chunk     members of a chunk
    together  chunks in one launch: members side by side share the time that a launch and its samples take
    """

    members: int
    chunk: int
    together: int
    seconds: float
    bytes: int

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.members // self.chunk)


def cost_of(spec: SceneSpec, members: int, particle_count: int, spring_count: int) -> Cost:
    """The cost of so many members like this one."""
    needed = estimate(spec)
    steps = needed.steps or 0
    adaptive = component.flag("integrators", spec.integrator.name, "controlled_by", "")
    each = steps * (ADAPTIVE_STEPS if adaptive else 1) * step_work(spec, particle_count, spring_count) * PAIR_SECONDS
    each += MEMBER_SECONDS
    launch = SAMPLES * SAMPLE_SECONDS
    chunk = max(FEWEST, min(MOST, int(CHUNK_SECONDS / each), -(-members // PARTS)))
    chunks = -(-members // chunk)
    size = ROW_BYTES * members + chunk * (PARTICLE_BYTES * particle_count + needed.bytes)
    together = max(1, min(SIDE_BY_SIDE, int(CHUNK_SECONDS / each)) // chunk)
    return Cost(members, chunk, together, members * each + chunks * launch, size)
