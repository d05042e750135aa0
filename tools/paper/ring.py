"""Section 4.4, appendix B, figures 8 and B.14: a planetary ring, and the speeds of its particles."""

import math

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.generators._elliptic import annulus_pull, elliptic_integrals
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

K = 0.0172
INNER, OUTER, SIGMA = 2.0, 2.5, 0.02
AREA = math.pi * (OUTER**2 - INNER**2)
PLACES = (1.5, 2.1, 2.25, 2.4, 3.0)
SATURN = 52.8e-9
MODES = np.arange(6, 31)  # angular, m: clumps from a sixth of the circle down to what is as long as half the ring is wide
CHANCE = 2.0  # power that chance exceeds once in a hundred thousand times: the mean of 25 exponential variables of mean 1
TURN = math.tau / (K * 2.25**-1.5)  # days, of the middle of the ring


def section(*, short):
    """Figure 8 and its three regimes, and figure B.14."""
    found = Section(
        "Planetary ring",
        "Section 4.4 and appendix B: 3072 particles around a planet at three masses, and the speed of a circular "
        "orbit in the field of "
        "planet and ring, eqs. (17) and (B.1)–(B.4).",
    )
    turns = 0.02 if short else 0.5
    rows, shown = _regimes(turns)
    found.rows += rows
    found.figures.append(
        Figure(
            "Figure 8",
            pictures(shown),
            f"The scene ring.yaml at the start and after {turns:g} turns, at three masses of the particles.",
            "A ring of particles with inner and outer radii, R1 and R2, and surface density ρ around a planet of mass M.",
        )
    )
    found.rows += _speeds()
    found.figures.append(_curve())
    found.rows += _slips()
    return found


def _regimes(turns):
    rows, shown, noise = [], [], {}
    for factor in (1, 500, 1000):
        with runs.start("ring", {"constants.mass_factor": factor, "run.duration": turns * TURN}) as run:
            if factor == 1:
                count, mass = run.start.particle_count - 1, float(run.start.mass[1])
                before = _clumping(run)
                shown += [(runs.show(run, [0.0])[0], "start")]
                rows += [Row("§4.4", "particles N", "3072", count), Row("§4.4", "mass of each, m/M", "1e-8", mass)]
            shown.append((runs.show(run, [run.spec.run.duration])[0], f"× {factor} after {turns:g} turns"))
            noise[factor] = (_clumping(run), _stirring(run), factor * mass * count)
    told = {
        1: ("nearly circular orbits, only small perturbations", noise[1][1] < 0.01 and noise[1][0] < CHANCE),
        500: ("perturbations become very strong", noise[500][1] > 10.0 * noise[1][1]),
        1000: ("some first clumpy structures", noise[1000][0] > max(2.0 * CHANCE, noise[500][0])),
    }
    for factor, (words, holds) in told.items():
        clumps, stirred, total = noise[factor]
        critical = 4.0 * math.pi**2 * (total / AREA) * 2.25**3
        rows.append(
            Row(
                "§4.4",
                f"masses × {factor}",
                words,
                f"radial speeds {stirred:.1%} of the orbital speed, clumps {clumps:.1f} times those of chance",
                f"After {turns:g} turns; ring mass {total:.3g} M, critical wavelength 4π²GΣ/κ² = {critical:.2g} beside a "
                f"spacing of "
                f"{math.sqrt(AREA / count):.3f}. Clumps: mean power |Σ exp(i m φ)|²/N of m = {MODES[0]} … {MODES[-1]}, "
                f"{before:.1f} at the start.",
                holds=bool(holds) if turns >= 0.5 else None,
            )
        )
    return rows, shown


def _ring_of(run):
    snapshot = run.snapshot()
    place, motion = snapshot.position[1:] - snapshot.position[0], snapshot.velocity[1:] - snapshot.velocity[0]
    return place, motion, np.linalg.norm(place[:, :2], axis=1)


def _stirring(run):
    """Root mean square of the radial speeds over that of the speeds."""
    place, motion, r = _ring_of(run)
    radial = np.sum(place * motion, axis=1) / r
    return float(np.sqrt(np.mean(radial**2) / np.mean(np.sum(motion**2, axis=1))))


def _clumping(run):
    """Mean power of angular modes, which is 1 for particles at random."""
    place, _, r = _ring_of(run)
    waves = np.exp(1j * MODES[:, None] * np.arctan2(place[:, 1], place[:, 0]))
    return float(np.mean(np.abs(waves.sum(axis=1)) ** 2) / len(r))


def _speed(r, density):
    """v of eq. (B.4) everywhere, by the closed form of the annulus."""
    return K * np.sqrt(1.0 / r + density * r * annulus_pull(r, INNER, OUTER))


