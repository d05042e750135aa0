"""Springs that break or yield: what each evaluation of the forces does to a spring that is stretched too far."""

from dataclasses import replace
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import components, root, vector_of, where, wide_number
from mpp_taichi.arithmetic.particle_update import separation
from mpp_taichi.arithmetic.traced import entry_of, traced
from mpp_taichi.forces._base import BondForce, Force
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.state.half_springs import numbers_of_halves
from mpp_taichi.types import Template

NEVER = 1e30
"""A length [length] that no spring reaches, in place of infinity, which compilers may leave out of comparisons."""
LASTING = ("spring_breaking_length", "spring_rest_length", "spring_broke_at", "spring_loss")
"""The fields of half-springs that change in a run."""


def with_limits(start: Snapshot, forces: tuple[Force, ...]) -> tuple[tuple[Force, ...], "SpringLimits | None"]:
    """The forces of a phase, of which broken springs exert none, and the limits of its springs if there are any."""
    if not start.springs.have_limits:
        return forces, None
    bonds = tuple(force for force in forces if isinstance(force, BondForce))
    limited = tuple(LimitedBond(force) if isinstance(force, BondForce) else force for force in forces)
    return limited, SpringLimits(start, bonds)


@ti.data_oriented
class SpringLimits:
    """Breaking and yielding of springs, at the places where a step evaluates the forces.

    A spring whose length l exceeds `breaking_length` breaks: it exerts no force from this evaluation on, and the potential
    energy that it has then is lost. A spring whose stretch |l − L| exceeds `yield_stretch` yields before: its rest length L
    follows, so that its stretch is the largest again (perfect plasticity), and the difference of the potential energies is
    lost. Each half-spring decides by itself, from the same distance and by the same instructions as its other half, so that no
    result depends on the threads. The moment has an error of a step.

    spring_breaking_length   [length], 0 of a broken spring
    spring_yield_stretch     [length]
    spring_broke_at          the time of the evaluation at which the spring broke [time]
    spring_loss              half of the energy that the spring has lost so far [energy]
    """

    def __init__(self, start: Snapshot, bonds: tuple[Any, ...]) -> None:
        """Bind the forces along the springs, all of which a broken spring loses."""
        springs = start.springs
        self.bonds, self.particle_count = bonds, start.particle_count
        self.half_count, self.number = 2 * len(springs), numbers_of_halves(start)
        self.yields = bool(np.isfinite(springs.yield_stretch).any())
        self.half_of = np.empty(len(springs), np.int64)
        self.half_of[self.number] = np.arange(self.half_count)

    needs = frozenset({"spring_rest_length"})
    memory = LASTING

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """Kind and count of the fields of half-springs, by name."""
        kinds = {"spring_breaking_length": "scalar", "spring_yield_stretch": "scalar"}
        kinds |= {"spring_broke_at": "wide", "spring_loss": "wide"}
        return {name: (kind, self.half_count) for name, kind in kinds.items()}

    def place(self, state: Any, springs: Springs) -> None:
        """Give the springs of the state the lengths that they have here; no energy is lost so far."""
        whole = np.isinf(springs.broke_at)
        columns = {
            "spring_breaking_length": np.where(whole, np.minimum(springs.breaking_length, NEVER), 0.0),
            "spring_yield_stretch": np.minimum(springs.yield_stretch, NEVER),
            "spring_rest_length": springs.rest_length,
            "spring_broke_at": np.where(whole, 0.0, springs.broke_at),
            "spring_loss": np.zeros(len(springs)),
        }
        for name, values in columns.items():
            field = state.field(name)
            field.from_numpy(values[self.number].astype(np.float32 if field.dtype == ti.f32 else np.float64))

    def take_over(self, state: Any, earlier: Any) -> None:
        """Copy the fields of the same springs from the state of an earlier phase."""
        for name in LASTING:
            state.field(name).from_numpy(earlier.field(name).to_numpy())

    def read(self, state: Any, springs: Springs) -> Springs:
        """The springs as they are now; a broken spring has no stiffness and no damping."""
        breaking, rest, since = (
            state.field(name).to_numpy()[self.half_of].astype(np.float64)
            for name in ("spring_breaking_length", "spring_rest_length", "spring_broke_at")
        )
        whole = breaking > 0.0
        rest = rest if self.yields else springs.rest_length
        stiffness, damping = (np.where(whole, each, 0.0) for each in (springs.stiffness, springs.damping))
        broke_at = np.where(whole, np.inf, since)
        return replace(springs, stiffness=stiffness, damping=damping, rest_length=rest, broke_at=broke_at)

    def losses(self, state: Any) -> np.ndarray:
        """Energy that each spring has lost by breaking and yielding since it was placed, (spring_count,) [energy]."""
        return np.bincount(self.number, state.spring_loss.to_numpy().astype(np.float64), len(self.half_of))

    def loss(self, state: Any) -> float:
        """Energy that all springs have lost by breaking and yielding since they were placed [energy]."""
        return float(np.sum(self.losses(state)))

    @ti.func
    def meet(self, state: Template, first, time):
        """Break springs, and let springs yield, at the present positions."""
        for i in range(first, first + self.particle_count):
            for h in range(state.spring_start[i - first], state.spring_start[i - first + 1]):
                self.meet_half(state, i, first + state.spring_neighbor[h], h, time)

    @ti.func
    def meet_half(self, state: Template, i, j, h, time):
        """Break the half-spring h, or let it yield."""
        breaking = state.spring_breaking_length[h]
        if breaking > 0.0:
            d = separation(state, i, j)
            length = root(d.dot(d))
            if ti.static(self.yields):
                stretch, largest = length - state.spring_rest_length[h], state.spring_yield_stretch[h]
                if ti.abs(stretch) > largest:
                    before = self.energy(state, i, j, h)
                    state.spring_rest_length[h] = length - largest if stretch > 0.0 else length + largest
                    state.spring_loss[h] = state.spring_loss[h] + 0.5 * (before - self.energy(state, i, j, h))
            if length > breaking:
                state.spring_loss[h] = state.spring_loss[h] + 0.5 * self.energy(state, i, j, h)
                state.spring_breaking_length[h] = 0.0
                state.spring_broke_at[h] = wide_number(state, time)

    @ti.func
    def energy(self, state: Template, i, j, h):
        """Potential energy of all forces along the half-spring h, whole as it is."""
        result = ti.cast(0.0, state.wide)
        for bond in ti.static(self.bonds):
            result += bond.potential(state, i, j, h)
        return result


