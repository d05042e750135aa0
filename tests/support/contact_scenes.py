"""Scenes of many contacts for `resting`, as mappings of the shape of the YAML."""

import numpy as np

GRAVITY = 9.81


def scene(particles, *, walls, dimensions=2, seed=1, restitution=0.4, dt=0.002, duration=3.0, **contacts):
    """Spheres under gravity along −y, or −z in three dimensions."""
    down = [0, -GRAVITY] if dimensions == 2 else [0, 0, -GRAVITY]
    return {
        "title": "Contacts",
        "dimensions": dimensions,
        "seed": seed,
        "particles": particles,
        "forces": [{"uniform_gravity": {"acceleration": down}}],
        "contacts": {"hard_spheres": {"solver": "resting", "restitution": restitution, **contacts}},
        "walls": walls,
        "integrator": {"symplectic_euler": {"dt": dt}},
        "run": {"duration": duration},
    }


def held(name, radius, position):
    """A sphere that does not move."""
    return {"body": {"name": name, "mass": 1.0, "radius": radius, "position": list(map(float, position)), "free": False}}


def galton_board(*, balls=150, rows=8, restitution=0.4, **more):
    """Balls fall through a triangle of held pegs into a box, where they lie in a heap on a level floor."""
    width, radius, peg = 2.0, 0.02, 0.03
    apart = width / (rows + 1)
    pegs = [
        held(f"peg{row}_{k}", peg, (round(width / 2 + (k - row / 2) * apart, 6), round(2.0 - 0.866 * row * apart, 6)))
        for row in range(rows)
        for k in range(row + 1)
    ]
    gas = {"name": "balls", "count": balls, "lower": [0.7, 2.1], "upper": [1.3, 3.5], "radius": radius, "mass": 1, "speed": 0.1}
    walls = [{"box": {"lower": [0, 0], "upper": [width, 4], "restitution": restitution}}]
    return scene([*pegs, {"gas": gas}], walls=walls, restitution=restitution, **more)


def hourglass(*, grains=2000, restitution=0.3, **more):
    """Grains flow through the neck between two slopes of held spheres, into the lower half of a box."""
    radius, width, neck = 0.05, 6.0, 0.3
    slope = []
    for side in (-1, 1):
        for k in range(26):
            slope.append(held(f"side{side}_{k}", 0.08, (side * (neck + 0.08 + 0.105 * k), 0.12 * k)))
    top = 3.2 + 0.022 * grains * (2 * radius) ** 2 * 100 / width
    gas = {
        "name": "grains",
        "count": grains,
        "lower": [-width / 2, 3.2],
        "upper": [width / 2, top],
        "radius": radius,
        "radius_spread": 0.1,
        "mass": 1,
        "speed": 0.1,
    }
    walls = [{"box": {"lower": [-width / 2, -4], "upper": [width / 2, top + 1], "restitution": restitution}}]
    return scene([*slope, {"gas": gas}], walls=walls, restitution=restitution, **more)


def struck_wall(*, columns=10, rows=20, heavy=100.0, speed=10.0, restitution=0.2, **more):
    """A heavy disk flies into a regular wall of disks on a floor."""
    bricks = [
        {"body": {"name": f"brick{a}_{b}", "mass": 1, "radius": 0.1, "position": [0.2 * a + 0.1 * (b % 2), 0.1 + 0.1733 * b]}}
        for a in range(columns)
        for b in range(rows)
    ]
    hammer = {"body": {"name": "hammer", "mass": heavy, "radius": 0.5, "position": [-2.0, 1.5], "velocity": [speed, 0]}}
    walls = [{"box": {"lower": [-3, 0], "upper": [8, 8], "restitution": restitution}}]
    return scene([hammer, *bricks], walls=walls, restitution=restitution, **more)


def column(*, count=10, heavy=1e3, restitution=0.0, **more):
    """A column of disks with a heavy one on top, between two walls."""
    bodies = [
        {
            "body": {
                "name": f"disk{k}",
                "mass": heavy if k == count - 1 else 1,
                "radius": 0.5,
                "position": [0.5, 0.55 + 1.05 * k],
            }
        }
        for k in range(count)
    ]
    walls = [{"box": {"lower": [0, 0], "upper": [1, 2.0 * count], "restitution": restitution}}]
    return scene(bodies, walls=walls, restitution=restitution, **more)


def press(**more):
    """A ball lies between two held spheres, and a lid comes down on it."""
    bodies = [held("left", 0.5, (0, 1)), held("right", 0.5, (1.9, 1))]
    ball = {"body": {"name": "ball", "mass": 1, "radius": 0.5, "position": [0.95, 1.4]}}
    walls = [{"plane": {"point": [0, 2.0], "normal": [0, -1], "velocity": [0, -1]}}]
    return scene([*bodies, ball], walls=walls, duration=1.0, **more)


def energies(snapshot, dimensions=2):
    """Kinetic energy of the free spheres, and energy of gravity."""
    free = snapshot.free.all(axis=1)
    mass = snapshot.mass[free]
    kinetic = 0.5 * np.sum(mass[:, None] * snapshot.velocity[free] ** 2)
    return kinetic, GRAVITY * np.sum(mass * snapshot.position[free, dimensions - 1])
