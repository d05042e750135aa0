"""Elements of orbits back from a state: against REBOUND, against the elements that bodies were placed with, and in a run."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from measured import MadeUpSample

import mpp_taichi as mpp
from mpp_taichi import component
from mpp_taichi.arithmetic.orbital_elements import Orbit, orbit_of
from mpp_taichi.quantities._base import NoResultError, Setting
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

G = 2.9
ROUND_OFF = 2.0**-53
SUN = {"name": "sun", "mass": 1.5, "position": [0.1, -0.2, 0.3], "velocity": [0.01, 0.02, -0.03]}
ELEMENTS = ("semi_major_axis", "eccentricity", "inclination", "ascending_node", "argument_of_pericentre", "true_anomaly")
ORBITS = {
    "an ellipse": (2.0, 0.3, 0.4, 1.1, -2.2, 2.5),
    "nearly a line": (2.0, 0.999, 1.4, -2.8, 0.3, 3.0),
    "retrograde": (0.7, 0.5, 3.0, 2.0, 1.0, -1.0),
    "a hyperbola": (-1.5, 1.8, 0.9, 0.2, -0.4, 1.9),
    "a circle": (0.7, 0.0, 0.4, 0.8, 0.0, 2.0),
    "an ellipse in the plane": (0.7, 0.4, 0.0, 0.0, 1.7, -2.0),
    "a circle in the plane": (0.7, 0.0, 0.0, 0.0, 0.0, -2.0),
    "backwards in the plane": (0.7, 0.4, math.pi, 0.0, 1.7, -2.0),
}


def scene(*bodies, **more):
    return {
        "particles": [{"body": body} for body in bodies],
        "forces": [{"newtonian_gravity": {"strength": G}}],
        "integrator": {"leapfrog": {"dt": 0.001}},
    } | more


def planet(elements, name="planet", mass=0.2, around="sun"):
    return {"name": name, "mass": mass, "around": around} | dict(zip(ELEMENTS, elements, strict=True))


def sensitivity(elements):
    """How much a rounding of the state may move an angle: 1/e for the pericentre, 1/sin i for the node, and 1/(1 − e)."""
    _, e, i, *_ = elements
    return (1.0 / e if e > 1e-10 else 1.0) * (1.0 / math.sin(i) if 1e-10 < i < 3.1 else 1.0) / min(1.0, abs(1.0 - e))


@pytest.mark.parametrize("case", ORBITS)
def test_the_elements_of_a_placed_body_come_back(case):
    start = assemble(load_scene(scene(SUN, planet(ORBITS[case]))))
    found = orbit_of(start.position[1] - start.position[0], start.velocity[1] - start.velocity[0], G * 1.7)
    # Some forty operations on numbers up to 4.
    bound = 40 * 4 * ROUND_OFF * sensitivity(ORBITS[case])
    for name, element in zip(ELEMENTS, ORBITS[case], strict=True):
        apart = getattr(found, name) - element
        assert abs(apart if "axis" in name or name == "eccentricity" else math.remainder(apart, math.tau)) <= bound, name
    a = ORBITS[case][0]
    assert found.period == (pytest.approx(math.tau * math.sqrt(a**3 / (G * 1.7)), rel=bound) if a > 0 else math.inf)


NAMES = {"semi_major_axis": "a", "eccentricity": "e", "inclination": "inc", "ascending_node": "Omega", "period": "P"} | {
    "argument_of_pericentre": "omega",
    "true_anomaly": "f",
    "mean_anomaly": "M",
}


@pytest.mark.parametrize("primary", [None, "sun"])
def test_orbits_are_those_of_rebound(primary):
    """Three planets, one of them on a hyperbola; without a primary in Jacobi's coordinates, as REBOUND has them."""
    import rebound

    bodies = [planet(ORBITS[case], name) for case, name in (("an ellipse", "b"), ("retrograde", "c"), ("a hyperbola", "d"))]
    with mpp.Simulation(scene(SUN, *bodies), backend="cpu", precision="f64") as simulation:
        state, found = simulation.snapshot(), simulation.orbits(around=primary)
    other = rebound.Simulation()
    other.G = G
    for m, x, v in zip(state.mass, state.position, state.velocity, strict=True):
        other.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    theirs = other.orbits() if primary is None else other.orbits(primary=other.particles[0])
    assert list(found) == ["b", "c", "d"] and {each.name for each in fields(Orbit)} == set(NAMES)
    for mine, its in zip(found.values(), theirs, strict=True):
        for name, short in NAMES.items():
            ours, other_value = getattr(mine, name), getattr(its, short)
            if name == "period" and mine.eccentricity > 1.0:
                assert ours == math.inf
                continue
            # REBOUND takes angles from their cosines, which loses half of the digits near 0 and π; they are not near there.
            angle = name not in ("semi_major_axis", "eccentricity", "period")
            unbound = mine.eccentricity > 1.0 and name == "mean_anomaly"
            apart = math.remainder(ours - other_value, math.tau) if angle and not unbound else ours - other_value
            assert abs(apart) <= 1e4 * ROUND_OFF * max(1.0, abs(ours)), name


