"""What every diagnostic is: a number that a run is watched for."""

import math
from abc import ABC, abstractmethod

from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.errors import StabilityError
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot


class NoResultError(StabilityError):
    """The run ended before the quantity was defined; the message says what did not happen."""


def require_present(snapshot: Snapshot, of: int) -> None:
    """NoResultError where particle `of` has become part of another."""
    if snapshot.merged_into is not None and snapshot.merged_into[of] >= 0:
        raise NoResultError(f"particle {of} merged into particle {snapshot.merged_into[of]} before time {snapshot.time:.6g}")


class Diagnostic(ABC):
    """Watches a run from its start and comes to one number. Changes nothing."""

    def begin(self, spec: SceneSpec, start: Snapshot) -> None:  # noqa: B027 most have nothing to prepare
        """See the scene and its start, before the first look.

        Raises:
            NoResultError: the quantity is not defined for this scene.
        """

    @abstractmethod
    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Look at the particles; called at the start, at the end, and at least as often as `interval` asks in between."""

    def observe_contacts(self, time: float, report: ContactReport) -> None:  # noqa: B027 most do not care
        """See what contacts have done since the start; called before `observe`, in scenes that have contacts."""

    @abstractmethod
    def result(self) -> float:
        """The number, finite.

        Raises:
            NoResultError: it is not defined by what was seen.
        """

    @property
    def interval(self) -> float:
        """Longest time until the next look [time]; without a wish, the samples of the run's table will do."""
        return math.inf
