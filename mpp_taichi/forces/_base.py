"""The three kinds of force: each force is a formula, without a loop, an allocation or a launch.

All forces give accelerations, so that a massless test particle needs no special case. `needs` names the quantities of `State`
that the formula reads beside position and velocity.
"""

import math
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import components, vector_of, where
from mpp_taichi.arithmetic.particle_update import velocity_seen
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@ti.data_oriented
class Force:
    """The declarations of every force."""

    needs: frozenset = frozenset()
    conserves_energy = True  # False: the force does work without a potential
    depends_on_velocity = False
    linear_in_velocity = True  # or independent of it; splittings from order 6 on need this
    depends_on_time = False  # explicitly, not only through the motion
    takes_sine = False  # of an angle: on Vulkan Taichi has the sine in f32 only
    # The scene is checked by the literal values that a class gives to these, which are read from its source text.
    gravitates = False  # Newtonian gravity, with the parameters `strength` and `softening`: orbits are made for it
    is_uniform = False  # the same acceleration everywhere and always, the parameter `acceleration`
    is_linear_drag = False  # F = −c v with c the parameter `coefficient`
    acts_on_springs = False  # the force of the springs, which no scene names
    can_use_tree = False  # has the parameters `solver` and `accuracy`, by which a tree sums the force
    proportional_to_mass = False  # the acceleration does not depend on the particle's own mass, which may be 0
    proportional_to_charge = False  # acts between charged particles only
    singular_at_zero_distance = False  # infinite between particles at one place, unless a `softening` is above 0
    has_functions: tuple[str, ...] = ()  # exponentials, say, which Vulkan has in f32 only
    turns = False  # depends on velocity by a term v × Ω alone, with an Ω of place and time, as a magnetic force
    is_formula = False  # has its law from a formula (scene/formulas/)
    gathers = False  # reads a number of all particles, which `meet` sums up before each sum of the forces
    encloses = False  # the particles of the parameter `of` are the corners of a closed skin in the plane
    encloses_volume = False  # these are the corners of a closed skin in space
    twists = False  # depends on the dihedral angles of the particles of the parameter `of`, four in a row
    takes_any_numbers = False  # the formula is right for every kind of KernelNumber: in df64, tangents and lanes
    takes_low_parts = True  # and in df64; double-single numbers have no exponentials, say, and no time
    has_derivatives = False  # in time, for methods that sum jerks; a class says so with a literal True of its own
    needs_gravity = False  # corrects Newton's gravity, the whole of which must stand beside it
    may_give_energy = False  # depends on velocity, and does not only brake
    mixes_velocities = False  # is not linear in the velocities of other particles


@ti.func
def is_among(state: Template, i, some: Template, chosen: Template):
    """Whether a force acts on particle i: on every particle, or where `some` on the particles `chosen`, (first, count)."""
    result = 1
    if ti.static(some):
        result = is_in(state, i, chosen)
    return result


@traced
def is_in(state: Any, i: Any, group: tuple[int, int]) -> Any:
    """Whether particle i, of any copy, belongs to a group, (first index, count)."""
    own = i % state.particle_count if state.replica_count > 1 else i
    return (own >= group[0]) & (own < group[0] + group[1])


@traced
def felt(state: Any, i: Any, group: tuple[int, int] | None, number: Any) -> Any:
    """A number of particle i where it belongs to the group that feels a force, else 0; None: every particle feels it."""
    return number if group is None else where(is_in(state, i, group), number, 0.0)


@traced
def felt_vector(state: Any, i: Any, group: tuple[int, int] | None, vector: Any) -> Any:
    """`felt` for each component of a vector."""
    if group is None:
        return vector
    return vector_of(state, [felt(state, i, group, each) for each in components(vector, state.dimensions)])


class ExternalForce(Force):
    """A force that acts on each particle by itself."""

    def see(self, start: Snapshot) -> None:
        """Take what the force needs to know of the particles at the start of the scene."""

    def parts(self) -> "tuple[ExternalForce, ...]":
        """The forces that are summed for this force: itself, or one without velocities beside one of velocities."""
        return (self,)

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """Kind and count of the fields that the force needs in the state, by name."""
        return {}

    @ti.func
    def meet(self, state: Template, first, time):
        """Look at all particles before a sum of the forces, where the force `gathers`."""

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """Acceleration of particle i at this velocity and time [length / time²]."""

    @ti.func
    def acceleration_gained(self, state: Template, slopes: Template, h, i, time):
        """Change of the acceleration of particle i when all velocities change by h times the velocities of `slopes`."""
        before = velocity_seen(state, i)
        after = before + h * velocity_seen(slopes, i)
        return self.accelerate(state, i, after, time) - self.accelerate(state, i, before, time)

    @ti.func
    def derivatives(self, state: Template, i, time):
        """First and second derivative of the acceleration in time along the motion, where the force `has_derivatives`."""

    @ti.func
    def damping_rate(self, state: Template, i, time):
        """−∂a/∂v of particle i where it is a number [1 / time], for the Newton iteration of implicit methods."""
        return ti.cast(0.0, float)

    @ti.func
    def potential(self, state: Template, i, time):
        """Potential energy of particle i, in the widest float of the device (`state.wide`)."""


