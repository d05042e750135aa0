"""Sections 2.1 and 4.1: the sample data.plist, and the Sun and the Earth."""

import math
import tempfile
from pathlib import Path

import numpy as np

from mpp_taichi.accuracy.svg import Plot, PlotMark, Series
from mpp_taichi.importers.catalogue import import_scene
from mpp_taichi.scene.load import load_scene
from paper import runs
from paper.page import Figure, Row, Section, drawing, pictures

K = 0.0172
# The listing of section 2.1, word for word.
DATA_PLIST = """\
# filename: data.plist
#---- ID x y z m c r color (rgb)
pos 0 0.0 0.0 0.0 1.0 0.0 0.1 1.0 1.0 0.0
pos 1 1.0 0.0 0.0 3e-6 0.0 0.03 0.3 0.3 1.0
#---- ID vx vy vz
vel 0 0.0 0.0 0.0
vel 1 0.0 0.0172 0.0
#---- ID x y z // fixed=0, free=1
vfix 0 1 1 0
vfix 1 1 1 0
#---- gravitational Gauss constant
k2 2.9584e-4
#---- time step
dt 0.03
"""
END = 50_000  # days, of algorithm 1
YEAR = {"orbital_period": {"of": "earth", "around": "sun", "near": 365.3, "within": 1.0}}


def section(*, short):
    """The two-body problem and the program's first listing."""
    found = Section(
        "Sun and Earth",
        "Sections 2.1 and 4.1: a listing of two bodies, run to t = 50 000 by algorithm 1, and the year that it gives.",
    )
    found.rows += _listing(END / 25 if short else END)
    found.rows += _year()
    rows, figure = _jupiter(20_000 if short else 60_000)
    found.rows += rows
    with runs.start("sun_earth", {"integrator.leapfrog.dt": 0.3}) as run:
        shown = runs.show(run, [365.3], frames=120)
    found.figures.append(Figure("Sun and Earth", pictures([(shown[0], "sun_earth.yaml after one year")]), "The orbit closes."))
    found.figures.append(figure)
    return found


def _listing(end):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "data.plist"
        path.write_text(DATA_PLIST, encoding="utf-8")
        _, scene = import_scene(path)
    with runs.start(scene) as run:
        first = runs.energy(run)
        distance = runs.follow(run, _distance, duration=end)
        steps, drift = run.step_count, run.diagnostics()["center_of_mass"]
        error = abs(runs.energy(run) / first - 1.0)
        strength = run.spec.forces[0].parameters["strength"]
        read = {
            **{"m of particle 0": ("1.0", run.start.mass[0]), "r of particle 0": ("0.1", run.start.radius[0])},
            **{"x of particle 1": ("1.0", run.start.position[1, 0]), "m of particle 1": ("3e-6", run.start.mass[1])},
            **{"r of particle 1": ("0.03", run.start.radius[1]), "vy of particle 1": ("0.0172", run.start.velocity[1, 1])},
            "dt": ("0.03", run.dt),
        }
    where = "§2.1, data.plist"
    return [
        *(Row(where, f"{what} as read from the listing", printed, float(value)) for what, (printed, value) in read.items()),
        Row(where, "k², Gauss’s constant squared", "2.9584e-4", K**2, "The square of k = 0.0172 of §4.1."),
        Row(where, "k² as read from the listing", "2.9584e-4", strength),
        Row(
            "§2.1, algorithm 1",
            "while GetCurrentTime() < 50000",
            "the listing is stepped until then",
            f"{steps:,} steps to t = {run.time:,.0f}",
            "The whole of it." if end == END else "A part of it.",
            holds=bool(np.isfinite(distance).all()),
        ),
        Row(
            "§2.1, algorithm 1",
            "the planet stays on its circle, r",
            "1",
            float(distance.mean()),
            f"Between {distance.min():.7f} and {distance.max():.7f} in {steps:,} steps; energy off by {error:.0e} at the end.",
            1e-4,
        ),
        Row(
            where,
            "vel 0 0.0 0.0 0.0",
            "the Sun starts at rest",
            f"the centre of mass drifts by {np.linalg.norm(drift) / end:.1e} AU a day",
            "move_to_center_of_mass takes that away.",
        ),
    ]


def _distance(run):
    place = run.snapshot().position
    return float(np.linalg.norm(place[1] - place[0]))


def _year():
    year = runs.measure("sun_earth", YEAR, duration=372)["orbital_period"]
    light = runs.measure("sun_earth", YEAR, {"particles[1].body.mass": 1 / 330000}, duration=372)["orbital_period"]
    gauss = math.sqrt(load_scene(runs.SCENES / "outer_solar_system.yaml").forces[0].parameters["strength"])
    return [
        Row("§4.1", "Gauss’s constant k [AU^(3/2)/day]", "0.0172", gauss, "As outer_solar_system.yaml has it."),
        Row("§4.1", "period T of the Earth, measured in a run [days]", "365.3", year),
        Row(
            "§4.1", "the same with m₂ = 1/330000 [days]", "365.3", light, "The listing has 3e-6 = 1/333333, one per cent less."
        ),
        Row("§4.1", "T = 2π/v, v = k/√r [days]", "365.3", 2.0 * math.pi / K),
    ]


def _jupiter(duration):
    """How far Saturn is from where it were if Jupiter had no mass, at Jupiter's mass and ten times that."""
    jupiter = load_scene(runs.SCENES / "outer_solar_system.yaml").particles[1].parameters["mass"]
    paths = {}
    for factor in (0.0, 1.0, 10.0):
        changes = {"particles[1].body.mass": factor * jupiter, "move_to_center_of_mass": False}
        with runs.start("outer_solar_system", {**changes, "integrator": {"yoshida4": {"dt": 20.0}}}) as run:
            paths[factor] = runs.follow(run, _saturn, duration=duration)
    time = paths[0.0][0] / 365.25
    apart = {factor: np.linalg.norm(paths[factor][1:] - paths[0.0][1:], axis=0) for factor in (1.0, 10.0)}
    radius = float(np.linalg.norm(paths[0.0][1:], axis=0).mean())
    series = [
        Series(f"Jupiter × {factor:.0f}", number, [PlotMark(t, d) for t, d in zip(time, apart[factor])], marked=False)
        for number, factor in enumerate(apart)
    ]
    plot = Plot(
        "Saturn’s disturbance", "years", "distance from Saturn’s place without Jupiter’s pull [AU]", series, linear_x=True
    )
    said = (
        f"{apart[1.0].max():.2g} AU of {radius:.3g} at Jupiter’s own mass within {time[-1]:.0f} years, "
        f"{apart[10.0].max():.2g} at ten times"
    )
    row = Row(
        "§4.1",
        "disturbances by Jupiter",
        "observable only in the logged data; more interesting if Jupiter’s mass is increased",
        said,
        "Saturn beside the same run with a massless Jupiter.",
        holds=bool(apart[1.0][len(time) // 10] < 0.1 * radius and apart[10.0].max() > 3.0 * apart[1.0].max()),
    )
    return [row], Figure("Jupiter made heavier", drawing(plot), "Outer solar system, logged and subtracted.")


def _saturn(run):
    place = run.snapshot().position
    return (run.time, *(place[2] - place[0]))
