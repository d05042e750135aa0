"""`accuracy: {of: NAME, below: E}` in scenes with a timeline, against the closed form of a spring whose stiffness changes."""

import math

import pytest

import mpp_taichi as mpp
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.settled import settled
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.scene.load import load_scene

SOFT, STIFF, LENGTH = 4.0, 25.0, 1.0
CHANGE, END = 1.3, 4.0  # times
PULL = 0.2  # by which the spring is longer than at rest, at the start


def spring(**more):
    """A mass of 1 on a spring that is held at its other end; the stiffness changes in the middle of an oscillation."""
    bodies = [
        {"name": "wall", "mass": 1, "position": [0, 0, 0], "free": False},
        {"name": "mass", "mass": 1, "position": [LENGTH + PULL, 0, 0]},
    ]
    return {
        "title": "Spring",
        "particles": [{"body": body} for body in bodies],
        "springs": [{"link": {"between": ["wall", "mass"], "stiffness": SOFT, "rest_length": LENGTH}}],
        "integrator": {"leapfrog": {"dt": 0.02}},
        "timeline": [{"at": CHANGE, "set": {"springs[0].link.stiffness": STIFF}}],
        "run": {"duration": END},
        "expect": {"end_position": {"of": "mass", "axis": "x", "near": 1, "within": 9}},
    } | more


def end_position():
    """A cos ω t with ω² of the first stiffness until the change, then on with the second from there."""
    soft, stiff = math.sqrt(SOFT), math.sqrt(STIFF)
    place, speed = PULL * math.cos(soft * CHANGE), -PULL * soft * math.sin(soft * CHANGE)
    late = END - CHANGE
    return LENGTH + place * math.cos(stiff * late) + speed / stiff * math.sin(stiff * late)


def energy_at_the_end():
    """½ k x² of the start, and what the change of the stiffness adds: ½ (k₂ − k₁) x² at that time."""
    place = PULL * math.cos(math.sqrt(SOFT) * CHANGE)
    return 0.5 * SOFT * PULL**2 + 0.5 * (STIFF - SOFT) * place**2


@pytest.fixture(scope="module")
def spring_study(tmp_path_factory):
    problem = pose(load_scene(spring()), of="end_position")
    store = Store(tmp_path_factory.mktemp("spring"), identity(problem, problem.span, "test"))
    study = Study(problem, store, Budget(16.0), StudyWishes(("leapfrog", "pefrl"), (("cpu", "f64"),)))
    study.run()
    return study


@pytest.mark.sampled(3)
def test_the_reference_of_a_whole_timeline_is_the_closed_form_within_its_bar(spring_study):
    found = spring_study.value_reference
    assert found.trusted and found.bar < 1e-11
    assert abs(found.values[0] - end_position()) <= found.bars[0] + 4.0 * math.ulp(1.0)


def test_every_error_of_a_timeline_that_is_told_is_within_a_factor_of_two(spring_study):
    told = [row for row in spring_study.rows() if row.wanted.value is not None]
    for row in told:
        assert 0.5 < row.wanted.value / abs(row.sample.values[0][0] / end_position() - 1.0) < 2.0
    assert len(told) > 4 and min(row.wanted.value for row in told) < 1e-7


@pytest.mark.sampled(3)
def test_a_row_of_a_timeline_measures_what_the_run_verb_measures(spring_study):
    import_taichi()
    machine = Machine(spring_study.problem, "pefrl", backend="cpu", precision="f64")
    steps = 131  # no whole number of the scene's own steps, so that the phases have steps of different lengths
    for _ in range(2):  # the second measurement begins where the first ended, in the last phase
        (value,) = machine.measure(machine.configuration(steps), Budget(1e9)).values
        scene = settled(load_scene(spring()), "pefrl", END / steps, END, {})
        with mpp.run(scene, precision="f64") as result:
            assert result.verdicts[0].value == value
    machine.close()


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("of", "exact"),
    [
        ({"end_position": {"of": "mass", "axis": "x", "below": 9}}, end_position),
        ({"total_energy": {"below": 9}}, energy_at_the_end),
    ],
)
def test_the_setting_that_is_chosen_for_a_timeline_delivers(of, exact, tmp_path):
    (name,) = of
    spec = load_scene(spring(expect=of, accuracy={"of": name, "below": 1e-6}))
    found = choose(spec, tmp_path, integrators=("leapfrog", "pefrl"), precisions=("f64",), seconds=20.0)
    with mpp.run(found.settle(spec), precision="f64") as result:
        true = abs(result.verdicts[0].value / exact() - 1.0)
    assert found.quantity == name
    assert 1e-8 < true < 1e-6
    assert 0.5 < found.error / true < 2.0
