"""Offers: the step with which each method would just reach an error, between two of its runs or a little beyond the last."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mpp_taichi.accuracy.front import StudyRow

BEYOND = 100.0  # times the aim: the largest error of a last run from which a finer step is extrapolated
LEAST_POWER = 0.5  # of the fineness, with which errors fall where they can be extrapolated


@dataclass(frozen=True)
class Offer:
    """A method in a precision, with the fineness at which it is expected to reach an aim.

    fineness   steps over the span, or 1 / tolerance of an adaptive method
    power      of the fineness with which the error falls; None where only one run is known
    is_known   whether a run has reached the aim; else its error is extrapolated
    """

    integrator: str
    precision: str
    backend: str
    fineness: float
    seconds: float
    power: float | None = None
    is_known: bool = True


def offers_for(rows: Sequence[StudyRow], quantity: str, aim: float) -> list[Offer]:
    """The offer of each method and precision whose runs lie on both sides of the aim, all reach it, or come close to it.

    A ladder that the budget cut short may end close to the aim: its errors are extrapolated, and a trial shows whether they
    fall further.
    """
    groups: dict[tuple[str, str, str], list[StudyRow]] = {}
    for row in rows:
        configuration = row.sample.configuration
        if row.sample.status == "ok" and row.seconds is not None and math.isfinite(row.error(quantity).bound):
            groups.setdefault((configuration.integrator, configuration.precision, configuration.backend), []).append(row)
    offers = []
    for names, group in groups.items():
        group.sort(key=lambda row: row.sample.configuration.fineness)
        reaching = next((k for k, row in enumerate(group) if row.error(quantity).bound <= aim), None)
        if reaching is not None:
            offers.append(Offer(*names, *_between(group[reaching - 1] if reaching else None, group[reaching], quantity, aim)))
        elif (found := _beyond(group, quantity, aim)) is not None:
            offers.append(Offer(*names, *found, is_known=False))
    return offers


def _beyond(group: Sequence[StudyRow], quantity: str, aim: float) -> tuple[float, float, float | None] | None:
    """`_between`, extrapolated from the last two of the runs, none of which reaches the aim; None where nothing promises it."""
    if len(group) < 2 or not aim > 0.0:
        return None
    coarse, fine = group[-2], group[-1]
    before, error = coarse.error(quantity).value, fine.error(quantity).value
    if before is None or error is None or not 0.0 < error < min(before, BEYOND * aim):
        return None
    found = _between(coarse, fine, quantity, aim)
    return found if found[2] is not None and found[2] > LEAST_POWER else None


def _between(coarse: StudyRow | None, fine: StudyRow, quantity: str, aim: float) -> tuple[float, float, float | None]:
    """Fineness and seconds at which the error equals the aim, by power laws between two runs, and the power of the error."""
    assert fine.seconds is not None
    finest = fine.sample.configuration.fineness
    if coarse is None or coarse.seconds is None or fine.error(quantity).value is None:
        return finest, fine.seconds, None
    fall = math.log(coarse.error(quantity).bound / fine.error(quantity).bound)
    part = math.log(aim / fine.error(quantity).bound) / fall
    coarsest = coarse.sample.configuration.fineness

    def mixed(of_fine: float, of_coarse: float) -> float:
        return of_fine ** (1.0 - part) * of_coarse**part

    return mixed(finest, coarsest), mixed(fine.seconds, coarse.seconds), fall / math.log(finest / coarsest)
