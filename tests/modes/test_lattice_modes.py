"""Waves and modes of lattices of springs against lattice theory, with and without tension."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from mpp_taichi import Simulation

STIFFNESS, MASS, COUNT = 50.0, 1.0, 8
SPACING = 2.0 / (COUNT - 1)
STRETCH = 1.5
TENSION = STIFFNESS * SPACING * (1.0 - 1.0 / STRETCH)
WAVES = np.sin(np.pi * np.outer(np.arange(1, COUNT - 1), np.arange(COUNT)) / (COUNT - 1))  # (modes along an axis, places)


def frequency(r, s):
    """ω² = (T/m d) [4 sin²(rπ/2(n−1)) + 4 sin²(sπ/2(n−1))]."""
    angle = math.pi / 2.0 / (COUNT - 1)
    return math.sqrt(TENSION / (MASS * SPACING) * (4.0 * math.sin(r * angle) ** 2 + 4.0 * math.sin(s * angle) ** 2))


FREQUENCIES = np.array([[frequency(r, s) for s in range(1, COUNT - 1)] for r in range(1, COUNT - 1)])


def membrane(prestretch, *, amplitude=0.1, dt=2.5e-3, free=True, count=COUNT, half_width=1.0):
    corner = [half_width, half_width, 0]
    lattice = {"name": "sheet", "shape": [count, count], "lower": [-half_width, -half_width, 0], "upper": corner, "mass": MASS}
    lattice |= {"fixed": "rim", "free": free, "displacement": [0, 0, f"{amplitude} * sin(pi * u) * sin(pi * v)"]}
    return {
        "particles": [{"lattice": lattice}],
        "springs": [{"lattice_links": {"of": "sheet", "stiffness": STIFFNESS, "prestretch": prestretch}}],
        "integrator": {"leapfrog": {"dt": dt}},
    }


def project(values):
    """Amplitudes of all modes, indexed [r − 1, s − 1]; the sum over the sheet of a squared mode is (n − 1)²/4."""
    return 4.0 / (COUNT - 1) ** 2 * WAVES @ values.reshape(COUNT, COUNT).T @ WAVES.T


def energies(snapshot):
    """Energy of every transverse mode, and of all motion in the plane, in the linearised network.

    In the plane a spring resists with D along itself and, by its tension, with T/d across.
    """
    amplitude, rate = project(snapshot.position[:, 2]), project(snapshot.velocity[:, 2])
    modes = 0.5 * MASS * (COUNT - 1) ** 2 / 4.0 * (rate**2 + FREQUENCIES**2 * amplitude**2)
    place = np.linspace(-1.0, 1.0, COUNT)
    rest = np.stack([np.tile(place, COUNT), np.repeat(place, COUNT)], axis=1)
    shift = snapshot.position[:, :2] - rest
    i, j = snapshot.springs.between.T
    along = np.abs(rest[j] - rest[i]) > 0.1
    resistance = np.where(along, STIFFNESS, TENSION / SPACING)
    plane = 0.5 * np.sum(resistance * (shift[j] - shift[i]) ** 2) + 0.5 * MASS * np.sum(snapshot.velocity[:, :2] ** 2)
    return modes, plane


def upward_passages(times, values, rates):
    """Times of the zeros of the cubics through values and rates between samples, by Newton's method."""
    found = []
    for k in range(len(times) - 1):
        if values[k] < 0.0 <= values[k + 1]:
            h = times[k + 1] - times[k]
            a, b = h * rates[k], h * rates[k + 1]
            rise = values[k + 1] - values[k]
            cubic = np.polynomial.Polynomial([values[k], a, 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise])
            s = -values[k] / rise
            for _ in range(20):
                s -= cubic(s) / cubic.deriv()(s)
            found.append(times[k] + s * h)
    return np.array(found)


