"""What the diagnostics of modes share: one mode, found before the run and followed through it."""

import numpy as np

from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.modes.frequency_meter import FrequencyMeter, MeasuredFrequency
from mpp_taichi.modes.mode_set import ModeError, ModeReading, ModeSet, find_modes
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

EXCITED_SHARE = 1e-6  # of the energy; what has less is rounding, or what other modes force on it


class OneMode(Diagnostic):
    """Follows one mode; subclasses declare its parameters and come to their number."""

    of: str | None
    mode: tuple[int, int, int]
    along: str | None
    after: float | None
    _modes: ModeSet
    _reading: ModeReading | None = None

    def begin(self, spec: SceneSpec, start: Snapshot) -> None:
        """Find the mode."""
        try:
            self._modes = find_modes(spec, start, of=self.of, show=[self.mode], along=self.along)
        except ModeError as error:
            raise NoResultError(str(error)) from None
        self._meter = FrequencyMeter()
        self._share = 0.0

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Project, from `after` on."""
        if self.after is None or time >= self.after:
            reading = self._modes.read(snapshot)
            self._share = max(self._share, float(np.nan_to_num(reading.share[0])))
            self._meter.observe(time, float(reading.amplitude[0]), float(reading.rate[0]))
            self.look(reading)

    def look(self, reading: ModeReading) -> None:
        """See what is in the mode and what is not."""

    @property
    def interval(self) -> float:
        """A small part of an oscillation."""
        return self._meter.interval(self.theory)

    @property
    def theory(self) -> float:
        """ω of the mode by theory [radians time⁻¹]."""
        return self._modes.modes[0].angular_frequency

    def measured(self) -> MeasuredFrequency:
        """ω as it was.

        Raises:
            NoResultError: the mode did not swing.
        """
        found, label = self._meter.measured(), self._modes.modes[0].label
        if self._share < EXCITED_SHARE and self.theory > 0.0:
            raise NoResultError(f"mode {label} never held more than {self._share:.1g} of the energy: it is not excited")
        if found is None:
            crossings = len(self._meter.crossings)
            raise NoResultError(f"mode {label} went through zero {crossings} times, three are needed")
        return found