def measured(name, start, of=(1, 1), around=(0, 1), gravity=G, spec=None):
    quantity = component.build("quantities", name, {"of": of, "around": around})
    quantity.begin(Setting(spec or load_scene(scene(SUN, planet(ORBITS["an ellipse"]))), start))
    return quantity.measure(MadeUpSample(start, gravity=gravity))


@pytest.mark.parametrize("name", [*ELEMENTS, "osculating_period"])
def test_each_quantity_is_its_element(name):
    spec = load_scene(scene(SUN, planet(ORBITS["an ellipse"])))
    start = assemble(spec)
    orbit = orbit_of(start.position[1] - start.position[0], start.velocity[1] - start.velocity[0], G * 1.7)
    assert measured(name, start) == getattr(orbit, {"osculating_period": "period"}.get(name, name))
    quantity = component.build("quantities", name, {"of": (1, 1), "around": (0, 1)})
    assert quantity.label(Setting(spec, start)).endswith(" of planet around sun")


def test_orbits_that_do_not_exist_say_why():
    start = assemble(load_scene(scene(SUN, planet(ORBITS["a hyperbola"]))))
    with pytest.raises(NoResultError, match="not bound"):
        measured("osculating_period", start)
    still = replace(start, velocity=np.zeros((2, 3)))
    with pytest.raises(NoResultError, match="along one line"):
        measured("eccentricity", still)
    # A parabola whose speed, √(2 μ/r) with μ = 2 and r = 1, is exact.
    parabola = replace(
        start, position=np.array([[0.0, 0, 0], [1, 0, 0]]), velocity=np.array([[0.0, 0, 0], [0, 2, 0]]), mass=np.array([1.0, 1])
    )
    assert measured("eccentricity", parabola, gravity=1.0) == 1.0
    assert orbit_of(parabola.position[1], parabola.velocity[1], 2.0).semi_major_axis == math.inf
    with pytest.raises(NoResultError, match="parabola"):
        measured("semi_major_axis", parabola, gravity=1.0)
    with pytest.raises(NoResultError, match="needs gravity"):
        measured("inclination", start, spec=load_scene(scene(SUN, BALL, forces=[])))
    with pytest.raises(NoResultError, match="around itself"):
        measured("inclination", start, around=(0, 2))


BALL = {"mass": 1, "position": [1, 0, 0]}


def test_a_group_counts_as_a_body_at_its_centre_of_mass():
    """A planet around two stars that are held together: elements with the mass of both, from their centre of mass."""
    stars = [{"mass": 0.5, "position": [x, 0, 0], "velocity": [0, 0.25 * x, 0]} for x in (-0.125, 0.125)]
    start = assemble(load_scene(scene(*stars, {"mass": 0.0, "position": [2, 0, 0], "velocity": [0, 1, 0]})))
    expected = orbit_of(np.array([2.0, 0, 0]), np.array([0.0, 1, 0]), G)
    assert measured("semi_major_axis", start, of=(2, 1), around=(0, 2)) == expected.semi_major_axis


