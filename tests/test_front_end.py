"""What Taichi's front end remembers is what it would have found."""

import pytest

from mpp_taichi.backends import import_taichi
from mpp_taichi.simulation import Simulation
from scenes import cluster


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
            ti.TaichiNameError, match=r"(?s)test_front_end\.py.*return x \+ unknown.*\^\^\^\^\^\^\^.*not defined"
        ):
            wrong(1.0)
    assert getsourcelines.cache_info().hits > 0
