"""The archive of a run of the command line, out/SCENE.run: kept while the run goes on, and found by the same command again."""

import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from mpp_taichi.archive import object_state
from mpp_taichi.cli._differences import differences
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._options import archive_path
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._terminal import UsageError, say
from mpp_taichi.errors import StateError
from mpp_taichi.simulation.run_archive import FoundRun, RunArchive, header_of
from mpp_taichi.simulation.run_output import RunOutput
from mpp_taichi.views.renderers import needs_ggui

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

MOST_TOLD = 5  # keys that differ
OUTPUT_OPTIONS = ("trajectory", "video", "frames", "still", "html")


class KeptRun:
    """The archive of one run: it goes on from an unfinished run of the same command, and writes its own records."""

    def __init__(
        self,
        simulation: "Simulation",
        request: Request,
        goal: Goal,
        every: int,
        objects: Mapping[str, Any],
        outputs: Mapping[str, RunOutput],
    ) -> None:
        """`objects` are the recorders whose samples belong to the run, and `outputs` its films and trajectories, by name."""
        options: dict[str, Any] = {
            "until": goal.until,
            "steps": goal.steps,
            "every": every,
            "asked_every": request.every,
            "force": request.force,
            "recorders": sorted(objects),
            "energy_balance": simulation.energy_balance is not None,
            **{name: str(path) for name in OUTPUT_OPTIONS if (path := getattr(request, name)) is not None},
        }
        if request.films:
            spec = simulation.scene
            size, fps = request.size or spec.record.size, request.fps or spec.record.fps
            options["film"] = {"size": list(size), "fps": fps, "frames": request.frame_count(spec)}
            if needs_ggui(request.renderer):  # archives of other films are as before there was a choice
                options["film"]["renderer"] = request.renderer
        self.path = request.archive_at or archive_path(simulation.scene.source)
        self.may_end = request.archive_at is None
        header = header_of(simulation, options)
        rewind = request.rewind
        if rewind is not None and request.is_new:
            options["rewound"] = {"from": str(rewind.file), "step": simulation.step_count, "dt": simulation.dt}
            header |= {"options": options, **rewind.header}  # type: ignore[union-attr]  # a new run has no Excerpt
        self.archive = RunArchive(self.path, header, objects, outputs=outputs)
        self._objects, self._outputs, self._request = dict(objects), dict(outputs), request

    def go_on(self, simulation: "Simulation") -> dict[str, Any] | None:
        """Go to the last record of an unfinished run; where it was, or None where there is no such run: films begin anew.

        Raises:
            UsageError: the unfinished run is of another scene, or had other options.
            StateError: the file is no archive of a run.
        """
        found = self._found()
        if found is None:
            for output in self._outputs.values():
                output.begin_anew()
            return None
        self._require_same(found)
        from mpp_taichi.simulation.moment import go_to

        state = found.state()
        go_to(simulation, state["moment"])
        try:
            object_state.restore(state["samples"], self._objects)
            for name, output in self._outputs.items():
                output.go_on(simulation, state["outputs"][name], found.news(name))
        except (StateError, KeyError, TypeError, ValueError) as error:
            found.close()
            told = error if isinstance(error, StateError) else f"the archive is damaged: {error!r}"
            raise StateError(f"{self.path}: {told}; --fresh begins anew") from None
        self.archive.go_on(found)
        torn = f"; a record that was being written, {found.torn:,} bytes, is lost" if found.torn else ""
        if not self._request.quiet:
            say(f"going on with {self.path} from step {state['step']:,}, t = {state['time']:.9g}{torn}; --fresh begins anew")
        return {"file": str(self.path), "time": state["time"], "step": state["step"], "torn_bytes": found.torn}

    def _found(self) -> FoundRun | None:
        """The unfinished run; an archive that is not to be gone on with is removed."""
        if not self.path.is_file():
            return None
        rewind = self._request.rewind
        if rewind is not None and not rewind.goes_on:
            return None  # it is replaced by the first record of this run
        if not self._request.fresh:
            found = FoundRun(self.path)
            if not found.has_ended:
                return found
            found.close()
        self.path.unlink()
        return None

    def _require_same(self, found: FoundRun) -> None:
        old, new = dict(found.header), dict(self.archive.header)
        versions = differences(old.pop("versions", {}), new.pop("versions"))
        devices = differences({"device": old.pop("device", "")}, {"device": new.pop("device")})
        old.pop("source", None), new.pop("source")
        old.pop("rewound", None), new.pop("rewound", None)  # states; the options say which
        old.pop("format", None), new.pop("format")  # an older one can be read
        known = {*OUTPUT_OPTIONS, "film", *"rewound", *old["options"]}  # the others, an earlier version knew nothing of
        new["options"] = {name: value for name, value in new["options"].items() if name in known}
        if differing := differences(old, new):
            found.close()
            told = "; ".join(differing[:MOST_TOLD]) + ("; …" if len(differing) > MOST_TOLD else "")
            raise UsageError(f"{self.path} is of another run ({told}): --fresh begins anew and replaces it")
        for each in (*versions, *devices):
            say(f"note: {self.path} was written with another {each}: the last bits of the results may differ")

    @contextmanager
    def listening(self) -> Iterator[None]:
        """A block in which SIGUSR1 asks for a record."""
        number = getattr(signal, "SIGUSR1", None)
        if number is None or threading.current_thread() is not threading.main_thread():
            yield
            return
        before = signal.signal(number, lambda *_: self.archive.ask())
        try:
            yield
        finally:
            signal.signal(number, before if before is not None else signal.SIG_DFL)


def is_kept(request: Request, goal: Goal) -> bool:
    """Whether a run keeps an archive: a run of one scene from its start to an end, without a window."""
    unlike = request.window or request.beside is not None
    return request.archive and not (unlike or goal.endless)
