"""Sections 2.3 and 4.5, figures 3 and 9: the damped oscillator, and the double pendulum with its largest step."""

import math

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.errors import StabilityError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

STIFFNESS = 4.0  # of the oscillator, with m = 1: ω₀ = 2, and γ = ω₀ at c = 4
CASES = {
    "no damping, c = 0": 0.0,
    "weak damping, γ² < ω₀²": 0.4,
    "aperiodic limit, γ² = ω₀²": 4.0,
    "overdamped, γ² > ω₀²": 10.0,
}
ANGLE = 0.6
GRAVITY = -1.8
STEPS = {"leapfrog": (0.028, 0.0285), "rk4": (0.040, 0.042)}


def section(*, short):
    """Eq. (3) in its regimes, eq. (18), and what a step too large does."""
    found = Section(
        "Springs and the double pendulum",
        "Sections 2.3 and 4.5: the free, damped oscillator of eq. (3) and figure 3, and two masses on springs, one "
        "of them stiff.",
    )
    rows, figure = _oscillator()
    found.rows += rows
    found.figures.append(figure)
    found.rows += _start()
    found.rows += _steps(3.0 if short else 20.0)
    with runs.start("double_pendulum") as run:
        shown = runs.show(run, [0.0, 0.7 if short else 3.0], frames=100 if short else 300)
    texts = ("at the start", "later, with the way that the masses came")
    found.figures.append(
        Figure(
            "Figure 9",
            pictures(list(zip(shown, texts))),
            "double_pendulum.yaml: the upper spring is nearly a rod, the lower one soft.",
            "The double pendulum consists of three particles: ‘0’ is fixed, whereas ‘1’ and ‘2’ can move in the xz-plane.",
        )
    )
    return found


def _scene(damping):
    return {
        "title": "Oscillator",
        "particles": [
            {"body": {"name": "wall", "mass": 1, "position": [0, 0, 0], "free": False}},
            {"body": {"name": "mass", "mass": 1, "position": [1, 0, 0], "displacement": [0.3, 0, 0]}},
        ],
        "springs": [{"link": {"between": ["wall", "mass"], "stiffness": STIFFNESS, "damping": damping}}],
        "integrator": {"rk4": {"dt": 2e-3}},
        "run": {"duration": 8},
    }


def _oscillator():
    rows, series = [], []
    slow = math.sqrt(STIFFNESS)
    for number, (name, damping) in enumerate(CASES.items()):
        with runs.start(_scene(damping)) as run:
            time, q = runs.follow(run, lambda run: (run.time, run.snapshot().position[1, 0] - 1.0))
        exact = _solution(time, damping)
        off = float(np.abs(q - exact).max() / 0.3)
        crossings = int(np.count_nonzero(np.diff(np.sign(q))))
        gamma = 0.5 * damping
        told = f"ω = {math.sqrt(slow**2 - gamma**2):.4f}, " if gamma < slow else ""
        statement = {
            "no damping, c = 0": "ω₀² = D/m, T = 2π/ω₀",
            "weak damping, γ² < ω₀²": "ω² = ω₀² − γ²",
            "aperiodic limit, γ² = ω₀²": "aperiodic limit",
        }.get(name, "no oscillation but an aperiodic creeping")
        words = f"{told}{crossings} passages through rest, off the formula by {off:.0e} of the amplitude"
        # rk4 errs by some (ω dt)⁴ ω t / 120 = 1e-11; what crosses zero oscillates
        rows.append(Row("§2.3", name, statement, words, holds=off < 1e-8 and (crossings > 0) == (gamma < slow)))
        series.append(Series(name, number, [PlotMark(t, x) for t, x in zip(time, q)], marked=False))
    plot = Plot("Damped oscillator", "t", "displacement q", series, linear_x=True, linear_y=True)
    paper = (
        "The most simple mass-spring model: a mass m that is connected to a wall by a spring with constant D and "
        "damping factor c."
    )
    return rows, Figure("Figure 3 in motion", drawing(plot), f"D = {STIFFNESS:g}, m = 1, four damping factors.", paper)


def _solution(t, damping):
    """Of eq. (3) with m = 1 from rest at q = 0.3, Kuypers, Klassische Mechanik."""
    gamma, square = 0.5 * damping, STIFFNESS - 0.25 * damping**2
    if square > 0.0:
        w = math.sqrt(square)
        return 0.3 * np.exp(-gamma * t) * (np.cos(w * t) + gamma / w * np.sin(w * t))
    if square == 0.0:
        return 0.3 * np.exp(-gamma * t) * (1.0 + gamma * t)
    w = math.sqrt(-square)
    return 0.15 * ((1.0 + gamma / w) * np.exp((w - gamma) * t) + (1.0 - gamma / w) * np.exp(-(w + gamma) * t))


def _start():
    spec = load_scene(runs.SCENES / "double_pendulum.yaml")
    start = assemble(spec)
    place = start.position[:, [0, 2]]
    formula = np.array([[math.sin(ANGLE), 1 - math.cos(ANGLE)], [2 * math.sin(ANGLE), 1 - 2 * math.cos(ANGLE)]])
    arms = np.linalg.norm(np.diff(place, axis=0), axis=1)
    return [
        Row(
            "eq. (18)",
            "x₁′, x₂′ of the scene",
            "l sin φ₁, l − l cos φ₁; …",
            ", ".join(f"({x:.6f}, {z:.6f})" for x, z in place[1:]),
            holds=bool(np.abs(place[1:] - formula).max() < 1e-14),
        ),
        Row("§4.5", "|x₁′ − x₀|, with l = 1", "1", float(arms[0])),
        Row("§4.5", "|x₂′ − x₁′|, with l = 1", "1", float(arms[1])),
        Row("§4.5", "D₁", "5e3", float(start.springs.stiffness[0])),
        Row("§4.5", "D₂", "5", float(start.springs.stiffness[1])),
        Row("§4.5", "g", "-1.8", float(spec.forces[0].parameters["acceleration"][2])),
    ]


def _steps(duration):
    rows = []
    for method, (held, broken) in STEPS.items():
        errors = {}
        for dt in (1e-3, held, broken):
            try:
                with runs.start("double_pendulum", {"integrator": {method: {"dt": dt}}}, force=True) as run:
                    limit = run.step_advice.limit
                    first = runs.energy(run)
                    time, now = runs.follow(run, lambda run: (run.time, runs.energy(run)), duration=duration, looks=1000)
                error = np.abs(now / first - 1.0)
                broken_at = time[error > 1.0]
                errors[dt] = f"crashes at t = {broken_at[0]:.2f}" if len(broken_at) else float(error.max())
            except StabilityError as error:
                errors[dt] = f"crashes at t = {error.time:.2f}"
        good = errors[1e-3]
        rows.append(
            Row(
                "§4.5",
                f"{method}, Δt ≈ 10⁻³",
                "should be small, e.g. Δt ≈ 10⁻³",
                f"energy off by {good:.1e}",
                holds=good < 1e-5,
            )
        )
        ends = {dt: each if isinstance(each, str) else f"energy off by {each:.1e}" for dt, each in errors.items()}
        rows.append(
            Row(
                "§4.5",
                f"{method}, step too high",
                "the simulation crashes and must be restarted",
                f"{held:g}: {ends[held]}; {broken:g}: {ends[broken]}",
                f"A crash is an energy that doubles. The limit is known before the run, {limit:.6f} here: the step advisor "
                f"refuses {broken:g} unless it is forced.",
                holds=not isinstance(errors[held], str) and isinstance(errors[broken], str),
            )
        )
    return rows
