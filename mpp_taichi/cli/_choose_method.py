"""Scenes with an `accuracy:`: the choice of integrator, step and precision before they run."""

import argparse
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli import _options
from mpp_taichi.cli._terminal import say

if TYPE_CHECKING:
    from mpp_taichi.scene.spec import SceneSpec


def settled(spec: "SceneSpec", arguments: argparse.Namespace) -> tuple["SceneSpec", str | None, dict[str, Any]]:
    """The scene with the chosen method, its precision, and the facts of the choice; unchanged for a scene without a target."""
    if spec.accuracy is None:
        return spec, arguments.precision, {}
    from dataclasses import asdict, replace

    from mpp_taichi.accuracy.choice import choose
    from mpp_taichi.cli._signals import Interruption

    tell = (lambda _: None) if arguments.quiet else say
    precisions = (arguments.precision,) if arguments.precision else ("f64", "f32")
    folder = _options.OUTPUT_FOLDER / f"{_options.output_stem(spec.source)}.accuracy"
    with Interruption() as interruption:
        found = choose(spec, folder, precisions=precisions, look=interruption.raise_if_any, tell=tell)
    tell(found.line())
    chosen = found.settle(spec)
    if chosen.horizon is None:
        chosen = replace(chosen, horizon=True)
    return chosen, found.precision, {"accuracy": asdict(found)}
