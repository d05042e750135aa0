"""Formulas that no user means well: each is refused in words, or derived, and none hangs or ends in a traceback."""

import subprocess
import sys
import time

import numpy as np
import pytest

from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.formulas import time_limit
from mpp_taichi.scene.formulas.bond_law import bond_law
from mpp_taichi.scene.formulas.external_law import external_law
from mpp_taichi.scene.formulas.fields import FormulaText
from mpp_taichi.scene.formulas.grammar import is_zero
from mpp_taichi.scene.formulas.pair_law import pair_law
from mpp_taichi.scene.formulas.path_law import path_law

WIDTH = 1e-3  # of a central difference of second order


def acceleration(*texts):
    return external_law(None, texts, 3, (), ())


REAL = ["abs(log(r))", "abs(sqrt(r) - 1)", "abs(r^r - 1)", "abs(asin(r/2) - 0.5)", "abs(cos(r)^1.5)"]


@pytest.mark.parametrize("text", REAL)
def test_the_slope_of_an_absolute_value_is_that_of_the_formula(text):
    """SymPy does not know these to be real. The difference quotient errs by WIDTH² V‴/6, and |V‴| is below 100 here."""
    law = pair_law(text, (), ())
    for r in (0.31, 1.3):
        rise = law.energy_at(r + WIDTH, {}) - law.energy_at(r - WIDTH, {})
        assert law.shape_at(r, {}) * r == pytest.approx(rise / (2 * WIDTH), abs=100 / 6 * WIDTH**2)


@pytest.mark.parametrize("text", ["abs(log(1 + t))", "abs((2 + sin(t))^1.5 - 3)"])
def test_a_path_may_have_an_absolute_value(text):
    law = path_law([FormulaText(text, {}, 1)])
    (x, v, a) = law.rows_at(np.array([0.4]))[:, 0]
    assert np.isfinite([x, v, a]).all()


@pytest.mark.parametrize(("text", "character"), [("1 + 0^x", 4), ("(-1)^x", 0), ("y*(1 - 1)^x", 2), ("(0 - 2)^(x*y)", 0)])
def test_a_power_that_varies_needs_a_base_above_0(text, character):
    with pytest.raises(ExpressionError, match="a power that varies needs a base above 0") as found:
        external_law(text, None, 3, (), ())
    assert found.value.offset == character


def test_a_derivative_that_is_no_real_number_is_refused():
    with pytest.raises(ExpressionError, match="a derivative of the formula has the number 'zoo', which is not real"):
        external_law("asin(x/abs(x))", None, 3, (), ())


def test_powers_of_sums_are_not_multiplied_out():
    """C(69, 9) is 6·10¹⁰ terms; the law needs their sum only, which is one power."""
    law = acceleration("(x + y + z + vx + vy + vz + t + m + q + R)^60", "0", "0")
    assert law.flags["depends_on_velocity"] and not law.flags["conserves_energy"] and not law.flags["turns"]
    with pytest.raises(ExpressionError, match="the forces would not be opposite"):
        pair_law("(m1 + q1 + R1 + 2)^60*(m2 + q2 + R2 + 3)^60/r", (), ())


def test_what_is_0_when_it_is_multiplied_out_is_seen():
    law = acceleration("(x + y)^2*vy", "-(x^2 + 2*x*y + y^2)*vx", "0")
    assert law.flags["conserves_energy"] and law.flags["turns"]
    assert pair_law("(m1 + q1)*(m1 - q1)*(m2^2 - q2^2)/r", (), ()).needs == {"mass", "charge"}


def test_an_expression_of_too_many_terms_counts_as_different_from_0():
    import sympy

    a, b, c = sympy.symbols("a b c")
    few = (a + b) ** 2 - a**2 - 2 * a * b - b**2
    assert is_zero(few)
    assert not is_zero(few * (a + b + c) ** 1000)
    assert not is_zero(sympy.exp((a + b + c) ** 1000) * few)
    assert not is_zero((a + b) ** sympy.Float(1e300) * few)


POWERS = "(vz + (x - q)*t*(x - z)/y)^6*exp((q - vy + x - x/t*1.2)^60/(degrees(q) + vy - atan(t/v)) - (q/7 - vx)^y)"
SLOW = f"asin(((x/tanh({POWERS}))^2)^-2)"


def test_derivatives_that_take_too_long_are_given_up(monkeypatch):
    """SymPy multiplies out the power of 60 to see whether a part is 0, for minutes."""
    monkeypatch.setattr(time_limit, "SECONDS_ALLOWED", 1.0)
    began = time.thread_time()
    with pytest.raises(ExpressionError, match=r"the derivatives of the formula take more than 1 s; write it more simply"):
        acceleration(SLOW, "0", "0")
    assert time.thread_time() - began < 30.0
    assert bond_law("(l - rest)^2", (), ()).at("energy", 3.0, 1.0, {}) == 4.0


def test_a_stop_that_comes_too_late_stops_nothing():
    """The limit is over as soon as the derivatives are there."""
    limited = time_limit.in_time(lambda: 5)
    assert [limited() for _ in range(100)] == [5] * 100


def test_a_profiler_works_after_derivatives():
    """A stop that is taken back stays pending in Python 3.11, whose first call under a profiler then never ends."""
    text = "from mpp_taichi.scene.formulas.time_limit import in_time; import sys; in_time(lambda: 5)(); "
    text += "sys.setprofile(lambda *_: None); print((lambda: 'over')())"
    ran = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60, check=True)
    assert ran.stdout == "over\n"
