"""Guard: the check of the step that a run makes before it begins, and again when the step has changed."""

from typing import Any

from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.stability.advice import Method, StepAdvice, advise
from mpp_taichi.stability.network import drag_of


class StepGuard:
    """Judges steps of one method for one scene, as it was placed; the limit is computed once, when it is first needed."""

    def __init__(self, spec: SceneSpec, start: Snapshot, method: Method, *, force: bool) -> None:
        """`force` turns refusals into warnings."""
        self.spec, self.start, self.method, self.force = spec, start, method, force
        self._advice: Any = None
        self._asked = False
        self._checked: float | None = None

    def knows(self, spec: SceneSpec, springs: Springs, method: Method) -> bool:
        """Whether the limit of the step is the same for these springs, this method and the drag of this scene."""
        return springs is self.start.springs and method is self.method and drag_of(spec) == drag_of(self.spec)

    def advice(self, dt: float) -> StepAdvice | None:
        """The largest step that the springs and the drag allow; None where nothing limits the step."""
        if not self._asked:
            self._asked, self._advice = True, advise(self.spec, self.start, self.method, dt)
        return None if self._advice is None else self._advice.at(dt)

    def check(self, dt: float, steps: int | None = None) -> None:
        """Warn of a step, or refuse it; a second call with the same dt does nothing.

        Raises:
            StabilityError: the step cannot hold, and `force` was not set.
        """
        if dt == self._checked:
            return
        advice = self.advice(dt)
        if advice is not None:
            advice.enforce(steps=steps, force=self.force)
        self._checked = dt
