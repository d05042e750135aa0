"""Pairs of groups of particles between which a force acts: which pairs they are, for kernels and for NumPy alike."""

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

Term = TypeVar("Term")
Group = tuple[int, int]
"""First index and count."""


def shares(first: Group, second: Group) -> list[tuple[Group, Group, float]]:
    """(particles that respond, particles that act, sign) of the terms whose sum is 1 for pairs of both groups, and else 0."""
    if first == second:
        return [(first, first, 1.0)]
    begin, end = max(first[0], second[0]), min(first[0] + first[1], second[0] + second[1])
    both = [((begin, end - begin), (begin, end - begin), -1.0)] if end > begin else []
    return [(first, second, 1.0), (second, first, 1.0), *both]


def between_groups(term: Term, between: Any) -> list[Term]:
    """The terms of a force between two groups, which together are the force; the term itself where it acts between all.

    A term is a dataclass with `source` and `response`, (…, N).
    """
    if between is None:
        return [term]
    one: Any = term
    everyone = np.arange(one.source.shape[-1])
    return [
        replace(one, source=sign * one.source * is_in(acting, everyone), response=one.response * is_in(responds, everyone))
        for responds, acting, sign in shares(*between)
    ]


def is_in(group: Group, index: Any) -> Any:
    """Whether particles belong to a group."""
    index = np.asarray(index)
    return (index >= group[0]) & (index < group[0] + group[1])


def acts(entry: Any, first: Any, second: Any) -> Any:
    """Whether a force acts between these particles; between all where it names no groups."""
    between = entry.parameters.get("between")
    if between is None:
        return np.ones(np.shape(first), bool)
    a, b = between
    return (is_in(a, first) & is_in(b, second)) | (is_in(b, first) & is_in(a, second))
