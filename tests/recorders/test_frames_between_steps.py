"""Frames between two steps of spheres that bounce off walls on the way."""

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.recorders.film import DenseOutput

SPEED, DT = 1.3, 0.5


def zigzag(time, low, high, start, speed):
    """The place at a time of a point between two mirrors."""
    width = high - low
    way = (start - low + speed * time) % (2.0 * width)
    return low + min(way, 2.0 * width - way)


@pytest.mark.parametrize("wall_speed", [0.0, -0.2])
def test_a_sphere_is_drawn_where_it_bounces_and_not_in_the_wall(wall_speed):
    radius = 0.1
    walls = [{"plane": {"point": [1, 0, 0], "normal": [-1, 0, 0], "velocity": [wall_speed, 0, 0]}}]
    walls += [{"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}] if wall_speed == 0.0 else []
    scene = {
        "particles": [{"body": {"mass": 1, "radius": radius, "position": [0.3, 0, 0], "velocity": [SPEED, 0, 0]}}],
        "walls": walls,
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "integrator": {"leapfrog": {"dt": DT}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for step in range(8 if wall_speed == 0.0 else 1):
            for part in (0.2, 0.5, 0.9):
                time = (step + part) * DT
                found = DenseOutput().particles(simulation, time).position[0, 0]
                if wall_speed == 0.0:
                    assert found == pytest.approx(zigzag(time, radius, 1.0 - radius, 0.3, SPEED), abs=1e-12)
                else:
                    assert found <= 1.0 + wall_speed * time - radius + 1e-12
            simulation.run(steps=1)


def test_a_sphere_that_is_held_in_a_wall_stays_there():
    scene = {
        "particles": [{"body": {"mass": 1, "radius": 0.1, "position": [0.95, 0, 0], "free": False}}],
        "walls": [{"plane": {"point": [1, 0, 0], "normal": [-1, 0, 0]}}],
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "integrator": {"leapfrog": {"dt": DT}},
    }
    with Simulation(scene, backend="cpu") as simulation:
        assert np.array_equal(DenseOutput().particles(simulation, 0.3).position[0], [0.95, 0, 0])
