"""What every contact solver is given, and what it tells. Host side; no Taichi."""

from typing import Any

import numpy as np

from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.start.contact_setup import ContactSetup

__all__ = ["TOUCHING_POWER", "ContactReport", "ContactSetup"]

# Of the rounding unit: the gap, in units of their reach, up to which spheres touch where contacts are resolved in groups.
TOUCHING_POWER = 2 / 3


class ContactSolver:
    """What every contact solver offers; it is bound to the spheres of a scene and to their fields.

    drifts   moves the spheres along straight ways, and resolves contacts on the way: `drift`
    flies    moves the spheres itself for any time, without steps: `advance`
    leads    takes the steps of an adaptive method, its `integrator`, set before `bind`, and cuts them at contacts: `lead`
    logs     notes every contact, to be taken by `take_log`; set before `bind`, where a solver `can_log`
    forces   the TotalForce that acts on the spheres, or None; set before `bind`
    merges   makes one sphere of two that touch
    order    of the global error in dt; None where the solver does not run at steps whose length is chosen
    in_turn  why it has to run in one thread, and so on the CPU only; empty where it need not
    most_elsewhere  spheres that it takes on other backends than the CPU; None: any number
    memory   of its `work_fields` those that one step hands on to the next, to be saved with the state
    """

    drifts = False
    flies = False
    leads = False
    merges = False
    order: int | None = None
    can_log = False
    logs = False
    in_turn = ""
    most_elsewhere: int | None = None
    forces: Any = None
    integrator: Any = None
    memory: tuple[str, ...] = ()
    setup: ContactSetup

    def work_fields(self, particle_count: int) -> dict[str, tuple[str, int]]:
        """Fields of the State beyond those of the integrator, by name: kind and count (see State)."""
        return {}

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Take the spheres, and the State whose position and velocity are to be changed; allocate what is needed."""
        raise NotImplementedError

    def prepare(self, time: float) -> None:
        """Positions and velocities were set from outside: forget what was known of them."""

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move every sphere by h along its velocity from `time` on, contacts resolved in the order of time."""
        raise NotImplementedError

    def write_back(self) -> None:
        """Bring the state up to date: a solver of a `force_free` setup may be behind with it between drifts."""

    def advance(self, time: float, span: float) -> None:
        """Go on from `time` to time + span."""
        raise NotImplementedError

    def lead(self, time: float, dt: float, looks: int) -> None:
        """Go on from `time` through so many looks, `dt` apart, and show the state at the last."""
        raise NotImplementedError

    def collect(self) -> ContactReport:
        """What was counted since the last call."""
        raise NotImplementedError

    def take_log(self) -> np.ndarray | None:
        """Contacts since this was last asked, records of time, i, j (−1 − w: surface w) and impulse; None without a log."""
        return None

    def destroy(self) -> None:
        """Give the memory back."""
        raise NotImplementedError

    def failure(self, count: int) -> str:
        """What to say of contacts that were given up on, and what would help."""
        return f"{count} contacts could not be resolved; try a smaller dt, or a contact_time that makes quick bounces elastic"

    @property
    def conserves_energy(self) -> bool:
        """Whether contacts keep the kinetic energy: nothing is inelastic, and no wall moves."""
        elastic = bool((self.setup.restitution == 1.0).all())
        return elastic and self.gains_no_energy and all(wall.restitution == 1.0 for wall in self.setup.enclosure.surfaces)

    @property
    def gains_no_energy(self) -> bool:
        """Whether contacts cannot add energy: no wall moves."""
        return not any(any(wall.velocity) for wall in self.setup.enclosure.surfaces)
