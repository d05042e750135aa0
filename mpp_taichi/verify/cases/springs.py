"""Hard cases of springs: stiff, slack, coincident and turned ones, waves, modes, shapes at rest, damping."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from mpp_taichi.verify.bounds import rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._nets import double_pendulum, ends_of, hanging_row, one_spring, row, sheet, swing
from mpp_taichi.verify.place import Place, sound

SPLITTING, SPLIT_STAGES = "kahan_li8", 17
RUNGE_KUTTA = "rk4"  # errs by (ω dt)⁵/120 of an oscillation in a step; a position is rounded once in a step
EVERYWHERE = ("f64", "f32", "ds", "f32c", "df64")
MODES = "normal modes of the linear chain, by eigenvectors in double precision"
EXTRAPOLATED = "extrapolated midpoint rule of order 16 in long double, in NumPy"


@case(
    "A mass on a spring follows the closed form without friction, and with weak, critical and strong friction",
    "x = e^(−γt) (x₀ C + (v₀ + γ x₀) S), with S = t where γ = ω",
    quick=True,
    solved_in=EVERYWHERE,
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


@case("A stiff double pendulum moves as its equations say", EXTRAPOLATED, quick=True, solved_in=EVERYWHERE)
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
    quick=True,
    solved_in=EVERYWHERE,
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


@case("A spring whose ends coincide exerts nothing", "no direction: a straight flight", quick=True, solved_in=EVERYWHERE)
def coincident_ends(place: Place) -> Found:
    """Two masses at one place with one velocity, their spring fully compressed; all numbers of the flight are exact."""
    bodies = [{"body": {"mass": m, "position": [1, 2, 3], "velocity": [0.25, 0, -0.5]}} for m in (1.0, 5.0)]
    springs = [{"link": {"between": [0, 1], "stiffness": 100.0, "rest_length": 1.0, "damping": 0.5}}]
    position, _ = ends_of(place, {"particles": bodies, "springs": springs, "integrator": {"leapfrog": {"dt": 2**-6}}}, 512)
    return Found(float(np.abs(position - [3.0, 2.0, -1.0]).max()), 0.0, "steps of 2⁻⁸ and 2⁻⁷ are exact: no rounding at all")


@case("Springs that make no sense are refused", "rules of a scene", quick=True, solved_in=EVERYWHERE)
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


@case("Two springs side by side are one spring of both stiffnesses", "D₁ + D₂", solved_in=EVERYWHERE)
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


@case(
    "Small waves of a taut membrane have the frequencies of the lattice",
    "ω² = (T/m d) [4 sin²(rπ/2n) + 4 sin²(sπ/2n)]",
    quick=True,
    solved_in=EVERYWHERE,
)
def membrane(place: Place) -> Found:
    """Three modes at once on seven by seven cells, d = ¼, stretched to twice the rest length; about a period of the slowest."""
    cells, stiffness, amplitude, time, steps = 7, 32.0, 2.0**-30, 1.75, 224
    net = sheet((cells + 1, cells + 1), spacing=0.25, stiffness=stiffness, mass=1.0, stretch=2.0)
    u, v = 4.0 * net.position[:, 0] * math.pi / cells, 4.0 * net.position[:, 1] * math.pi / cells
    expected, fastest = np.zeros(len(u)), 0.0
    for r, s in ((1, 1), (2, 1), (6, 5)):
        shape = amplitude * np.sin(r * u) * np.sin(s * v)
        sines = math.sin(0.5 * r * math.pi / cells) ** 2 + math.sin(0.5 * s * math.pi / cells) ** 2
        omega = math.sqrt(0.5 * stiffness * 4.0 * sines)
        net.position[net.free, 2] += shape[net.free]
        expected += shape * math.cos(omega * time)
        fastest = max(fastest, omega)
    position, _ = ends_of(place, net.scene({SPLITTING: {"dt": time / steps}}), steps)
    error = float(np.abs(position[:, 2] - expected).max()) / amplitude
    # A rounding of the length of a spring, d, is twice as large a part of its stretch, d/2.
    return swing(place, error, steps=steps, stages=SPLIT_STAGES, phase=fastest * time, size=3.0)


@case(
    "A mass among four slack springs swings with the period that grows with the inverse of its amplitude",
    "4 ∫ dz/ż by Gauss–Legendre quadrature; T A → 4 · 1.31103 d √(m/D)",
    solved_in=EVERYWHERE,
)
def slack_springs(place: Place) -> Found:
    """Without tension there is no linear mode; after a quarter of the period the mass passes through the plane."""
    length, stiffness, amplitude, steps = 0.25, 50.0, 0.125, 100
    at, weight = np.polynomial.legendre.leggauss(200)
    s, weight = 0.5 * (at + 1.0), 0.5 * weight
    z = amplitude * (1.0 - s**2)  # takes away the pole at the turning point
    stretch, most = z**2 / (np.hypot(length, z) + length), amplitude**2 / (math.hypot(length, amplitude) + length)
    # √(A² + d²) − √(z² + d²) without cancellation, A² − z² = (A − z)(A + z) with A − z = A s².
    fall = amplitude * s**2 * (amplitude + z) / (np.hypot(length, z) + math.hypot(length, amplitude))
    quarter = float(np.sum(weight * 2.0 * amplitude * s / np.sqrt(4.0 * stiffness * fall * (stretch + most))))
    net = sheet((3, 3), spacing=length, stiffness=stiffness, mass=1.0, stretch=1.0)
    net.position[4, 2] = amplitude
    position, _ = ends_of(place, net.scene({SPLITTING: {"dt": quarter / steps}}), steps)
    bound, why = rounding(place, steps=steps, stages=SPLIT_STAGES, phase=math.pi / 2, leverage=(length / amplitude) ** 2)
    return Found(abs(position[4, 2]) / amplitude, bound, f"{why}: half of a rounding of d over the stretch, A²/2d")


@case("A net that hangs in the shape of equilibrium stays there", "Newton's method on the forces", solved_in=EVERYWHERE)
def sagging_net(place: Place) -> Found:
    """Five by five cells under a load that makes it sag, without friction: what rounding moves, and no more."""
    net = replace(sheet((6, 6), spacing=0.25, stiffness=32.0, mass=0.25, stretch=1.25), gravity=(0.0, 0.0, -2.0))
    shape, _ = net.shape_at_rest((True, True, True))
    net, steps, dt = replace(net, position=shape), 400, 1.0 / 64.0
    lowest = 1.0 / math.sqrt(net.shape_at_rest((True, True, True))[1] * 0.25)
    position, _ = ends_of(place, net.scene({"leapfrog": {"dt": dt}}), steps)
    error = float(np.abs(position - shape).max())
    # The forces of a mass at rest are rounded alike at all times: it swings by δF/(m ω²) about a place that is as far away.
    systematic = 2.0 * 2.0 * 32.0 * max(place.u, place.force_u) * 0.25 / (0.25 * lowest**2)
    found = swing(place, error, steps=steps, stages=1, phase=32.0 * steps * dt, size=1.25, amplitude=0.0)
    why = f"{found.because}; and 2 · 2 D u d/(m ω²), ω = {lowest:.3g}, by which the forces of four springs at rest are rounded"
    return Found(error, found.bound + systematic, why)


@case("A braced cantilever comes to rest in the shape of the truss", "Newton's method on the forces", solved_in=("f64", "f32"))
def cantilever(place: Place) -> Found:
    """Five cells that bend under their weight, with a drag: the slowest mode, ω = 3.95, falls as e^(−2t)."""
    net = replace(sheet((6, 2), spacing=0.4, stiffness=500.0, mass=0.1, stretch=1.0, braced=True), gravity=(0.0, 0.0, -2.0))
    shape, flexibility = net.shape_at_rest((True, False, True))
    duration, steps = 12.0, 1500
    drag = [{"linear_drag": {"coefficient": 0.4}}]
    scene = net.scene({"leapfrog": {"dt": duration / steps}}, free=[True, False, True], forces=drag)
    position, _ = ends_of(place, scene, steps)
    error = float(np.abs(position - shape).max())
    left = float(np.abs(shape - net.position).max()) * math.exp(-2.0 * duration) * 2.0
    rounded = 8.0 * 500.0 * max(place.u, place.force_u) * 2.0 * flexibility
    why = f"e^(−2t) of the sag is left, and 8 springs round by D u x, to which the truss yields by {flexibility:.3g} of it"
    return Found(error, left + rounded, why)


@case("A chain of 64 links hangs in its polygon", "one unknown, the pull along x, by bisection", solved_in=EVERYWHERE)
def hanging_chain(place: Place) -> Found:
    """It begins at rest in the closed form, and has to stay there without friction."""
    links, stiffness, mass, steps, dt = 64, 2048.0, 1.0 / 64.0, 400, 1.0 / 1024.0
    net = hanging_row(links, span=0.75, stiffness=stiffness, mass=mass)
    position, _ = ends_of(place, net.scene({"leapfrog": {"dt": dt}}), steps)
    error = float(np.abs(position - net.position).max())
    phase = 2.0 * math.sqrt(stiffness / mass) * steps * dt
    force = 2.0 * stiffness / links * max(place.u, place.force_u)
    pushed = force / mass * (steps * dt) ** 2 / 2.0
    found = swing(place, error, steps=steps, stages=1, phase=phase, size=1.0, amplitude=0.0)
    return Found(error, found.bound + pushed, f"{found.because}; and roundings of two springs, D u L, that push for t²/2")


@case("Waves of a chain run by the dispersion of the lattice", MODES, quick=True, solved_in=EVERYWHERE)
def chain_waves(place: Place) -> Found:
    """A pulse on 201 masses, narrow enough to spread: ω = 2 √(D/m) |sin(kd/2)|; the motion along a line is exactly linear."""
    net, time, steps = row(201), 50.0, 400
    net.position[1:-1, 0] += 0.25 * np.exp(-0.5 * (np.arange(-99, 100) / 2.0) ** 2)
    expected = net.along_a_line(time)
    scene = net.scene({SPLITTING: {"dt": time / steps}}, free=[True, False, False])
    position, _ = ends_of(place, scene, steps)
    error = float(np.abs(position[:, 0] - expected).max())
    # Places up to 100, and the largest of 201 errors is about twice one that is as large as a sum of so many roundings is.
    return swing(place, error, steps=steps, stages=SPLIT_STAGES, phase=2.0 * time, size=2.0 * 100.0, amplitude=0.25)


@case("Masses in the ratio of a million move as their equations say", EXTRAPOLATED, solved_in=EVERYWHERE)
def unlike_masses(place: Place) -> Found:
    """Masses of 2⁻¹⁰ on either side of a mass of 2¹⁰ in the plane, for 20 periods; the heavy one is near the origin."""
    net = row(3, stiffness=16.0, mass=np.array([2.0**-10, 2.0**10, 2.0**-10]), held=())
    net.position[[0, 2]] += [[0.25, 0.125, 0.0], [-0.125, 0.25, 0.0]]
    time, steps = 1.0, 2048
    expected, growth = net.motion(time, 128)
    position, _ = ends_of(place, net.scene({SPLITTING: {"dt": time / steps}}), steps)
    error = float(np.abs(position - expected).max())
    return swing(place, error, steps=steps, stages=SPLIT_STAGES, phase=128.0 * time, size=1.25, amplitude=0.375, growth=growth)


@case("A chain that is turned inside out moves as its equations say", EXTRAPOLATED, quick=True, solved_in=EVERYWHERE)
def inverted_chain(place: Place) -> Found:
    """Of three masses between walls one was pushed through its neighbour, a little aside."""
    net = row(5)
    net.position[2] += [1.5, 0.125, 0.0625]
    time, steps = 8.0, 512
    expected, growth = net.motion(time, 100)
    position, _ = ends_of(place, net.scene({SPLITTING: {"dt": time / steps}}), steps)
    error = float(np.abs(position - expected).max())
    return swing(place, error, steps=steps, stages=SPLIT_STAGES, phase=2.0 * time, size=2.0, growth=growth)


@case("A spring stretched a hundredfold keeps its energy where it turns over", "conservation of energy", solved_in=EVERYWHERE)
def huge_stretch(place: Place) -> Found:
    """The mass shoots through the held end, where the force jumps by 2 D L."""
    dt, worst, energy = 0.05, 0.0, 0.5 * 99.0**2
    with place.simulation(one_spring([100.0, 0, 0], stiffness=1.0, rest=1.0).scene({"leapfrog": {"dt": dt}})) as simulation:
        for _ in range(20):
            simulation.run(steps=50)
            worst = max(worst, abs(simulation.diagnostics()["total_energy"] / energy - 1.0))
    passages = math.ceil(1000 * dt / math.pi) + 1
    bound = dt**2 / 4.0 + passages * 2.0 * 99.0 * dt / 2.0 / energy
    return Found(worst, bound, f"(ω dt)²/4 by leapfrog, and in {passages} passages each a jump of 2 at a speed of 99 for dt/2")


@case("Axes that are held keep their bits and take no part", "the same bits", quick=True, solved_in=EVERYWHERE)
def held_axes(place: Place) -> Found:
    """A membrane that moves along z only, thrown along x and y as well."""
    net = sheet((6, 6), spacing=0.3, stiffness=30.0, mass=1.0, stretch=1.5)
    net.position[net.free, 2] += 0.1
    net = replace(net, velocity=np.where(net.free[:, None], [1.0, -2.0, 0.5], 0.0))
    scene = net.scene({"leapfrog": {"dt": 0.01}}, free=[False, False, True])
    with place.simulation(scene) as simulation:
        before = simulation.snapshot().position
        simulation.run(steps=200)
        sound(simulation)
        end = simulation.snapshot()
    moved = float(np.abs(end.position - before)[:, :2].max() + np.abs(end.velocity[:, :2]).max())
    swings = float(np.abs(end.velocity[net.free, 2]).min()) > 0.0
    return Found(moved if swings else math.inf, 0.0, "along x and y no bit changes and no velocity is left; along z it moves")


@case(
    "Damping along a spring leaves rotation alone, and full damping brakes it",
    "r × u of the pair: constant, or e^(−ct/μ), in any motion",
    solved_in=EVERYWHERE,
)
def damped_rotation(place: Place) -> Found:
    """Masses of 1 and 3 that turn about each other and stretch their spring."""
    steps, time, friction, worst = 1536, 6.0, 0.125, 0.0
    bodies = [{"mass": 1.0, "position": [0.0, 0, 0], "velocity": [0, -1.5, 0]}, {"mass": 3.0, "position": [1.5, 0, 0]}]
    bodies[1]["velocity"] = [0.0, 0.5, 0.0]
    link = {"between": [0, 1], "stiffness": 4.0, "rest_length": 1.0, "damping": friction}
    for damping, rate in (("axial", 0.0), ("full", friction / 0.75)):
        scene = {"particles": [{"body": body} for body in bodies], "springs": [{"link": link}], "spring_damping": damping}
        position, velocity = ends_of(place, scene | {"integrator": {RUNGE_KUTTA: {"dt": time / steps}}}, steps)
        turning = float(np.cross(position[1] - position[0], velocity[1] - velocity[0])[2])
        worst = max(worst, abs(turning - 3.0 * math.exp(-rate * time)))
    # r × u is of the places and velocities of both, each up to 2.
    rate = math.sqrt(4.0 / 0.75)
    found = swing(place, worst, steps=steps, stages=1, phase=rate * time, size=2.0 * 2.0)
    method = 4.0 * time * rate**5 * (time / steps) ** 4 / 120.0
    return Found(worst, found.bound + method, f"{found.because}; and t ω⁵ dt⁴/120 by the method")


@case("Energy that damping takes is booked to the order of the method", "E + ∫ c |Δv|² dt is constant", solved_in=("f64",))
def energy_balance(place: Place) -> Found:
    """A damped chain in the plane: with half the step a quarter of the residual is left."""
    net, residuals = row(5, stiffness=4.0), []
    net.position[1:-1] += [[0.25, 0.125, 0.0], [-0.125, 0.25, 0.0], [0.375, 0.0, 0.125]]
    for steps in (500, 1000):
        with place.simulation(net.scene({"leapfrog": {"dt": 8.0 / steps}}, damping=0.25)) as simulation:
            simulation.keep_energy_balance()
            simulation.run(steps=steps)
            found = simulation.diagnostics()
            residuals.append(abs(found["energy_balance_residual"]))
    bound = 0.25 * residuals[0] * 1.05 + math.sqrt(1000 * 4) * place.u
    return Found(residuals[1], bound, "a quarter of the residual of twice the step, 5 % for higher orders, and roundings")
