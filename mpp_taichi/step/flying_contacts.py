"""Flying contacts: a contact solver that moves the spheres itself for any time, without steps."""

from mpp_taichi.step.launcher import Launcher


class FlyingContacts(Launcher):
    """Free flight from collision to collision; `dt` is the time between two samples."""

    takes_steps = False

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """Advance from the time of the first sample to the time of the last sample."""
        self.contacts.advance(time + first * dt, time + last * dt)

    def launches_per_step(self) -> int | None:
        """Not known: it depends on the contacts."""
        return None