def _potential_speed(r, density):
    """v of eq. (B.4) as the paper has it: the integral (B.3) by the midpoint rule, differentiated over one cell."""
    cells = 40_000
    h = (OUTER - INNER) / cells
    r = INNER + h * np.round((r - INNER) / h)  # whole cells, so that the logarithm in the middle of one stays where it is
    ring = INNER + h * (np.arange(cells) + 0.5)

    def potential(place):
        modulus = np.sqrt(4.0 * ring * place / (ring + place) ** 2)
        return -1.0 / place - 4.0 * density * h * np.sum(ring / (ring + place) * elliptic_integrals(modulus)[0])

    return K * math.sqrt(r * (potential(r + h) - potential(r - h)) / (2.0 * h))


def _speeds():
    rows = []
    for density, name in ((0.0, "σ = 0"), (SIGMA, "ρ = Mσ as printed"), (SIGMA / AREA, "σ = M_ring/M as said")):
        closed = _speed(np.array(PLACES), density)
        integral = [_potential_speed(r, density) for r in PLACES]
        off = float(np.abs(closed / np.array(integral) - 1.0).max())
        words = ", ".join(f"{r:g}: {v:.6f}" for r, v in zip(PLACES, closed))
        rows.append(
            Row(
                "Fig. B.14",
                f"v [AU a day] at r′, {name}",
                "solid line: σ = 0.02, dashed line: σ = 0",
                words,
                f"Closed form; the integral (B.3), differentiated numerically, agrees to {off:.0e}.",
                holds=off < 2e-3,
            )
        )
    saturn = float(np.abs(_speed(np.array(PLACES), SATURN / AREA) / _speed(np.array(PLACES), 0.0) - 1.0).max())
    words = f"changes the speeds by {saturn:.0e} of themselves at most"
    rows.append(Row("§4.4", "Saturn: M_ring/M = 52.8e-9", "the ring potential can be neglected", words, holds=saturn < 1e-6))
    scene = assemble(load_scene(runs.SCENES / "ring.yaml"))
    r = np.linalg.norm(scene.position[1:] - scene.position[0], axis=1)
    slow = float(np.abs(np.linalg.norm(scene.velocity[1:], axis=1) ** 2 * r / K**2 - 1.0).max())
    words = f"v² r/k² is 1 to {slow:.0e} for each particle of the scene"
    rows.append(
        Row(
            "§4.4", "without the ring’s potential", "v² = k²/r", words, "The rest is the softening of 0.005.", holds=slow < 1e-4
        )
    )
    rows += [
        Row("Fig. B.14", "R₁ of the scene: innermost particle", "2", float(r.min()), "", 1e-3),
        Row("Fig. B.14", "R₂ of the scene: outermost particle", "2.5", float(r.max()), "", 1e-3),
    ]
    return rows


def _curve():
    r = np.concatenate([np.linspace(0.5, 1.99, 120), 2.0 + np.linspace(0.002, 0.498, 120), np.linspace(2.51, 5.0, 140)])
    kinds = (("σ = 0", 0.0, -1, True), ("ρ = Mσ, σ = 0.02", SIGMA, 0, False), ("M_ring = 0.02 M", SIGMA / AREA, 4, False))
    series = [
        Series(name, number, [PlotMark(x, v) for x, v in zip(r, _speed(r, density))], marked=False, dashed=dashed)
        for name, density, number, dashed in kinds
    ]
    plot = Plot("Initial velocity in a ring", "r′ [AU]", "v [AU / day]", series, linear_x=True, linear_y=True)
    said = "With a solid line for each meaning of σ. At both rims v diverges like a root of a logarithm."
    paper = (
        "Initial velocity of a particle for a ring with R1 = 2, R2 = 2.5, k = 0.0172. Solid line: σ = 0.02, dashed line: σ = 0."
    )
    return Figure("Figure B.14", drawing(plot), said, paper)


def _slips():
    far = 1e4  # there the ring is a point but for (R/far)² = 1e-7 of its pull
    near = [float(_speed(np.array(OUTER - gap), SIGMA)) for gap in (1e-2, 1e-4, 1e-8)]
    return [
        Row(
            "App. B",
            "ratio of ring and central mass with ρ = Mσ, σ = 0.02",
            "0.02",
            float(SIGMA * annulus_pull(np.array(far), INNER, OUTER) * far**2),
            f"By its pull far away. ρ = Mσ and σ as a ratio of masses differ by the area {AREA:.4f}; Fig. B.14 does not say "
            "which.",
            correct="ρ = Mσ/[π(R₂² − R₁²)]",
        ),
        Row(
            "eqs. (B.3), (B.4)",
            "v² = r′ ∂φ/∂r′",
            "a velocity for every r′",
            f"v = {near[0]:.4f}, {near[1]:.4f}, {near[2]:.4f} at 1e-2, 1e-4, 1e-8 inside of R₂",
            "ρ = Mσ with σ = 0.02.",
            holds=near[2] - near[1] < 0.5 * (near[1] - near[0]),
            correct="diverges logarithmically at both rims of a sharp disc; particles keep a spacing away",
        ),
    ]
