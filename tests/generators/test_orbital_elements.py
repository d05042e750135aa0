"""Bodies placed by their orbital elements, against REBOUND's conversion and the laws of the orbit."""

import math

import numpy as np
import pytest

from mpp_taichi import SceneError
from mpp_taichi.generators._orbit import true_anomaly_at
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

ROUND_OFF = 2.0**-53
G = 2.9


def scene(*bodies, **more):
    return {
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": G}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
    } | more


SUN = {"name": "sun", "mass": 1.5, "position": [0.1, -0.2, 0.3], "velocity": [0.01, 0.02, -0.03]}
PLANET = {"name": "planet", "mass": 0.2, "around": "sun", "semi_major_axis": 2.0, "eccentricity": 0.3, "inclination": 0.4}
ANGLES = {"ascending_node": 1.1, "argument_of_pericentre": -2.2}
ORBITS = {
    "an ellipse": PLANET | ANGLES | {"true_anomaly": 2.5},
    "by its mean anomaly": PLANET | ANGLES | {"mean_anomaly": 4.0},
    "nearly a line": PLANET | {"eccentricity": 0.999, "mean_anomaly": 0.01},
    "retrograde": PLANET | ANGLES | {"inclination": 3.0, "true_anomaly": -1.0},
    "a hyperbola": PLANET | ANGLES | {"semi_major_axis": -1.5, "eccentricity": 1.8, "true_anomaly": 1.9},
    "far out on a hyperbola": PLANET | {"semi_major_axis": -1.5, "eccentricity": 1.2, "mean_anomaly": -300.0},
    "a circle": {"mass": 0.0, "around": 0, "semi_major_axis": 0.7},
}


@pytest.mark.parametrize("case", ORBITS)
def test_places_and_velocities_are_those_of_rebound(case):
    import rebound

    orbit = ORBITS[case]
    found = assemble(load_scene(scene(SUN, orbit)))
    other = rebound.Simulation()
    other.G = G
    other.add(m=SUN["mass"])
    names = {"semi_major_axis": "a", "eccentricity": "e", "inclination": "inc", "ascending_node": "Omega"}
    names |= {"argument_of_pericentre": "omega", "true_anomaly": "f", "mean_anomaly": "M", "mass": "m"}
    other.add(primary=other.particles[0], **{names[key]: value for key, value in orbit.items() if key in names})
    x, v = np.array(other.particles[1].xyz), np.array(other.particles[1].vxyz)
    # Some thirty operations; an anomaly's error is that of M over dM/df = (r/a)²/√|1 − e²|, at most 30 times as large here.
    for mine, its, offset in ((found.position, x, SUN["position"]), (found.velocity, v, SUN["velocity"])):
        assert np.abs(mine[1] - mine[0] - its).max() <= 30 * 30 * ROUND_OFF * (np.linalg.norm(its) + np.abs(offset).max())


def test_a_moon_goes_around_its_planet_and_keeps_the_elements_it_was_given():
    moon = {
        "mass": 0.0,
        "around": "planet",
        "semi_major_axis": 1e-3,
        "eccentricity": 0.1,
        "inclination": 1.0,
        "mean_anomaly": 1.0,
    }
    found = assemble(load_scene(scene(SUN, PLANET, moon)))
    x, v = found.position[2] - found.position[1], found.velocity[2] - found.velocity[1]
    mu, h = G * 0.2, np.cross(x, v)
    lost = 1e3 * 20 * ROUND_OFF  # differences of numbers a thousand times as large
    assert v @ v == pytest.approx(mu * (2.0 / np.linalg.norm(x) - 1e3), rel=4 * lost)
    assert h[2] / np.linalg.norm(h) == pytest.approx(math.cos(1.0), abs=4 * lost)
    assert np.linalg.norm(np.cross(v, h) / mu - x / np.linalg.norm(x)) == pytest.approx(0.1, abs=8 * lost)


@pytest.mark.parametrize("eccentricity", [0.0, 0.2, 0.9, 0.999999, 1.000001, 1.5, 40.0])
def test_the_mean_anomaly_of_what_was_found_is_the_one_asked_for(eccentricity):
    e = eccentricity
    for mean in (-3.1, -1e-9, 0.0, 1e-3, 0.7, math.pi, 2.0):
        f = true_anomaly_at(mean, e)
        if e < 1.0:
            eccentric = 2.0 * math.atan2(math.sqrt(1.0 - e) * math.sin(f / 2), math.sqrt(1.0 + e) * math.cos(f / 2))
            back, slope = eccentric - e * math.sin(eccentric), 1.0 + e
        else:
            eccentric = 2.0 * math.atanh(math.sqrt((e - 1.0) / (e + 1.0)) * math.tan(f / 2))
            back, slope = e * math.sinh(eccentric) - eccentric, e * math.cosh(eccentric)
        # The way back loses where f is near its end: an ulp of f there is so many of the half angle's tangent.
        lost = 8 * ROUND_OFF * max(1.0, math.tan(abs(f) / 2) ** 2) * max(1.0, slope) * max(1.0, abs(eccentric))
        assert math.remainder(back - mean, math.tau) == pytest.approx(0.0, abs=lost * (1.0 + e) / abs(1.0 - e) ** 0.5)


REFUSED = {
    "needs a position": {"mass": 1.0},
    "leave one of them out": PLANET | {"position": [1, 0, 0]},
    "an orbit needs around": {"mass": 1.0, "semi_major_axis": 1.0},
    "inclination is of an orbit": {"mass": 1.0, "position": [1, 0, 0], "inclination": 0.1},
    "eccentricity 1 is a parabola": PLANET | {"eccentricity": 1.0},
    "is a hyperbola, whose semi_major_axis is below 0": PLANET | {"eccentricity": 1.3},
    "is an ellipse, whose semi_major_axis is above 0": PLANET | {"semi_major_axis": -1.0},
    "beyond the asymptotes": PLANET | {"semi_major_axis": -1.0, "eccentricity": 2.0, "true_anomaly": 2.2},
    "a true_anomaly and a mean_anomaly": PLANET | {"true_anomaly": 1.0, "mean_anomaly": 1.0},
    "farther out": PLANET | {"semi_major_axis": -1.0, "eccentricity": 2.0, "mean_anomaly": 1e200},
}


@pytest.mark.parametrize("said", REFUSED)
def test_what_is_no_orbit_is_refused_at_its_line(said):
    with pytest.raises(SceneError) as error:
        assemble(load_scene(scene(SUN, REFUSED[said])))
    assert said in str(error.value) and "particles[1].body" in str(error.value) and "\n" not in str(error.value)


def test_an_orbit_needs_what_attracts():
    with pytest.raises(SceneError, match="needs newtonian_gravity"):
        assemble(load_scene(scene(SUN, PLANET, forces=[])))
    with pytest.raises(SceneError, match="placed later"):
        assemble(load_scene(scene(PLANET | {"around": 1}, SUN)))
