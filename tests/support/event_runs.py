"""An event-driven solver on arrays, without a scene around it."""

from types import SimpleNamespace

import numpy as np

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.device import backends
from mpp_taichi.walls._base import Enclosure, Surface


def plane(point, normal, velocity=(0.0, 0.0, 0.0), restitution=1.0):
    """A wall with particles on the side that its normal points to."""
    return Surface("plane", point, normal, 0.0, True, velocity, restitution, f"plane at {point}")


def box(*sides):
    """Planes at 0 and at the given lengths along x, y, z."""
    planes = []
    for k, side in enumerate(sides):
        n = tuple(float(k == a) for a in range(3))
        planes += [plane((0.0, 0.0, 0.0), n), plane(tuple(side * c for c in n), tuple(-c for c in n))]
    return tuple(planes)


class EventRun:
    """Spheres at (n, d) positions with velocities, and a solver bound to them; `start` begins anew, `to` goes on."""

    def __init__(self, position, velocity, radius, *, inverse_mass=None, surfaces=(), period=(0.0, 0.0, 0.0), precision="f64",
                 restitution=((1.0,),), material=None, gravity=(0.0, 0.0, 0.0), contact_time=0.0, **parameters):  # fmt: skip
        """One mass for each axis may be given, or one for all."""
        backends.start("cpu", precision)
        import taichi as ti

        from mpp_taichi.contacts.event_driven import EventDriven

        position = np.asarray(position, dtype=float)
        n, d = position.shape
        weight = np.ones(n) if inverse_mass is None else np.asarray(inverse_mass, dtype=float)
        self.setup = ContactSetup(
            dimensions=d,
            radius=np.broadcast_to(np.asarray(radius, dtype=float), (n,)).copy(),
            inverse_mass=np.tile(weight[:, None], (1, 3)) if weight.ndim == 1 else weight,
            material=np.zeros(n, np.int32) if material is None else np.asarray(material, np.int32),
            restitution=np.asarray(restitution, dtype=float),
            gravity=gravity,
            enclosure=Enclosure(tuple(surfaces), period),
        )
        self.state = SimpleNamespace(position=ti.Vector.field(d, float, n), velocity=ti.Vector.field(d, float, n), wide=ti.f64)
        self.real = np.float32 if precision == "f32" else np.float64
        self._write(position, velocity)
        log_capacity = parameters.pop("log_capacity", 0)
        self.solver = EventDriven(contact_time=contact_time, **parameters)
        self.solver.logs, self.solver.log_capacity = log_capacity > 0, log_capacity
        self.solver.bind(self.setup, self.state)
        self.start()

    def start(self, position=None, velocity=None, time=0.0):
        """Begin anew, from new places where they are given."""
        self._write(*(old if new is None else new for new, old in ((position, self.position), (velocity, self.velocity))))
        self.time = time
        self.solver.prepare(time)
        self.solver.collect()
        return self

    def to(self, time):
        """Go on to a time; the report of what happened."""
        self.solver.advance(self.time, time)
        self.time = time
        return self.solver.collect()

    def _write(self, position, velocity):
        self.state.position.from_numpy(np.ascontiguousarray(position, dtype=self.real))
        self.state.velocity.from_numpy(np.ascontiguousarray(velocity, dtype=self.real))

    @property
    def position(self):
        """(n, d)."""
        return self.state.position.to_numpy()

    @property
    def velocity(self):
        """(n, d)."""
        return self.state.velocity.to_numpy()

    @property
    def energy(self):
        """Kinetic, of spheres that are not held."""
        weight = self.setup.inverse_mass[:, 0]
        free = weight > 0
        return float((self.velocity[free].astype(float) ** 2 / weight[free, None]).sum() / 2)
