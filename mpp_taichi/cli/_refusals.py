"""Refusals before the work of a verb begins: no backend that starts here, and a scene that is too large for the machine."""

from collections.abc import Sequence
from dataclasses import replace

from mpp_taichi.device.availability import BACKENDS, availability, present
from mpp_taichi.errors import BackendError
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.spec import SceneSpec


def require_any_backend(names: Sequence[str]) -> None:
    """Refuse a list of backends of which none starts here; names that are none of Taichi's backends count as starting.

    Raises:
        BackendError: the reason of each backend, and the backends that do start.
    """
    reasons = []
    for name in names:
        if name not in BACKENDS or (report := availability(name))["available"]:
            return
        reasons.append(f"{name} does not start here: {report['reason']}")
    raise BackendError(f"{'; '.join(reasons)}; here are: {', '.join(present())}")


def require_room(spec: SceneSpec) -> None:
    """Refuse a scene whose particles and springs the machine cannot hold, whatever the length of its run.

    Raises:
        CapacityError: the counts, and the memory that is there.
    """
    check_capacity(replace(estimate(spec), steps=None))
