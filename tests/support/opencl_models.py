"""Scenes for the OpenCL kernels, forces by the textbook, and a kernel whose text is changed before it is compiled."""

import numpy as np
from reference import accelerations

from mpp_taichi.compare.opencl_package import load_opencl
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble
from scenes import everything

UNIT = {"f32": 2.0**-24, "f64": 2.0**-53}
FORCE_LIMITS = {"f32": 5e-6, "f64": 1e-13}  # of the largest acceleration: what each backend is to reach


def loaded(scene):
    """Spec and particles."""
    spec = load_scene(scene)
    return spec, assemble(spec)


def bodies(count, *, seed=4):
    """Bodies in a unit cube that move, exact in f32; no two at one place."""
    random = np.random.default_rng(seed)
    position, velocity = (random.uniform(-1, 1, (count, 3)).astype(np.float32).astype(float) for _ in range(2))
    mass, charge = random.uniform(0.5, 1.5, count).astype(np.float32).astype(float), np.zeros(count)
    return Snapshot(
        position, velocity, mass, np.zeros(count), charge, np.ones((count, 3)), np.ones((count, 3), bool), ("",) * count
    )


def gravity_spec(softening, integrator="leapfrog", dt=0.01):
    """Gravity between the bodies of any snapshot."""
    return load_scene(
        {
            "title": "Gravity",
            "particles": [{"body": {"mass": 1.0, "position": [0, 0, 0]}}, {"body": {"mass": 1.0, "position": [1, 0, 0]}}],
            "forces": [{"newtonian_gravity": {"strength": 0.5, "softening": softening}}],
            "integrator": {integrator: {"dt": dt}},
        }
    )


def spheres(count, *, edges=(8, 8, 8), walls=(), dt=0.02, integrator="leapfrog", radius=0.25, repeats=False, **contacts):
    """A gas in a box, of different radii and masses; one sphere is held."""
    dimensions = len(edges)
    lower, upper = [0.0] * dimensions, [float(edge) for edge in edges]
    middle = [edge / 2 for edge in edges] + [0.0] * (3 - dimensions)
    bead = {"mass": 3.0, "radius": 0.4, "position": middle, "free": [False] * 3}
    gas = {"name": "gas", "count": count, "lower": lower, "upper": upper, "radius": radius, "radius_spread": 0.3, "speed": 2.0}
    box = {"lower": lower, "upper": upper}
    field = [{"uniform_gravity": {"acceleration": [0.3, -1.0, 0.2 * (dimensions == 3)]}}]
    solver = {"solver": "pairwise", "restitution": 0.9, **contacts}
    return {
        "title": "Spheres",
        "dimensions": dimensions,
        "seed": 3,
        "particles": [{"body": {"name": "bead", **bead}}, {"gas": gas}],
        "forces": field,
        "contacts": {"hard_spheres": solver},
        "walls": [{"periodic_box": box} if repeats else {"box": box | {"restitution": 0.8}}, *walls],
        "integrator": {integrator: {"dt": dt}},
    }


def gravity_error(runner, count, *, precision, softening=0.0, variant=None):
    """Largest difference from NumPy over the largest acceleration."""
    particles = bodies(count)
    with runner.Runner(gravity_spec(softening), particles, precision=precision, variant=variant) as found:
        result = found.accelerations()
    exact = accelerations.gravity(particles.position, particles.mass, 0.5, softening)
    return np.abs(result - exact).max() / np.linalg.norm(exact, axis=1).max()


def everything_by_the_textbook(particles, *, full):
    """Accelerations in the scene `everything`, all forces of it."""
    x, v, m, links = particles.position, particles.velocity, particles.mass, particles.springs
    result = accelerations.gravity(x, m, 0.7, 0.2) + accelerations.coulomb(x, m, particles.charge, 0.5, 0.3)
    result += accelerations.springs(x, v, m, links.between, links.stiffness, links.damping, links.rest_length, full=full)
    result += np.array([0.1, -0.2, -0.3]) - 0.2 * v / m[:, None]
    return np.where(particles.free, result, 0.0)


def everything_error(runner, precision, *, full=False):
    """The same of all forces together; one axis is held."""
    spec, particles = loaded(everything() | ({"spring_damping": "full"} if full else {}))
    with runner.Runner(spec, particles, precision=precision) as found:
        result = found.accelerations()
    exact = everything_by_the_textbook(particles, full=full)
    return np.abs(result - exact).max() / np.linalg.norm(exact, axis=1).max()


def change_kernel(monkeypatch, file, text, instead):
    """Compile one kernel file with another text from now on; the text must be there."""
    program = load_opencl("program")
    read = program.read

    def changed(name):
        source = read(name)
        if name != file:
            return source
        assert text in source, f"{file}.cl has no {text!r}"
        return source.replace(text, instead)

    monkeypatch.setattr(program, "read", changed)
