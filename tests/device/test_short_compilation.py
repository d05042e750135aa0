"""Kernels that are compiled in short compute the bits of kernels that are compiled in full."""

import pytest

from mpp_taichi import Simulation
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.device import backends, own_runtime
from mpp_taichi.device.fast_taichi.short_compilation import OPTION, short_compilation
from mpp_taichi.scene.load import load_scene
from scenes import cluster, kepler

backends.import_taichi()  # which decides which parts are on
METHODS = ["leapfrog", "rk4", "dop853", "kahan_li8", "ias15", "taylor", "adaptive_dop853", "hermite6", "implicit_midpoint"]
SCENES = {"pair": kepler(0.5), "vectors": cluster(9)}


def analysed():
    return getattr(own_runtime.config(), OPTION)


@pytest.mark.fast_taichi("short_compilation")
def test_the_analysis_is_left_out_inside_and_comes_back():
    backends.start("cpu", "f64")
    with pytest.raises(ZeroDivisionError), short_compilation():
        assert not analysed()
        backends.start("cpu", "f32")  # a runtime that starts inside
        assert not analysed()
        with short_compilation():
            assert not analysed()
        raise ZeroDivisionError
    assert analysed()


@pytest.mark.sampled(3)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", SCENES)
def test_a_run_has_the_same_bits(scene, method):
    def end():
        with Simulation({**SCENES[scene], "integrator": {method: {"dt": 0.01}}}, backend="cpu", precision="f64") as simulation:
            return simulation.run(steps=5).snapshot().position.tobytes()

    with short_compilation():
        found = end()
    assert found == end()


@pytest.mark.fast_taichi("short_compilation")
def test_pilots_compile_in_short(monkeypatch):
    from mpp_taichi.accuracy import machine

    seen = []
    before = machine.Machine._enter
    monkeypatch.setattr(machine.Machine, "_enter", lambda self, *a, **k: seen.append(analysed()) or before(self, *a, **k))
    with Workbench(pose(load_scene({**kepler(0.5), "run": {"duration": 1.0}})), backend="cpu", precision="f64") as bench:
        bench.machine("leapfrog")
    assert seen and not any(seen)
