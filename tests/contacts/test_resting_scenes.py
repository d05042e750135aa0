"""`resting` on scenes of many contacts: it ends none of them for want of iterations."""

import numpy as np
import pytest
from contact_scenes import GRAVITY, column, energies, galton_board

from mpp_taichi.simulation.simulation import Simulation


@pytest.mark.sampled(3)
def test_a_galton_board_runs_through():
    """150 balls fall over 36 pegs and form a heap with regular parts, whose contacts determine each other."""
    simulation = Simulation(galton_board(), backend="cpu", precision="f64")
    before = sum(energies(simulation.snapshot()))
    for end in (0.4, 0.8, 1.2, 1.6):
        simulation.run(until=end)
        kinetic, height = energies(simulation.snapshot())
        # A kick and a drift keep H + ½ m g v dt in free flight; the contacts of a drift give no kinetic energy.
        room = 0.5 * GRAVITY * 0.002 * np.sqrt(2 * 150 * kinetic)
        assert kinetic + height <= before + room
        before = kinetic + height + room
    report = simulation.contact_report
    simulation.close()
    assert report.unresolved == 0 and report.pair_count > 1000
    assert report.largest_overlap < 1e-10  # the tolerance is 1e-12; what two drifts lack adds up


@pytest.mark.sampled(3)
def test_a_column_bears_a_sphere_a_thousand_times_as_heavy():
    simulation = Simulation(column(), backend="cpu", precision="f64")
    simulation.run(until=2.0)
    snapshot, told = simulation.snapshot(), simulation.contact_report
    simulation.run(until=2.2)
    floor = simulation.contact_report.wall_impulse[2] - told.wall_impulse[2]
    simulation.close()
    assert np.abs(snapshot.velocity).max() < 1e-8
    assert np.abs(snapshot.position[:, 1] - 0.5 - np.arange(10)).max() < 1e-9
    assert floor == pytest.approx(1009 * GRAVITY * 0.2, rel=1e-9)


@pytest.mark.sampled(3)
def test_a_column_does_not_sink_into_an_elastic_floor_in_single_precision():
    """Its lowest sphere hits the floor in every drift; what the problem leaves of an overlap is undone in the next drift."""
    bodies = [{"body": {"mass": 1, "radius": 0.5, "position": [0, 0, 0.5 + k]}} for k in range(10)]
    scene = {
        "particles": bodies,
        "walls": [{"plane": {"point": [0, 0, 0], "normal": [0, 0, 1], "restitution": 1}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}],
        "contacts": {"hard_spheres": {"solver": "resting", "restitution": 0.5}},
        "integrator": {"leapfrog": {"dt": 1 / 64}},
    }
    with Simulation(scene, backend="cpu", precision="f32") as simulation:
        simulation.run(steps=1000)
        depth = 0.5 - simulation.snapshot().position[0, 2]
    assert abs(depth) < 16 * 10 * 2.0**-24  # a few roundings of heights up to 10, and not one in each of 1000 drifts
