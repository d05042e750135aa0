"""Spring networks that are difficult for numerical methods, as mappings of scenes, for any integrator.

`integrator` is a name, `dt` its step, `damping` that of every spring. Without damping each of them conserves its energy.
"""


def with_integrator(scene, integrator, dt, **more):
    return {**scene, "integrator": {integrator: {"dt": dt, **more}}}


def cloth_links(damping=0.0):
    """Nearest neighbours, cross-links and bending, ever weaker; ω_max < √(8 (20 + 10 + 4) / 0.02) = 117."""
    kinds = {"nearest": 20.0, "diagonal": 10.0, "bending": 4.0}
    return [
        {"lattice_links": {"of": "cloth", "neighbors": kind, "stiffness": stiffness, "damping": damping}}
        for kind, stiffness in kinds.items()
    ]


def cloth(damping=0.0, **lattice):
    """Seven by six masses of 0.02 at distances of 0.1, held at two corners."""
    given = {"shape": [7, 6], "lower": [0, 0, 0], "upper": [0.6, 0.5, 0], "mass": 0.02, "fixed": "upper_corners"}
    return {"particles": [{"lattice": {"name": "cloth", **given, **lattice}}], "springs": cloth_links(damping), "seed": 7}


def random_cloth(integrator="leapfrog", dt=2e-4, damping=0.0):
    """Every particle anywhere in a cube three times as wide as the cloth."""
    return with_integrator(cloth(damping, scatter=[0.9, 0.9, 0.9]), integrator, dt)


def flattened_cloth(integrator="leapfrog", dt=2e-4, damping=0.0):
    """Folded onto one line: every row of the cloth lies on the first one, so that ten or more particles share a place."""
    return with_integrator(cloth(damping, displacement=[0, "-0.5 * v", 0], fixed="none"), integrator, dt)


def coincident_ends(integrator="leapfrog", dt=1e-2, damping=0.0):
    """Two free masses at one place, and a third that pulls them apart after a while; rest lengths of 1 and of 0."""
    particles = [
        {"body": {"mass": 1.0, "position": [0, 0, 0]}},
        {"body": {"mass": 1.0, "position": [0, 0, 0]}},
        {"body": {"mass": 2.0, "position": [1.5, 0.2, 0]}},
        {"body": {"mass": 1.0, "position": [3, 0, 0]}},
        {"body": {"mass": 1.0, "position": [3, 0, 0]}},
    ]
    springs = [
        {"link": {"between": [0, 1], "stiffness": 10.0, "rest_length": 1.0, "damping": damping}},
        {"link": {"between": [1, 2], "stiffness": 5.0, "rest_length": 1.0, "damping": damping}},
        {"link": {"between": [2, 3], "stiffness": 5.0, "rest_length": 1.0, "damping": damping}},
        {"link": {"between": [3, 4], "stiffness": 10.0, "rest_length": 0.0, "damping": damping}},
    ]
    return with_integrator({"particles": particles, "springs": springs}, integrator, dt)


def chain_of(masses, stiffnesses, damping=0.0, stretch=0.1):
    """Masses along x at distances of 1, the first on a wall, each next one displaced further; with a little y to be no line."""
    particles = [{"body": {"mass": 1.0, "position": [0, 0, 0], "free": False}}]
    for k, mass in enumerate(masses, start=1):
        particles.append({"body": {"mass": mass, "position": [k, 0, 0], "displacement": [stretch * k, 0.05 * (-1) ** k, 0]}})
    springs = [
        {"link": {"between": [k, k + 1], "stiffness": stiffness, "damping": damping}} for k, stiffness in enumerate(stiffnesses)
    ]
    return {"particles": particles, "springs": springs}


def mass_ratio(integrator="leapfrog", dt=1e-3, damping=0.0):
    """Masses of 1e3 and 1e-3 in turn on springs of 10: ω from 0.1 to 141, the limit of leapfrog at 0.014."""
    return with_integrator(chain_of([1e3, 1e-3, 1e3, 1e-3], [10.0] * 4, damping), integrator, dt)


def stiffness_ratio(integrator="leapfrog", dt=1e-5, damping=0.0):
    """Springs of 1e8 and 1 in turn between masses of 1: ω up to 1.4e4, the limit of leapfrog at 1.4e-4."""
    return with_integrator(chain_of([1.0] * 4, [1e8, 1.0, 1e8, 1.0], damping, stretch=1e-4), integrator, dt)


def zero_stiffness(integrator="leapfrog", dt=1e-2, damping=0.0):
    """A spring that only damps, or does nothing at all."""
    pair = [
        {"body": {"mass": 1.0, "position": [0, 0, 0], "velocity": [0.5, 0.25, 0]}},
        {"body": {"mass": 3.0, "position": [1, 0, 0], "velocity": [-0.25, 0.5, 0]}},
    ]
    springs = [{"link": {"between": [0, 1], "stiffness": 0.0, "damping": damping}}]
    return with_integrator({"particles": pair, "springs": springs}, integrator, dt)


def zero_rest_length(integrator="leapfrog", dt=1e-2, damping=0.0):
    """An isotropic linear oscillator in three dimensions, ω = 2, through whose centre nothing special happens."""
    pair = [
        {"body": {"mass": 1.0, "position": [0, 0, 0], "free": False}},
        {"body": {"mass": 1.0, "position": [0.8, 0, 0.3], "velocity": [0, 1.2, -0.4]}},
    ]
    springs = [{"link": {"between": [0, 1], "stiffness": 4.0, "damping": damping, "rest_length": 0.0}}]
    return with_integrator({"particles": pair, "springs": springs}, integrator, dt)


def huge_stretch(integrator="leapfrog", dt=0.05, damping=0.0):
    """A spring of length 1, ω = 1, stretched a hundredfold; its mass shoots past the wall to the other side."""
    pair = [
        {"body": {"mass": 1.0, "position": [0, 0, 0], "free": False}},
        {"body": {"mass": 1.0, "position": [1, 0, 0], "displacement": [99, 0, 0]}},
    ]
    return with_integrator(
        {"particles": pair, "springs": [{"link": {"between": [0, 1], "stiffness": 1.0, "damping": damping}}]}, integrator, dt
    )


def inverted_chain(integrator="leapfrog", dt=0.02, damping=0.0):
    """Four masses between walls on springs of ω = 1, the second pushed through the third."""
    scene = chain_of([1.0] * 3, [1.0] * 3, damping, stretch=0.0)
    scene["particles"][2]["body"]["displacement"] = [1.6, 0.02, 0.01]
    return with_integrator(scene, integrator, dt)


# Forces are smooth along the way: the energy error falls with the order of the method.
SMOOTH = (random_cloth, mass_ratio, stiffness_ratio, zero_stiffness, zero_rest_length, inverted_chain)
# The force jumps by 2 D L where two ends pass through one another or part, which costs any method its order.
WITH_JUMPS = (flattened_cloth, coincident_ends, huge_stretch)
