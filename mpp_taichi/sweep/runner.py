"""Runner: the rows of any members, those that can share a launch side by side, the others one after the other."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from mpp_taichi.sweep.alone import run_alone
from mpp_taichi.sweep.member import Member, MemberRow, made
from mpp_taichi.sweep.replicas import Bench, run_together
from mpp_taichi.sweep.structure import Own, key_of, why_alone, with_own


def run_members(
    numbers: Sequence[int],
    values: Sequence[Mapping[str, Any]],
    resolved: Mapping[str, Any],
    source: str,
    bench: Bench,
    own: Own = frozenset(),
) -> list[MemberRow]:
    """The rows of members of a scene, in the order of `numbers`; each has its `values`, path → value.

    `own` are the parameters of forces that vary in the sweep, so that they are loaded from a field in all chunks alike.
    """
    rows: dict[int, MemberRow] = {}
    groups: dict[Hashable, list[Member]] = {}
    for number, given in zip(numbers, values, strict=True):
        member = made(number, resolved, source, given)
        if isinstance(member, MemberRow):
            rows[number] = member
        elif why_alone(member.spec):
            rows[number] = run_alone(member, bench)
        else:
            member = replace(member, spec=with_own(member.spec, own))
            groups.setdefault(key_of(member.spec, member.start, own), []).append(member)
        bench.look()
    for key, members in groups.items():
        for row in run_together(key, members, bench):
            rows[row.number] = row
    return [rows[number] for number in numbers]
