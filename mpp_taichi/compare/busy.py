"""Busy: warnings that timings mean little, because others use the machine or because they scatter."""

from collections.abc import Mapping

QUIET_SHARE = 0.25  # of the processors that other programs may use before a comparison begins
QUIET_SPREAD = 0.1  # interquartile range over median


def warnings(load: float | None, processors: int, spreads: Mapping[str, float]) -> list[str]:
    """Warnings about the reliability of the times.

    `load` is the system's load average before the comparison began, None where the system does not give it; `spreads` are
    interquartile ranges of the repeats over their median, by row.
    """
    found = []
    if load is not None and load > QUIET_SHARE * processors:
        found.append(
            f"the machine was busy before the comparison began: load average {load:.2f} on {processors} processors; "
            "all times are too long by the share that other programs used"
        )
    loose = {name: spread for name, spread in spreads.items() if spread > QUIET_SPREAD}
    if loose:
        told = ", ".join(f"{name} {100 * spread:.0f} %" for name, spread in loose.items())
        found.append(f"repeated times have an interquartile range above {100 * QUIET_SPREAD:.0f} % of their median: {told}")
    return found
