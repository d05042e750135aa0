"""Expressions compute the same numbers as Python, refuse other syntax, and report the place of a fault."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.expressions import FUNCTIONS, ExpressionError, Formula, parse
from mpp_taichi.scene.load import load_scene

VALUES = {"a": 2.0, "b": -3.5, "k2": 2.9584e-4}


@pytest.mark.parametrize(
    "text",
    [
        "1",
        "1e-9",
        ".5",
        "-a",
        "+a",
        "a + b * 2",
        "a ** 0.5",
        "2 ** -1",
        "a // 3",
        "b % 3",
        "(a + b) / (a - b)",
        "-2 ** 2",
        "7 // 2 * 3",
    ],
)
def test_arithmetic_is_that_of_python(text):
    assert parse(text).number(VALUES) == pytest.approx(eval(text, {}, VALUES), rel=1e-15)  # the texts above only


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_a_function_means_the_same_on_numbers_and_on_arrays(name):
    on_numbers, on_arrays, (fewest, _) = FUNCTIONS[name]
    points = [(0.3, 0.9), (0.7, 0.2), (0.11, 0.5)]
    arguments = [np.array([point[k] for point in points]) for k in range(max(fewest, 1))]
    text = f"{name}({', '.join(['x', 'y'][: len(arguments)])})"
    array = parse(text).array(dict(zip("xy", arguments, strict=False)))
    numbers = [parse(text).number(dict(zip("xy", point, strict=True))) for point in points]
    assert array == pytest.approx(numbers, rel=4e-16, abs=4e-16)


def test_constants_that_are_always_there():
    assert parse("pi + tau + e").number({}) == math.pi + math.tau + math.e


@pytest.mark.parametrize(
    "text, offset, message",
    [
        ("k3 + 1", 0, "did you mean 'k2'"),
        ("1 + k3", 4, "unknown name"),
        ("  1 + k3", 6, "unknown name"),
        ("sqrt(2) + sin(nope)", 14, "unknown name 'nope'"),
        ("1 + 1/(a - 2)", 4, "division by zero"),
        ("1 + sqrt(b)", 4, "not a real number"),
        ("a + 10.0**400", 4, "too large"),
        ("exp(1000)", 0, "too large"),
        ("1e999", 0, "not a real number"),
        ("b ** 0.5", 0, "not a real number"),
        ("a b", 2, "neither a number nor an expression"),
        ("2 | a", 0, "this operator is not allowed"),
        ("2^^a", 2, "neither a number nor an expression"),
        ("2^a + nope^2", 6, "unknown name 'nope'"),
        ("  2^2^2 + 1/(a^1 - 2)", 10, "division by zero"),
        ("sin", 0, "write sin"),
        ("sin()", 0, "takes 1"),
        ("min()", 0, "one or more"),
        ("a.real", 0, "only numbers"),
        ("a[0]", 0, "only numbers"),
        ("a < b", 0, "only numbers"),
        ("a if b else 1", 0, "only numbers"),
        ("[1]", 0, "only numbers"),
        ("'a'", 0, "not a number"),
        ("True", 0, "not a number"),
        ("1j", 0, "not a number"),
        ("lambda: 1", 0, "only numbers"),
        ("(a := 1)", 1, "only numbers"),
        ("not a", 0, "not allowed"),
        ("~a", 0, "not allowed"),
        ("a @ b", 0, "not allowed"),
        ("a << 2", 0, "not allowed"),
        ("open('x')", 0, "unknown function"),
        ("sqrt(*a)", 0, "takes numbers only"),
        ("sqrt(x=1)", 0, "takes numbers only"),
        ("(lambda: 1)()", 0, "only the named functions"),
        ("é + nope", 4, "unknown name 'nope'"),
        ("", 0, "neither"),
        ("(", 0, "neither"),
        *((text, 0, "neither") for text in ("1e___", "1__0e2", "1e5_", ".1_e5", "1e-_5")),
        ("2 * 1_0e-4_00", 4, "too small"),
        ("a + 0." + "0" * 400 + "1", 4, "too small"),
        ("9" * 900, 0, "too large"),
        ("-" * 900 + "1", 0, ""),
    ],
)
def test_what_is_not_arithmetic_is_refused_at_its_character(text, offset, message):
    with pytest.raises(ExpressionError) as caught:
        parse(text).number({**VALUES, "é": 1.0} if "nope" in text else VALUES)
    assert message in str(caught.value)
    if message not in ("", "neither"):
        assert caught.value.offset == offset


@settings(max_examples=300, deadline=None)
@given(st.one_of(st.text(max_size=60), st.text(alphabet="0123456789._e+-*/%()ab ,sqrtnidf", max_size=60)))
@pytest.mark.sampled(3)
def test_any_text_is_a_finite_number_or_an_expression_error(text):
    try:
        assert math.isfinite(parse(text).number(VALUES))
    except ExpressionError as error:
        assert 0 <= error.offset <= len(text)


def test_a_formula_broadcasts_and_refuses_what_is_not_finite():
    assert Formula(parse("a"), {"a": 3.0})(4).tolist() == [3.0] * 4
    assert Formula(parse("a * u"), {"a": 3.0})(3, u=np.arange(3.0)).tolist() == [0.0, 3.0, 6.0]
    for text in ("1 / u", "log(u)", "sqrt(u - 1)", "1e200 * 1e200", "exp(1000)", "0 ** -1"):
        with pytest.raises(ExpressionError):
            Formula(parse(text), {})(3, u=np.arange(3.0))


def scene(**constants):
    return {
        "constants": constants,
        "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}],
        "integrator": {"leapfrog": {"dt": 1}},
    }


def test_constants_are_resolved_in_the_order_of_their_dependence():
    spec = load_scene(scene(c="a + b", a=1, b="2 * a"))
    assert (spec.constants["c"], spec.constants["b"]) == (3.0, 2.0)


def test_a_cycle_of_constants_is_named_once():
    with pytest.raises(SceneError) as caught:
        load_scene(scene(a="b", b="c", c="a", d="a + 1"))
    assert len(caught.value.faults) == 1
    assert "depends on itself: " in caught.value.faults[0]


def test_a_constant_at_fault_is_reported_where_it_is_defined_only(tmp_path):
    path = tmp_path / "scene.yaml"
    rest = "particles:\n  - body: {mass: a, position: [a, 0, a]}\nintegrator: {leapfrog: {dt: 2 * a}}\n"
    path.write_text("constants: {a: 1 / 0}\n" + rest)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert caught.value.faults == (f"{path}:1:16: constants.a: '1 / 0': division by zero",)


@pytest.mark.parametrize("quoted", ["{}", "'{}'", '"{}"'])
def test_the_column_is_that_of_the_character_in_the_file(quoted, tmp_path):
    path = tmp_path / "scene.yaml"
    text = quoted.format("2 * (1 + nope)")
    path.write_text(f"constants: {{ä: 1, b: {text}}}\n")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    column = path.read_text().index("nope") + 1
    faults = [fault for fault in caught.value.faults if "nope" in fault]
    known = "known: b, ä, pi, tau, e; names of your own stand under constants:"
    assert faults == [f"{path}:1:{column}: constants.b: unknown name 'nope', {known}"]
