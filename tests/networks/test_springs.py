"""Springs: the oscillator in its three regimes for every integrator, and difficult networks."""

import logging
import math

import hard_networks
import numpy as np
import pytest

from mpp_taichi import Simulation, component

UNIT = {"f64": 2.0**-53, "f32": 2.0**-24}
DAMPINGS = {"underdamped": 0.25, "critical": 2.0, "overdamped": 4.0}
ALSO_IN_F32 = ("leapfrog", "rk4", "newmark", "bdf2")  # the same text with another type: one of each family
START, PUSH = 0.5, -0.25  # stretch and its rate


def order_of(name):
    return component.build("integrators", name, {"dt": 1.0}).order


def oscillators(integrator, dt):
    """Masses of 1 on springs of 1 along x, one in each regime, side by side; all numbers are exact in binary."""
    particles, springs = [], []
    for k, damping in enumerate(DAMPINGS.values()):
        particles += [
            {"body": {"mass": 1.0, "position": [0, k, 0], "free": False}},
            {"body": {"mass": 1.0, "position": [2, k, 0], "displacement": [START, 0, 0], "velocity": [PUSH, 0, 0]}},
        ]
        springs.append({"link": {"between": [2 * k, 2 * k + 1], "stiffness": 1.0, "damping": damping}})
    return {"particles": particles, "springs": springs, "integrator": {integrator: {"dt": dt}}}


def closed_form(damping, time):
    """Stretch and rate of x" = −x − c x′: x = e^{−γt} [x₀ C + (v₀ + γ x₀) S], S the limit t where γ = ω₀."""
    gamma = damping / 2.0
    if gamma < 1.0:
        omega = math.sqrt(1.0 - gamma**2)
        c, s = math.cos(omega * time), math.sin(omega * time) / omega
    elif gamma == 1.0:
        c, s = 1.0, time
    else:
        kappa = math.sqrt(gamma**2 - 1.0)
        c, s = math.cosh(kappa * time), math.sinh(kappa * time) / kappa
    fade = math.exp(-gamma * time)
    return fade * (START * c + (PUSH + gamma * START) * s), fade * (PUSH * c - (gamma * PUSH + START) * s)


def errors_in_each_regime(simulation, count):
    """Largest error of stretch and rate after 0.5 and 4, with 1/count as step: the fast part of the overdamped one is over."""
    simulation.dt = 1.0 / count
    simulation.restart()
    errors = np.zeros(3)
    for time in (0.5, 4.0):
        simulation.run(until=time)
        end = simulation.snapshot()
        for k, damping in enumerate(DAMPINGS.values()):
            stretch, rate = closed_form(damping, time)
            error = max(abs(end.position[2 * k + 1, 0] - 2.0 - stretch), abs(end.velocity[2 * k + 1, 0] - rate))
            errors[k] = max(errors[k], error)
    return errors


def rounding(precision, count):
    """Each of the 4·count steps rounds a position of about 2 once or twice: a random walk of one unit a step, six deviations
    wide; inexact coefficients of the increments add up to a few units in each of the 4 units of time."""
    return UNIT[precision] * (6.0 * math.sqrt(4.0 * count) + 5.0 * 4.0)


