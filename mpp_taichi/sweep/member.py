"""Member: one copy of a scene with its values, and the row of a table that it leaves."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from mpp_taichi.errors import MppError
from mpp_taichi.scene.load import load_resolved
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble

OK, STOPPED, BROKEN, DIVERGED, STALLED, REFUSED = STATUSES = ("ok", "stopped", "broken", "diverged", "stalled", "refused")
"""Outcomes of a member.

ok        it reached the end of its run
stopped   a condition of `stop:` held, before the end
broken    it reached the end, and a measured quantity is beyond a bound that `measure:` gives it
diverged  a position or velocity is no finite number, or an implicit step was not solved
stalled   an adaptive step has become too short to change the time
refused   the scene with these values cannot be run
"""
UNREAD = ("view", "title", "description", "record", "inspect", "sliders", "modes", "expect")
"""Keys of a scene that no result of a member depends on."""


@dataclass(frozen=True, eq=False)
class Member:
    """A member that can be run: its number, its scene, its particles at the start."""

    number: int
    spec: SceneSpec
    start: Snapshot


@dataclass(eq=False)
class MemberRow:
    """The results of a member.

    values     one for each measure; NaN where the measure is not defined
    time       at which the member ended [time]
    steps      done until then
    particle   which broke down, −1 where none did
    reason     in words, where the status is not ok
    """

    number: int
    status: str
    values: list[float] = field(default_factory=list)
    time: float = 0.0
    steps: int = 0
    particle: int = -1
    reason: str = ""


def scene_of(resolved: Mapping[str, Any], source: str, values: Mapping[str, Any]) -> SceneSpec:
    """The scene of a member, without pictures and promises, which hold for the scene as it is written.

    Raises:
        SceneError: the scene cannot have these values.
    """
    block = {key: value for key, value in resolved["sweep"].items() if key in ("measure", "stop")}
    unread = UNREAD if block.get("measure") else (*UNREAD[:-1],)  # without measure: the quantities of expect: are measured
    plain = {key: value for key, value in resolved.items() if key not in unread}
    plain["sweep"] = {**block, "vary": {"member": [0]}}  # a list of all values would be read again for every member
    return load_resolved(plain, source, overrides=dict(values))


def whole_scene(resolved: Mapping[str, Any], source: str, values: Mapping[str, Any]) -> SceneSpec:
    """The scene of a member with its pictures, to be run, filmed or opened in the window by itself."""
    plain = {key: value for key, value in resolved.items() if key not in ("sweep", "expect")}
    spec = load_resolved(plain, source, overrides=dict(values))
    told = ", ".join(
        f"{path} = {value:.6g}" if isinstance(value, float) else f"{path} = {value}" for path, value in values.items()
    )
    return replace(spec, title=f"{spec.title}: {told}" if spec.title else told)


def made(number: int, resolved: Mapping[str, Any], source: str, values: Mapping[str, Any]) -> Member | MemberRow:
    """The member, or its row where it is refused."""
    try:
        spec = scene_of(resolved, source, values)
        return Member(number, spec, assemble(spec))
    except MppError as error:
        return refused(number, error)


def refused(number: int, error: Exception | str) -> MemberRow:
    """The row of a member that is not run, with the message on one line."""
    return MemberRow(number, REFUSED, reason=one_line(error))


def one_line(error: Exception | str) -> str:
    """A message without its ends of lines."""
    return " ".join(str(error).split())
