"""Small scenes, as mappings of the shape of the YAML, that several tests use."""

import math

from mpp_taichi import component

# Every method that advances by steps of dt; event_driven flies from collision to collision and goes with contacts alone,
# adaptive methods choose their steps themselves, wisdom_holman knows planets alone, and langevin has a bath of heat, so that it
# follows no motion which could be compared (tests/integrators/test_langevin.py).
INTEGRATORS = [
    name
    for name in component.names("integrators")
    if name not in ("event_driven", "wisdom_holman", "langevin")
    and component.declaration("integrators", name).base not in ("Adaptive", "Embedded")
]
# Splittings are one code with many tables, and so are Runge–Kutta methods: tests/integrators/test_tables.py looks at each of
# these tables
# (order with and without friction, symmetry, energy, amplification). Tests of the code itself, where a step of many stages
# takes many seconds to compile, are spared them.
MORE_TABLES = [
    *("ruth3", "pefrl", "mclachlan_atela4", "srkn6b", "srkn11b", "srkn14a", "rkn8", "yoshida6", "yoshida8", "kahan_li6"),
    *("kahan_li8", "bogacki_shampine", "dop853"),
]
KINDS_OF_STEP = [name for name in INTEGRATORS if name not in MORE_TABLES]

REQUIRED = {"langevin": {"temperature": 0.5, "friction": 1.0}}
"""The parameters that a method has beside dt without a default."""


def takes_friction(name):
    """Whether a method takes forces that depend on velocity."""
    return component.declaration("integrators", name).flags.get("takes_velocity", True)


def kepler(eccentricity=0.3, dt=0.01, integrator="leapfrog", forces=(), **parameters):
    """A light body around one of mass 1 with G = 1, from pericentre; semi-major axis 1, period 2π."""
    pericentre = 1.0 - eccentricity
    speed = math.sqrt((1.0 + eccentricity) / pericentre)
    return {
        "title": "Kepler",
        "particles": [
            {"body": {"name": "sun", "mass": 1.0, "position": [0, 0, 0]}},
            {"body": {"name": "planet", "mass": 1e-3, "position": [pericentre, 0, 0], "velocity": [0, speed, 0]}},
        ],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}, *forces],
        "integrator": {integrator: {"dt": dt, **parameters}},
        "move_to_center_of_mass": True,
    }


def cluster(count=40, *, seed=1, softening=0.1, dt=0.01, integrator="leapfrog", dimensions=3):
    """Bodies of different masses at random places, at rest."""
    import numpy as np

    random = np.random.default_rng(seed)
    places = random.uniform(-1, 1, (count, 3))
    places[:, dimensions:] = 0.0
    masses = random.uniform(0.5, 1.5, count) / count
    bodies = [{"body": {"mass": float(m), "position": [float(x) for x in p]}} for m, p in zip(masses, places)]
    return {
        "title": "Cluster",
        "dimensions": dimensions,
        "particles": bodies,
        "forces": [{"newtonian_gravity": {"strength": 1.0, "softening": softening}}],
        "integrator": {integrator: {"dt": dt}},
    }


def everything(dt=0.005, integrator="leapfrog", damping=0.3, drag=0.2):
    """Gravity, charges, a uniform field, drag and damped springs at once; five bodies, one axis fixed.

    Without drag and damping for methods that do not take them.
    """
    if not takes_friction(integrator):
        damping = drag = 0.0
    bodies = [
        {"body": {"mass": 1.0, "charge": 0.4, "position": [0, 0, 0], "velocity": [0.1, 0, 0], "free": [True, True, False]}},
        {"body": {"mass": 2.0, "charge": -0.3, "position": [1, 0.1, 0], "velocity": [0, 0.3, 0.1]}},
        {"body": {"mass": 0.5, "charge": 0.2, "position": [0.2, 1.1, 0.3], "velocity": [0, 0, -0.2]}},
        {"body": {"mass": 1.5, "charge": 0.1, "position": [-0.8, 0.4, 0.9], "velocity": [0.2, 0.1, 0]}},
        {"body": {"mass": 0.7, "charge": -0.5, "position": [0.5, -0.9, 0.4], "velocity": [-0.1, 0.2, 0.3]}},
    ]
    links = [[0, 1], [1, 2], [2, 3], [3, 0], [3, 4]]
    return {
        "title": "Everything",
        "particles": bodies,
        "springs": [
            {"link": {"between": pair, "stiffness": 4.0 + k, "damping": damping, "rest_length": 0.9 + 0.05 * k}}
            for k, pair in enumerate(links)
        ],
        "forces": [
            {"newtonian_gravity": {"strength": 0.7, "softening": 0.2}},
            {"coulomb": {"coulomb_constant": 0.5, "softening": 0.3}},
            {"uniform_gravity": {"acceleration": [0.1, -0.2, -0.3]}},
            *([{"linear_drag": {"coefficient": drag}}] if drag else []),
        ],
        "integrator": {integrator: {"dt": dt}},
    }


def irregular_network(count=1100, springs=2500, *, seed=2, damping=0.3, dt=0.01, integrator="leapfrog"):
    """Bodies at random places, springs between random pairs: from none to many at a particle, none of them alike."""
    import numpy as np

    random = np.random.default_rng(seed)
    places = random.uniform(-1, 1, (count, 3))
    rows = zip(random.uniform(0.5, 1.5, count).tolist(), places.tolist())
    pairs = [random.choice(count, 2, replace=False).tolist() for _ in range(springs)]
    terms = zip(pairs, random.uniform(1, 3, springs).tolist(), random.uniform(0.5, 1.5, springs).tolist())
    return {
        "title": "Network",
        "particles": [{"body": {"mass": mass, "position": place}} for mass, place in rows],
        "springs": [
            {"link": {"between": pair, "stiffness": stiffness, "damping": damping, "rest_length": length}}
            for pair, stiffness, length in terms
        ],
        "integrator": {integrator: {"dt": dt}},
    }
