"""The film of a run from its archive, with any view: its moments are computed again, from the last record before them."""

import argparse
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._excerpt import Excerpt
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._terminal import UsageError
from mpp_taichi.scene.load import load_resolved
from mpp_taichi.simulation.resume import scene_of
from mpp_taichi.simulation.run_archive import FoundRun
from mpp_taichi.views.renderers import RENDERERS
from mpp_taichi.wording.told_apart import told_apart

if TYPE_CHECKING:
    from mpp_taichi.cli._session import Outcome
    from mpp_taichi.scene.spec import SceneSpec

DRAWN = re.compile(r"\s*\+?(view|record)\s*[.\[=]")  # what a film may show in another way than the run did


def check_overrides(overrides: Sequence[str]) -> None:
    """Refuse changes of the motion.

    Raises:
        UsageError: a change is of something else than the view or the film.
    """
    for each in overrides:
        if not DRAWN.match(each):
            raise UsageError(f"replay --set {each}: only view… and record… can be changed, since the run is what it was")


def record_film(arguments: argparse.Namespace) -> "Outcome":
    """Record the film that is asked for.

    Raises:
        UsageError: the times are not those of the run.
        MppError: the archive cannot be read, or the run cannot be started here.
    """
    from mpp_taichi.cli._amounts import check_frames
    from mpp_taichi.cli._session import run_scene

    found = FoundRun(arguments.archive, to_append=False)
    try:
        header, times, ended = found.header, found.times, found.has_ended
        if not header or not times:
            raise UsageError(f"{arguments.archive}: it has no state")
        spec = load_resolved(scene_of(header, found.state()), header["source"], overrides=arguments.overrides)
        options: Mapping[str, Any] = header["options"]
        goal = Goal.of(spec, options.get("until"), options.get("steps"))
        first = times[0] if "rewound" in header else 0.0  # of what was before, the archive knows nothing
        goal = replace(goal, begin=first)
        excerpt = None
        if first > 0.0 or not (ended and options and arguments.begin is None and arguments.until is None):
            excerpt = _excerpt(arguments, goal, spec, found, last_time=math.inf if ended and options else times[-1])
    finally:
        found.close()
    request = _request(arguments, header, spec, goal, excerpt)
    check_frames(spec, request)
    return run_scene(spec, request)


def _excerpt(arguments: argparse.Namespace, goal: Goal, spec: "SceneSpec", found: FoundRun, *, last_time: float) -> Excerpt:
    path: Path = arguments.archive
    first = goal.begin
    last = min(last_time, first + goal.span(spec)) if not goal.endless else last_time
    begin = first if arguments.begin is None else arguments.begin
    end = last if arguments.until is None else arguments.until
    if not first <= begin < end <= last * (1.0 + 1e-12):
        begins, ends, earliest, latest = told_apart(begin, end, first, last, digits=9)
        raise UsageError(f"{path}: a film from t = {begins} to {ends} is not within the run, {earliest} to {latest}")
    earlier = [number for number, time in enumerate(found.times) if time <= begin]
    return Excerpt(path, found.state(earlier[-1]) if earlier else None, begin, end)


def _request(
    arguments: argparse.Namespace, header: Mapping[str, Any], spec: "SceneSpec", goal: Goal, excerpt: Excerpt | None
) -> Request:
    """The request of the run, with a film in place of its files; a part of a run takes its share of the film's frames."""
    options, film = header["options"], header["options"].get("film", {})
    fps = arguments.fps or film.get("fps") or spec.record.fps
    seconds = arguments.duration
    if seconds is None:
        seconds = film["frames"] / film["fps"] if film else spec.record.seconds
        if excerpt is not None and not goal.endless:
            seconds = max(2.0 / fps, seconds * (excerpt.end - excerpt.begin) / goal.span(spec))
    size = arguments.size or (tuple(film["size"]) if film else None)
    renderer = arguments.renderer or film.get("renderer") or RENDERERS[0]
    if arguments.renderer is None and all(path is None for path in (arguments.video, arguments.frames)):
        renderer = RENDERERS[0]  # a page has no renderer
    own = {} if excerpt is not None else {name: options.get(name) for name in ("until", "steps")}
    return Request(
        **{name: header[name] for name in ("backend", "precision", "plan")},
        **{name: getattr(arguments, name) for name in ("video", "frames", "html", "threads", "quiet")},
        **own,
        size=size,
        renderer=renderer,
        fps=fps,
        film_seconds=seconds,
        every=options.get("asked_every"),
        force=bool(options.get("force", False)),
        allow_inaccurate=True,
        rewind=excerpt,
        start_digest=header["start"],
    )