# The order of every method beside friction is asked in test_integrators; here are regimes, and single precision.
@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", [*ALSO_IN_F32, "implicit_euler", "energy_momentum"])
def test_an_oscillator_of_each_regime_follows_the_closed_form_to_the_order(name):
    order = order_of(name)
    finest = {1: 4096, 2: 1024}.get(order, 512)
    counts = [finest // 8, finest // 4, finest // 2, finest]
    with Simulation(oscillators(name, 1.0 / finest), backend="cpu", precision="f64") as simulation:
        exact = {count: errors_in_each_regime(simulation, count) for count in counts}
    for k, regime in enumerate(DAMPINGS):
        errors = np.array([exact[count][k] for count in counts])
        seen = np.flatnonzero(errors > [rounding("f64", count) for count in counts])[-3:]
        if len(seen) == 3:
            slope = -np.polyfit(np.log(np.array(counts)[seen]), np.log(errors[seen]), 1)[0]
            assert slope == pytest.approx(order, abs=0.15), f"{regime}: {errors}"
        else:  # a method that is exact on an oscillator shows nothing but rounding
            assert len(seen) == 0, f"{regime}: {errors}"
    if name not in ALSO_IN_F32:
        return
    with Simulation(oscillators(name, 1.0 / finest), backend="cpu", precision="f32") as simulation:
        for count in counts:
            excess = errors_in_each_regime(simulation, count) - exact[count]
            assert (excess <= rounding("f32", count)).all(), f"f32, dt = 1/{count}: {excess}"


# --- special springs ----------------------------------------------------------------------------------------------------


def ladder(scene, halvings=3, looks=20, steps=40):
    """Relative energy error, largest over the run, for dt, dt/2, …; and the last snapshot."""
    errors = []
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        dt = simulation.dt
        for k in range(halvings):
            simulation.dt = dt / 2**k
            simulation.restart()
            energy = simulation.diagnostics()["total_energy"]
            changes = []
            for _ in range(looks):
                simulation.run(steps=steps * 2**k)
                changes.append(simulation.diagnostics()["total_energy"] - energy)
            errors.append(np.abs(changes).max() / energy)
        return errors, simulation.snapshot()


@pytest.mark.sampled(3)
def test_a_spring_of_rest_length_zero_is_an_isotropic_linear_oscillator():
    """Its orbit is the ellipse x₀ cos ωt + v₀/ω sin ωt about the wall; a radial one passes through the wall undisturbed."""
    errors = {}
    for start in ([0.8, 0, 0.3], [0.0, 0.6, -0.2]):
        scene = hard_networks.zero_rest_length("rk4", dt=0.01)
        scene["particles"][1]["body"]["position"] = start
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            begin = simulation.start
            simulation.run(steps=1000)
            end = simulation.snapshot()
        turned = 2.0 * end.time
        ellipse = begin.position[1] * math.cos(turned) + begin.velocity[1] / 2.0 * math.sin(turned)
        errors[tuple(start)] = np.abs(end.position[1] - ellipse).max()
    # rk4 turns an oscillator too slowly by (ω dt)⁵/120 a step: 1000 steps of 0.02 are 2.7e-8 of a radian.
    assert max(errors.values()) < 1e-7


def test_a_radial_orbit_passes_through_the_place_of_the_other_end():
    scene = hard_networks.zero_rest_length("rk4", dt=math.pi / 4 / 100)
    scene["particles"][1]["body"] |= {"position": [0.8, 0, 0], "velocity": [0, 0, 0]}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=100)  # a quarter of a period π: at the wall to rounding and the method's error
        assert np.abs(simulation.snapshot().position[1]).max() < 1e-8
        simulation.run(steps=100)
        np.testing.assert_allclose(simulation.snapshot().position[1], [-0.8, 0, 0], atol=1e-8)


@pytest.mark.sampled(3)
def test_springs_between_the_same_particles_add():
    single = hard_networks.chain_of([1.0], [3.0], damping=0.5)
    double = hard_networks.chain_of([1.0], [1.0], damping=0.2)
    double["springs"].append({"link": {"between": [1, 0], "stiffness": 2.0, "damping": 0.3}})
    ends = []
    for scene in (single, double):
        with Simulation(hard_networks.with_integrator(scene, "leapfrog", 0.01), backend="cpu", precision="f64") as simulation:
            ends.append(simulation.run(steps=300).snapshot())
    np.testing.assert_allclose(ends[0].position, ends[1].position, rtol=0, atol=300 * 4 * UNIT["f64"])


def test_coincident_ends_exert_nothing_on_one_another_until_something_parts_them(caplog):
    """Alone, they fly on together for ever, to the last bit, with their spring fully compressed."""
    pair = [{"body": {"mass": m, "position": [1, 2, 3], "velocity": [0.25, 0, -0.5]}} for m in (1.0, 5.0)]
    springs = [{"link": {"between": [0, 1], "stiffness": 1e2, "rest_length": 1.0, "damping": 0.5}}]
    scene = hard_networks.with_integrator({"particles": pair, "springs": springs}, "leapfrog", 1 / 64)
    with caplog.at_level(logging.WARNING), Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert simulation.diagnostics()["potential_energy"] == 50.0
        end = simulation.run(steps=64_000).snapshot()
    assert [("same place" in record.getMessage()) for record in caplog.records] == [True]
    assert end.position.tolist() == [[251, 2, -497], [251, 2, -497]]


