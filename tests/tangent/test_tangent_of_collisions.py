"""The tangent of event-driven spheres: the derivative of their flights and collisions, and the exponents of known gases."""

import math

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.errors import UnsupportedError

SHIFT = 2.0**-20  # of the start, along the deviation
ROUND_OFF = 2.0**-53
MEASURED = {"lyapunov": {"above": -1e9}}


def flying(particles, walls, *, restitution=1.0, dimensions=2, **keys):
    contacts = {"hard_spheres": {"solver": "event_driven", "restitution": restitution}}
    return {"dimensions": dimensions, "seed": 1, "particles": particles, "contacts": contacts, "walls": walls, **keys}


def body(name, position, velocity=(0, 0), mass=1, radius=0.4, free=True):
    place = {"position": list(map(float, position)), "velocity": list(map(float, velocity))}
    return {"body": {"name": name, "mass": mass, "radius": radius, "free": free, **place}}


def gas(count, edge, radius, dimensions=2, **keys):
    lower, upper = [0] * dimensions, [edge] * dimensions
    entry = {"gas": {"name": "gas", "count": count, "lower": lower, "upper": upper, "radius": radius, "temperature": 1}}
    entry["gas"]["radius_spread"] = 0.2
    return flying([entry], [{"box": {"lower": lower, "upper": upper}}], dimensions=dimensions, **keys)


def three(b_is_free=True):
    return [
        body("a", [-1, 0.2], [1, 0.3]),
        body("b", [1, 0], [-1, 0.1] if b_is_free else [0, 0], 3, 0.5, b_is_free),
        body("c", [0, 1.5], [0.2, -1], 2, 0.3),
    ]


BOWL = {"sphere": {"center": [0, 0], "radius": 3}}
FALL = [{"uniform_gravity": {"acceleration": [0, -1]}}]
SEGMENTS = [{"segment": {"from": [-2.5, -1], "to": [0, -2]}}, {"segment": {"from": [0.5, -1.2], "to": [2, -1]}}]
PISTON = [
    {"plane": {"point": [-3, 0], "normal": [1, 0.2], "velocity": [0.3, 0], "restitution": 0.9}},
    {"plane": {"point": [3, 0], "normal": [-1, 0]}},
]
CYLINDER = {"cylinder": {"point": [0, 0, 0], "axis": [0.2, 0.1, 1], "radius": 3}}

SCENES = {  # scene and time
    "gas": (gas(30, 7, 0.3), 0.6),
    "inelastic": (gas(30, 7, 0.3, restitution=0.8), 0.8),
    "spheres": (gas(40, 4, 0.3, 3), 0.6),
    "bowl": (flying(three(), [BOWL], restitution=0.9), 4.0),
    "falling in a bowl": (flying(three(), [BOWL], forces=FALL), 4.0),
    "one is held": (flying(three(False), [BOWL], forces=FALL), 4.0),
    "held along an axis": (flying([*three()[:2], body("c", [0, 1.5], [0.2, 0], free=[True, False, True])], [BOWL]), 5.0),
    "segments": (flying(three(), [*SEGMENTS, BOWL], forces=FALL), 3.0),
    "piston": (flying(three(), PISTON), 9.0),
    "periodic": (flying(three(), [{"periodic_box": {"lower": [-2, -2], "upper": [3, 3]}}]), 9.0),
    "cylinder": (
        flying([body("a", [-1, 0.2, 0], [1, 0.3, 0.2]), body("b", [1, 0, 0.3], [-1, 0.1, 0.2], 3)], [CYLINDER], dimensions=3),
        12.0,
    ),
}


def ends_of(simulation, time, calls=1):
    """Positions and velocities after a time, and the number of collisions until then."""
    for k in range(calls):
        simulation.run(until=time * (k + 1) / calls, judge="off")
    counts = simulation.contact_report.pair_count + simulation.contact_report.wall_count
    return np.concatenate(simulation.state.read()), counts


def run(scene, time, calls=1):
    """Positions and velocities and their deviation at the start and after a time, and the number of collisions."""
    with Simulation({**scene, "expect": MEASURED}, backend="cpu", precision="f64") as simulation:
        read = simulation.phase.tangent.read_deviation
        first, deviation = np.concatenate(simulation.state.read()), np.concatenate(read())
        end, counts = ends_of(simulation, time, calls)
        return first, deviation, end, np.concatenate(read()), counts


def runs_from(scene, time, starts):
    """Positions and velocities after a time from each start, and the numbers of collisions, without a tangent."""
    found = []
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for start in starts:
            simulation.restart()
            simulation.state.write(*np.split(start, 2))
            found.append(ends_of(simulation, time))
    return found


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.sampled(6)
def test_deviations_are_the_derivative_of_the_flights(name):
    scene, time = SCENES[name]
    first, deviation, end, found, counts = run(scene, time)
    d = deviation.shape[1]
    shift = np.zeros_like(first)
    shift[:, :d] = deviation * SHIFT
    ends = runs_from(scene, time, [first + k * shift for k in (-2, -1, 0, 1, 2)])
    np.testing.assert_array_equal(ends[2][0], end)  # the motion keeps its bits
    assert counts > 4 and all(each[1] == counts for each in ends)  # the same collisions, so that there is a derivative
    sides = [each[0][:, :d] for each in ends]
    near, far = (sides[3] - sides[1]) / (2 * SHIFT), (sides[4] - sides[0]) / (4 * SHIFT)
    by_difference = (4 * near - far) / 3
    # Each collision rounds places, velocities and its time some ten times; rounding errors grow as deviations do.
    rounding = 10 * counts * ROUND_OFF * np.abs(np.concatenate(sides)).max() * np.abs(found).max() / SHIFT
    assert rounding < 1e-4 * np.abs(found).max()
    assert np.abs(found - by_difference).max() < rounding + np.abs(near - far).max() ** 2
    assert np.abs(near - far).max() < 1e-4 * np.abs(found).max()  # of second order in the shift


