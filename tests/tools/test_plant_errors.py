"""Errors of one per cent that are planted in scenes: which there are, and that what the scenes expect notices them."""

import sys

import pytest
from conftest import ROOT

sys.path[:0] = [str(ROOT / "tools" / "checks")]

import plant_errors  # noqa: E402

# Scenes that notice all of theirs, run in at most five seconds of processor time, and together have most effects.
QUICK = ("kepler", "newtons_cradle", "one_on_two", "oscillator", "billiard_break", "membrane_loose", "morse_molecule")
QUICK += ("lissajous_trap", "penning_trap", "argon_drop", "breathing_bubble", "cantilever_loose", "chain")
QUICK += ("double_pendulum_flips", "galton")
PLANTS = [
    (scene, effect, settings)
    for scene in QUICK
    for effect, settings in plant_errors.errors_of(ROOT / "scenes" / f"{scene}.yaml", 1.01)
]


def test_every_kind_of_effect_is_planted():
    assert {"newtonian_gravity", "springs", "damping of springs", "contacts", "walls"} <= {effect for _, effect, _ in PLANTS}


def test_a_force_with_two_effects_has_an_error_in_each():
    planted = dict(plant_errors.errors_of(ROOT / "scenes" / "migrating_planets.yaml", 1.01))
    assert planted["migration"] == ["forces[1].migration.rate=1.01 * (shrink)"]
    assert planted["circularization"] == ["forces[1].migration.circularization=1.01 * (rounding)"]


def test_a_force_that_is_off_has_no_error():
    assert set(dict(plant_errors.errors_of(ROOT / "scenes" / "steered_rocket.yaml", 1.01))) == {"newtonian_gravity"}


def test_friction_of_walls_has_an_error():
    planted = dict(plant_errors.errors_of(ROOT / "scenes" / "turntable.yaml", 1.01))
    assert planted["friction of the walls"] == ["walls[0].plane.friction=1.01 * (mu)"]
    assert "friction of the walls" not in dict(plant_errors.errors_of(ROOT / "scenes" / "hourglass.yaml", 1.01))


def test_an_error_is_planted_in_every_place_of_its_effect():
    scene = {
        "particles": [
            {"body": {"name": name, "mass": 1, "radius": 0.1, "position": [k, 0.5, 0]}} for k, name in enumerate("ab")
        ],
        "springs": [
            {"link": {"between": ["a", "b"], "stiffness": 2, "damping": "0.5"}},
            {"link": {"between": ["a", "b"], "stiffness": 3}},
            {"link": {"between": ["b", "a"], "type": "soft"}},
        ],
        "spring_types": {"soft": {"stiffness": 4, "damping": 0.25}},
        "walls": [{"plane": {"point": [0, 0], "normal": [0, 1]}}, {"periodic_box": {"lower": [-9, -9], "upper": [9, 9]}}],
        "contacts": {"hard_spheres": {"solver": "swept", "restitution": 0.5}},
        "integrator": {"leapfrog": {"dt": 0.1}},
        "run": {"steps": 1},
    }
    found = dict(plant_errors.errors_of_springs(scene, 1.01)) | dict(plant_errors.errors_of_contacts(scene, 0.99))
    assert found == {
        "springs": [
            "springs[0].link.stiffness=1.01 * (2)",
            "springs[1].link.stiffness=1.01 * (3)",
            "spring_types.soft.stiffness=1.01 * (4)",
        ],
        "damping of springs": ["springs[0].link.damping=1.01 * (0.5)", "spring_types.soft.damping=1.01 * (0.25)"],
        "contacts": ["contacts.hard_spheres.restitution=0.99 * (0.5)"],
        "walls": ["walls[0].plane.restitution=0.99 * (1.0)"],
    }
    merging = {"contacts": {"hard_spheres": {"solver": "merging"}}, "walls": [{"plane": {"restitution": 0.5}}]}
    assert list(plant_errors.errors_of_contacts(merging, 0.5)) == [("walls", ["walls[0].plane.restitution=0.5 * (0.5)"])]
    sticky = {"contacts": {"hard_spheres": {"solver": "swept", "restitution": 0}}, "walls": [{"plane": {"restitution": 0}}]}
    assert not list(plant_errors.errors_of_contacts(sticky, 0.5))


@pytest.mark.parametrize(
    "particles, meets",
    [
        ([{"body": {"radius": 0.1}}], False),
        ([{"body": {"radius": 0.1}}, {"body": {"radius": 0}}], False),
        ([{"body": {"radius": 0.1}}, {"body": {"radius": 0.2}}], True),
        ([{"gas": {"count": 9, "radius": 0.1}}], True),
        ([{"gas": {"count": 9, "radius": 0}}], False),
    ],
    ids=["one", "one and a point", "two", "a gas", "a gas of points"],
)
def test_contacts_of_spheres_are_planted_where_two_spheres_can_meet(particles, meets):
    scene = {"particles": particles, "contacts": {"hard_spheres": {"solver": "swept"}}}
    assert bool(list(plant_errors.errors_of_contacts(scene, 0.99))) is meets


@pytest.mark.sampled(6)
@pytest.mark.parametrize("scene, effect, settings", PLANTS, ids=[f"{scene}-{effect}" for scene, effect, _ in PLANTS])
def test_quick_scenes_notice_every_planted_error(scene, effect, settings):
    """Without an error the scenes pass, which the tests of scenes see."""
    code, failed, _ = plant_errors.run(ROOT / "scenes" / f"{scene}.yaml", settings, ["--backend", "cpu"])
    assert code == 4 and failed, f"{effect} of {scene} is off by one per cent, and no expectation fails"


def test_a_run_without_a_verdict_is_told_with_its_error():
    scene = ROOT / "scenes" / "kepler.yaml"
    code, failed, error = plant_errors.run(scene, ["forces[0].newtonian_gravity.strength=nothing"], ["--backend", "cpu"])
    assert code == 2 and not failed and "unknown name 'nothing'" in error
