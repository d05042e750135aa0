"""The abstract contact solver, which is given a ContactSetup and returns ContactReports. Host side; no Taichi."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.start.contact_setup import ContactSetup

__all__ = ["TOUCHING_POWER", "ContactReport", "ContactSetup"]

# Of the rounding unit: the gap, in units of their reach, up to which spheres touch where contacts are resolved in groups.
TOUCHING_POWER = 2 / 3


class ContactSolver:
    """A contact solver; it is bound to the spheres of a scene and to their fields.

    launched_by     the file of `step/` whose launcher runs a scene with this solver
    drifts          whether it moves the spheres along straight lines, and resolves contacts on the way: `drift`
    flies           whether it moves the spheres itself for any time, without steps: `advance`
    leads           whether it takes the steps of an adaptive method, and cuts them at contacts: `lead`
    integrator      the adaptive method of a solver that leads; set before `bind`
    merges          whether it makes one sphere of two spheres that touch
    any_frame       whether it reads differences of positions and of velocities only, so that the state may be in a moving frame
    order           of the global error in dt; None where the solver does not run at steps whose length is chosen
    can_log, logs   whether it can log every contact, and whether it does, for `take_log`; `logs` is set before `bind`
    takes_restitution   whether restitutions may change between two runs of what is compiled: `take_restitution`
    takes_motions   whether walls may move as formulas say; scenes are checked by this literal value
    takes_turnings  whether walls may turn; scenes are checked by this literal value
    sees_flights    whether it finds the contacts on the whole way of a sphere, and not only at the end of a step
    takes_friction  whether walls may have a friction; scenes are checked by this literal value
    takes_heat      whether walls may have a temperature; scenes are checked by this literal value
    takes_tangent   whether it can carry a small deviation of the spheres through flights and collisions
    follows_deviation   whether it does, in the fields `tangent_…` of the state; set before `bind`
    forces          the TotalForce that acts on the spheres, or None; set before `bind`
    in_turn         the reason why it needs a single thread, and so the CPU; empty if it needs no single thread
    most_elsewhere  largest number of spheres on other backends than the CPU; None: any number
    memory          the `work_fields` that one step hands on to the next, and that are saved with the state
    setup           the spheres and surfaces that it was bound to, with its own restitution and contact time
    """

    launched_by = "drifting_contacts"
    drifts = False
    flies = False
    leads = False
    merges = False
    any_frame = False
    order: int | None = None
    can_log = False
    logs = False
    takes_restitution = False
    takes_heat = False
    takes_motions = False
    takes_turnings = False
    takes_friction = False
    sees_flights = True
    takes_tangent = False
    follows_deviation = False
    in_turn = ""
    most_elsewhere: int | None = None
    forces: Any = None
    integrator: Any = None
    memory: tuple[str, ...] = ()
    setup: ContactSetup
    _sums: Any = None

    def work_fields(self, particle_count: int) -> dict[str, tuple[str, int]]:
        """Fields of the State beyond the fields of the integrator, by name: kind and count (see State)."""
        return {}

    def bind(self, setup: ContactSetup, state: Any) -> None:
        """Take the spheres, and the State whose positions and velocities are to be changed; allocate the fields."""
        raise NotImplementedError

    def take_restitution(self, restitution: float, setup: ContactSetup) -> None:
        """Bounce with the restitutions of another setup of the same spheres, and with this one where it gives none."""
        raise NotImplementedError

    def prepare(self, time: float) -> None:
        """Forget the positions and velocities that the solver knows, because the state was changed from outside."""

    def save(self) -> tuple[np.ndarray, ...]:
        """All that the solver knows of the spheres beyond the State and `memory`, for `restore`; empty for most solvers."""
        return ()

    def restore(self, saved: Sequence[np.ndarray]) -> None:
        """Go on from the result of `save`, with the same bits, in place of `prepare`."""

    def drift(self, state: Any, time: float, h: float) -> None:
        """Move every sphere by h along its velocity from `time` on, contacts resolved in the order of time."""
        raise NotImplementedError

    def write_back(self) -> None:
        """Bring the state up to date: between drifts of a `force_free` setup a solver need not have written it."""

    def advance(self, begin: float, end: float) -> None:
        """Go on from one time to another."""
        raise NotImplementedError

    def lead(self, time: float, dt: float, first: int, last: int) -> None:
        """Go on from `time` + `first` dt through the samples at `time` + k dt, and write the state of the sample `last`."""
        raise NotImplementedError

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        raise NotImplementedError

    def sum_fields(self) -> tuple[Any, ...]:
        """Fields of one axis in which sums of real numbers grow from the begin of a phase on.

        They are not set to 0 when they are collected: how they are rounded must not depend on how often that is.
        """
        raise NotImplementedError

    def save_sums(self) -> tuple[np.ndarray, ...]:
        """The sums of the phase, for `restore_sums`."""
        from mpp_taichi.device.bulk_copy import MixedFields  # it imports Taichi

        if self._sums is None:
            self._sums = MixedFields(self.sum_fields())
        return tuple(self._sums.read())

    def restore_sums(self, saved: Sequence[np.ndarray]) -> None:
        """Go on from the result of `save_sums`, with the same bits; counts since the last `collect` are dropped."""
        from mpp_taichi.device import bulk_copy

        bulk_copy.write(self.sum_fields(), saved)
        self.collect()

    def begin_sums(self) -> None:
        """Begin the sums at 0, for a new phase; counts since the last `collect` are dropped."""
        from mpp_taichi.device import bulk_copy

        bulk_copy.clear(self.sum_fields())
        self.collect()

    def take_log(self) -> np.ndarray | None:
        """Contacts since the last call: records of time, i, j (−1 − w: surface w) and impulse; None without a log."""
        return None

    def destroy(self) -> None:
        """Give the memory back."""
        raise NotImplementedError

    def failure(self, count: int) -> str:
        """The message for contacts that were given up, with a remedy."""
        contacts = "1 contact" if count == 1 else f"{count} contacts"
        return f"{contacts} could not be resolved; try a smaller dt, or a contact_time that makes quick bounces elastic"

    @property
    def conserves_energy(self) -> bool:
        """Whether contacts keep the kinetic energy: all are elastic, and no wall moves or has a temperature."""
        elastic = bool((self.setup.restitution == 1.0).all())
        return elastic and self.gains_no_energy and all(wall.restitution == 1.0 for wall in self.setup.enclosure.surfaces)

    @property
    def gains_no_energy(self) -> bool:
        """Whether contacts cannot add energy: no wall moves or has a temperature."""
        return not any(wall.moves or wall.is_thermal for wall in self.setup.enclosure.surfaces)
