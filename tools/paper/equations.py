"""What the paper's equations say where they are printed wrongly, and limits that it states of itself."""

import math
import time

import numpy as np

from paper import runs
from paper.page import Row, Section
from paper.spheres import two_balls


def section(*, short):
    """Each equation as it is printed and as it must be, by numbers; then the limits."""
    found = Section(
        "Equations as printed, and stated limits",
        "Eqs. (4), (10) and (15) put into numbers as they are printed, beside runs; and what the paper says "
        "that its program cannot do.",
    )
    found.rows += [_spring(), _distance(), *_back_step()]
    found.rows += _limits(short)
    return found


def _spring():
    """Eq. (4) at a stretched spring whose end moves away, and what the program makes of it."""
    stiffness, damping, rest, place, speed = 5.0, 0.7, 1.0, 1.5, 0.4
    bodies = [
        {"body": {"mass": 1, "position": [0, 0, 0], "free": False}},
        {"body": {"mass": 1, "position": [place, 0, 0], "velocity": [speed, 0, 0]}},
    ]
    link = {"between": [0, 1], "stiffness": stiffness, "damping": damping, "rest_length": rest}
    scene = {"title": "Spring", "particles": bodies, "springs": [{"link": link}], "integrator": {"rk4": {"dt": 1e-4}}}
    with runs.start(scene) as run:
        run.run(steps=1)
        pulled = float(run.snapshot().velocity[1, 0] - speed) / run.dt
    # Of particle i = 1 with its neighbour j = 0: x_j − x_i = −place, the rate −speed; a = −Σ[…] as printed.
    bracket = -stiffness * (place - rest) - damping * speed
    return Row(
        "eq. (4)",
        "a stretched spring whose free end moves away: its acceleration",
        f"{-bracket:+.3f}".replace("+", ""),
        pulled,
        "As printed, m ẍ + Σ[…] = 0 with n pointing from i to j, it is pushed farther and friction speeds it up.",
        within=0.01,
        correct="m ẍ − Σ[…] = 0",
    )


def _distance():
    """Eq. (15) with d as printed, beside the measured pull in a choreography of three."""
    n, radius = 3, 2.0
    with runs.start("choreography_ring", {"constants.n": n, "constants.radius": radius}) as run:
        place = run.snapshot().position
    apart = float(np.linalg.norm(place[1] - place[0]))
    printed = 2.0 * radius**2 * (1.0 - math.cos(math.tau / n))
    return Row(
        "eq. (15), text",
        f"distance of neighbours for N = {n}, R = {radius:g}",
        f"{printed:.6f}",
        apart,
        "2R²(1 − cos ψ) is its square; r_i = R cos(2πi/N) is one component. Eq. (16) follows from the square.",
        correct="d² = 2R²(1 − cos ψ), r_i = R (cos, sin)",
    )


def _back_step():
    """Eq. (10) and the approximate correction for a moving ball on one at rest, overlapping by δ."""
    radius, overlap, speed = 0.5, 0.01, 1.0
    x = np.array([0.0, 2 * radius - overlap])
    v = np.array([speed, 0.0])
    normal = 1.0
    with np.errstate(divide="ignore"):
        steps = radius * overlap / (2 * radius) / (normal * v)
    a, b, c = speed**2, (x[1] - x[0]) * (v[1] - v[0]), (x[1] - x[0]) ** 2 - 4 * radius**2
    exact = (b + math.sqrt(b * b - a * c)) / a
    balls = [(1, (float(place), 0), (float(motion), 0)) for place, motion in zip(x - v * 0.5, v)]
    with runs.start(two_balls(*balls)) as run:
        run.run(duration=0.5)
        ours = run.snapshot().position[:, 0]
    moved = x - radius * overlap / (2 * radius) * normal
    left = 2 * radius - (moved[1] - moved[0])
    weights = np.array([1.0, 3.0])
    radii = np.array([0.5, 0.2])
    shift = float(weights @ (radii * overlap / radii.sum() * [-1, 1]))
    right = np.array([0.0, 1.0]) * exact + np.array([x[0] - v[0] * exact, x[1]])
    return [
        Row(
            "eq. (10)",
            f"back-step of a ball at rest, hit at speed {speed:g}, overlap {overlap:g}",
            "∞" if np.isinf(steps[1]) else f"{steps[1]:g}",
            float(exact),
            f"Δt₂ divides by ⟨n, v₂⟩ = 0, and Δt₁ = {steps[0]:g} is half of what it took. In the event-driven run the "
            f"balls are at "
            f"{ours[0]:.6f} and {ours[1]:.6f}, where this step puts them to {np.abs(ours - right).max():.0e}.",
            correct="one step for both, s = [b + √(b² − a c)]/a with a = |Δv|², b = Δx·Δv, c = |Δx|² − (r₁+r₂)²",
        ),
        Row(
            "§2.4",
            "overlap after x′ₙ = xₙ − rₙ δ/(r₁+r₂) n₁₂ for both balls",
            "0",
            float(left),
            "Both move the same way, so that equal balls overlap as before.",
            correct="the sign turns for n = 2",
        ),
        Row(
            "§2.4",
            "by how much it moves the centre of mass, r = 0.5, 0.2, m = 1, 3 (sign put right)",
            "0",
            shift / weights.sum(),
            "Weighted by radii.",
            correct="weights of the inverse masses",
        ),
    ]


def _limits(short):
    steps = 3 if short else 60
    with runs.start("ring") as run:
        run.run(steps=2)
        began = time.perf_counter()
        run.run(steps=steps)
        each = (time.perf_counter() - began) / steps
    year = 1.0 / each
    rows = [
        Row(
            "§4.4",
            "N = 3072 on a CPU",
            "extremely slow, which makes it necessary to switch to OpenCL",
            f"{1e3 * each:.1f} ms a step, {year:.0f} steps a second",
            "On this machine, in f64, while other sections run.",
        ),
    ]
    span = 2.0 if short else 20.0
    with runs.start("double_pendulum", {"integrator": {"adaptive_dop853": {"dt": 0.02, "tolerance": 1e-9}}}) as run:
        first = runs.energy(run)
        stamps, energies = runs.follow(run, lambda run: (run.time, runs.energy(run)), duration=span, looks=10**6)
    off = float(np.abs(energies / first - 1.0).max())
    even = float(np.ptp(np.diff(stamps)))
    rows.append(
        Row(
            "§4.5",
            "step size control",
            "not implemented, because this would make the visualization bumpy",
            f"energy off by {off:.0e} with frames {np.diff(stamps).mean():.3g} apart, even to {even:.0e}",
            "adaptive_dop853 chooses its own steps; frames come from the polynomial of each step.",
            holds=off < 1e-6 and even < 1e-12,
            cured=True,
        )
    )
    return rows