class PairForce(Force):
    """A central force between each two particles, a_i = r_i Σ_j s_j g(1/ρ_ij) d_ij with d_ij = x_j − x_i.

    ρ² = |d|² + ε². The response r, the source s and the shape g are the three formulas. All pair forces of one softening ε
    share the inverse distance that the loop computes. By Newton's third law m_i r_i s_j = m_j r_j s_i.
    """

    takes_lanes: bool | None = None  # whether `shape` may get a whole vector; None: to be read from its source text
    derivatives_take_lanes: bool | None = None  # the same of `slope` and `curvature`
    softening = 0.0
    reach = math.inf  # distance beyond which the force is 0 for any parameters that may change in a run [length]
    solver = "direct"  # how the force is summed: a row of `SOLVERS` in _pair_solver.py

    @ti.func
    def response(self, state: Template, i):
        """The factor r_i of particle i in its acceleration: its charge or mass for this force, divided by its inertial mass."""

    @ti.func
    def source(self, state: Template, j):
        """The factor s_j with which particle j acts on all other particles."""

    @ti.func
    def shape(self, inverse_distance):
        """Dependence on the distance, g(u) of u = 1/ρ; positive attracts."""

    @ti.func
    def slope(self, inverse_distance):
        """dg/du, where the force `has_derivatives`."""

    @ti.func
    def curvature(self, inverse_distance):
        """d²g/du², where the force `has_derivatives`."""

    @ti.func
    def potential(self, state: Template, i, j, inverse_distance):
        """Potential energy of the pair (i, j), in the widest float of the device (`state.wide`)."""


class BondForce(Force):
    """A force along the springs of a scene; `h` counts half-springs, one for each end.

    The part that depends on velocity, `friction`, is linear in the velocity of j relative to i.
    """

    @property
    def fits_slices(self) -> bool:
        """Whether device/fast_taichi/spring_lanes.c sums this force."""
        return False

    @ti.func
    def force(self, state: Template, i, j, h):
        """Force on particle i from the half-spring h that leads to j."""

    @ti.func
    def friction(self, state: Template, i, j, h):
        """The part of `force` that depends on velocity, where the force does."""

    @ti.func
    def shape(self, state: Template, h, inverse_distance):
        """g(u) of u = 1/|d|: the part of `force` without velocity is g d. Where the force `has_derivatives`."""

    has_curvature = False

    @ti.func
    def within(self, state: Template, i, j, value):
        """The value where the force acts between i and j, and 0 elsewhere."""
        return value

    @ti.func
    def slope(self, state: Template, h, inverse_distance):
        """dg/du."""

    @ti.func
    def curvature(self, state: Template, h, inverse_distance):
        """d²g/du², of a bond that `has_curvature`; without, it is 0."""

    @ti.func
    def stiffness(self, state: Template, i, j, h, length):
        """∂F/∂x of the half-spring from i to j at the present positions: (along it, across it) [force / length]."""

    @ti.func
    def step_lengths(self, state: Template, i, j):
        """Lengths at the start and at the end of a step, the end as far beyond the middle as the start is before it."""
        before = state.piece_start[j] - state.piece_start[i]
        after = 2.0 * (state.position[j] - state.position[i]) - before
        return ti.sqrt(before.dot(before)), ti.sqrt(after.dot(after))

    @ti.func
    def step_force(self, state: Template, i, j, h):
        """Force on particle i whose work over a step from `piece_start` is the change of the potential, to round-off.

        Positions and velocities are taken at the middle of the step; damping may only take energy.
        """

    @ti.func
    def step_stiffness(self, state: Template, i, j, h, length):
        """∂F/∂x of `step_force` by the position in the middle of the step, exact or nearly so: (along, across)."""

    @ti.func
    def damping_rates(self, state: Template, h):
        """∂F/∂v of the half-spring: (along, across) [force / velocity]."""

    @ti.func
    def potential(self, state: Template, i, j, h):
        """Potential energy of the whole spring, in the widest float of the device (`state.wide`)."""

    @ti.func
    def dissipation(self, state: Template, i, j, h):
        """Power that the whole spring dissipates, −Σ F·v of the part of `force` without a potential, in `state.wide`.

        Only where `conserves_energy` is False.
        """
