"""The problems of benchmark_work_precision.py: bodies, the forces between them, a span, and where the bodies are at its end.

The reference is heyoka's Taylor method in long double at its tightest tolerance, and its error is told as the difference from a
run at a tolerance of 1e-17. For the cluster long double would take an hour, so its reference is of double, beside a tolerance
of 1e-14.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from benchmark_adaptive import JUPITER_YEAR, MASS, POSITION, VELOCITY
from benchmark_adaptive import G as SUN_G

FIGURE_EIGHT, DRUM = 6.32591398, 7


@dataclass
class Problem:
    """Bodies about their centre of mass under gravity, or on springs.

    Shapes: mass (n,), x and v (n, 3), ends of springs (s, 2), held (n,). `periods` is what a fixed step is counted in. A
    problem has a centre where one heavy body holds all others. `finest` is the number of evaluations of the force in the
    dearest run of a fixed step.
    """

    name: str
    mass: np.ndarray
    x: np.ndarray
    v: np.ndarray
    span: float
    periods: int
    g: float = 0.0
    centre: bool = False
    ends: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), int))
    stiffness: float = 0.0
    rest_length: float = 0.0
    held: np.ndarray | None = None
    finest: float = 1e6
    reference: tuple = (np.longdouble, 1e-17)  # heyoka's numbers, and the tolerance of the run beside the tightest

    def __post_init__(self):
        """With the reference, and its own error."""
        if self.held is None:
            self.held = np.zeros(len(self.mass), bool)
            weight = self.mass / self.mass.sum()
            self.x, self.v = self.x - weight @ self.x, self.v - weight @ self.v
        self.size = float(np.sqrt(((self.x - self.x.mean(0)) ** 2).sum(1).mean()))
        kind, tolerance = self.reference
        self.end, coarser = self._heyoka(kind, 0.0), self._heyoka(kind, tolerance)
        self.bar = float(self.error(coarser))

    @property
    def on_springs(self):
        """Whether springs are the only forces."""
        return len(self.ends) > 0

    def error(self, positions):
        """Largest of a body, over the root mean square distance from the centre."""
        return np.linalg.norm((positions - self.end).astype(float), axis=1).max() / self.size

    def _heyoka(self, kind, tolerance):
        run = self.heyoka(kind, tolerance, compact_mode=True)
        run.propagate_until(kind(self.span))
        return self.placed(run.state)

    def placed(self, state):
        """Positions of all bodies, from heyoka's state of the free ones."""
        free = np.array(state).reshape(-1, 6)[:, :3]
        found = self.x.astype(free.dtype)
        found[~self.held] = free
        return found

    def heyoka(self, kind, tolerance, **options):
        """Its integrator of the bodies that are not held; tolerance 0 is its tightest."""
        import heyoka

        free = ~self.held
        state = np.concatenate([np.r_[x, v] for x, v in zip(self.x[free], self.v[free])]).astype(kind)
        if self.on_springs:
            # Loops instead of one long text of code: the long text of 112 springs takes minutes to compile.
            system, options = self._spring_system(), {"compact_mode": True, **options}
        else:
            system = heyoka.model.nbody(len(self.mass), masses=list(self.mass), Gconst=self.g)
        return heyoka.taylor_adaptive(system, state, tol=kind(tolerance), fp_type=kind, **options)

    def _spring_system(self):
        """The equations of motion in heyoka's expressions; held bodies are numbers."""
        import heyoka

        place, speed, force = {}, {}, {}
        for i in range(len(self.mass)):
            place[i] = [float(c) for c in self.x[i]]
            if not self.held[i]:
                place[i] = list(heyoka.make_vars(*(f"{axis}_{i}" for axis in "xyz")))
                speed[i] = list(heyoka.make_vars(*(f"v{axis}_{i}" for axis in "xyz")))
                force[i] = [[], [], []]
        for i, j in self.ends:
            d = [b - a for a, b in zip(place[i], place[j])]
            inverse = heyoka.sum([c**2.0 for c in d]) ** -0.5
            pull = self.stiffness - self.stiffness * self.rest_length * inverse
            for c in range(3):
                for body, sign in ((i, 1.0), (j, -1.0)):
                    if body in force:
                        force[body][c].append(sign * pull * d[c])
        system = []
        for i, sums in force.items():
            system += list(zip(place[i], speed[i]))
            system += [(speed[i][c], heyoka.sum(sums[c]) / float(self.mass[i])) for c in range(3)]
        return system


def kepler(e=0.6):
    """Two bodies from the greatest distance, on an orbit of eccentricity e."""
    mass = np.array([1.0, 1e-3])
    speed = np.sqrt(mass.sum() * (1 - e) / (1 + e))
    x, v = np.array([[0, 0, 0], [1 + e, 0, 0]], float), np.array([[0, 0, 0], [0, speed, 0]], float)
    span = 100 * 2 * np.pi / np.sqrt(mass.sum())
    return Problem(f"Kepler, e = {e}, 100 orbits", mass, x, v, span, 100, g=1.0, centre=True)


