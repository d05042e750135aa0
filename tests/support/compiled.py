"""Forces that are compiled alone, to evaluate their accelerations and energies at any position."""

import numpy as np
import taichi as ti

from mpp_taichi import component
from mpp_taichi.energy.energy_meter import EnergyMeter, PowerMeter
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.forces._composition import built
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.scene.formulas.fields import FormulaText
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.spec import ComponentSpec
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.state.state import State
from mpp_taichi.state.vector_layout import VectorLayout

TIME = 0.3  # at which forces are asked, not 0, so that one that swings with time does not vanish


def snapshot_of(position, *, velocity=None, mass=None, charge=None, springs=None, free=None):
    count = len(position)
    return Snapshot(
        position=np.asarray(position, float),
        velocity=np.zeros((count, 3)) if velocity is None else np.asarray(velocity, float),
        mass=np.ones(count) if mass is None else np.asarray(mass, float),
        radius=np.ones(count),
        charge=np.zeros(count) if charge is None else np.asarray(charge, float),
        color=np.ones((count, 3)),
        free=np.ones((count, 3), bool) if free is None else np.asarray(free, bool),
        name=("",) * count,
        springs=Springs() if springs is None else springs,
    )


def random_snapshot(count=5, *, seed=3, dimensions=3, masses=True):
    random = np.random.default_rng(seed)
    position = random.uniform(-1, 1, (count, 3))
    velocity = random.uniform(-1, 1, (count, 3))
    position[:, dimensions:] = velocity[:, dimensions:] = 0.0
    between = np.array([[k, (k + 1) % count] for k in range(count)], np.int32)
    springs = Springs(
        between=between,
        stiffness=random.uniform(1, 5, count),
        damping=random.uniform(0.1, 1, count),
        rest_length=random.uniform(0.3, 0.9, count),
        color=np.ones((count, 3)),
    )
    mass = random.uniform(0.5, 2, count) if masses else np.ones(count)
    return snapshot_of(position, velocity=velocity, mass=mass, charge=random.uniform(-1, 1, count), springs=springs)


FORMULAS = {
    "pair": {"potential": "0.7*m1*m2*q1*q2*exp(-r/2)*(1/r + r^2)"},
    "bond": {"potential": "0.7*(l - 0.4*rest)^2*(1 + exp(-l))"},
    "external": {"potential": "m*(0.7*x^2 + 0.3*x*y^2 + sin(y)) + q*r"},
}
"""A formula for each force that has none of its own."""


def build_force(name, dimensions=3):
    """An instance with every parameter that has no default set to 0.7, to a vector of that size, or to four particles.

    Forces of torsion act on two rows of five particles, whose middle particles are in another order than their indices.
    """
    from mpp_taichi.component import REQUIRED

    values = {"float": 0.7, "Vector": (0.7, -0.6, 0.5)}
    values["AxialVector"] = values["Vector"] if dimensions == 3 else (0.0, 0.0, 0.5)
    declared = component.declaration("forces", name).parameters
    parameters = {p.name: values.get(p.type) for p in declared if p.default is REQUIRED or p.optional}
    parameters |= {p.name: (0, 4) for p in declared if p.default is REQUIRED and p.type == "Particles"}
    parameters |= {p.name: tuple((place, 2) for place in (0, 1, 3, 2)) for p in declared if p.type == "FourInRow"}
    parameters |= {key: FormulaText(text, {}, dimensions) for key, text in FORMULAS.get(name, {}).items()}
    given = {p.name: p.default for p in declared if p.default is not REQUIRED and p.type != "Numbers"} | parameters
    return built(ComponentSpec(name, given, Location("a test", 1, 1)))


@ti.data_oriented
class CompiledForces:
    """TotalForce and State of a snapshot, with host functions for what they give."""

    def __init__(self, forces, snapshot, *, dimensions=3, shape="serial"):
        for force in forces:
            if isinstance(force, ExternalForce):
                force.see(snapshot)
        self.total_force = TotalForce(tuple(forces), snapshot.particle_count, dimensions)
        self.shape = shape
        self.state = State(
            snapshot,
            dimensions=dimensions,
            needs=self.total_force.needs,
            scratch_count=0,
            work=self.total_force.work_fields(),
            layout=VectorLayout.BY_COMPONENT if self.total_force.has_pairs else VectorLayout.BY_PARTICLE,
        )
        self.meter = EnergyMeter(self.state, self.total_force)
        self.mass = snapshot.mass

    @ti.kernel
    def _accumulate(self):
        self.total_force.accumulate(self.state, 0, TIME, self.shape)

    @ti.kernel
    def _add_velocity_dependent(self):
        for i in range(self.state.particle_count):
            extra = self.total_force.local_acceleration(self.state, 0, i, TIME, True)
            self.state.acceleration[i] = self.state.acceleration[i] + extra

    def acceleration(self, position=None, velocity=None, *, parts="all"):
        """At these places and velocities, (N, dimensions); parts: all, position, velocity."""
        if position is not None:
            self.state.write(position, velocity)
        if parts == "velocity":
            self.state.acceleration.fill(0.0)
        else:
            self._accumulate()
        if parts != "position":
            self._add_velocity_dependent()
        return self.state.acceleration.to_numpy().astype(float)

    def powers(self):
        """Power dissipated and power of the driving forces, where the particles are now."""
        meter = PowerMeter(self.state, self.total_force, self.mass, in_kernel=False)
        meter.keep(0, TIME)
        return meter.kept(1)[0, :2]

    def potential(self, position, velocity):
        self.state.write(position, velocity)
        return self.meter.potential_energy(TIME)
