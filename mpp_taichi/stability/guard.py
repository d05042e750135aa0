"""Guard: the check that a simulation makes of its step before it takes one, and again when the step has changed."""

from typing import Any

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.stability.advice import Method, StepAdvice, advise
from mpp_taichi.stability.network import drag_of


class StepGuard:
    """Knows the scene as it was placed; computes nothing before it is asked, and nothing twice."""

    def __init__(self, spec: SceneSpec, start: Snapshot, method: Method, *, force: bool) -> None:
        """`force` turns refusals into warnings."""
        self.spec, self.start, self.method, self.force = spec, start, method, force
        self._advice: Any = None
        self._asked = False
        self._checked: float | None = None

    def knows(self, spec: SceneSpec, springs: Springs, method: Method) -> bool:
        """Whether what limits a step is the same: these springs, this method, and the drag."""
        return springs is self.start.springs and method is self.method and drag_of(spec) == drag_of(self.spec)

    def advice(self, dt: float) -> StepAdvice | None:
        """How large a step the springs and the drag allow; None where nothing limits it."""
        if not self._asked:
            self._asked, self._advice = True, advise(self.spec, self.start, self.method, dt)
        return None if self._advice is None else self._advice.at(dt)

    def check(self, dt: float, steps: int | None = None) -> None:
        """Warn or refuse, once for each dt.

        Raises:
            StabilityError: the step cannot hold, and `force` was not set.
        """
        if dt == self._checked:
            return
        advice = self.advice(dt)
        if advice is not None:
            advice.enforce(steps=steps, force=self.force)
        self._checked = dt
