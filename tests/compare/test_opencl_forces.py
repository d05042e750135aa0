"""The forces of the OpenCL kernels agree with the textbook in every variant of the sum; planted faults are found."""

import pytest
from opencl_models import FORCE_LIMITS, change_kernel, everything_error, gravity_error

PRECISIONS = ["f32", "f64"]
# None: the fastest one, which is searched for.
VARIANTS = [None, "naive", "tiled", "vectors", "third_law"]


@pytest.mark.sampled(3)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_each_variant_of_the_direct_sum_is_exact(opencl, variant, precision):
    """700 bodies fill neither the last vector nor the last tile, nor do 3; without softening a body must leave itself out."""
    for count, softening in ((700, 0.0), (700, 0.05), (3, 0.0)):
        error = gravity_error(opencl, count, precision=precision, softening=softening, variant=variant)
        assert error < FORCE_LIMITS[precision], (count, softening)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("variant", ["naive", "tiled", "vectors", "third_law"])
def test_roots_seeded_in_f32_are_exact_in_f64(opencl, variant):
    """5/16 h³ of a seed that f32 rounds a few times, h ≤ 8·2⁻²⁴, is far below 2⁻⁵³."""
    assert gravity_error(opencl, 300, precision="f64", softening=0.05, variant=f"{variant} seeded") < FORCE_LIMITS["f64"]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("full", [False, True], ids=["axial", "full"])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_all_forces_together_are_exact(opencl, precision, full):
    """Gravity and charges of different softening, springs with both kinds of damping, a field, drag, and a held axis."""
    assert everything_error(opencl, precision, full=full) < FORCE_LIMITS[precision]


WRONG_SIGN = ("columns[j] - px", "px - columns[j]")
DROPPED_PAIR = ("for (int j = begin; j < end; j++)", "for (int j = begin + 1; j < end; j++)")
FAULTS = {
    "wrong sign": ("vectors", *WRONG_SIGN),
    "dropped pair": ("vectors", *DROPPED_PAIR),
    "dropped pair of the third law": ("third_law", "int j = b + LANES; j < end", "int j = b + 2 * LANES; j < end"),
    "one-sided third law": ("third_law", "LOAD(0, row_y + j) - back_y", "LOAD(0, row_y + j)"),
    "lost row": ("third_law", "for (int row = 0; row < row_count", "for (int row = 1; row < row_count"),
    "lost barrier": ("tiled", "barrier(CLK_LOCAL_MEM_FENCE);\n        REAL4 block", "REAL4 block"),
    "forgotten tile": ("tiled", "begin < count; begin += TILE", "begin < count - TILE; begin += TILE"),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_direct_sum_is_seen(opencl, fault, monkeypatch):
    variant, text, instead = FAULTS[fault]
    change_kernel(monkeypatch, "n_body", text, instead)
    assert not gravity_error(opencl, 700, precision="f32", softening=0.05, variant=variant) < 100 * FORCE_LIMITS["f32"]


SPRING_FAULTS = {
    "wrong sign": ("springs", "(distance - rest_length[h]) / distance", "(rest_length[h] - distance) / distance"),
    "dropped spring": ("springs", "const int end = start[i + 1];", "const int end = start[i + 1] - 1;"),
    "drag forgotten": ("motion", "(friction - DRAG * moving)", "friction"),
    "held axis let go": ("motion", "return select((REAL4)(0), a, free_axes[i] > 0);", "return a;"),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("fault", SPRING_FAULTS)
def test_a_fault_in_the_other_forces_is_seen(opencl, fault, monkeypatch):
    change_kernel(monkeypatch, *SPRING_FAULTS[fault])
    assert not everything_error(opencl, "f32") < 100 * FORCE_LIMITS["f32"]
