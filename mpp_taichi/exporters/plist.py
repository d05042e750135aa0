"""Particle lists of MPPhys: one command in each line (T. Müller, arXiv:1403.1695, §2.1 and appendix A), with all digits."""

from collections.abc import Iterable

import numpy as np

from mpp_taichi.exporters._source import Source

SUFFIXES = (".plist",)
AT_REST = 1e-12  # relative: more than rounding of a distance
COMMANDS = {"newtonian_gravity": "k2", "uniform_gravity": "grav", "linear_drag": "damp"}


def text(source: Source) -> str:
    """Particles, springs by types, and the forces on all particles.

    SceneError for a part of a scene for which a list has no command: other forces, softening, contacts, springs whose length at
    rest is not the distance at which their ends are placed.
    """
    state, rest = source.state, source.rest()
    if state.driven:
        raise source.refuse("a particle list has no bodies on paths")
    if state.changing:
        raise source.refuse("a particle list has no masses and charges that change")
    lines = ["# ID x y z m c r R G B"]
    columns = zip(rest, state.mass, state.charge, state.radius, state.color, strict=True)
    lines += [f"pos {k} {_row((*x, m, c, r, *color))}" for k, (x, m, c, r, color) in enumerate(columns)]
    lines += [f"vel {k} {_row(v)}" for k, v in enumerate(state.velocity) if v.any()]
    lines += [f"vfix {k} {' '.join(str(int(axis)) for axis in free)}" for k, free in enumerate(state.free) if not free.all()]
    lines += [f"dis {k} {_row(x)}" for k, x in enumerate(state.position - rest) if x.any()]
    return "\n".join([*lines, *_springs(source, rest), *_globals(source)]) + "\n"


def _springs(source: Source, rest: np.ndarray) -> Iterable[str]:
    springs = source.state.springs
    if springs.have_limits:
        raise source.refuse("a particle list has no springs that break or yield")
    if len(source.state.rods):
        raise source.refuse("a particle list has springs, and no rods")
    if not len(springs):
        return
    distance = np.linalg.norm(rest[springs.between[:, 1]] - rest[springs.between[:, 0]], axis=1)
    if off := np.flatnonzero(np.abs(distance - springs.rest_length) > AT_REST * distance).tolist():
        i, j = springs.between[off[0]]
        raise source.refuse(f"a particle list has springs that are at rest as placed, and that between {i} and {j} is not")
    kinds: dict[tuple[float, ...], int] = {}
    links = []
    for (i, j), stiffness, damping, color in zip(
        springs.between, springs.stiffness, springs.damping, springs.color, strict=True
    ):
        kind = kinds.setdefault((stiffness, damping, *color), len(kinds))
        links.append(f"sl {i} {j} {kind}")
    yield "# ID D c R G B, then i j ID"
    yield from (f"s {number} {_row(kind)}" for kind, number in kinds.items())
    yield from links


def _globals(source: Source) -> Iterable[str]:
    spec = source.spec
    if spec is None:
        return
    if spec.contacts is not None:
        raise source.refuse("a particle list has no contacts")
    for force in spec.forces:
        if force.name not in COMMANDS:
            raise source.refuse(f"a particle list has no {force.name}, only {', '.join(COMMANDS)}")
        if force.parameters.get("on") is not None or force.parameters.get("between") is not None:
            raise source.refuse(f"a particle list has no groups on which {force.name} acts")
        if force.parameters.get("softening"):
            raise source.refuse("a particle list has no softening")
        value = next(force.parameters[key] for key in ("strength", "acceleration", "coefficient") if key in force.parameters)
        yield f"{COMMANDS[force.name]} {_row(value if isinstance(value, tuple) else (value,))}"
    if "dt" in spec.integrator.parameters:
        yield f"dt {_row((spec.integrator.parameters['dt'],))}"


def _row(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