def eccentric_kepler():
    """The same two bodies on an orbit of eccentricity 0.9: their least distance is a nineteenth of the greatest."""
    return kepler(0.9)


def figure_eight():
    """Chenciner & Montgomery's (Ann. Math. 152 (2000) 881)."""
    p, w = np.array([0.97000436, -0.24308753, 0]), np.array([-0.93240737, -0.86473146, 0])
    x, v = np.array([p, -p, np.zeros(3)]), np.array([-w / 2, -w / 2, w])
    return Problem("figure eight, 20 periods", np.ones(3), x, v, 20 * FIGURE_EIGHT, 20, g=1.0)


def outer_solar_system():
    """Sun, giants and Pluto."""
    name, span = "outer solar system, 50 orbits of Jupiter", 50 * JUPITER_YEAR
    return Problem(name, MASS, POSITION, VELOCITY, span, 50, g=SUN_G, centre=True)


def burrau():
    """The Pythagorean problem: masses 3, 4 and 5 at rest at the corners of a right triangle.

    Source: Burrau, Astron. Nachr. 195 (1913) 113.
    """
    x = np.array([[1, 3, 0], [-2, -1, 0], [1, -1, 0]], float)
    return Problem("Burrau's three bodies, t = 10", np.array([3.0, 4.0, 5.0]), x, np.zeros((3, 3)), 10.0, 10, g=1.0)


def pleiades():
    """Seven stars in a plane (Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993) p. 245)."""
    x, v = np.zeros((7, 3)), np.zeros((7, 3))
    x[:, 0], x[:, 1] = [3, 3, -1, -3, 2, -2, 2], [3, -3, 2, 0, 0, -4, 4]
    v[5:, 0], v[3:5, 1] = [1.75, -1.5], [-1.25, 1]
    return Problem("Pleiades, seven stars, t = 3", np.arange(1.0, 8.0), x, v, 3.0, 3, g=1.0)


def drum():
    """A square net of 7 × 7 masses on 112 springs at 1.5 of their rest length, its rim held, struck beside its middle.

    The slowest motion of small amplitude has ω² = 8 D (1 − 1/1.5) sin²(π/16) / m; the span is 20 of its periods.
    """
    side = DRUM + 2
    column, row = np.meshgrid(np.arange(side), np.arange(side))
    inside = ~((column % (side - 1) == 0) | (row % (side - 1) == 0))
    corner = (column % (side - 1) == 0) & (row % (side - 1) == 0)
    index = np.where(corner, -1, np.cumsum(~corner).reshape(side, side) - 1)
    links = [(index[r, c], index[r + dr, c + dc]) for r in range(side) for c in range(side) for dr, dc in ((0, 1), (1, 0))
             if r + dr < side and c + dc < side and (inside[r, c] or inside[r + dr, c + dc])]  # fmt: skip
    kept = ~corner
    middle = (side - 1) / 2
    x = np.stack([column[kept] - middle, row[kept] - middle, np.zeros(kept.sum())], axis=1)
    held, v = ~inside[kept], np.zeros((kept.sum(), 3))
    away = (x[~held] - [0.7, -1.1, 0.0]) ** 2
    v[~held] = np.exp(-away.sum(1) / 2.0)[:, None] * [0.4, 0.2, 1.5]
    slowest = math.sqrt(8 * (1 - 1 / 1.5)) * math.sin(math.pi / (2 * (DRUM + 1)))
    name = f"drum of {len(links)} springs, 20 periods"
    return Problem(
        name, np.ones(len(x)), x, v, 20 * 2 * math.pi / slowest, 20, ends=np.array(links), stiffness=1.0,
        rest_length=1 / 1.5, held=held, finest=1e5,
    )  # fmt: skip


def cluster():
    """256 stars in Plummer's sphere of mass 1 and energy −1/4, to t = 1/2, a sixth of a crossing time; no softening."""
    from mpp_taichi.scene.load import load_scene
    from mpp_taichi.start.assemble import assemble

    scene = {
        "seed": 256,
        "particles": [{"plummer": {"count": 256, "scale_radius": 3 * math.pi / 16}}],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {"leapfrog": {"dt": 1.0}},
    }
    start = assemble(load_scene(scene))
    return Problem(
        "cluster of 256 stars, t = 1/2", start.mass, start.position, start.velocity, 0.5, 1, g=1.0, finest=2e4,
        reference=(np.float64, 1e-14),
    )  # fmt: skip


PROBLEMS = {
    each.__name__: each
    for each in (kepler, eccentric_kepler, figure_eight, outer_solar_system, burrau, pleiades, drum, cluster)
}