@traced
def of_whole(state: Any, h: Any, vector: Any) -> Any:
    """A vector where the half-spring h is whole, and 0 where it is broken."""
    is_whole = entry_of(state.spring_breaking_length, h) > 0.0
    return vector_of(state, [where(is_whole, each, 0.0) for each in components(vector, state.dimensions)])


@ti.data_oriented
class LimitedBond(BondForce):
    """A force along springs that may break: none along a broken spring."""

    def __init__(self, bond: Any) -> None:
        """Bind the force."""
        self.bond = bond
        self.needs, self.takes_sine, self.has_functions = bond.needs, bond.takes_sine, bond.has_functions
        self.conserves_energy, self.depends_on_velocity = bond.conserves_energy, bond.depends_on_velocity

    @ti.func
    def force(self, state: Template, i, j, h):
        """The force of a whole spring."""
        return of_whole(state, h, self.bond.force(state, i, j, h))

    @ti.func
    def friction(self, state: Template, i, j, h):
        """The friction of a whole spring."""
        return of_whole(state, h, self.bond.friction(state, i, j, h))

    @ti.func
    def potential(self, state: Template, i, j, h):
        """The potential energy of a whole spring."""
        return ti.select(state.spring_breaking_length[h] > 0.0, self.bond.potential(state, i, j, h), 0.0)

    @ti.func
    def dissipation(self, state: Template, i, j, h):
        """The power that the friction of a whole spring takes."""
        return ti.select(state.spring_breaking_length[h] > 0.0, self.bond.dissipation(state, i, j, h), 0.0)
