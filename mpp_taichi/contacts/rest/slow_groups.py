"""Groups of spheres whose problem the iteration does not solve: they are solved on the host, to the last digits. NumPy only."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpp_taichi.contacts.rest.complementarity import Complementarity
from mpp_taichi.contacts.rest.contact_rows import ContactRows
from mpp_taichi.contacts.rest.proximal import ContactProblem, Proximal

PRESSED = 1e-3  # of the smaller radius: spheres between things that leave them less room overlap by so much without a refusal
ROUNDED = 1e-8  # of the smaller radius: what the rounding of large impulses that cancel, as in a narrow wedge, may leave undone
SHARE = 1e-6  # of its own yielding: how much a contact yields where no velocities satisfy all contacts
OF_CONTACTS = ("normal", "approach", "impulse", "allowed", "rounded")  # fields of a ContactProblem
NAMED = 4  # spheres and surfaces of a message, at most
WORK = 2e10  # operations of a factorization above which a group is left to the iteration


@dataclass(frozen=True)
class Squeeze:
    """A sphere that has too little room.

    sphere     the one of the worst contact that is not held
    others     the spheres and surfaces (−1 − s) that press on it: the other side of the worst contact, then by their impulses
    overlap    at the worst contact, at the end of the drift, relative to the smaller radius
    """

    sphere: int
    others: tuple[int, ...]
    overlap: float


class SlowGroups:
    """The problem that the fields of `solver` hold, taken to the host and back."""

    def __init__(self, rows: ContactRows, solver: Complementarity):
        """Bind the fields."""
        self.rows = rows
        self.solver = solver
        self.surface_velocity = np.array([surface.velocity[: rows.dimensions] for surface in rows.walls.surfaces])

    def solve(self, h: float, *, whatever: bool = True) -> tuple[bool, Squeeze | None]:
        """Solve the groups that are not solved, and write their impulses and velocities.

        Returns whether this was done, and the worst contact of all if it is violated by more than `PRESSED`. Nothing is done
        where a group needs more than `WORK` operations; with `whatever` such groups are left as they are, and judged.
        """
        rows, solver = self.rows, self.solver
        n = rows.particle_count
        start = rows.start.to_numpy()[: n + 1]
        entries = int(start[n])
        owner = np.repeat(np.arange(n), np.diff(start))
        other = rows.other.to_numpy()[:entries]
        active = solver.step.to_numpy()[:entries] > 0.0
        chosen = np.flatnonzero(active & (other < owner))
        impulses = rows.impulse.to_numpy()
        velocity = solver.velocity.to_numpy()
        base = solver.base.to_numpy().astype(float)
        inverse_mass = rows.inverse_mass.to_numpy().astype(float)[:n]
        radius = rows.radius.to_numpy().astype(float)
        i, j = owner[chosen], other[chosen]
        pair = j >= 0
        smaller = np.where(pair, np.minimum(radius[i], radius[np.maximum(j, 0)]), radius[i])
        normal = rows.normal.to_numpy()[:entries][chosen].astype(float)
        beside = base[np.maximum(j, 0)]
        if len(self.surface_velocity):
            beside[~pair] = self.surface_velocity[-1 - j[~pair]]
        approach = (normal * (base[i] - beside)).sum(axis=1) + solver.offset.to_numpy()[:entries][chosen].astype(float)
        movable = inverse_mass.max(axis=1) > 0.0
        first, second = np.where(movable[i], i, -1), np.where(pair & movable[np.maximum(j, 0)], j, -1)
        whole = ContactProblem(
            first=first,
            second=second,
            normal=normal,
            inverse_mass=inverse_mass,
            approach=approach,
            impulse=impulses[chosen].astype(float),
            allowed=solver.tolerance * smaller / h,
            rounded=max(solver.tolerance, ROUNDED) * smaller / h,
            yielding=float(solver.softness[0]),
        )
        searches = []
        for members, contacts in _groups(whole):
            number = np.full(n + 1, -1)
            number[members] = np.arange(len(members))
            group = replace(
                whole,
                first=number[first[contacts]],
                second=number[second[contacts]],
                inverse_mass=inverse_mass[members],
                **{name: getattr(whole, name)[contacts] for name in OF_CONTACTS},
            )
            # Numbers that are not finite are found, and named, at the end of the step.
            if not np.isfinite(group.approach).all():
                continue
            search = Proximal(group)
            if not search.solves(group.impulse):
                searches.append((members, contacts, search))
        if not whatever and any(search.work > WORK for _, _, search in searches):
            return False, None
        worst = None
        for members, contacts, search in searches:
            if search.work > WORK:
                found = search.judged(search.group.impulse)
            else:
                found = search.solve()
                if not found.solved:
                    pressed = search.pressed(SHARE)
                    found = pressed if pressed.violation < 2.0 * found.violation else found  # its impulses are small
                impulses[chosen[contacts]] = found.impulse
                velocity[members] = base[members] + found.velocity
            overlap = found.speeds * (-h) / smaller[contacts]
            if not found.solved and overlap.max() > PRESSED and (worst is None or overlap.max() > worst.overlap):
                worst = _squeeze(i[contacts], j[contacts], movable, overlap, found.impulse)
        self._write(impulses, velocity, owner, other, chosen)
        return True, worst

    def _write(self, impulses: Any, velocity: Any, owner: Any, other: Any, chosen: Any) -> None:
        """Give both entries of a pair the impulse, and the spheres their velocities."""
        pairs = np.flatnonzero(other >= 0)
        low, high = np.minimum(owner, other)[pairs], np.maximum(owner, other)[pairs]
        # The two entries of a pair come one after the other, the entry in the row of the lower number first.
        order = pairs[np.lexsort((owner[pairs], high, low))]
        impulses[order[0::2]] = impulses[order[1::2]]
        self.rows.impulse.from_numpy(impulses)
        self.solver.velocity.from_numpy(velocity)


def _groups(whole: ContactProblem) -> list[tuple[np.ndarray, np.ndarray]]:
    """The spheres and the contacts of each group of spheres that are connected by contacts."""
    label = np.arange(len(whole.inverse_mass))
    both = (whole.first >= 0) & (whole.second >= 0)
    a, b = whole.first[both], whole.second[both]
    while True:
        least = np.minimum(label[a], label[b])
        before = label.copy()
        np.minimum.at(label, a, least)
        np.minimum.at(label, b, least)
        label = label[label]
        if (label == before).all():
            break
    of_contact = label[np.maximum(whole.first, whole.second)]
    order = np.argsort(of_contact, kind="stable")
    ends = np.flatnonzero(np.diff(of_contact[order])) + 1
    result = []
    for contacts in np.split(order, ends):
        if len(contacts):
            members = np.unique(np.concatenate([whole.first[contacts], whole.second[contacts]]))
            result.append((members[members >= 0], contacts))
    return result


def _squeeze(i: Any, j: Any, movable: Any, overlap: Any, impulse: Any) -> Squeeze:
    """The contact with the largest overlap, and what else presses on its sphere."""
    worst = int(np.argmax(overlap))
    a, b = int(i[worst]), int(j[worst])
    sphere, first = (a, b) if movable[a] else (b, a)
    at = np.flatnonzero(((i == sphere) | (j == sphere)) & (np.arange(len(i)) != worst) & (impulse > 0.0))
    at = at[np.argsort(-impulse[at], kind="stable")][: NAMED - 1]
    return Squeeze(sphere, (first, *np.where(i[at] == sphere, j[at], i[at]).tolist()), float(overlap[worst]))
