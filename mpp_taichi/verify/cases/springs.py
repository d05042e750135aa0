"""Hard cases of springs: oscillators in all regimes of damping, stiff pendulums, the largest step, springs of length zero."""

import math
from typing import Any

import numpy as np

from mpp_taichi.precision import PRECISIONS
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._nets import (
    EXTRAPOLATED,
    MODES,
    RUNGE_KUTTA,
    SPLIT_STAGES,
    SPLITTING,
    double_pendulum,
    ends_of,
    one_spring,
    row,
    swing,
)
from mpp_taichi.verify.place import Place, sound


@case(
    "A mass on a spring follows the closed form without friction, and with weak, critical and strong friction",
    "x = e^(−γt) (x₀ C + (v₀ + γ x₀) S), with S = t where γ = ω",
    quick=True,
    solved_in=PRECISIONS,
)
def oscillator(place: Place) -> Found:
    """Four masses side by side, friction 0, ¼, 2 and 4, for a time of 4."""
    steps, time, x, v = 1024, 4.0, 0.5, -0.25
    particles, springs, expected = [], [], []
    for k, damping in enumerate((0.0, 0.25, 2.0, 4.0)):
        body = {"mass": 1.0, "position": [2, k, 0], "displacement": [x, 0, 0], "velocity": [v, 0, 0]}
        particles += [{"body": {"mass": 1.0, "position": [0, k, 0], "free": False}}, {"body": body}]
        springs.append({"link": {"between": [2 * k, 2 * k + 1], "stiffness": 1.0, "damping": damping}})
        gamma = damping / 2.0
        omega = np.sqrt(complex(1.0 - gamma**2))
        c, s = np.cos(omega * time).real, time if gamma == 1.0 else (np.sin(omega * time) / omega).real
        fade = math.exp(-gamma * time)
        expected.append((2.0 + fade * (x * c + (v + gamma * x) * s), fade * (v * c - (gamma * v + x) * s)))
    scene = {"particles": particles, "springs": springs, "integrator": {RUNGE_KUTTA: {"dt": time / steps}}}
    position, velocity = ends_of(place, scene, steps)
    found = np.stack([position[1::2, 0], velocity[1::2, 0]], axis=1)
    error = float(np.abs(found - np.array(expected)).max())
    by_rounding = swing(place, error, steps=steps, stages=1, phase=time, size=2.5, amplitude=0.6)
    method = 0.6 * time * (time / steps) ** 4 / 120.0  # the fast part of strong friction is over by then
    return Found(error, by_rounding.bound + method, f"{by_rounding.because}; and t dt⁴/120 of the amplitude by the method")


