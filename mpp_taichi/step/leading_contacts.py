"""Leading contacts: a contact solver that takes the steps of an adaptive method, and cuts them at contacts."""

from mpp_taichi.step.adaptive_steps import AdaptiveSteps
from mpp_taichi.step.launcher import Launcher


class LeadingContacts(Launcher):
    """Steps of an adaptive method up to each contact and on from there; `dt` is the time between two samples."""

    contacts_in_every_step = False

    def set_up(self) -> None:
        """The method's own steps, of which only `begin` is launched."""
        self.steps = AdaptiveSteps(self.parts)

    def begin(self, time: float, dt: float) -> None:
        """Take the state as the start of the method's first step."""
        self.steps.begin(time, dt)

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """Advance through the samples first + 1 … last."""
        self.steps.check_span((last - first) * dt)
        self.contacts.lead(time, dt, first, last)

    def launches_per_step(self) -> int | None:
        """Not known: it depends on the contacts."""
        return None
