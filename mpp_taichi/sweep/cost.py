"""Cost: the work of a sweep before its start, and how many members a chunk has."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.scene.estimate import estimate
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.step.plans import step_work
from mpp_taichi.sweep.gauges import SAMPLES
from mpp_taichi.sweep.member import Member, made
from mpp_taichi.sweep.plan import Plan
from mpp_taichi.sweep.structure import key_alone, why_alone

CHUNK_SECONDS = 30.0
PAIR_SECONDS = 3e-9
"""Of a unit of `step_work` in one thread."""
ADAPTIVE_STEPS = 20
"""Steps of a method that chooses its own, between two samples, roughly."""
MEMBER_SECONDS = 2e-3
"""To read the scene of a member and to place its particles."""
ALONE_SECONDS = 0.1
"""To sample a member that runs by itself."""
COMPILED_SECONDS = 1.5
"""To compile a member anew, with kernels from the cache."""
SAMPLE_SECONDS = 1e-3
"""To sample all members of a launch."""
FEWEST, MOST = 8, 4096
"""Members of a chunk."""
SIDE_BY_SIDE = 2048
"""Members in one launch at most."""
LOOKED_AT, FEW_PARTICLES = 12, 20_000
"""Members by which it is estimated how many are compiled anew, and their particles together."""
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


def cost_of(spec: SceneSpec, members: int, start: Snapshot, compiled: float = 0.0) -> Cost:
    """The cost of so many members like this one, of which the share `compiled` is compiled anew."""
    particle_count, spring_count = start.particle_count, len(start.springs)
    needed = estimate(spec)
    steps = needed.steps or 0
    adaptive = component.flag("integrators", spec.integrator.name, "controlled_by", "")
    each = steps * (ADAPTIVE_STEPS if adaptive else 1) * step_work(spec, particle_count, spring_count) * PAIR_SECONDS
    each += MEMBER_SECONDS + compiled * COMPILED_SECONDS
    if why_alone(spec):
        each += ALONE_SECONDS
    launch = SAMPLES * SAMPLE_SECONDS
    chunk = max(FEWEST, min(MOST, int(CHUNK_SECONDS / each), -(-members // PARTS)))
    chunks = -(-members // chunk)
    size = ROW_BYTES * members + chunk * (PARTICLE_BYTES * particle_count + needed.bytes)
    together = max(1, min(SIDE_BY_SIDE, int(CHUNK_SECONDS / each)) // chunk)
    return Cost(members, chunk, together, members * each + chunks * launch, size)


def compiled_share(resolved: Mapping[str, Any], source: str, plan: Plan, particle_count: int) -> float:
    """The share of members that are compiled anew where members run one after the other, by a few of them."""
    looked_at = max(2, min(LOOKED_AT, FEW_PARTICLES // particle_count))
    numbers = np.unique(np.linspace(0, plan.count - 1, looked_at).astype(np.int64))
    found = [made(int(number), resolved, source, values) for number, values in zip(numbers, plan.values(numbers), strict=True)]
    keys = [key_alone(each.spec, each.start) for each in found if isinstance(each, Member)]
    distinct = len({key for key in keys if key is not None}) + sum(key is None for key in keys)
    return distinct / len(keys) if keys else 0.0
