"""Horizon: the result of the search, as data and as a sentence."""

from dataclasses import asdict, dataclass
from typing import Any

LIMIT = 1e-3  # of the system's size: the largest error of a position that still has a meaning


@dataclass(frozen=True)
class Horizon:
    """The time until which no position is farther than LIMIT of the system's size from the exact solution of the scene.

    found     "before_end": `time` is the horizon; "after_end": the error stays below LIMIT; "extrapolated": `time` is where the
              error goes if it grows on as in the first `part` of the run; "unknown": `reason` says why nothing can be said
    by        "step" or "rounding", the cause of the larger error; None where it is not known
    error     estimate of the largest error at `time`, or at the end of the followed part [of the system's size]
    part      part of the run that the reruns followed, 0 … 1
    share     work of the search over the work of the run
    """

    found: str
    end: float
    time: float | None = None
    by: str | None = None
    error: float | None = None
    part: float = 0.0
    share: float = 0.0
    reason: str = ""

    def facts(self) -> dict[str, Any]:
        """The result as plain data."""
        return {**asdict(self), "limit": LIMIT, "sentence": self.line()}

    def line(self) -> str:
        """The result as a sentence."""
        if self.found == "after_end":
            return f"positions are valid to the end, t = {self.end:.6g}: their error stays below {LIMIT:g} of the system's size"
        if self.found == "unknown":
            return f"the time until which positions are valid was not found: {self.reason}"
        cause = {"step": " by the step", "rounding": " by rounding", None: ""}[self.by]
        later = f"then the error{cause} exceeds {LIMIT:g} of the system's size"
        how = f"; extrapolated from the first {self.part:.1%} of the run" if self.found == "extrapolated" else ""
        return f"positions are valid until t ≈ {self.time:.3g}; {later}{how}"

    def caption(self) -> str:
        """A short line for pictures; empty where nothing before the end is known."""
        return "" if self.time is None else f"valid until t ≈ {self.time:.3g}"

    def is_beyond(self, time: float) -> bool:
        """Whether positions at a time have an error above LIMIT."""
        return self.time is not None and time > self.time
