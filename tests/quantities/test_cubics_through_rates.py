"""The cubic through two values and their rates: every cubic is its own, and is found to cross a level where it does."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from mpp_taichi.arithmetic.hermite import crossing, cubic

SPAN = (1.5, 4.0)


def looks(curve):
    """Value and rate at both ends of the span."""
    return tuple((curve(time), curve.deriv()(time)) for time in SPAN)


@pytest.mark.parametrize("power", range(4))
def test_a_polynomial_of_degree_three_is_its_own_cubic(power):
    curve, (begin, end) = Polynomial([0.0] * power + [2.0]), SPAN
    shares = np.linspace(0.0, 1.0, 11)
    expected = curve(begin + shares * (end - begin))
    # Some ten roundings of numbers that are at most the largest value, 2 · 4³, and its rate times the span, four times that.
    bound = 10 * 2.0**-53 * 5.0 * abs(expected).max()
    assert cubic(shares, end - begin, *looks(curve)) == pytest.approx(expected, rel=0.0, abs=bound)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["rising", "falling"])
@pytest.mark.parametrize("place", [1.5, 1.6, 2.75, 3.9, 4.0])
def test_a_level_is_crossed_where_the_curve_has_it(place, sign):
    """Upwards and downwards, near both ends and at them; the slope of the curve is at least 1 in size."""
    curve = sign * Polynomial([0.3, 1.0, 0.1, 0.05])
    found = crossing(*SPAN, *looks(curve), level=curve(place))
    # Bisection ends at 10⁻¹⁵ of the span, and values of about 10 are rounded some ten times, over a slope of at least 1.
    assert found == pytest.approx(place, rel=0.0, abs=1e-15 * 2.5 + 10 * 2.0**-53 * 10.0)
