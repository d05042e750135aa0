"""History: the last moments of a motion, kept to go back to them one by one, exactly."""

from mpp_taichi.simulation.phased_motion import Bookmark, PhasedMotion

BYTES_ALLOWED = 256 << 20
MOMENTS_ALLOWED = 2000


class History:
    """Bookmarks in order of time; the oldest are let go where they are too many, or take too much memory."""

    def __init__(
        self, motion: PhasedMotion, *, bytes_allowed: int = BYTES_ALLOWED, moments_allowed: int = MOMENTS_ALLOWED
    ) -> None:
        """Begin with the present moment."""
        self.motion, self.bytes_allowed, self.moments_allowed = motion, bytes_allowed, moments_allowed
        self.restart()

    def restart(self) -> None:
        """Forget everything but the present."""
        self._kept: list[Bookmark] = [self.motion.bookmark()]
        self._bytes = self._kept[0].bytes

    def keep(self) -> None:
        """Keep the present moment; what was set at the time of the last one becomes part of it."""
        moment = self.motion.bookmark()
        if moment.mark.step == self._kept[-1].mark.step:
            self._bytes -= self._kept.pop().bytes
        self._kept.append(moment)
        self._bytes += moment.bytes
        while len(self._kept) > 1 and (self._bytes > self.bytes_allowed or len(self._kept) > self.moments_allowed):
            self._bytes -= self._kept.pop(0).bytes

    def back(self) -> bool:
        """Go back to the moment before the present one; False where there is none."""
        step = self.motion.step_count
        while self._kept and self._kept[-1].mark.step >= step:
            self._bytes -= self._kept.pop().bytes
        if not self._kept:
            self.restart()
            return False
        self.motion.go_back(self._kept[-1])
        return True
