"""History: the last moments of a run, kept to go back to them one by one, exactly."""

from mpp_taichi.simulation.saved_state import Bookmark
from mpp_taichi.simulation.simulation import Simulation

BYTES_ALLOWED = 256 << 20
MOMENTS_ALLOWED = 2000


class History:
    """Bookmarks in order of time; the oldest bookmarks are dropped where there are too many, or they take too much memory."""

    def __init__(
        self, simulation: Simulation, *, bytes_allowed: int = BYTES_ALLOWED, moments_allowed: int = MOMENTS_ALLOWED
    ) -> None:
        """Begin with the present moment."""
        self.simulation, self.bytes_allowed, self.moments_allowed = simulation, bytes_allowed, moments_allowed
        self.restart()

    def restart(self) -> None:
        """Forget every moment but the present one."""
        self._kept: list[Bookmark] = [self.simulation.bookmark()]
        self._bytes = self._kept[0].bytes

    def keep(self) -> None:
        """Keep the present moment; it replaces the last one if no step lies between them."""
        moment = self.simulation.bookmark()
        if moment.mark.step == self._kept[-1].mark.step:
            self._bytes -= self._kept.pop().bytes
        self._kept.append(moment)
        self._bytes += moment.bytes
        while len(self._kept) > 1 and (self._bytes > self.bytes_allowed or len(self._kept) > self.moments_allowed):
            self._bytes -= self._kept.pop(0).bytes

    def back(self) -> bool:
        """Go back to the moment before the present one; False where there is none."""
        step = self.simulation.step_count
        while self._kept and self._kept[-1].mark.step >= step:
            self._bytes -= self._kept.pop().bytes
        if not self._kept:
            self.restart()
            return False
        self.simulation.go_back(self._kept[-1])
        return True
