"""Catalogue: every case of the folder `cases/`, in the order of the report."""

import importlib

from mpp_taichi.verify.case import GROUPS, Case


def cases() -> list[Case]:
    """All cases: of each module those that stand there, alone or in a list."""
    found: list[Case] = []
    for group in GROUPS:
        for each in vars(importlib.import_module(f"mpp_taichi.verify.cases.{group}")).values():
            several = each if isinstance(each, list) else [each]
            found += [case for case in several if isinstance(case, Case) and case.group == group]
    return found
