"""How far a mode of the springs is deflected."""

from mpp_taichi.component import Lattice, ModeNumbers, component, param
from mpp_taichi.modes.mode_set import ModeError, find_modes
from mpp_taichi.quantities._base import Look, NoResultError, Quantity, Setting, of_which


@component
class ModeAmplitude(Quantity):
    """Amplitude of a mode [length]: the projection of the displacement from rest, a = Σ m shape · u / Σ m shape²."""

    of: Lattice = param(None, optional=True, help="a lattice; absent: the mode is counted in the whole network")
    mode: ModeNumbers = param(help="[r, s] of a lattice, [k] from below of a network")
    along: str = param(None, optional=True, choices=("x", "y", "z"), help="direction of the motion; absent: across the lattice")
    dimension = (1, 0, 0)

    def begin(self, setting: Setting) -> None:
        """Find the mode."""
        try:
            self._modes = find_modes(setting.spec, setting.start, of=self.of, show=[self.mode], along=self.along)
        except ModeError as error:
            raise NoResultError(str(error)) from None

    def label(self, setting: Setting) -> str:
        """The numbers of the mode."""
        return of_which(f"mode {self._modes.modes[0].label}", self.of or "")

    def measure(self, look: Look) -> float:
        """The amplitude."""
        return float(self._modes.read(look.snapshot).amplitude[0])