@case(
    "Friction far too strong for the step is refused by an explicit method, and an implicit method creeps",
    "x = x₀ e^(−λt), λ = ½ (c − √(c² − 4))",
)
def strong_friction(place: Place) -> Found:
    """c = 1000 with steps of 0.1, so that c dt = 100; the energy may not increase."""
    net, friction, dt, steps = one_spring([1.5, 0, 0], stiffness=1.0, rest=1.0), 1000.0, 0.1, 100
    if not place.refusal(net.scene({"leapfrog": {"dt": dt}}, damping=friction), steps=1):
        return Found(math.inf, 0.0, "a step of leapfrog beyond 2/c has to be refused")
    with place.simulation(net.scene({"implicit_euler": {"dt": dt}}, damping=friction)) as simulation:
        energies = [simulation.diagnostics()["total_energy"]]
        for _ in range(10):
            simulation.run(steps=steps // 10)
            energies.append(simulation.diagnostics()["total_energy"])
        stretch = simulation.snapshot().position[1, 0] - 1.0
    rate, time = 0.5 * (friction - math.sqrt(friction**2 - 4.0)), steps * dt
    error = abs(stretch - 0.5 * math.exp(-rate * time)) if max(np.diff(energies)) < 0.0 else math.inf
    bound = 0.5 * (0.5 * dt * rate**2 * time + 2.0 / friction**2) + 1.5 * steps * place.u
    why = f"dt λ² t/2 by implicit Euler and 2/c² by the first moment, of a stretch of ½, and {steps} roundings of 1.5"
    return Found(error, bound, why)


@case("A stiff double pendulum moves as its equations say", EXTRAPOLATED, quick=True, solved_in=PRECISIONS)
def stiff_pendulum(place: Place) -> Found:
    """D = 5000 and 5, for 22 periods of the stiff spring."""
    net, time, steps = double_pendulum(5000.0), 2.0, 1000
    expected, growth = net.motion(time, 200)
    position, _ = ends_of(place, net.scene({SPLITTING: {"dt": time / steps}}), steps)
    error = float(np.abs(position - expected).max())
    phase = math.sqrt(5010.0) * time
    return swing(place, error, steps=steps, stages=SPLIT_STAGES, phase=phase, size=1.3, amplitude=0.25, growth=growth)


@case("A rod of stiffness 10⁸ keeps its length with steps of a sixtieth", "the pull over D")
def stiff_rod(place: Place) -> Found:
    """The double pendulum by the energy–momentum method, an explicit step would have to be below 2e-4."""
    stiffness, dt, worst = 1e8, 1.0 / 60.0, 0.0
    with place.simulation(double_pendulum(stiffness).scene({"energy_momentum": {"dt": dt}})) as simulation:
        for _ in range(20):
            simulation.run(steps=30)
            worst = max(worst, abs(float(np.linalg.norm(simulation.snapshot().position[1] - [0, 1, 0])) - 1.0))
        sound(simulation)
    bound = 2.0 * 10.0 / stiffness + 6.0 * math.sqrt(600) * place.force_u
    return Found(worst, bound, "a pull of at most 10 over D, twice as it began without it, and 600 roundings, six deviations")


@case("The largest step of leapfrog for a chain is told: just below it holds, just above it is refused", MODES, quick=True)
def largest_step(place: Place) -> Found:
    """Nine springs of 100 in a row: ω = 20 sin(4π/9), and leapfrog holds up to 2/ω."""
    chain = row(10, stiffness=100.0)
    chain.position[4, 0] += 0.01
    limit = 2.0 / (20.0 * math.sin(4.0 * math.pi / 9.0))
    scenes = [chain.scene({"leapfrog": {"dt": part * limit}}, free=[True, False, False]) for part in (1.01, 0.99)]
    if not place.refusal(scenes[0], steps=1):
        return Found(math.inf, 0.0, "a step of 1.01 of the limit has to be refused")
    with place.simulation(scenes[1]) as simulation:
        position = simulation.run(steps=2000, judge="off").snapshot().position  # the energy of leapfrog swings far here
    moved = float(np.abs(position[:, 0] - row(10).position[:, 0]).max())
    bound = 0.01 * math.sqrt(8.0) / math.sqrt(1.0 - 0.99**2)
    return Found(moved, bound, "0.01, shared by 8 modes, times 1/√(1 − (ω dt/2)²), by which leapfrog's motion is larger")


@case(
    "A spring of rest length zero is an isotropic oscillator, also straight through its other end",
    "x₀ cos ωt + v₀/ω sin ωt",
    solved_in=PRECISIONS,
)
def zero_rest_length(place: Place) -> Found:
    """An ellipse, and a straight line through the centre, for 20 radians."""
    worst, steps, time = 0.0, 320, 10.0
    for x, v in (([0.75, 0.0, 0.25], [0.0, 1.25, -0.5]), ([0.75, 0.0, 0.0], [0.0, 0.0, 0.0])):
        scene = one_spring(x, stiffness=4.0, rest=0.0, velocity=v).scene({SPLITTING: {"dt": time / steps}})
        position, _ = ends_of(place, scene, steps)
        ellipse = np.array(x) * math.cos(2.0 * time) + np.array(v) / 2.0 * math.sin(2.0 * time)
        worst = max(worst, float(np.abs(position[1] - ellipse).max()))
    return swing(place, worst, steps=steps, stages=SPLIT_STAGES, phase=2.0 * time, size=1.0)


@case("A spring whose ends coincide exerts nothing", "no direction: a straight flight", quick=True, solved_in=PRECISIONS)
def coincident_ends(place: Place) -> Found:
    """Two masses at one place with one velocity, their spring fully compressed; all numbers of the flight are exact."""
    bodies = [{"body": {"mass": m, "position": [1, 2, 3], "velocity": [0.25, 0, -0.5]}} for m in (1.0, 5.0)]
    springs = [{"link": {"between": [0, 1], "stiffness": 100.0, "rest_length": 1.0, "damping": 0.5}}]
    position, _ = ends_of(place, {"particles": bodies, "springs": springs, "integrator": {"leapfrog": {"dt": 2**-6}}}, 512)
    return Found(float(np.abs(position - [3.0, 2.0, -1.0]).max()), 0.0, "steps of 2⁻⁸ and 2⁻⁷ are exact: no rounding at all")


@case("Springs that make no sense are refused", "rules of a scene", quick=True, solved_in=PRECISIONS)
def impossible_springs(place: Place) -> Found:
    """A spring from a mass to itself, to a mass that is not there, to a free end without mass, and of negative stiffness."""
    bodies = [{"body": {"mass": m, "position": [x, 0, 0]}} for x, m in ((0.0, 1.0), (1.0, 1.0), (2.0, 0.0))]
    fine: dict[str, Any] = {"between": [0, 1], "stiffness": 1.0}
    wrong: list[dict[str, Any]] = [
        {"between": [0, 0]},
        {"between": [0, 7]},
        {"between": [0, 2]},
        {"stiffness": -1.0},
        {"rest_length": -1.0},
    ]
    taken = 0
    ends_of(place, {"particles": bodies[:2], "springs": [{"link": fine}], "integrator": {"leapfrog": {"dt": 0.01}}}, 1)
    for fault in wrong:
        scene = {"particles": bodies, "springs": [{"link": fine | fault}], "integrator": {"leapfrog": {"dt": 0.01}}}
        taken += not place.refusal(scene, steps=1)
    return Found(float(taken), 0.0, f"none of {len(wrong)} such springs may run")


@case("Two springs side by side are one spring of both stiffnesses", "D₁ + D₂", solved_in=PRECISIONS)
def side_by_side(place: Place) -> Found:
    """Springs of 1 and 2 with dampings of 1/8 and 1/4, the second written from its other end."""
    steps, dt, ends = 300, 1.0 / 64.0, []
    for links in ([(0, 1, 3.0, 0.375)], [(0, 1, 1.0, 0.125), (1, 0, 2.0, 0.25)]):
        scene = one_spring([1.25, 0.5, 0.0], stiffness=3.0, rest=1.0).scene({"leapfrog": {"dt": dt}})
        scene["springs"] = [
            {"link": {"between": [i, j], "stiffness": d, "rest_length": 1.0, "damping": c}} for i, j, d, c in links
        ]
        ends.append(ends_of(place, scene, steps)[0])
    error = float(np.abs(ends[0] - ends[1]).max())
    return swing(place, error, steps=steps, stages=1, phase=math.sqrt(3.0) * steps * dt, size=1.25)
