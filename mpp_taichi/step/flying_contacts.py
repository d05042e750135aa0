"""Flying contacts: a contact solver that moves the spheres itself for any time, without steps."""

from mpp_taichi.step.launcher import Launcher


class FlyingContacts(Launcher):
    """Free flight from collision to collision; `dt` is the time between two samples."""

    takes_steps = False

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """Advance from the time of the first sample to the time of the last sample."""
        if self.parts.tangent_meter is None:
            self.contacts.advance(time + first * dt, time + last * dt)
            return
        for s in range(first, last):
            self.contacts.advance(time + s * dt, time + (s + 1) * dt)
            scaled = self.contacts.deviation.show(time + (s + 1) * dt)
            factor = self.parts.tangent_meter.measure_alone(dt, scaled)
            if factor != 1.0:
                self.contacts.deviation.scale(factor)

    def launches_per_step(self) -> int | None:
        """Not known: it depends on the contacts."""
        return None
