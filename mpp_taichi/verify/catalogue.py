"""Catalogue: every case of the folder `cases/`, in the order of the report."""

import importlib

from mpp_taichi.verify.case import GROUPS, Case


def cases() -> list[Case]:
    """All cases; a case of a module counts by being there."""
    found = []
    for group in GROUPS:
        module = importlib.import_module(f"mpp_taichi.verify.cases.{group}")
        found += [each for each in vars(module).values() if isinstance(each, Case)]
    return found
