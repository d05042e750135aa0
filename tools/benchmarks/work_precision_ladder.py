"""What the contenders of benchmark_work_precision.py share: numbers of steps, tolerances, and when a run is warm."""

import numpy as np

HALF_DECADES = 10.0 ** -np.arange(2, 16.5, 0.5)
LADDER = 10.0 ** (1 / 6)  # steps of a run over steps of the run before
WARMED = 0.1  # seconds; what takes longer is warm most of the time
COARSEST = 20  # evaluations of the force in a period
COARSEST_CENTRED = 4  # where the motion about the centre is solved exactly


def step_counts(problem, evaluations, *, centred):
    """Numbers of steps, from a coarse run to the dearest."""
    count, found = problem.periods * max((COARSEST_CENTRED if centred else COARSEST) / evaluations, 1.0), []
    while count * evaluations < problem.finest:
        found.append(round(count))
        count *= LADDER
    return found


def warm(once):
    """Seconds of the third time in a row where it takes milliseconds: caches and predictors are cold after other runs."""
    seconds = once()
    for _ in range(2):
        seconds = once() if seconds < WARMED else seconds
    return seconds