@pytest.mark.sampled(3)
def test_modes_of_a_taut_membrane_are_those_of_the_lattice_and_keep_their_energy():
    """Modes (1,1), (2,1) and (2,2) at 0.7 % of a spacing, side by side, for 20 periods of the slowest.

    The lengthening of the springs changes a frequency by order (A/d)²: 0.34 % for (1,1) at A = 0.1, 1.1 % for (2,1), measured,
    so by 5e-6 at A = 0.002; leapfrog by (ω dt)²/24 = 7e-6 at most; the cubic between samples of 0.1 by
    1.6e-4 of a radian in 126. What leaves a mode, most of it into the plane, is of order (A/d)², too: 1.5e-3
    of the energy at A = 0.005, measured.
    """
    modes, amplitude = ((1, 1), (2, 1), (2, 2)), 0.002
    looks, steps = 490, 40
    scene = membrane(STRETCH)
    with Simulation(scene, backend="cpu", precision="f64") as flat:
        start = flat.start
    u, v = (start.position[:, k] / 2.0 + 0.5 for k in (0, 1))
    starts = []
    for r, s in modes:
        position = start.position.copy()
        position[:, 2] = amplitude * np.sin(r * np.pi * u) * np.sin(s * np.pi * v)
        starts.append(replace(start, position=position))
    tracks = {mode: [] for mode in modes}
    worst = dict.fromkeys(modes, 0.0)
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=starts) as simulation:
        for _ in range(looks):
            simulation.run(steps=steps)
            for copy, (r, s) in enumerate(modes):
                snapshot = simulation.snapshot(copy)
                own = (r - 1, s - 1)
                tracks[r, s].append(
                    (snapshot.time, project(snapshot.position[:, 2])[own], project(snapshot.velocity[:, 2])[own])
                )
                in_modes, in_plane = energies(snapshot)
                total = in_modes.sum() + in_plane
                worst[r, s] = max(worst[r, s], 1.0 - in_modes[own] / total)
    for r, s in modes:
        passages = upward_passages(*np.array(tracks[r, s]).T)
        assert len(passages) >= 20
        period = (passages[-1] - passages[0]) / (len(passages) - 1)
        assert period == pytest.approx(2.0 * math.pi / frequency(r, s), rel=1e-4)
        assert worst[r, s] < 1e-3


@pytest.mark.sampled(3)
def test_the_first_mode_keeps_its_share_of_the_transverse_energy_at_a_large_amplitude():
    with Simulation(membrane(STRETCH), backend="cpu", precision="f64") as simulation:
        worst = 0.0
        for _ in range(200):
            simulation.run(steps=98)
            in_modes, _ = energies(simulation.snapshot())
            worst = max(worst, 1.0 - in_modes[0, 0] / in_modes.sum())
    assert 1e-6 < worst < 1e-3  # the modes do couple, with (A/d)⁴


def test_axes_that_are_held_keep_their_bits_and_the_energy_is_kept_by_what_is_left():
    scene = membrane(STRETCH, free=[False, False, True])
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start, energy = simulation.snapshot(), simulation.diagnostics()["total_energy"]
        simulation.run(steps=4000)
        end, error = simulation.snapshot(), simulation.diagnostics()["total_energy"] / energy - 1.0
    assert np.array_equal(start.position[:, :2], end.position[:, :2]) and not end.velocity[:, :2].any()
    rim = ~start.free.any(axis=1)
    assert np.array_equal(start.position[rim], end.position[rim])
    assert np.abs(end.velocity[~rim, 2]).max() > 1e-3
    # ω ≤ √(8 D/m) = 20: the energy of the fastest motion swings by (ω dt)²/4 of itself.
    assert abs(error) < (20.0 * 2.5e-3) ** 2 / 4.0


def first_quarter(simulation, dt, particle=None):
    """Time until the first mode, or a particle, passes through the plane."""
    simulation.restart()
    last = simulation.snapshot()
    looks = [(0.0, last)]
    for _ in range(10_000):
        simulation.run(steps=max(1, round(dt / simulation.dt)))
        looks.append((simulation.time, simulation.snapshot()))
        values = [project(s.position[:, 2])[0, 0] if particle is None else s.position[particle, 2] for _, s in looks[-2:]]
        rates = [project(s.velocity[:, 2])[0, 0] if particle is None else s.velocity[particle, 2] for _, s in looks[-2:]]
        if values[1] < 0.0:
            return upward_passages([looks[-2][0], looks[-1][0]], [-value for value in values], [-rate for rate in rates])[0]
    raise AssertionError("it never came down")


@pytest.mark.sampled(3)
def test_without_tension_a_mass_among_four_springs_swings_with_a_period_inverse_to_its_amplitude():
    """T = 4 ∫₀ᴬ dz / √(2 (U(A) − U(z))/m), U(z) = 4 · ½ D (√(d² + z²) − d)²; T A → 0.2119 as A → 0."""
    length = 2.0 / 7.0
    products = []
    for amplitude in (0.1, 0.0125):

        def stored(z):
            return 2.0 * STIFFNESS * (math.hypot(length, z) - length) ** 2

        def slope(x, amplitude=amplitude):  # z = A (1 − x²) takes the pole at the turning point away
            z = amplitude * (1.0 - x * x)
            gap = stored(amplitude) - stored(z)
            return 2.0 * amplitude * x / math.sqrt(2.0 * gap / MASS) if gap > 0.0 else 0.0

        period = 4.0 * quad(slope, 0.0, 1.0, epsrel=1e-10, limit=200)[0]
        scene = membrane(1.0, amplitude=amplitude, count=3, half_width=length, dt=5e-5 / amplitude)
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            measured = 4.0 * first_quarter(simulation, 0.001 / amplitude, particle=4)
        # Leapfrog with 4000 steps a period errs by (2π/4000)²/24 and, the force being cubic, a few times that.
        assert measured == pytest.approx(period, rel=1e-6)
        products.append(measured * amplitude)
    # The next term is of order (A/d)²: 0.05 % at 0.0125.
    assert products[1] == pytest.approx(0.2119, rel=1e-3) and products[0] > 1.02 * products[1]


