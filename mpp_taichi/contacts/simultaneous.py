"""Time-stepped hard spheres; all contacts that touch at one instant are resolved together."""

from mpp_taichi.component import component, param
from mpp_taichi.contacts.sweep.group_sweep import GroupSweep
from mpp_taichi.contacts.sweep.solver import SweepSolver


@component
class Simultaneous(SweepSolver):
    """Straight flights from instant to instant of contact within a drift, and what touches then is resolved as a group.

    Groups are resolved by generalized reflections (`reflections.py`): independent of numbering, symmetric where the scene
    is, energy kept where e = 1, and a row of touching balls passes on as many as come in. Two spheres that meet alone are
    treated as `swept` treats them, at the exact time of contact. Not for piles: a group of more than 512 contacts that approach
    together is given up, and spheres that rest on each other under gravity are better held by `resting`.
    """

    restitution: float = param(1.0, minimum=0.0, maximum=1.0, help="e, relative speed after over before; 1: elastic")
    contact_time: float = param(
        0.0, minimum=0.0, unit="time", help="t_c: contacts within it after the last are elastic; 0: off"
    )
    event_limit: int = param(
        1_000_000, minimum=1, help="contacts of one connected group in a drift, beyond which it is given up"
    )

    sweep_kind = GroupSweep
    order = 2
