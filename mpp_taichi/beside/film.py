"""Films of exact moments: what each picture shows is the state that a run to its time would end in."""

from typing import TYPE_CHECKING, Any, Protocol

from mpp_taichi.beside.difference import Difference
from mpp_taichi.beside.half_frame import Moment
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.scene import timeline
from mpp_taichi.snapshot import Snapshot

if TYPE_CHECKING:
    from mpp_taichi.beside.view import TwoHalves
    from mpp_taichi.simulation.simulation import Simulation


class ExactFilm(FilmRecorder):
    """A film whose pictures between two steps are of states that the method has led to, by one shorter step.

    Positions x + v δ are near enough to be looked at, but are off by ½ a δ², beside which the difference of two methods would
    not be seen. The run goes on from its last whole step, and keeps every bit.
    """

    same_time = timeline.SAME_TIME

    def _between(self, simulation: "Simulation", offset: float) -> Snapshot:
        before = simulation.bookmark()
        try:
            simulation.run(until=self._due_time())
            return simulation.snapshot()
        finally:
            simulation.go_back(before)


class Other(Protocol):
    """The other run: `Companion`."""

    def moment(self) -> Moment:
        """Its next moment."""


class BesideFilm(ExactFilm):
    """The film of one run with another beside it, which is at the same times."""

    def __init__(self, view: "TwoHalves | None", *given: Any, other: Other, difference: Difference | None, **more: Any) -> None:
        """As a film; `difference` is told of every pair of moments."""
        super().__init__(view, *given, **more)
        self._halves, self._other, self._difference = view, other, difference

    def _show(self, simulation: "Simulation", snapshot: Snapshot) -> None:
        with self.stopwatch("beside"):
            moment = self._other.moment()
        if self._difference is not None:
            self._difference.add(self._due_time(), snapshot, moment.place, moment.present)
        if self._halves is not None:
            self._halves.other = moment.frame
        super()._show(simulation, snapshot)
