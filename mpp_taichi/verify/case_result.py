"""Case result: what one place did with one case, a row of the report."""

import math
import time as clock
import traceback
import warnings
from dataclasses import asdict, dataclass
from typing import Any

from mpp_taichi.errors import BackendError, MppError, UnsupportedError
from mpp_taichi.verify.case import Case
from mpp_taichi.verify.place import Place

SOLVED, REFUSED, FAILED, NOT_HERE = "solved", "refused", "failed", "not here"


@dataclass(frozen=True)
class CaseResult:
    """What a place did with a case.

    status    solved: the number is within its bound; refused: the program said in words why not; failed: a number beyond its
              bound, a refusal where the case has to be solved, or a crash; not here: the backend does not start
    reached, bound, because   see `Found`; None and empty where there is no number
    reason    the words of a refusal or of a failure
    seconds   that the case took, with compilation
    """

    case: str
    backend: str
    precision: str
    status: str
    reached: float | None = None
    bound: float | None = None
    because: str = ""
    reason: str = ""
    seconds: float = 0.0

    @property
    def told(self) -> str:
        """`solved, 3.2e-14 ≤ 6.1e-13`, or `refused: …`."""
        if self.reached is None or self.bound is None:
            return f"{self.status}: {self.reason}"
        sign = "≤" if self.status == SOLVED else ">"
        return f"{self.status}, {self.reached:.2g} {sign} {self.bound:.2g}"

    def facts(self) -> dict[str, Any]:
        """The row as plain data."""
        return asdict(self)


def failed(case: Case, place: Place, reason: str, seconds: float = 0.0) -> CaseResult:
    """The result of a case whose process crashed or gave no answer in time."""
    return CaseResult(case.name, place.backend, place.precision, FAILED, reason=reason, seconds=seconds)


def examine(case: Case, place: Place) -> CaseResult:
    """Ask a case of a place."""
    began = clock.perf_counter()
    known: dict[str, Any] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a verdict is read in place of its warning
            found = case.ask(place)
    except MppError as error:
        status, reason = _refused(case, place, error), " ".join(str(error).split())
    except Exception as error:  # of Taichi, a driver, or the program: each is a failure, and the examination goes on
        traceback.print_exc()
        status, reason = FAILED, f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
    else:
        solved = math.isfinite(found.reached) and found.reached <= found.bound
        status, reason = (SOLVED, "") if solved else (FAILED, "the number is beyond its bound")
        known = {"reached": float(found.reached), "bound": float(found.bound), "because": found.because}
    return CaseResult(
        case.name, place.backend, place.precision, status, reason=reason, seconds=clock.perf_counter() - began, **known
    )


def _refused(case: Case, place: Place, error: MppError) -> str:
    if isinstance(error, BackendError) and not isinstance(error, UnsupportedError):
        return NOT_HERE
    return FAILED if place.backend == "cpu" and place.precision in case.solved_in else REFUSED
