"""Section 4.2 and figure 7, left: a planet around two stars, and when it is ejected."""

import math

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

YEAR = 365.25
JUPITER = 1.0 / 1047.3486  # of the Sun's mass, IAU 1976 and 2009 constants
FAR = 3.0  # AU; a planet beyond that and faster than the speed of escape is gone
LOOKS = 240
# The bundled scene by the report's method. The paper has star A on the other side: all is turned by half a turn.
SCENE = "kepler16"
METHOD = {"integrator": {"yoshida4": {"dt": 0.1}}}
SHOWN = {"view": {"camera": {"position": [0, 0, 2.6], "look_at": [0, 0, 0], "up": [0, 1, 0]}, "trails": 400}}
HALF_TURN = 180.0


def _at(distance=0.7048, angle=0.0):
    """What is changed for a planet at this distance [AU] and phase [degrees]."""
    return {**METHOD, "constants.distance": float(distance), "constants.phase": float(angle) + HALF_TURN}


def section(*, short):
    """The stars' and the planet's speeds and periods, and the distance at which it is lost."""
    found = Section(
        "Circumbinary planet",
        "Section 4.2: a planet around the two stars of Kepler-16 on circles, eqs. (11)–(14). The paper asks what "
        "happens if r_P is "
        "reduced, and when the planet will be ejected; here is the answer.",
    )
    found.rows += _speeds()
    distances = np.append(np.arange(0.40, 0.54, 0.04) if short else np.arange(0.38, 0.69, 0.02), 0.7048)
    phases = np.arange(0.0, 360.0, 90.0 if short else 45.0)
    years = 5.0 if short else 30.0
    lost = ejections(distances, phases, years)
    found.rows += _answer(distances, phases, years, lost)
    shown = []
    for distance, days in ((0.7048, 230.0), (0.42, 400.0)):
        with runs.start(SCENE, _at(distance, 0.0 if distance > 0.5 else 90.0) | SHOWN) as run:
            text = f"r_P = {distance:g} AU, {days:.0f} days"
            shown.append((runs.show(run, [days], frames=400)[0], text))
    found.figures.append(
        Figure(
            "Figure 7, left",
            pictures(shown),
            "Trails of the two stars and the planet.",
            "Planet P orbiting a binary system (A, B).",
        )
    )
    found.figures.append(_map(distances, phases, years, lost))
    return found


def _scene(changes):
    return load_scene(runs.SCENES / f"{SCENE}.yaml", overrides=changes)


def _speeds():
    start = assemble(_scene(_at()))
    speed = np.linalg.norm(start.velocity, axis=1)
    expect = {
        "orbital_period": [
            {"of": "star_b", "around": "star_a", "near": 41.0, "within": 1.0},
            {"of": "planet", "around": "star_a", "near": 229.0, "within": 1.0},
        ]
    }
    with runs.start(SCENE, _at()) as run:
        track = runs.follow(run, _distances, duration=230.0)
    periods = runs.measure(SCENE, expect, _at(), duration=260.0)["orbital_period"]
    kepler = math.tau * math.sqrt(0.2243**3 / (0.0172**2 * (0.6897 + 0.2026)))
    ours = "r_AB"
    return [
        Row("eq. (14)", "m_P = 0.333 M_Jup/M_sol", "0.318e-3", 0.333 * JUPITER),
        Row(
            "eq. (13)",
            "the stars keep to circles: mean of r_AB in a run",
            "0.2243",
            float(track[0].mean()),
            f"{ours} keeps to {np.ptp(track[0]):.1e} AU.",
        ),
        Row(
            "eq. (13)",
            "v_A, v_B, v_P [AU a day]",
            "balance of attraction and centrifugal force",
            f"{speed[0]:.7f}, {speed[1]:.7f}, {speed[2]:.7f}",
            f"Checked by the circles that they give: r_AB varies by {np.ptp(track[0]) / 0.2243:.0e} of itself.",
            holds=bool(np.ptp(track[0]) < 1e-3 * 0.2243),
        ),
        Row(
            "eq. (12)",
            "period of the stars [days]",
            "an effective one-body motion",
            f"{periods[0]:.3f} in a run, {kepler:.3f} by eq. (12)",
            holds=abs(periods[0] / kepler - 1.0) < 1e-3,
        ),
        Row(
            "§4.2",
            "orbit of the planet",
            "v_P² = k²(m_A + m_B)/r_P approximates a circle",
            f"r_P between {track[1].min():.4f} and {track[1].max():.4f} AU, first turn {periods[1]:.1f} days",
            "The two stars pull more than one at their centre.",
            holds=bool(np.ptp(track[1]) < 0.2 * 0.7048),
        ),
    ]


