"""A reference that shares no code with the program: equations of motion in long double, extrapolated steps.

The force laws are written here again, from the text of a scene alone. Method: Gragg, Bulirsch, Stoer (Hairer, Nørsett and
Wanner, Solving Ordinary Differential Equations I, II.9 and II.14): Störmer's rule where forces depend on places alone, else the
modified midpoint rule for y' = f(t, y) with y = (x, v).
"""

import numpy as np

EXACT = np.longdouble
LONGEST = 12  # rows of the extrapolation table
TOLERANCE = EXACT(1e-17)  # of a step, relative to the largest position and velocity


def acceleration(spec, start):
    """a(t, x, v), (particle_count, 3), of a scene.

    Raises:
        SystemExit: the reference does not have a force of the scene.
    """
    mass, free = start.mass.astype(EXACT), start.free.astype(EXACT)
    terms = []
    for force in spec.forces:
        if force.name == "newtonian_gravity":
            terms.append(_pairs(force.parameters["strength"], force.parameters, mass, np.ones_like(mass)))
        elif force.name == "coulomb":
            charge = start.charge.astype(EXACT)
            response = -charge / np.where(charge != 0, mass, 1)
            terms.append(_pairs(force.parameters["coulomb_constant"], force.parameters, charge, response))
        elif force.name in LAWS:
            terms.append(LAWS[force.name](force.parameters, mass))
        else:
            raise SystemExit(f"the reference knows no {force.name}")
    if len(start.springs):
        terms.append(_springs(start.springs, mass, along=spec.spring_damping == "axial"))

    def of(t, x, v):
        return sum((term(t, x, v) for term in terms), np.zeros_like(x)) * free

    return of


def _pairs(strength, parameters, source, response):
    """strength · response_i Σ_j source_j d / (|d|² + ε²)^(3/2), d = x_j − x_i."""
    softening = EXACT(parameters.get("softening") or 0.0)

    def of(t, x, v):
        d = x[None, :, :] - x[:, None, :]
        squared = (d * d).sum(-1) + softening**2
        np.fill_diagonal(squared, 1)
        return EXACT(strength) * response[:, None] * np.einsum("ij,ijk->ik", source[None, :] / (squared * np.sqrt(squared)), d)

    return of


def _springs(springs, mass, *, along):
    """Hooke's law with damping, along the spring or of the whole relative velocity."""
    one, other = springs.between.T
    stiffness, damping, rest = (each.astype(EXACT) for each in (springs.stiffness, springs.damping, springs.rest_length))

    def of(t, x, v):
        d, u = x[other] - x[one], v[other] - v[one]
        length = np.sqrt((d * d).sum(-1))
        friction = (damping * (d * u).sum(-1) / length**2)[:, None] * d if along else damping[:, None] * u
        pull = (stiffness * (length - rest) / length)[:, None] * d + friction
        a = np.zeros_like(x)
        np.add.at(a, one, pull / mass[one, None])
        np.add.at(a, other, -pull / mass[other, None])
        return a

    return of


def _uniform(parameters, mass):
    g = np.array(parameters["acceleration"], EXACT)
    return lambda t, x, v: np.tile(g, (len(mass), 1))


def _drag(parameters, mass):
    rate = (EXACT(parameters["coefficient"]) / mass)[:, None]
    return lambda t, x, v: -rate * v


def _drive(parameters, mass):
    amplitude = np.array(parameters["force"], EXACT)[None, :] / mass[:, None]
    driven = np.zeros((len(mass), 1), EXACT)
    first, count = parameters.get("of") or (0, len(mass))
    driven[first : first + count] = 1
    frequency, phase = EXACT(parameters["angular_frequency"]), EXACT(parameters["phase"])
    return lambda t, x, v: np.sin(frequency * t + phase) * amplitude * driven


LAWS = {"uniform_gravity": _uniform, "linear_drag": _drag, "harmonic_drive": _drive}
NOT_OF_PLACES_ALONE = {"linear_drag", "harmonic_drive"}


def reference_end(spec, start, span):
    """Positions at the end of the span, (particle_count, 3), in long double."""
    return reference_state(spec, start, start.position.astype(EXACT), (start.velocity * start.free).astype(EXACT), 0.0, span)[0]


def reference_end_of_phases(phases, until):
    """Positions at the end of a run through the phases of a timeline, each with a time `at`, a `spec` and its `particles`."""
    start = phases[0].particles
    y = start.position.astype(EXACT), (start.velocity * start.free).astype(EXACT)
    ends = [*(phase.at for phase in phases[1:]), until]
    for phase, end in zip(phases, ends):
        began, end = max(phase.at, 0.0), min(end, until)
        if end > began:
            y = reference_state(phase.spec, phase.particles, y[0], y[1] * phase.particles.free, began, end)
    return y[0]


def reference_state(spec, start, position, velocity, began, ended):
    """Positions and velocities at the time `ended`, from those at the time `began`; masses and springs as in `start`."""
    of, moves = acceleration(spec, start), start.free.astype(EXACT)
    general = any(force.name in NOT_OF_PLACES_ALONE for force in spec.forces) or bool(np.any(start.springs.damping))
    steps = _midpoint_steps if general else _leapfrog_steps
    y = np.stack([position, velocity])
    t, ended = EXACT(began), EXACT(ended)
    h = (ended - t) / 64
    while t < ended:
        h = min(h, ended - t)
        found, rows = _extrapolated(steps, of, moves, t, y, h)
        if found is None:
            h /= 2
        else:
            t, y = t + h, found
            h *= EXACT(3) / 2 if rows < LONGEST - 2 else 1
    return y


def _extrapolated(steps, of, moves, t, y, h):
    """The state after h by 2, 4, 6 … steps, extrapolated, or None where it does not converge; and the rows of the table."""
    table, first = [], of(t, *y)
    for k in range(LONGEST):
        n = 2 * (k + 1)
        row = [steps(of, moves, t, y, first, h, n)]
        for j in range(k):
            ratio = (EXACT(n) / (2 * (k - j))) ** 2
            row.append(row[j] + (row[j] - table[j]) / (ratio - 1))
        size = np.abs(row[-1]).max(axis=(1, 2), keepdims=True)
        if k > 1 and (np.abs(row[-1] - row[-2]) / np.where(size > 0, size, 1)).max() <= TOLERANCE:
            return row[-1], k + 1
        table = row
    return None, LONGEST


def _leapfrog_steps(of, moves, t, y, first, h, n):
    """Störmer's rule, for forces of places alone: an error of even powers of h/n with one force in a step."""
    g, (place, velocity) = h / n, y
    w = velocity + g / 2 * first
    for _ in range(n - 1):
        place = place + g * w
        w = w + g * of(t, place, velocity)
    place = place + g * w
    return np.stack([place, w + g / 2 * of(t, place, velocity)])


def _midpoint_steps(of, moves, t, y, first, h, n):
    """The modified midpoint rule, for forces that depend on velocity or time."""
    g = h / n

    def rate(time, z):
        return np.stack([z[1] * moves, of(time, *z)])

    before, now = y, y + g * np.stack([y[1] * moves, first])
    for number in range(1, n):
        before, now = now, before + 2 * g * rate(t + number * g, now)
    return (before + now + g * rate(t + h, now)) / 2
