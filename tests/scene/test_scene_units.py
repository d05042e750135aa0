"""Units: the gravitational constant in the units of a scene, against Gauss, Kepler and SI."""

import math
from pathlib import Path

import pytest
import yaml
from doc_commands import blocks

import mpp_taichi as mpp
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.units import GRAVITATIONAL_PARAMETERS, LENGTHS, TIMES, gravitational_constant

ASTRONOMICAL = {"length": "AU", "time": "day", "mass": "Msun"}


def scene(**changes):
    return {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}],
        "forces": [{"newtonian_gravity": {}}],
        "integrator": {"leapfrog": {"dt": 1}},
        **changes,
    }


def test_solar_units_give_gauss_constant():
    # Gauss's k defined the astronomical unit until 2012; today's values of both differ from it in the tenth digit.
    assert gravitational_constant("AU", "day", "Msun") == pytest.approx(0.01720209895**2, rel=1e-9)


def test_si_units_give_codata():
    assert gravitational_constant("m", "s", "kg") == pytest.approx(6.67430e-11, rel=1e-15)
    assert gravitational_constant("cm", "s", "g") == pytest.approx(6.67430e-8, rel=1e-12)


def test_a_geostationary_orbit_turns_once_a_sidereal_day():
    strength = gravitational_constant("km", "hour", "Mearth")
    assert 2 * math.pi * math.sqrt(42_164.0**3 / strength) == pytest.approx(23.9345, rel=1e-4)


def test_a_year_in_years_is_two_pi():
    assert gravitational_constant("AU", "yr", "Msun") == pytest.approx(4 * math.pi**2, rel=1e-4)


def test_masses_of_planets_in_suns():
    suns = GRAVITATIONAL_PARAMETERS["Msun"]
    assert suns / GRAVITATIONAL_PARAMETERS["Mearth"] == pytest.approx(332_946.05, rel=1e-6)  # IERS 2010
    assert suns / GRAVITATIONAL_PARAMETERS["Mjup"] == pytest.approx(1047.5655, rel=1e-5)  # Jupiter alone
    assert GRAVITATIONAL_PARAMETERS["Mearth"] / GRAVITATIONAL_PARAMETERS["Mmoon"] == pytest.approx(81.3006, rel=1e-5)


def test_a_parsec_is_where_the_astronomical_unit_spans_an_arc_second():
    assert LENGTHS["AU"] / LENGTHS["pc"] == pytest.approx(math.radians(1 / 3600), rel=1e-10)
    assert LENGTHS["pc"] / LENGTHS["ly"] == pytest.approx(3.26156, rel=1e-5)
    assert TIMES["yr"] == 365.25 * 86_400


def test_gravity_takes_its_strength_from_the_units():
    assert load_scene(scene(units=ASTRONOMICAL)).forces[0].parameters["strength"] == gravitational_constant("AU", "day", "Msun")


def test_gravity_without_units_has_strength_one():
    assert load_scene(scene()).forces[0].parameters["strength"] == 1.0


def test_a_strength_that_is_said_is_kept():
    spec = load_scene(scene(units=ASTRONOMICAL, forces=[{"newtonian_gravity": {"strength": "2 * G"}}]))
    assert spec.forces[0].parameters["strength"] == 2 * spec.constants["G"]


def test_without_units_there_is_no_g_and_a_scene_may_define_it():
    with pytest.raises(SceneError, match="unknown name 'G'"):
        load_scene(scene(run={"duration": "G"}))
    assert load_scene(scene(constants={"G": 7}, run={"duration": "G"})).run.duration == 7.0
    with pytest.raises(SceneError, match="means something already"):
        load_scene(scene(units=ASTRONOMICAL, constants={"G": 7}))


@pytest.mark.parametrize("word, near", [("au", "AU"), ("Au", "AU"), ("days", None), ("parsec", None)])
def test_an_unknown_unit_is_told_the_known_ones(word, near):
    with pytest.raises(SceneError) as caught:
        load_scene(scene(units={**ASTRONOMICAL, "length": word}))
    assert "allowed: AU, " in str(caught.value)
    assert near is None or f"did you mean {near!r}?" in str(caught.value)


def test_units_at_fault_do_not_make_g_unknown():
    with pytest.raises(SceneError) as caught:
        load_scene(scene(units={**ASTRONOMICAL, "time": "dya"}, run={"duration": "1 / G"}))
    assert len(caught.value.faults) == 1


def test_the_example_of_the_reference_holds_and_its_results_are_in_the_units_of_the_scene():
    """A sidereal day has 86,164.1 s, and geostationary satellites an orbit with a radius of 42,164 km."""
    (example,) = (block for block in blocks("docs/scene.md") if block.kind == "yaml" and "\nunits:" in block.text)
    given = yaml.safe_load(example.text)
    with mpp.run(given, backend="cpu", samples=10) as result:
        assert result.passed and len(result.verdicts) == 1
        assert result.time[-1] == result.table["time"][-1] == given["run"]["duration"]
        # Leapfrog at 1436 steps a turn keeps the radius of a circle to (2π/1436)²/4 = 5e-6.
        assert math.dist(*result.position[-1]) == pytest.approx(42_164.17, rel=1e-5)
    assert load_scene(given).forces[0].parameters["strength"] == gravitational_constant("km", "s", "Mearth")


def test_every_unit_is_in_the_reference():
    text = (Path(__file__).parents[2] / "docs" / "scene.md").read_text(encoding="utf-8")
    table = text.partition("### `units:`")[2].partition("\n### ")[0]
    assert all(f"`{word}`" in table for words in (LENGTHS, TIMES, GRAVITATIONAL_PARAMETERS) for word in words)
