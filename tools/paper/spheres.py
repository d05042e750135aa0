"""Sections 2.4 and 4.8, figures 4 and 12: collisions of two, what the paper says cannot be done, and Newton's cradle."""

import numpy as np

from paper import runs
from paper.page import Figure, Row, Section, pictures

BALLS = 5
# The cradle of figure 12 by other starts: what is changed, and what the paper says of it.
CRADLES = {
    "one ball": ({}, "ball ‘1’ comes in, ‘5’ swings away"),
    "two balls": ({"constants.k": 2}, "the number of balls pulled away can be changed easily"),
    "three balls": ({"constants.k": 3}, "the number of balls pulled away can be changed easily"),
    "‘1’ and ‘5’, v₅ = −v₁": ({"symmetric": True}, "a symmetric simulation"),
    "‘1’ twice as heavy": ({"particles[0].lattice.mass": 2}, "the physical explanation becomes non-trivial"),
}
PERIOD = 5.5  # there and back over 2 · 2.75 of free way at speed 1


def section(*, short):
    """Eqs. (5)–(10) on cases with known outcomes, and figure 12."""
    found = Section(
        "Hard spheres and Newton’s cradle",
        "Sections 2.4 and 4.8: collisions of two, eqs. (5)–(9), the symmetric situations that the paper’s model "
        "cannot do, and five balls in a row.",
    )
    found.rows += _pairs()
    found.rows += _limits()
    cases = dict(list(CRADLES.items())[:1]) if short else CRADLES
    for name, (changes, words) in cases.items():
        found.rows.append(_cradle(name, changes, words))
    found.figures.append(_pictures())
    return found


def two_balls(first, second, **more):
    """Two balls, each (mass, position, velocity), of radius 1/2."""
    bodies = [
        {"body": {"mass": mass, "position": list(place), "velocity": list(motion), "radius": 0.5}}
        for mass, place, motion in (first, second)
    ]
    return {
        "title": "Two balls",
        "dimensions": 2,
        "particles": bodies,
        "contacts": {"hard_spheres": {"solver": "event_driven"}},
        "run": {"duration": 4},
        **more,
    }


def _collide(first, second):
    """Velocities before and after, and the normal at the contact."""
    with runs.start(two_balls(first, second)) as run:
        before = run.snapshot()
        run.run()
        after = run.snapshot()
    # Both flew straight: at the time of contact t the distance is 1.
    x, v = before.position[1] - before.position[0], before.velocity[1] - before.velocity[0]
    a, b, c = v @ v, x @ v, x @ x - 1.0
    time = (-b - np.sqrt(b * b - a * c)) / a
    return before.velocity, after.velocity, (x + time * v)


def _pairs():
    before, after, _ = _collide((1.0, (-2, 0), (1, 0)), (1.0, (0, 0), (0, 0)))
    rows = [
        Row("§2.4", "equal masses, head-on, ‘2’ at rest: v₁′", "0", float(after[0, 0])),
        Row("§2.4", "equal masses, head-on, ‘2’ at rest: v₂′ = v₁", "1", float(after[1, 0])),
    ]
    masses = np.array([1.0, 3.0])
    before, after, normal = _collide((1.0, (-2, 0.2), (1.3, 0.1)), (3.0, (0, -0.1), (-0.4, 0.15)))
    other = masses[::-1] / masses.sum()
    expected = np.stack([before[k] - 2.0 * (normal @ (other[k] * (before[k] - before[1 - k]))) * normal for k in (0, 1)])
    off = float(np.abs(after - expected).max())
    momentum = float(np.abs(masses @ (after - before)).max())
    energy = float(abs(masses @ np.sum(after**2 - before**2, axis=1)))
    rows.append(
        Row(
            "eqs. (9a), (9b)",
            "an oblique collision, m₂ = 3 m₁",
            "v′ = v − 2⟨n₁₂, …⟩n₁₂",
            f"off by {off:.0e}",
            holds=off < 1e-13,
        )
    )
    words = f"momentum kept to {momentum:.0e}, energy to {energy:.0e}"
    return [*rows, Row("eq. (5)", "the same", "energy and momentum conservation", words, holds=max(momentum, energy) < 1e-13)]


