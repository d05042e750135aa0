"""Sliders with contacts, on a graphics device and with adaptive methods: the same bits, without compilation."""

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.scene.load import load_scene

FIELD = "forces.uniform_gravity.acceleration[1]"
STRENGTH = "forces.newtonian_gravity.strength"
STEP = "integrator.leapfrog.dt"
VULKAN = {"backend": "vulkan", "precision": "f32"}
MOVED, END = 1.0, 2.0


def balls(solver, integrator="leapfrog", **more):
    """Two balls in a box that meet each other and its walls, before and after the move."""
    bodies = [((0.5, 0.5), (0.9, 0.1)), ((1.5, 0.5), (-0.4, 0.1))]
    return {
        "dimensions": 2,
        "particles": [
            {"body": {"mass": 1, "position": list(place), "velocity": list(velocity), "radius": 0.2}}
            for place, velocity in bodies
        ],
        "forces": [{"uniform_gravity": {"acceleration": [0, -1, 0]}}],
        "walls": [{"box": {"lower": [0, 0], "upper": [2, 2]}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "integrator": {integrator: {"dt": 0.02}},
        "run": {"duration": 4},
        "sliders": [{"set": FIELD, "from": -5, "to": 5}],
        **more,
    }


def planets(integrator, dt=0.1, *moved):
    """Two planets around a sun; sliders for what is moved."""
    bodies = [(1, (0, 0), (0, 0)), (1e-3, (1, 0), (0, 1)), (1e-3, (0, 2), (-0.7, 0))]
    return {
        "particles": [
            {"body": {"mass": mass, "position": [*place, 0], "velocity": [*velocity, 0]}} for mass, place, velocity in bodies
        ],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "integrator": {integrator: {"dt": dt}},
        "run": {"duration": 4},
        "sliders": [{"set": each} for each in moved or (STRENGTH,)],
    }


BOUNCING = [{"set": FIELD, "from": -5, "to": 5}, {"set": STEP, "from": 0.005, "to": 0.04}]
CASES = [
    *(
        pytest.param(planets("leapfrog", 0.05, STRENGTH, STEP), {**VULKAN, "plan": plan}, {STRENGTH: 2.0, STEP: 0.03}, id=plan)
        for plan in ("serial", "parallel")  # of vulkan
    ),
    *(
        pytest.param(balls(solver, sliders=BOUNCING), {}, {FIELD: 2.0, STEP: 0.01}, id=solver)
        for solver in ("swept", "pairwise", "resting", "simultaneous", "merging")
    ),
    pytest.param(balls("swept", sliders=BOUNCING), VULKAN, {FIELD: 2.0, STEP: 0.01}, id="swept-vulkan"),
    pytest.param(balls("pairwise", sliders=BOUNCING), VULKAN, {FIELD: 2.0, STEP: 0.01}, id="pairwise-vulkan"),
    pytest.param(balls("located", "adaptive_bogacki_shampine"), {}, {FIELD: 2.0}, id="located"),
    *(
        pytest.param(planets(method), {}, {STRENGTH: 2.0}, id=method)
        for method in ("adaptive_leapfrog", "adaptive_bogacki_shampine", "taylor")
    ),
    pytest.param(
        planets("wisdom_holman", 0.1, "integrator.wisdom_holman.dt"), {}, {"integrator.wisdom_holman.dt": 0.05}, id="wh"
    ),
]


def met(simulation):
    """Collisions so far, of spheres with one another and with walls."""
    report = simulation.contact_report
    return report.pair_count + report.wall_count + report.merge_count


@pytest.mark.sampled(5)
@pytest.mark.parametrize(("scene", "device", "move"), CASES)
def test_a_move_while_it_runs_compiles_nothing_and_gives_the_bits_of_kernels_with_those_numbers(
    scene, device, move, compilations, request
):
    if device.get("backend") == "vulkan":
        request.getfixturevalue("software_vulkan")
    how, merges = {"backend": "cpu", "precision": "f64", **device}, "merging" in str(scene)
    with mpp.Simulation(scene, **how) as simulation:
        simulation.run(until=MOVED).diagnostics()
        before = met(simulation)
        compilations.clear()
        simulation.set(move)
        moved = simulation.run(until=END).snapshot()
        assert compilations == [] and len(simulation._runner.compiled) == 1
        assert "contacts" not in scene or (before > 0 and (merges or met(simulation) > before)), "there was something to meet"
        simulation.restart(as_written=True)  # sliders stay
        simulation.restart()
        assert compilations == []
    event = {"timeline": [{"at": MOVED, "set": move}]}
    fixed = {**scene, **event} if merges else {**scene, **event, "sliders": []}  # spheres that merge have no other timeline
    with mpp.Simulation(fixed, **how) as simulation:
        compiled = simulation.run(until=END).snapshot()
        assert merges or len(simulation._runner.compiled) == 2
    assert np.array_equal(moved.position, compiled.position) and np.array_equal(moved.velocity, compiled.velocity)
    with mpp.Simulation({**scene, "sliders": []}, **how) as simulation:
        assert not np.array_equal(moved.position, simulation.run(until=END).snapshot().position), "and it was moved"


FLIGHT = {**balls("event_driven", "event_driven"), "forces": []}
NO_SLIDER = "cannot be moved while the scene runs: its value is compiled, or places particles; allowed: "


@pytest.mark.parametrize(
    ("scene", "path", "allowed"),
    [
        (balls("event_driven", "event_driven"), FIELD, "nothing in this scene"),
        (FLIGHT, "integrator.event_driven.dt", "nothing in this scene"),
        *((planets(name), f"integrator.{name}.dt", STRENGTH) for name in ("adaptive_leapfrog", "ias15", "taylor")),
        (planets("ias15"), "integrator.ias15.tolerance", STRENGTH),
        (planets("wisdom_holman"), STRENGTH, "integrator.wisdom_holman.dt"),
        (balls("swept"), "contacts.hard_spheres.restitution", "forces.uniform_gravity.acceleration[0], "),
    ],
)
def test_what_has_no_slider_there_is_named_with_what_has_in_one_line(scene, path, allowed):
    with pytest.raises(mpp.SceneError) as caught:
        load_scene({**scene, "sliders": [{"set": path}]})
    (fault,) = caught.value.faults
    assert fault.startswith(f"scene: sliders[0].set: '{path}' {NO_SLIDER}{allowed}") and "\n" not in fault
