"""Amplitude of a mode of the springs."""

from mpp_taichi.component import Lattice, ModeNumbers, component, param
from mpp_taichi.modes.mode_set import Mode, ModeError, ModeReading, find_modes
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting, of_which


@component
class ModeAmplitude(Quantity):
    """Amplitude of a mode [length]: the projection of the displacement from rest, a = Σ m shape · u / Σ m shape²."""

    of: Lattice = param(None, optional=True, help="a lattice; absent: the mode is counted in the whole network")
    mode: ModeNumbers = param(help="[r, s] of a lattice, [k] from below of a network")
    along: str = param(None, optional=True, choices=("x", "y", "z"), help="direction of the motion; absent: across the lattice")
    dimension = (1, 0, 0)
    has_rate = True

    def begin(self, setting: Setting) -> None:
        """Find the mode."""
        try:
            self._modes = find_modes(setting.spec, setting.start, of=self.of, show=[self.mode], along=self.along)
        except ModeError as error:
            raise NoResultError(str(error)) from None

    def label(self, setting: Setting) -> str:
        """`mode (2, 1) of sheet`."""
        return of_which(f"mode {self.found.label}", self.of or "")

    def measure(self, sample: RunSample) -> float:
        """The amplitude."""
        return float(self.reading(sample).amplitude[0])

    def rate(self, sample: RunSample) -> float:
        """The rate of the amplitude."""
        return float(self.reading(sample).rate[0])

    def reading(self, sample: RunSample) -> ModeReading:
        """The amplitude with its rate, and the energies of the mode and of the network."""
        return self._modes.read(sample.snapshot)

    @property
    def found(self) -> Mode:
        """The mode."""
        return self._modes.modes[0]