@pytest.mark.sampled(3)
def test_a_spring_of_stiffness_zero_leaves_its_ends_alone_or_only_brakes_them():
    with Simulation(hard_networks.zero_stiffness(), backend="cpu", precision="f64") as simulation:
        end = simulation.run(steps=1000).snapshot()
    np.testing.assert_allclose(end.position, [[5, 2.5, 0], [-1.5, 5, 0]], rtol=1e-12)
    damped = hard_networks.zero_stiffness(damping=2.0)
    for body in damped["particles"]:
        body["body"]["velocity"][1] = 0.0
    with Simulation(damped, backend="cpu", precision="f64") as simulation:
        end = simulation.run(duration=1.0).snapshot()
    # Along one line (v₂ − v₁)′ = −c/μ (v₂ − v₁), μ = 3/4; each of a hundred kicks errs by (c dt/μ)³/6 = 3.2e-6 of itself.
    assert end.velocity[1, 0] - end.velocity[0, 0] == pytest.approx(-0.75 * math.exp(-8.0 / 3.0), rel=3.4e-4)


# --- hard networks ------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
@pytest.mark.parametrize("make", hard_networks.SMOOTH, ids=lambda make: make.__name__)
@pytest.mark.parametrize("name", ["leapfrog", "rk4"])
def test_a_smooth_network_keeps_its_energy_to_the_order_of_the_method(make, name):
    errors, end = ladder(make(name))
    assert np.isfinite(end.position).all() and np.isfinite(end.velocity).all()
    # Over a bounded time the energy error of a method of order p is of order p, of rk4 on an oscillator 5.
    floor = 100.0 * 20 * 40 * 4 * UNIT["f64"]
    for coarse, fine in zip(errors, errors[1:]):
        assert fine <= floor or coarse / fine > 2.0 ** (order_of(name) - 0.3), errors
    assert errors[0] < 0.02


@pytest.mark.parametrize("make", hard_networks.WITH_JUMPS, ids=lambda make: make.__name__)
@pytest.mark.sampled(3)
def test_a_network_whose_forces_jump_stays_finite_and_keeps_its_energy(make, caplog):
    """A force that jumps by ΔF = 2 D L within a step costs up to ΔF v dt of energy, at random in sign at every passage."""
    errors, end = ladder(make(), halvings=2, looks=40, steps=50)
    assert np.isfinite(end.position).all() and np.isfinite(end.velocity).all()
    assert max(errors) < 0.02, errors


def test_a_hundredfold_stretch_keeps_its_energy_within_the_bound():
    """Leapfrog's energy swings by (ω dt)²/4 of itself; passing the wall at 99 with a jump of 2 costs up to 2 · 99 · 0.05/2."""
    scene = hard_networks.huge_stretch(dt=0.05)
    energy = 0.5 * 99.0**2
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for quarter in range(1, 41):
            simulation.run(steps=50)
            passages = math.ceil(quarter * 50 * 0.05 / math.pi) + 1
            bound = 0.05**2 / 4.0 + passages * 2.0 * 99.0 * 0.05 / 2.0 / energy
            assert abs(simulation.diagnostics()["total_energy"] / energy - 1.0) <= bound


@pytest.mark.sampled(3)
@pytest.mark.parametrize("make", [hard_networks.random_cloth, hard_networks.mass_ratio, hard_networks.inverted_chain])
def test_damped_networks_never_gain_energy(make):
    """From one sample to the next the energy falls, but for the wobble (ω dt)²/4 of the method; ω dt is below 0.15 in each."""
    with Simulation(make(damping=0.05), backend="cpu", precision="f64") as simulation:
        energies = [simulation.diagnostics()["total_energy"]]
        for _ in range(50):
            simulation.run(steps=40)
            energies.append(simulation.diagnostics()["total_energy"])
    assert (np.diff(energies) <= 0.15**2 / 4.0 * np.array(energies[:-1])).all()
    assert energies[-1] < 0.9 * energies[0]
