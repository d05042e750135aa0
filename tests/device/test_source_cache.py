"""The cached results of Taichi's front end are the results that it would compute again."""

import pytest

from mpp_taichi.device.backends import import_taichi
from mpp_taichi.simulation.simulation import Simulation
from scenes import cluster

pytestmark = pytest.mark.fast_taichi("source_cache")


@pytest.fixture
def plain(monkeypatch):
    """The context that tells places in a source, with every answer compared with Taichi's own: how many there were."""
    import_taichi()
    from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext

    remembering, seen = ASTTransformerContext.get_pos_info, []

    def compared(self, node):
        found = remembering(self, node)
        seen.append((found, remembering.__wrapped__(self, node)))
        return found

    monkeypatch.setattr(ASTTransformerContext, "get_pos_info", compared)
    return seen


@pytest.mark.sampled(3)
def test_the_places_told_are_taichis_own(plain):
    for integrator in ("leapfrog", "rk4"):  # the second finds much of the first remembered
        with Simulation(cluster(3, integrator=integrator)) as simulation:
            simulation.run(steps=1)
    assert len(plain) > 1000
    assert [pair for pair in plain if pair[0] != pair[1]] == []


def test_a_mistake_in_a_kernel_is_told_at_its_place():
    ti = import_taichi()
    from taichi.lang.kernel_impl import getsourcelines

    ti.init(arch=ti.cpu, log_level=ti.ERROR)

    @ti.kernel
    def wrong(x: ti.f32) -> ti.f32:
        return x + unknown  # noqa: F821

    for _ in range(2):  # first found, then remembered
        with pytest.raises(
            ti.TaichiNameError, match=r"(?s)test_source_cache\.py.*return x \+ unknown.*\^\^\^\^\^\^\^.*not defined"
        ):
            wrong(1.0)
    assert getsourcelines.cache_info().hits > 0


DECLARE = """
def declare(ti):
    builder, field = ti.FieldsBuilder(), ti.field(ti.f32)
    builder.dense(ti.i, 3).place(field)
    builder.finalize()
    ti.Vector.field(2, ti.f32, shape=4)
"""


@pytest.mark.parametrize("package", ["mpp_taichi", "program"])
def test_a_field_of_this_package_knows_its_place_and_a_field_of_a_program_all_that_taichi_tells(package, monkeypatch):
    ti = import_taichi()
    from taichi.lang import impl, snode, util

    told = []

    def compared(remembering):
        def get_traceback(stacklevel=1):
            told.append((remembering(stacklevel + 1), util.get_traceback(stacklevel + 1)))
            return told[-1][0]

        return get_traceback

    for module in (impl, snode):
        monkeypatch.setattr(module, "get_traceback", compared(module.get_traceback))
    ti.init(arch=ti.cpu, log_level=ti.ERROR)
    names = {"__name__": f"{package}.declaring"}
    exec(compile(DECLARE, "declaring.py", "exec"), names)
    names["declare"](ti)
    declared = [(found, plain) for found, plain in told if "declaring.py" in plain]
    assert len(declared) >= 3
    for found, plain in declared:
        if package == "program":
            assert found == plain and "test_source_cache.py" in found
        else:
            assert found.strip() == [line.strip() for line in plain.splitlines() if line.startswith("  File ")][-1]
