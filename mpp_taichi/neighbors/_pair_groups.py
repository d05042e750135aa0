"""Pair forces sorted by softening: forces of one softening share one inverse distance."""

from collections.abc import Sequence
from typing import Any

from mpp_taichi.device.fast_taichi.explicit_vectors import is_elementwise


class GroupMember:
    """A force, its place among all forces, and whether its shape takes whole vectors."""

    def __init__(self, index: int, force: Any) -> None:
        self.index = index
        self.force = force
        self.elementwise = takes_lanes(force)


class SofteningGroup:
    """The forces of one softening."""

    def __init__(self, softening: float, members: Sequence[GroupMember]) -> None:
        self.softening_squared = softening * softening
        self.members = tuple(members)


def grouped(pair_forces: Sequence[Any]) -> tuple[tuple[GroupMember, ...], tuple[SofteningGroup, ...]]:
    """All members in the order of the forces, and the groups that the members form."""
    members = tuple(GroupMember(index, force) for index, force in enumerate(pair_forces))
    softenings = dict.fromkeys(float(force.softening) for force in pair_forces)
    return members, tuple(SofteningGroup(s, [m for m in members if float(m.force.softening) == s]) for s in softenings)


def takes_lanes(force: Any) -> bool:
    """Whether the shape of a force may get a vector of lanes in place of a number."""
    known: bool | None = getattr(force, "takes_lanes", None)
    return is_elementwise(type(force).shape) if known is None else known


def derivatives_take_lanes(force: Any) -> bool:
    """Whether slope and curvature of a force may get a vector of lanes in place of a number."""
    known: bool | None = getattr(force, "derivatives_take_lanes", None)
    return known if known is not None else is_elementwise(type(force).slope) and is_elementwise(type(force).curvature)
