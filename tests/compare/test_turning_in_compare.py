"""Magnetic fields and rotating frames in `compare`: turned kicks are judged by turned kicks of the reference."""

import numpy as np
import pytest

from mpp_taichi.compare.certificate import Judge, verdict
from mpp_taichi.compare.evidence import gather
from mpp_taichi.compare.taichi_contender import TaichiContender
from mpp_taichi.device import backends
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

PLACES = np.random.default_rng(5).uniform(-2.0, 2.0, (6, 3))
SPEEDS = np.random.default_rng(6).uniform(-1.0, 1.0, (6, 3))
TURNING = {
    "magnetic": [{"magnetic_field": {"field": [0.3, -0.4, 1.2]}}, {"harmonic_trap": {"frequencies": [1.0, 1.5, 2.0]}}],
    "rotating": [
        {"rotating_frame": {"rate": [0.0, 0.5, 1.0]}},
        {"lennard_jones": {"strength": 0.1, "length": 0.1}},
    ],
    "of one": [{"external": {"acceleration": ["3*q*vy + x", "-3*q*vx", "sin(z)"], "on": "b2"}}],
}


@pytest.mark.sampled(6)
@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("method", ["leapfrog", "velocity_verlet", "symplectic_euler", "yoshida4", "pefrl"])
@pytest.mark.parametrize("name", TURNING)
def test_forces_that_turn_the_velocity_are_judged(name, method, precision):
    """The kicks of the CPU turn by the exact angle; those of a method of second order would be off by (ω dt)³/12, 2e-5."""
    verdict_of = judged(TURNING[name], method)
    assert verdict_of(TaichiContender, "cpu", precision) == "rounding"


@pytest.mark.parametrize(("precision", "turns"), [("f64", False), ("f32", True)])
def test_vulkan_turns_the_velocity_where_it_has_sines(software_vulkan, precision, turns):
    verdict_of = judged(TURNING["magnetic"], "leapfrog", turns=turns)
    assert verdict_of(TaichiContender, "vulkan", precision) == "rounding"


def test_kicks_of_another_order_are_noticed():
    assert judged(TURNING["magnetic"], "leapfrog", turns=False)(TaichiContender, "cpu", "f64") == "bug"


def judged(forces, method, *, turns=True):
    """What the certificate says of a backend after trajectories of some steps of 0.05."""
    some = [
        {"body": {"name": f"b{k}", "position": place, "velocity": speed, "mass": 1 + k % 3, "charge": (-1.0) ** k}}
        for k, (place, speed) in enumerate(zip(PLACES.tolist(), SPEEDS.tolist()))
    ]
    held = {"body": {"mass": 2, "position": [3, 3, 3], "velocity": [0, 1, 1], "charge": 1, "free": [False, True, True]}}
    scene = {"particles": [*some, held], "forces": forces, "integrator": {method: {"dt": 0.05}}}
    spec = load_scene(scene)
    start, looks = assemble(spec), [1, 3, 10, 30]
    judge = Judge(spec, start, 0.05)
    course = judge.follow(("f64", "f32"), looks, turns=turns)

    def verdict_of(contender_of, backend, precision):
        backends.stop()
        contender = contender_of(spec, start, backend, precision, threads=2)
        try:
            evidence = gather(contender, judge.states(), looks)
        finally:
            contender.close()
        assert judge.turns(backend, precision) == ((backend, precision) != ("vulkan", "f64"))
        return verdict(judge.forces(evidence, precision) + course.findings(evidence, precision))["verdict"]

    return verdict_of