def _distances(run):
    place, mass = run.snapshot().position, run.start.mass
    middle = mass[:2] @ place[:2] / mass[:2].sum()
    return float(np.linalg.norm(place[1] - place[0])), float(np.linalg.norm(place[2] - middle))


def ejections(distances, phases, years):
    """Years until the planet is gone, (distances, phases), infinite where it stays: all run side by side in one launch."""
    starts = [assemble(_scene(_at(r, angle))) for r in distances for angle in phases]
    gone = np.full(len(starts), np.inf)
    with runs.start(SCENE, METHOD, replica_starts=starts) as run:
        strength = run.spec.forces[0].parameters["strength"]
        while run.time < years * YEAR:
            run.run(duration=years * YEAR / LOOKS)
            for number in np.flatnonzero(np.isinf(gone)):
                if _is_gone(run.snapshot(int(number)), strength):
                    gone[number] = run.time / YEAR
    return gone.reshape(len(distances), len(phases))


def _is_gone(snapshot, strength):
    mass = snapshot.mass[:2]
    middle, drift = (mass @ each[:2] / mass.sum() for each in (snapshot.position, snapshot.velocity))
    r, v = np.linalg.norm(snapshot.position[2] - middle), np.linalg.norm(snapshot.velocity[2] - drift)
    return bool(r > FAR and 0.5 * v**2 > strength * mass.sum() / r)


def _answer(distances, phases, years, lost):
    ejected = np.isfinite(lost)
    farthest = {float(angle): distances[ejected[:, k]].max(initial=0.0) for k, angle in enumerate(phases)}
    safe = max(farthest.values())
    words = ", ".join(f"{farthest[angle]:.2f} at {angle:.0f}°" for angle in (0.0, 90.0))
    stays = distances[distances > safe + 1e-9]
    return [
        Row(
            "§4.2",
            "“When will the planet be ejected?”",
            "an open question",
            f"within {years:.0f} years up to r_P = {safe:.2f} AU; the largest distances are {words}",
            f"{lost.size} runs side by side, r_P from {distances[0]:.2f} to {distances[-1]:.2f}, {len(phases)} phases of "
            f"the planet. Holman "
            "and Wiegert (Astron. J. 117 (1999) 621) have 0.51 AU for the innermost stable orbit.",
        ),
        Row(
            "§4.2",
            "r_P = 0.7048, as found by Doyle et al.",
            "the planet stays",
            f"from {stays.min():.2f} AU on every planet stays for {years:.0f} years" if len(stays) else "none stays",
            holds=bool(len(stays)) and not ejected[-1].any(),
        ),
    ]


def _map(distances, phases, years, lost):
    series = [
        Series(
            f"{angle:.0f}°",
            k,
            [
                PlotMark(
                    r,
                    t if np.isfinite(t) else years,
                    f"{angle:.0f}°, {r:.2f} AU: " + (f"{t:.1f} years" if np.isfinite(t) else "stays"),
                    bound=not np.isfinite(t),
                )
                for r, t in zip(distances, lost[:, k])
            ],
            joined=False,
        )
        for k, angle in enumerate(phases)
    ]
    plot = Plot("When the planet is gone", "r_P [AU]", "years until the planet is gone", series, linear_x=True)
    said = f"By distance and, in colours, phase. Hollow: still bound after {years:.0f} years."
    return Figure("When the planet is ejected", drawing(plot), said)
