"""The cached results of Taichi's front end are the results that it would compute again."""

import inspect
import subprocess
import sys

import pytest
from conftest import ROOT

from mpp_taichi.device.backends import import_taichi
from mpp_taichi.device.fast_taichi.source_cache import lines_read_directly
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


DEFINE = """
import mpp_taichi.device.backends as backends
ti = backends.import_taichi()

@ti.func
def alone(x):
    return x

@ti.data_oriented
class Decorated:
    @ti.func
    def f(self, x):
        return x

    @ti.kernel
    def k(self):
        pass

class Plain:
    @ti.func
    def f(self, x):
        return x

    @ti.pyfunc
    def p(self, x):
        return x

def made():
    @ti.kernel
    def inner():
        pass
    return inner
"""


def test_a_function_in_a_class_is_told_from_others(tmp_path):
    path = tmp_path / "defining.py"
    path.write_text(DEFINE)
    names = {"__name__": "defining", "__file__": str(path)}
    exec(compile(DEFINE, str(path), "exec"), names)
    decorated, plain = vars(names["Decorated"]), vars(names["Plain"])
    in_a_class = [decorated["f"].func, plain["f"].func, plain["p"].func]
    assert [each.classfunc for each in in_a_class] == [True] * 3
    assert decorated["k"]._is_classkernel
    assert not names["alone"].func.classfunc and not names["made"]()._is_classkernel


def test_a_program_may_define_functions_in_its_first_lines(tmp_path):
    path = tmp_path / "program.py"
    path.write_text(DEFINE + "print(alone.func.classfunc, Plain.f.func.classfunc)\n")
    done = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, cwd=ROOT, check=False, timeout=100)
    assert done.stdout.split() == ["False", "True"], done.stderr


def test_lines_of_frames_are_those_that_python_finds():
    plain, frame = inspect.getframeinfo, sys._getframe()
    with lines_read_directly():
        expected, found = plain(frame), inspect.getframeinfo(frame)  # both on one line, at which the frame is
        whole = inspect.getframeinfo(frame, 3)  # more lines than one are Python's own work
    assert inspect.getframeinfo is plain and len(whole.code_context) == 3
    assert found.filename == expected.filename
    assert found.function == expected.function
    assert found.code_context == expected.code_context
