"""Meanings: what the names of a formula stand for, which are numbers and functions through points."""

from collections.abc import Mapping

from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.scene.expressions import Expression, parse

Meanings = tuple[tuple[str, float | PointFunction], ...]
"""The names of a formula, each with what it stands for."""


def parsed(text: str, meanings: Meanings | Mapping[str, float | PointFunction]) -> Expression:
    """The expression of a formula, which may call the functions among what its names stand for."""
    return parse(text, frozenset(name for name, value in dict(meanings).items() if isinstance(value, PointFunction)))