@pytest.mark.sampled(3)
def test_without_tension_the_period_of_a_sheet_doubles_when_its_amplitude_is_halved():
    """25 at amplitude 0.1, 50 at 0.05; four quarters of the first mode are a little shorter than the mean of later swings."""
    quarters = {}
    for amplitude in (0.1, 0.05):
        with Simulation(membrane(1.0, amplitude=amplitude, dt=1e-2), backend="cpu", precision="f64") as simulation:
            quarters[amplitude] = first_quarter(simulation, 0.05 / amplitude * 0.1)
    # The force is D z³/2d² [1 + O(z²/d²)]: the law holds to (0.1/d)² times a small number.
    assert quarters[0.05] / quarters[0.1] == pytest.approx(2.0, rel=5e-3)
    assert 4.0 * quarters[0.1] == pytest.approx(25.2, rel=0.02)


# --- chains -------------------------------------------------------------------------------------------------------------


def chain(count, displacement, velocity="0", dt=0.05):
    """Masses of 1 at distances of 1 along x on springs of 1, both ends held: c = 1, ω = 2 sin(k/2)."""
    lattice = {"name": "chain", "shape": [count], "lower": [0, 0, 0], "upper": [count - 1, 0, 0], "fixed": "ends"}
    return {
        "particles": [{"lattice": {**lattice, "displacement": [displacement, 0, 0], "velocity": [velocity, 0, 0]}}],
        "springs": [{"lattice_links": {"of": "chain", "stiffness": 1.0}}],
        "integrator": {"leapfrog": {"dt": dt}},
    }


@pytest.mark.parametrize("mode", [3, 20, 55])
@pytest.mark.sampled(3)
def test_longitudinal_waves_of_a_chain_have_the_lattice_s_phase_velocity(mode):
    """Exactly linear as long as no spring is turned round: ω/k = 2 sin(k/2)/k to leapfrog's (ω dt)²/24 < 3e-6."""
    count, dt = 61, 4e-3
    k = mode * math.pi / (count - 1)
    shape = np.sin(k * np.arange(count))
    period = math.pi / math.sin(k / 2.0)
    looks = []
    with Simulation(chain(count, f"0.1 * sin({mode} * pi * u)", dt=dt), backend="cpu", precision="f64") as simulation:
        steps = int(period / 40.0 / dt)
        while simulation.time < 5.2 * period:
            simulation.run(steps=steps)
            snapshot = simulation.snapshot()
            looks.append((snapshot.time, shape @ (snapshot.position[:, 0] - np.arange(count)), shape @ snapshot.velocity[:, 0]))
    passages = upward_passages(*np.array(looks).T)
    measured = 2.0 * math.pi * (len(passages) - 1) / (passages[-1] - passages[0])
    assert measured / k == pytest.approx(2.0 * math.sin(k / 2.0) / k, rel=1e-4)


def test_a_long_pulse_runs_along_a_chain_of_a_thousand_masses_at_the_speed_of_sound():
    """A Gaussian of width 20 that moves to the right, v = −c ∂x/∂s; its group velocity is c (1 − 1/3200)."""
    width, place, count, time = 20.0, 150.0, 1000, 650.0
    argument = f"((u * {count - 1} - {place}) / {width})"
    bump = f"0.3 * exp(-0.5 * {argument} ** 2)"
    scene = chain(count, bump, f"{argument} / {width} * {bump}", dt=0.1)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        end = simulation.run(duration=time).snapshot()
    shift = end.position[:, 0] - np.arange(count)
    peak = int(np.argmax(shift))
    top = np.polyfit(np.arange(-3, 4), shift[peak - 3 : peak + 4], 2)
    arrived = peak - top[1] / (2.0 * top[0])
    assert (arrived - place) / time == pytest.approx(1.0, rel=0.01)
    assert shift[peak] > 0.25 and np.abs(shift[:400]).max() < 0.01, "one pulse, and nothing that runs back"
