"""Hard cases of networks of springs: modes, static shapes, waves, large stretches, held axes, and the balance of energy."""

import math
from dataclasses import replace

import numpy as np

from mpp_taichi.precision import PRECISIONS
from mpp_taichi.verify.bounds import rounding
from mpp_taichi.verify.case import Found, case
from mpp_taichi.verify.cases._nets import (
    EXTRAPOLATED,
    MODES,
    RUNGE_KUTTA,
    SPLIT_STAGES,
    SPLITTING,
    ends_of,
    hanging_row,
    one_spring,
    row,
    sheet,
    swing,
)
from mpp_taichi.verify.place import Place, sound


@case(
    "Small waves of a taut membrane have the frequencies of the lattice",
    "ω² = (T/m d) [4 sin²(rπ/2n) + 4 sin²(sπ/2n)]",
    quick=True,
    solved_in=PRECISIONS,
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
    solved_in=PRECISIONS,
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


@case("A net that hangs in the shape of equilibrium stays there", "Newton's method on the forces", solved_in=PRECISIONS)
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


@case("A chain of 64 links hangs in its polygon", "one unknown, the pull along x, by bisection", solved_in=PRECISIONS)
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


@case("Waves of a chain run by the dispersion of the lattice", MODES, quick=True, solved_in=PRECISIONS)
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


@case("Masses in the ratio of a million move as their equations say", EXTRAPOLATED, solved_in=PRECISIONS)
def unlike_masses(place: Place) -> Found:
    """Masses of 2⁻¹⁰ on either side of a mass of 2¹⁰ in the plane, for 20 periods; the heavy one is near the origin."""
    net = row(3, stiffness=16.0, mass=np.array([2.0**-10, 2.0**10, 2.0**-10]), held=())
    net.position[[0, 2]] += [[0.25, 0.125, 0.0], [-0.125, 0.25, 0.0]]
    time, steps = 1.0, 2048
    expected, growth = net.motion(time, 128)
    position, _ = ends_of(place, net.scene({SPLITTING: {"dt": time / steps}}), steps)
    error = float(np.abs(position - expected).max())
    return swing(place, error, steps=steps, stages=SPLIT_STAGES, phase=128.0 * time, size=1.25, amplitude=0.375, growth=growth)


@case("A chain that is turned inside out moves as its equations say", EXTRAPOLATED, solved_in=PRECISIONS)
def inverted_chain(place: Place) -> Found:
    """Of three masses between walls one was pushed through its neighbour, a little aside."""
    net = row(5)
    net.position[2] += [1.5, 0.125, 0.0625]
    time, steps = 8.0, 512
    expected, growth = net.motion(time, 100)
    position, _ = ends_of(place, net.scene({SPLITTING: {"dt": time / steps}}), steps)
    error = float(np.abs(position - expected).max())
    return swing(place, error, steps=steps, stages=SPLIT_STAGES, phase=2.0 * time, size=2.0, growth=growth)


@case("A spring stretched a hundredfold keeps its energy where it turns over", "conservation of energy", solved_in=PRECISIONS)
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


@case("Axes that are held keep their bits and take no part", "the same bits", quick=True, solved_in=PRECISIONS)
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
    solved_in=PRECISIONS,
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
