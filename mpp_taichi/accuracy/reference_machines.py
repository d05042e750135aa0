"""The device, the share of a budget and the compiled methods of a reference, of positions and of other quantities alike."""

import logging

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import StudyMethod
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.errors import BackendError, MppError

log = logging.getLogger(__name__)

DEVICE = ("cpu", "f64")
SHARE = 0.3  # of the budget
MOST_BUDGETS = 4.0  # that a reference may take, since without a reference nothing can be compared


def machine_of(bench: Workbench, name: str, methods: dict[str, StudyMethod], budget: Budget) -> Machine | None:
    """The compiled method of this name; None where the scene does not allow it.

    Raises:
        OutOfTime: the budget ended before the compiler, which is not cut off.
    """
    if name not in methods:
        return None
    if name not in bench.machines:
        budget.check()
    try:
        return bench.machine(name)
    except BackendError:
        raise
    except MppError as error:
        log.info("%s is no reference here: %s", name, error)
        return None
