"""Worker: the run of the right half; its moments go to standard output.

Run as `python -m mpp_taichi.beside.worker`, with an order in JSON on standard input: `scene`, `source`, `folder`, `options`,
`span` and `count`. It answers with `ready`, `count` times `moment`, and `end`, or with `failed`; a `warning` may come at any
time.
"""

import json
import logging
import os
import sys
from contextlib import nullcontext
from dataclasses import replace
from typing import IO, Any

from mpp_taichi.beside.film import ExactMoments
from mpp_taichi.beside.half_frame import MomentSender
from mpp_taichi.beside.wire import send
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.device.with_parent import end_with_parent
from mpp_taichi.errors import INTERNAL_ERROR_CODE, MppError
from mpp_taichi.recorders.film import FilmRecorder
from mpp_taichi.scene.load import load_scene

LONGEST_WORDS = 300


class WarningSender(logging.Handler):
    """Sends the warnings of the program to the parent."""

    def __init__(self, stream: IO[bytes]) -> None:
        """Send warnings, and nothing below them."""
        logging.Handler.__init__(self, logging.WARNING)
        self._stream = stream

    def emit(self, record: logging.LogRecord) -> None:
        """Send a warning."""
        send(self._stream, {"kind": "warning", "text": record.getMessage()})


def follow(order: dict[str, Any], stream: IO[bytes]) -> None:
    """Run the scene of an order."""
    import_taichi()  # quietly, before anything else imports it
    from mpp_taichi.simulation.simulation import Simulation

    os.chdir(order["folder"])  # where files that the scene names are
    spec, span, count = replace(load_scene(order["scene"]), source=order["source"]), order["span"], order["count"]
    with Simulation(spec, **order["options"]) as simulation:
        simulation.judge.use_log()
        if count > 1:
            simulation.sample_at_multiples_of(span / (count - 1))
        device = simulation.device
        facts = {"backend": device.backend, "device": device.name, "precision": device.precision, "threads": device.threads}
        facts |= {"plan": simulation.plan, "integrator": simulation.spec.integrator.name, "dt": simulation.dt}
        send(stream, {"kind": "ready", **facts, "particle_count": simulation.start.particle_count})
        film = FilmRecorder(
            None, (), count, span, moments=[MomentSender(stream)], between=ExactMoments(), stopwatch=lambda _: nullcontext()
        )
        simulation.run(until=span, recorders=[film])
        film.finish(simulation)
        send(stream, {"kind": "end", "steps": simulation.step_count})


def main() -> None:
    """Follow the order; an error is the last message."""
    end_with_parent()
    with os.fdopen(os.dup(1), "wb") as stream:
        os.dup2(2, 1)  # output of libraries goes to standard error
        logging.getLogger("mpp_taichi").addHandler(WarningSender(stream))
        try:
            follow(json.load(sys.stdin), stream)
        except BrokenPipeError:
            os._exit(0)  # the parent has ended
        except MppError as error:
            send(stream, {"kind": "failed", "text": " ".join(str(error).split()), "exit_code": error.exit_code})
        except Exception as error:  # Taichi and drivers raise errors of any class
            text = f"{type(error).__name__}: {' '.join(str(error).split())[:LONGEST_WORDS]}"
            send(stream, {"kind": "failed", "text": text, "exit_code": INTERNAL_ERROR_CODE})


if __name__ == "__main__":
    main()