def _limits():
    """What the paper gives up on: small ⟨n, v⟩, and symmetric contacts of more than two."""
    grazing = 1.0 - 1e-9
    before, after, _ = _collide((1.0, (-2, grazing), (1, 0)), (1.0, (0, 0), (0, 0)))
    turned = float(np.linalg.norm(after[0] - before[0]))
    kept = abs(float(np.sum(after**2) - 1.0))
    expect = {"mirror_error": {"below": 1.0}, "largest_overlap": {"below": 1.0}}
    found = runs.measure("billiard_break", expect)
    pairwise = runs.measure("billiard_break", expect, {"contacts.hard_spheres.solver": "pairwise"})["mirror_error"]
    with runs.start("one_on_two") as run:
        run.run()
        v = run.snapshot().velocity
    words = (
        f"v₀ = ({v[0, 0]:.4f}, {abs(v[0, 1]):.4f}), v₁ = ({v[1, 0]:.4f}, {v[1, 1]:.4f}), v₂ = ({v[2, 0]:.4f}, {v[2, 1]:.4f})"
    )
    return [
        Row(
            "§2.4",
            "grazing contact, 1e-9 of a radius deep",
            "numerically unstable because ⟨n₁₂, vₙ⟩ can become very small",
            f"v₁ turns by {turned:.1e}, energy kept to {kept:.0e}",
            "The exact time of contact is the root of a quadratic, here (1 − d²) = 2e-9 under it: "
            "v₁ turns by √(2e-9). Positions need no correction.",
            holds=abs(turned / np.sqrt(2e-9) - 1.0) < 1e-4 and kept < 1e-13,
            cured=True,
        ),
        Row(
            "§2.4",
            "the first shot in pool billiards",
            "cannot be simulated exactly",
            f"mirror images to {found['mirror_error']:.0e}, largest overlap {found['largest_overlap']:.0e}",
            f"By the solver simultaneous, all contacts at once; one pair after the other, as in the paper, it is off by "
            f"{pairwise:.2g} m.",
            holds=found["mirror_error"] < 1e-10,
            cured=True,
        ),
        Row(
            "§2.4",
            "one ball on two that touch",
            "only two-body collisions",
            words,
            "Exact: (−1/5, 0), (3/5, ±√3/5).",
            holds=float(np.abs(v[:, :2] - [[-0.2, 0], [0.6, np.sqrt(0.12)], [0.6, -np.sqrt(0.12)]]).max()) < 1e-13,
            cured=True,
        ),
    ]


def _changes(changes):
    """Overrides; a symmetric cradle is two single balls and three at rest, with equal ways to go."""
    if "symmetric" not in changes:
        return changes
    r = 0.125
    single = {"shape": [1], "radius": r}
    row = {"name": "row", "shape": [3], "lower": [0, 0], "upper": [4 * r, 0], "radius": r}
    coming = [
        {"lattice": {**single, "name": "coming", "lower": [-1 - 2 * r, 0], "upper": [-1 - 2 * r, 0], "velocity": [1, 0]}},
        {"lattice": row},
        {"lattice": {**single, "name": "going", "lower": [1 + 6 * r, 0], "upper": [1 + 6 * r, 0], "velocity": [-1, 0]}},
    ]
    return {"particles": coming, "walls": [{"box": {"lower": [-1.75, -0.5], "upper": [2.25, 0.5]}}]}


def _cradle(name, changes, words):
    with runs.start("newtons_cradle", _changes(changes)) as run:
        first = run.diagnostics()
        before = run.snapshot().velocity[:, 0]
        run.run(duration=1.5)
        after = run.snapshot().velocity[:, 0]
        mass = run.start.mass
        energy = abs(run.diagnostics()["total_energy"] / first["total_energy"] - 1.0)
    told = ", ".join(f"{v:+.3f}" for v in before), ", ".join(f"{v:+.3f}" for v in after)
    still = int(np.count_nonzero(np.abs(after) < 1e-12))
    holds = {
        "one ball": lambda: np.abs(after - [0, 0, 0, 0, 1]).max() < 1e-12,
        "‘1’ twice as heavy": lambda: still == 0 and abs(mass @ (after - before)) < 1e-12,
    }.get(name, lambda: np.allclose(np.sort(np.abs(after)), np.sort(np.abs(before)), atol=1e-12))
    text = f"velocities {told[0]} become {told[1]}"
    return Row(
        "§4.8",
        name,
        words,
        text,
        f"Energy kept to {energy:.0e}; after 1.5 units of time, before a wall is reached.",
        holds=bool(holds()) and energy < 1e-12,
    )


def _pictures():
    moments = (0.0, 1.02, 2.0, 3.5)
    with runs.start("newtons_cradle", {"view.camera.projection": "orthographic", "view.camera.height": 1.2}) as run:
        shown = runs.show(run, moments, size=(560, 160))
    return Figure(
        "Figure 12",
        pictures([(uri, f"t = {moment:g}") for uri, moment in zip(shown, moments)]),
        "newtons_cradle.yaml: coming in, at the contact, the last ball leaves, and comes back from the wall.",
        "Newton cradle simulation with five balls/spheres. The pendulum effect which lets the outer balls return is "
        "realized by reflecting walls.",
    )
