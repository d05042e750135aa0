"""Shared part of the diagnostics of modes: one mode, found before the run and followed through it."""

import numpy as np

from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.modes.frequency_meter import FrequencyMeter, MeasuredFrequency
from mpp_taichi.modes.mode_set import ModeReading
from mpp_taichi.quantities._base import NoResultError, RunSample, Setting
from mpp_taichi.quantities.mode_amplitude import ModeAmplitude

EXCITED_SHARE = 1e-6  # of the energy; a smaller share is rounding, or an oscillation that other modes force on the mode


class OfMode(Diagnostic):
    """Follows one mode from `after` on; a subclass declares these parameters and comes to its number."""

    of: str | None
    mode: tuple[int, int, int]
    along: str | None
    after: float | None

    def begin(self, setting: Setting) -> None:
        """Find the mode."""
        self._amplitude = ModeAmplitude(of=self.of, mode=self.mode, along=self.along)
        self._amplitude.begin(setting)
        self._meter = FrequencyMeter()
        self._share = 0.0

    def observe(self, sample: RunSample) -> None:
        """Project the sample on the mode."""
        if self.after is None or sample.time >= self.after:
            reading = self._amplitude.reading(sample)
            self._share = max(self._share, float(np.nan_to_num(reading.share[0])))
            self._meter.observe(sample.time, float(reading.amplitude[0]), float(reading.rate[0]))
            self.compare(reading)

    def compare(self, reading: ModeReading) -> None:
        """Compare the energy of the mode with the energy of the network."""

    @property
    def interval(self) -> float:
        """A small part of an oscillation."""
        return self._meter.interval(self.theory)

    @property
    def theory(self) -> float:
        """ω of the mode by theory [radians time⁻¹]."""
        return self._amplitude.found.angular_frequency

    @property
    def label(self) -> str:
        """The numbers of the mode."""
        return self._amplitude.found.label

    def measured(self) -> MeasuredFrequency:
        """ω as measured.

        Raises:
            NoResultError: the mode did not swing.
        """
        found = self._meter.measured()
        if self._share < EXCITED_SHARE and self.theory > 0.0:
            raise NoResultError(f"mode {self.label} never held more than {self._share:.1g} of the energy: it is not excited")
        if found is None:
            crossings = len(self._meter.crossings)
            raise NoResultError(f"mode {self.label} went through zero {crossings} times, three are needed")
        return found
