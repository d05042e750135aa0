"""The message of a run that ended in NaN names particles by their numbers at the start."""

import numpy as np
import pytest

from mpp_taichi import Simulation, StabilityError
from mpp_taichi.device.fast_taichi import bitcode
from mpp_taichi.scene.load import load_scene
from mpp_taichi.simulation.first_bad_step import diagnose
from mpp_taichi.start.assemble import assemble

COUNT = 600  # each pair is evaluated once
MEETING = (11, 400)  # in the second of two tiles of bodies that are taken together, and elsewhere


@pytest.mark.parametrize("has_root", [True, False], ids=["as this processor does it", "written out"])
@pytest.mark.sampled(3)
def test_bodies_that_meet_exactly_are_named(monkeypatch, has_root):
    """In the middle of the first step, at the origin; a body that shares a division with one of them is not blamed."""
    if not has_root:
        monkeypatch.setattr(bitcode, "has_avx512", lambda: False)
    random = np.random.default_rng(1)
    position, velocity = random.normal(size=(COUNT, 3)), np.zeros((COUNT, 3))
    for body, sign in zip(MEETING, (-1.0, 1.0)):
        position[body], velocity[body] = [0.5 * sign, 0.0, 0.0], [-sign, 0.0, 0.0]
    places = zip(position.tolist(), velocity.tolist(), strict=True)
    bodies = [{"body": {"mass": 1e-9, "position": x, "velocity": v}} for x, v in places]
    scene = {"particles": bodies, "forces": [{"newtonian_gravity": {}}], "integrator": {"leapfrog": {"dt": 1.0}}}
    with Simulation(scene, backend="cpu", precision="f64", force=True) as simulation:
        with pytest.raises(StabilityError, match="particle 11 is no longer a finite number") as caught:
            simulation.run(steps=3)
        assert caught.value.step == 1 and caught.value.particle == MEETING[0]
        assert np.isfinite(simulation.snapshot().position).all()


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_places_whose_squares_are_infinite_are_named_without_a_warning():
    bodies = [{"body": {"mass": 1, "position": [place, 0, 0]}} for place in (0.0, 3e99, 1e100)]
    spec = load_scene({"particles": bodies, "forces": [], "integrator": {"leapfrog": {"dt": 1}}})
    start = assemble(spec)
    far = start.moved(position=1e100 * start.position, velocity=start.velocity, time=0.0, step=0)
    error = diagnose(far, 2, step=1, time=1.0, pairs_singular=False)
    assert "its nearest neighbour is particle 1 at distance 7e+199" in str(error)
