"""Films of exact moments: each picture shows the state in which a run to its time would end."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol

from mpp_taichi.beside.difference import Difference
from mpp_taichi.beside.half_frame import Moment
from mpp_taichi.scene import timeline
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame

if TYPE_CHECKING:
    from mpp_taichi.beside.view import TwoHalves
    from mpp_taichi.simulation.simulation import Simulation


class ExactMoments:
    """Finds the particles between two steps by one shorter step of the method itself.

    Positions x + v δ are good enough for a picture, but their error ½ a δ² is larger than the difference of two methods. The
    run goes on from its last whole step, and keeps every bit.
    """

    tolerance = timeline.SAME_TIME
    velocities_stay = False

    def particles(self, simulation: "Simulation", time: float) -> Snapshot:
        """The particles at a time before the next step."""
        before = simulation.bookmark()
        try:
            simulation.run(until=time, judge="off")  # the state is left again
            return simulation.snapshot()
        finally:
            simulation.go_back(before)


class Other(Protocol):
    """The other run: `Companion`."""

    def moment(self) -> Moment:
        """The next moment of the other run."""


class BothHalves:
    """Adds the other run to each frame of a film: both runs are at the same times."""

    def __init__(
        self,
        view: "TwoHalves",
        other: Other,
        difference: Difference | None,
        stopwatch: Callable[[str], AbstractContextManager[Any]],
    ) -> None:
        """`view` draws the two halves, `difference` compares every pair of moments; `stopwatch` times the wait."""
        self._view, self._other, self._difference, self._stopwatch = view, other, difference, stopwatch

    def add(self, snapshot: Snapshot, frame: Frame) -> None:
        """Take the moment of the other run, compare it with this one, and give it to the view."""
        with self._stopwatch("beside"):
            moment = self._other.moment()
        if self._difference is not None:
            self._difference.add(frame.time, snapshot, moment.place, moment.present)
        self._view.other = moment.frame