@pytest.mark.sampled(3)
def test_the_deviation_does_not_depend_on_when_it_is_looked_at():
    scene = {**gas(30, 7, 0.3), "integrator": {"event_driven": {"dt": 0.25}}}
    once, often = run(scene, 6.0), run(scene, 6.0, calls=6)
    for k in (2, 3):
        np.testing.assert_array_equal(once[k], often[k])


@pytest.mark.sampled(3)
def test_deviations_are_rescaled_without_a_change_of_digits():
    scene, ends = {**gas(30, 7, 0.3), "expect": MEASURED}, []
    for scale in (1.0, 2.0**60, 2.0**-60):  # far outside of the range in which deviations are kept
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            meter = simulation.phase.tangent
            meter.write(*(scale * each for each in meter.read_deviation()))
            simulation.run(4.0, judge="off")
            ends.append((np.concatenate(meter.read_deviation()), meter.read().growth[0]))
    for deviation, growth in ends[1:]:
        np.testing.assert_allclose(deviation, ends[0][0], rtol=1e-13)  # by exp and logarithm of the scale
        assert growth == pytest.approx(ends[0][1], abs=1e-13)


@pytest.mark.sampled(3)
def test_a_run_goes_back_with_its_deviation():
    with Simulation({**gas(30, 7, 0.3), "expect": MEASURED}, backend="cpu", precision="f64") as simulation:
        simulation.run(1.0, judge="off")
        mark, meter = simulation.mark(), simulation.phase.tangent
        simulation.run(1.0, judge="off")
        ends = [(np.concatenate(meter.read_deviation()), meter.read())]
        simulation.return_to(mark)
        simulation.run(1.0, judge="off")
        ends.append((np.concatenate(meter.read_deviation()), meter.read()))
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    assert ends[0][1].growth[0] == ends[1][1].growth[0] and ends[0][1].megno[0] == ends[1][1].megno[0]


@pytest.mark.sampled(3)
def test_the_exponent_of_a_dilute_lorentz_gas_is_known():
    """A point among held disks at random places: λ = 2 n a v (1 − γ − ln 2 n a²), with γ of Euler.

    Source: van Beijeren & Dorfman, Phys. Rev. Lett. 74 (1995) 4412. A collision multiplies a deviation by 2 τ v/(a cos φ). Here
    the time τ to the next collision is exponentially distributed, and the density of φ is (cos φ)/2. Disks that do not overlap
    leave less room: the frequency is larger by the factor 1/(1 − π n a²), which is 0.3 % here.
    """
    count, radius, density, time = 1000, 1.0, 0.001, 4e6
    edge = math.sqrt(count / density)
    disks = {"gas": {"name": "disks", "count": count, "lower": [0, 0], "upper": [edge] * 2, "radius": radius, "mass": 1}}
    rates = []
    for seed in range(4):
        scene = flying(
            [body("point", [0, 0], [math.cos(1 + seed), math.sin(1 + seed)], 1e-12, 0.0), disks],
            [{"periodic_box": {"lower": [0, 0], "upper": [edge] * 2}}],
            seed=seed,
        )
        with Simulation({**scene, "expect": MEASURED}, backend="cpu", precision="f64") as simulation:
            simulation.run(time, judge="off")
            growth = simulation.phase.tangent.read()
            rates.append(growth.growth[0] / growth.time[0])
    frequency = 2 * density * radius
    known = frequency * (1 - np.euler_gamma - math.log(2 * density * radius**2))
    # In a long time t the variance of ln |δ| is ν t times that of ln τ − ln cos φ − λ τ: π²/6, 1 − π²/12, and (λ/ν)² − 2 λ/ν.
    ratio = known / frequency
    variance = math.pi**2 / 6 + (1 - math.pi**2 / 12) + ratio**2 - 2 * ratio
    deviation = known * math.sqrt(variance / (frequency * time * len(rates))) / ratio
    assert deviation < 0.005 * known
    assert np.mean(rates) == pytest.approx(known / (1 - math.pi * density * radius**2), abs=4 * deviation)


@pytest.mark.parametrize("solver", ["pairwise", "swept", "resting", "simultaneous", "located"])
def test_other_solvers_are_refused_by_name(solver):
    scene = {**gas(3, 4, 0.2), "expect": MEASURED, "integrator": {"leapfrog": {"dt": 0.01}}}
    scene["contacts"] = {"hard_spheres": {"solver": solver}}
    if solver == "located":
        scene["integrator"] = {"adaptive_bogacki_shampine": {"dt": 0.01}}
    with pytest.raises(UnsupportedError, match=f"which collisions of {solver} do not have"):
        Simulation(scene, backend="cpu")
