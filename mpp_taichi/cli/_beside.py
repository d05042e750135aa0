"""The right half of a film with `--beside`, controlled by the session of the left half."""

from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from mpp_taichi.beside.companion import Companion
from mpp_taichi.beside.difference import Difference
from mpp_taichi.beside.film import BothHalves, ExactMoments
from mpp_taichi.beside.settings import Beside
from mpp_taichi.cli._terminal import UsageError, say
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.scene.spec import SceneSpec

if TYPE_CHECKING:
    from mpp_taichi.cli._goal import Goal
    from mpp_taichi.cli._request import Request
    from mpp_taichi.simulation.simulation import Simulation

OPTIONS = ("backend", "precision", "plan", "threads", "force")


class RightHalf:
    """Another run of the scene in a process of its own, and its difference from the left half; a context manager."""

    def __init__(self, beside: Beside, spec: SceneSpec, request: "Request", goal: "Goal", look: Callable[[], None]) -> None:
        """Start the right half while the left half starts as well; `look` raises when a signal has been received."""
        self.beside, self._spec, self._request = beside, spec, request
        options = {name: getattr(request, name) for name in OPTIONS} | beside.device
        self._span = goal.span(spec)
        self._companion = Companion(beside, options, self._span, request.frame_count(spec), look)
        self._facts: dict[str, Any] = {}
        self._captions: tuple[Sequence[str], Sequence[str]] = ((), ())
        self.difference: Difference | None = None

    def __enter__(self) -> "RightHalf":
        """Return this half."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End the process of the right half."""
        self._companion.__exit__(kind, error, trace)

    def begin(self, left: "Simulation") -> None:
        """Wait until the right half has started, and find the quantity by which the halves can be compared.

        Raises:
            BesideError: the right half could not be started.
            UsageError: a file of the difference is asked for, but the halves cannot be compared.
        """
        self._facts = self._companion.begin()
        device = left.device
        there = {"backend": device.backend, "precision": device.precision, "plan": left.plan, "threads": device.threads}
        self._captions = self.beside.captions(self._spec, there, self._facts)
        one, other = left.start.particle_count, self._facts["particle_count"]
        if one == other:
            self.difference = Difference(self._spec, left.start, (left.time, left.time + self._span))
            return
        problem = f"{one:,} particles on the left and {other:,} on the right have no distance"
        if self._request.inspect:
            raise UsageError(f"--inspect {self._request.inspect[0]}: {problem} to write")
        if not self._request.quiet:
            say(f"note: {problem} to be plotted")

    def film(self, size: tuple[int, int], sinks: Sequence[Any], count: int, **more: Any) -> FilmRecorder:
        """The film of both halves, with the arguments of an ordinary film."""
        from mpp_taichi.beside.view import TwoHalves

        record = self._spec.record
        plots = [self.difference.plot] if self.difference is not None and record.panels != "none" else []
        view = TwoHalves(
            self._spec.view, size, self._captions, plots, share=record.panel_share, dimensions=self._spec.dimensions
        )
        halves = BothHalves(view, self._companion, self.difference, more["stopwatch"])
        return FilmRecorder(view, sinks, count, self._span, between=ExactMoments(), moments=[halves], **more)

    def end(self) -> None:
        """Check that the right half has reached its end as well.

        Raises:
            BesideError: the right half broke off.
        """
        self._facts |= self._companion.end()

    def save(self, path: Path) -> None:
        """Write the curve of the difference; OutputError if the file cannot be written."""
        assert self.difference is not None
        self.difference.save(path)

    def summary(self) -> dict[str, Any]:
        """The facts of the right half for the summary of the left half."""
        facts = {key: value for key, value in self._facts.items() if key not in ("kind", "particle_count")}
        last = None if self.difference is None else self.difference.last
        return {"beside": {"settings": list(self.beside.said), **facts, "rms_distance": last}}
