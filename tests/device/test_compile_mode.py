"""Of two nested compile modes, only the inner mode applies."""

import pytest

from mpp_taichi import Simulation
from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi.compile_mode import TAICHIS_OWN, CompileMode
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from scenes import cluster

ti = backends.import_taichi()
QUICK, VECTORS = (0, True), (1, False)


def options():
    config = ti.lang.impl.current_cfg()
    return config.opt_level, config.real_matrix_scalarize


@pytest.mark.fast_taichi("quick_compilation", "explicit_vectors")
@pytest.mark.parametrize(
    ("outer", "inner", "expected"),
    [
        (quick_compilation, explicit_vectors, [QUICK, VECTORS]),
        (explicit_vectors, quick_compilation, [VECTORS, QUICK]),
        (explicit_vectors, explicit_vectors, [VECTORS, VECTORS]),
    ],
)
def test_the_inner_of_two_modes_holds_and_the_outer_mode_comes_back(outer, inner, expected):
    backends.start("cpu", "f64")
    found = []
    with outer():
        found.append(options())
        with pytest.raises(ZeroDivisionError), inner():
            found.append(options())
            raise ZeroDivisionError
        found.append(options())
    assert found == [*expected, expected[0]] and options() == TAICHIS_OWN


@pytest.mark.sampled(3)
def test_no_kernel_keeps_vectors_whole_without_taichis_own_optimisation(monkeypatch):
    """An implicit method with pair forces launches the pair sum inside a step that is compiled quickly."""
    from taichi.lang.kernel_impl import Kernel

    plain, found = Kernel.materialize, {}

    def materialize(self, key=None, args=None, arg_features=None):
        if key not in self.compiled_kernels:
            found[self.func.__name__] = options()
        return plain(self, key, args, arg_features)

    monkeypatch.setattr(Kernel, "materialize", materialize)
    scene = cluster(9, integrator="implicit_midpoint")
    with Simulation(scene, backend="cpu", precision="f64", plan="parallel") as simulation:
        simulation.run(steps=1)
    assert "_accumulate_on_cpu" in found and (0, False) not in found.values()


def test_a_mode_with_both_options_cannot_be_made():
    with pytest.raises(ValueError, match="own optimisation"):
        CompileMode().use(opt_level=0, real_matrix_scalarize=False)