@pytest.mark.sampled(3)
def test_elements_are_constants_of_a_run_and_change_with_the_strength_of_gravity():
    """Two bodies keep their orbit, until gravity is four times as strong and their speed is no longer that of the orbit."""
    elements = (1.0, 0.25, 0.5, 0.3, 0.2, 0.0)
    bound = 1e-4  # leapfrog keeps a and e to (ω dt)² at pericentre, 7e-6 here
    given = scene(
        SUN,
        planet(elements, mass=0.0),
        run={"duration": 1.0},
        record={"table": {"columns": ["time", {"inclination": {"of": "planet", "around": "sun"}}]}},
        expect={
            "semi_major_axis": {"of": "planet", "around": "sun", "near": 1.0, "within": bound, "when": "largest"},
            "eccentricity": {"of": "planet", "around": "sun", "near": 0.25, "within": 4 * bound, "when": "smallest"},
        },
    )
    with mpp.run(given, backend="cpu", precision="f64", samples=4) as result:
        assert result.passed, str(result)
    with mpp.Simulation(given, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=1)  # at the start a change would place the bodies anew
        simulation.set("forces.newtonian_gravity.strength", 4 * G)
        state = simulation.snapshot()
        distance, speed = (np.linalg.norm(values[1] - values[0]) for values in (state.position, state.velocity))
        found = simulation.orbits()["planet"]
        assert 1.0 / found.semi_major_axis == pytest.approx(2.0 / distance - speed**2 / (4 * G * 1.5), rel=1e-13)
        with pytest.raises(mpp.ArgumentError, match="did you mean 'sun'"):
            simulation.orbits(around="snu")


HELD = SUN | {"velocity": [0, 0, 0], "free": False}


@pytest.mark.sampled(3)
def test_a_sun_that_is_held_does_not_answer():
    """μ is G m₁ then: a body placed by its elements keeps them in the run, and the elements and the period are those."""
    elements = (1.0, 0.25, 0.5, 0.3, 0.2, 0.0)
    period = math.tau / math.sqrt(G * 1.5)
    given = scene(HELD, planet(elements, mass=1.0), integrator={"leapfrog": {"dt": 0.001}}, run={"duration": 1.2 * period})
    bound = 1e-4  # leapfrog keeps a and e to (ω dt)² at pericentre, some 1e-5 here
    given["expect"] = {
        "orbital_period": {"of": "planet", "around": "sun", "near": period, "within": bound},
        "osculating_period": {"of": "planet", "around": "sun", "near": period, "within": bound, "when": "largest"},
        "eccentricity": {"of": "planet", "around": "sun", "near": 0.25, "within": 4 * bound, "when": "smallest"},
    }
    with mpp.run(given, backend="cpu", precision="f64", samples=20) as result:
        assert result.passed, str(result)
    for primary in (None, "sun"):
        with mpp.Simulation(given, backend="cpu", precision="f64") as simulation:
            found = simulation.orbits(around=primary)["planet"]
            # Some forty operations on numbers up to 4.
            assert (found.semi_major_axis, found.eccentricity) == pytest.approx((1.0, 0.25), abs=160 * ROUND_OFF)


def test_two_bodies_that_are_both_held_have_no_orbit():
    start = assemble(load_scene(scene(HELD, planet(ORBITS["an ellipse"]) | {"free": False})))
    with pytest.raises(NoResultError, match="a mass that attracts"):
        measured("eccentricity", start)


def test_a_held_axis_does_not_hold_a_body():
    """In the plane of the two free axes a sun is free: μ has both masses."""
    flat = [True, True, False]
    sun = SUN | {"position": [0, 0, 0], "velocity": [0, 0, 0], "free": flat}
    start = assemble(load_scene(scene(sun, planet(ORBITS["a circle in the plane"]) | {"free": flat})))
    assert measured("semi_major_axis", start) == pytest.approx(0.7, rel=160 * ROUND_OFF)
