"""Mistakes that people make who write their first scene: each is answered by its cause and by what to write instead."""

import pytest

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene

SCENE = """title: Test
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0]}
  - body: {name: b, mass: 1e-3, position: [1, 0, 0], velocity: [0, 1, 0]}
forces:
  - newtonian_gravity: {strength: 1}
integrator: {leapfrog: {dt: 0.01}}
run: {duration: 1}
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load the scene with one text replaced by another."""
    monkeypatch.chdir(tmp_path)

    def replaced(old, new):
        assert old in SCENE
        (tmp_path / "s.yaml").write_text(SCENE.replace(old, new, 1), encoding="utf-8")
        return load_scene("s.yaml")

    return replaced


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        (
            "mass: 1,",
            "mass: 1,0,",
            "s.yaml:3:29: particles[0].body.0: unknown key '0'; a comma ends an entry, and a decimal number",
        ),
        ("run: {duration: 1}", "run:\n  duration: 1,5", "'1,5' is no number; a decimal number has a point, as 1.5"),
        ("mass: 1,", "mass: 1.0 kg,", "'1.0 kg' is neither a number nor an expression; write 1.0 alone: the units of all"),
        ("dt: 0.01", "dt: 0.5 %", "'0.5 %' is neither a number nor an expression; write 0.005"),
        ("mass: 1,", "mass: 1, color: yelow,", "'yelow' is no colour, did you mean 'yellow'?"),
        ("mass: 1,", "mass: 1, color: '#12345',", "'#12345' is no colour; a colour is a name of CSS, '#rrggbb'"),
        ("mass: 1,", "mass: 1, color: ,", "hexadecimal digits need quotes"),
        ("strength: 1", "strength: G*2", "unknown name 'G'; G is known where the scene has units:"),
        ("mass: 1,", "mass: heavy,", "unknown name 'heavy', known: pi, tau, e; names of your own stand under constants:"),
        (
            "position: [0, 0, 0]}",
            "position: [0, 0, 0]",
            "s.yaml:4:3: not valid YAML: the { of line 3, column 11 is not closed by }",
        ),
        ("[0, 0, 0]", "[0, 0, 0", "not valid YAML: the [ of line 3, column 40 is not closed by ]"),
        ("mass: 1,", "mass: 1", "line 3"),
        ("  - newtonian", "\t- newtonian", "s.yaml:6:1: not valid YAML: a tab; YAML needs spaces here"),
        ("title: Test", "title: @home", "a value that begins with @ needs quotes around it"),
        ("title: Test", "title Test", "line 1, 'title Test', has no colon behind its key"),
        ("run: {", "run {", "a colon belongs before the {: run: …"),
        ("title: Test", "title: Test: two bodies", 'a text with a colon needs quotes around it: title: "Test: two bodies"'),
        ("title: Test", "title: 'Test", "the quote of line 1, column 8 is not closed"),
        ("{leapfrog: {dt", "{leapfrog:{dt", "a space belongs behind the colon of leapfrog:"),
        ("{dt: 0.01}", "{dt:0.01}", "unknown key 'dt:0.01'; a space belongs behind the colon: dt: …"),
        ("[0, 0, 0]", "[0; 0; 0]", "not a list of 1; commas separate the entries"),
        (
            "  - body: {name: b",
            "   - body: {name: b",
            "begins in column 4, but the entries of a list from line 3 on in column 3",
        ),
        ("leapfrog", "leapfrgo", "unknown integrator 'leapfrgo', did you mean 'leapfrog'?"),
        ("leapfrog", "verlet", "did you mean 'velocity_verlet'"),
        ("{leapfrog: {dt: 0.01}}", "leapfrog", "integrator.leapfrog: missing key 'dt'"),
        ("newtonian_gravity: {strength: 1}", "newton_gravity", "did you mean 'newtonian_gravity'?"),
    ],
)
def test_a_mistake_is_answered_by_its_cause(load, right, wrong, said):
    with pytest.raises(SceneError) as error:
        load(right, wrong)
    told = str(error.value)
    assert said in told
    assert max(map(len, told.splitlines())) < 400


@pytest.mark.parametrize("bare", ["newtonian_gravity", "newtonian_gravity:"])
def test_a_force_without_parameters_needs_no_braces(load, bare):
    by_default = load("newtonian_gravity: {strength: 1}", "newtonian_gravity: {}")
    assert load("newtonian_gravity: {strength: 1}", bare).forces[0].parameters == by_default.forces[0].parameters


def test_an_integrator_that_chooses_its_own_steps_needs_no_braces(load):
    assert load("{leapfrog: {dt: 0.01}}", "ias15").integrator.name == "ias15"


@pytest.mark.parametrize(
    ("written", "color"),
    [
        ("orange", (1.0, 165 / 255, 0.0)),
        ("LightSkyBlue", (135 / 255, 206 / 255, 250 / 255)),
        ("'#ffa500'", (1.0, 165 / 255, 0.0)),
        ("'#0f0'", (0.0, 1.0, 0.0)),
        ("[0.1, 0.2, 0.3]", (0.1, 0.2, 0.3)),
    ],
)
def test_a_colour_has_a_name_or_digits(load, written, color):
    spec = load("mass: 1,", f"mass: 1, color: {written},")
    assert spec.particles[0].parameters["color"] == pytest.approx(color, abs=1e-15)


def test_the_background_has_a_name_too(load):
    assert load("run: {duration: 1}", "run: {duration: 1}\nview: {background: white}").view.background == (1.0, 1.0, 1.0)
