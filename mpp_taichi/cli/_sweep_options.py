"""Sweep options: --vary, --sample, --measure and --stop of the command line, as the block `sweep:` of a scene."""

import argparse
from collections.abc import Mapping
from typing import Any

from mpp_taichi.cli._terminal import UsageError
from mpp_taichi.errors import SceneError

KINDS = ("random", "sobol")
REFINED = 0.05


def add_plan(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    group = parser.add_argument_group("which members, in place of the scene's sweep:")
    group.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="PATH=VALUES",
        help="values of a key: A:B:N, N values from A to B; log:A:B:N in equal ratios; or [A, B, …]; repeatable",
    )
    group.add_argument(
        "--zip", action="store_true", help="take the first values together, then the second, in place of all pairs"
    )
    group.add_argument(
        "--sample", metavar="KIND:N", help="draw N values between A and B of --vary PATH=A:B: random:N or sobol:N"
    )
    group.add_argument(
        "--refine",
        type=_share,
        nargs="?",
        const=REFINED,
        metavar="SHARE",
        help="run a coarse grid first, and refine it only where the status of neighbours differs, or a measure by more than "
        f"this share of its range; SHARE absent: {REFINED}",
    )
    group.add_argument("--seed", type=int, metavar="S", help="seed of --sample; absent: 0")
    group.add_argument(
        "--measure",
        action="append",
        default=[],
        metavar="QUANTITY",
        help="result of a member: end_time, or distance: {of: planet, when: largest}; repeatable",
    )
    group.add_argument(
        "--stop",
        action="append",
        default=[],
        metavar="QUANTITY",
        help="a member ends when it leaves its bounds: distance: {of: planet, below: 3}; repeatable",
    )


def block_of(arguments: argparse.Namespace, written: Any) -> dict[str, Any] | None:
    """The block `sweep:` as plain data: the block that the scene has, if any, in which options replace the keys of their names.

    Raises:
        UsageError: an option cannot be read.
    """
    block: dict[str, Any] = dict(written) if isinstance(written, Mapping) else {}
    given = any((arguments.vary, arguments.zip, arguments.sample, arguments.measure, arguments.stop, arguments.refine))
    if not block and not given:
        return None
    if arguments.vary:
        block = {key: value for key, value in block.items() if key not in ("vary", "combine", "sample")}
        block["vary"] = dict(_vary(text, sampled=arguments.sample is not None) for text in arguments.vary)
    if arguments.zip:
        block["combine"] = "zipped"
    if arguments.sample:
        block["sample"] = _sample(arguments.sample, arguments.seed)
    elif arguments.seed is not None:
        if not isinstance(block.get("sample"), Mapping):
            raise UsageError("sweep: --seed belongs to a sample; --set seed=… sets the seed of the scene")
        block["sample"] = {**block["sample"], "seed": arguments.seed}
    if arguments.refine is not None:
        block["refine"] = arguments.refine
    for key in ("measure", "stop"):
        if given_texts := getattr(arguments, key):
            block[key] = [_value(text, f"--{key}") for text in given_texts]
    if "vary" not in block:
        raise UsageError("sweep: nothing varies; --vary PATH=A:B:N says which key of the scene, and its values")
    return block


def _vary(text: str, *, sampled: bool) -> tuple[str, Any]:
    path, equals, values = text.partition("=")
    values = values.strip()
    if not (equals and path.strip() and values):
        raise UsageError(f"sweep: --vary {text}: must be PATH=A:B:N, as in constants.distance=0.3:1.2:50, or PATH=[A, B, …]")
    if values.startswith("["):
        found = _value(values, f"--vary {path}")
        return path.strip(), found
    scale = "linear"
    for prefix in ("log:", "linear:"):
        if values.startswith(prefix):
            scale, values = ("logarithmic" if prefix == "log:" else "linear"), values[len(prefix) :]
    parts = values.split(":")
    if len(parts) != (2 if sampled else 3) or not all(part.strip() for part in parts):
        raise UsageError(
            f"sweep: --vary {text}: must be {'PATH=A:B with --sample' if sampled else 'PATH=A:B:N or PATH=[A, B, …]'}"
        )
    read = [_value(part, f"--vary {path}") for part in parts]
    found = {"from": read[0], "to": read[1], "scale": scale}
    return path.strip(), found if sampled else {**found, "count": read[2]}


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = -1.0
    if not 0.0 <= share <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} must be a number from 0 to 1")
    return share


def _sample(text: str, seed: int | None) -> dict[str, Any]:
    kind, _, count = text.partition(":")
    if kind not in KINDS or not count:
        raise UsageError(f"sweep: --sample {text}: must be random:N or sobol:N")
    return {kind: _value(count, "--sample"), "seed": seed or 0}


def _value(text: str, option: str) -> Any:
    """A value written as in a scene."""
    import yaml

    from mpp_taichi.scene.document import read_value
    from mpp_taichi.scene.location import Location

    try:
        return read_value(text, Location(option, 0, 0)).plain()
    except (SceneError, yaml.YAMLError) as error:
        raise UsageError(f"sweep: {' '.join(str(error).split())}") from None
