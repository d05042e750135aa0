"""Which members a sweep has, in which order, and that a scene's block is checked where it is written."""

import numpy as np
import pytest

from mpp_taichi import CapacityError, SceneError, load_scene
from mpp_taichi.scene.sweep_spec import AxisSpec
from mpp_taichi.sweep.order import coarse_to_fine
from mpp_taichi.sweep.plan import Plan, along

SCENE = {
    "constants": {"speed": 1, "place": 0},
    "particles": [{"body": {"name": "ball", "mass": 1, "position": ["place", 0, 0], "velocity": ["speed", 0, 0]}}],
    "integrator": {"leapfrog": {"dt": 0.5}},
    "run": {"duration": 4},
}


def plan(**sweep):
    return Plan(load_scene({**SCENE, "sweep": {"measure": ["end_time"], **sweep}}).sweep)


def test_on_a_grid_the_last_key_varies_fastest():
    found = plan(vary={"constants.speed": [1, 2, 3], "constants.place": {"from": 0, "to": "2*pi", "count": 3}})
    assert found.shape == (3, 3) and found.count == 9
    assert found.values([0, 1, 8]) == [
        {"constants.speed": 1, "constants.place": 0.0},
        {"constants.speed": 1, "constants.place": np.pi},
        {"constants.speed": 3, "constants.place": 2 * np.pi},
    ]


def test_a_range_ends_exactly_or_leaves_its_end_out():
    assert plan(vary={"constants.speed": {"from": 0.1, "to": 0.7, "count": 4}}).values([3])[0]["constants.speed"] == 0.7
    angles = plan(vary={"constants.speed": {"from": 0, "to": 360, "count": 4, "endpoint": False}}).columns(np.arange(4))
    assert angles["constants.speed"].tolist() == [0.0, 90.0, 180.0, 270.0]


def test_a_logarithmic_range_has_equal_ratios():
    found = plan(vary={"constants.speed": {"from": 1e-3, "to": 10, "count": 5, "scale": "logarithmic"}})
    values = found.columns(np.arange(5))["constants.speed"]
    assert np.allclose(values[1:] / values[:-1], 10.0, rtol=1e-14) and values[-1] == 10.0


def test_zipped_values_go_in_pairs():
    found = plan(vary={"constants.speed": [1, 2], "constants.place": [5, 6]}, combine="zipped")
    assert found.count == 2 and found.values([1]) == [{"constants.speed": 2, "constants.place": 6}]


@pytest.mark.parametrize("kind", ["random", "sobol"])
def test_a_drawn_member_is_the_same_however_it_is_asked_for(kind):
    block = {"vary": {"constants.speed": {"from": 1, "to": 3}, "constants.place": {"from": 0, "to": 1}}}
    found = plan(**block, sample={kind: 10_000, "seed": 7})
    all_at_once = found.columns(np.arange(10_000))["constants.speed"]
    some = np.array([9_999, 3, 4_096, 4_095, 0])
    assert np.array_equal(found.columns(some)["constants.speed"], all_at_once[some])
    assert 1.0 <= all_at_once.min() and all_at_once.max() <= 3.0 and len(np.unique(all_at_once)) > 9_900
    # The mean of n uniform numbers of width 2 has the standard deviation 2/√(12 n) = 0.0058; two of 10⁹ means are beyond six.
    assert abs(all_at_once.mean() - 2.0) < 6 * 2.0 / np.sqrt(12 * 10_000)
    other = plan(**block, sample={kind: 10_000, "seed": 8}).columns(np.arange(10_000))["constants.speed"]
    assert not np.array_equal(other, all_at_once)


@pytest.mark.parametrize("shape", [(1,), (7,), (8, 5), (3, 4, 5), (200, 100)])
def test_every_member_has_its_turn_and_coarse_grids_come_first(shape):
    order = coarse_to_fine(shape)
    assert np.array_equal(np.sort(order), np.arange(np.prod(shape)))
    longest = max(shape)
    step = 1 << max(0, int(longest - 1).bit_length() - 2)
    places = np.unravel_index(order, shape)
    on_coarse_grid = np.all([place % step == 0 for place in places], axis=0)
    assert on_coarse_grid[: on_coarse_grid.sum()].all()


def test_ten_million_members_are_allowed_and_more_are_not():
    with pytest.raises(CapacityError, match="allowed"):
        plan(
            vary={
                "constants.speed": {"from": 0, "to": 1, "count": 5_000},
                "constants.place": {"from": 0, "to": 1, "count": 5_000},
            }
        )


@pytest.mark.parametrize(
    ("sweep", "said"),
    [
        ({"vary": {"constants.speed": []}}, "empty list"),
        ({"vary": {"constants.speed": 3}}, "list of values"),
        ({"vary": {"constants.speed": {"from": 0, "count": 3}}}, "missing key 'to'"),
        ({"vary": {"constants.speed": {"from": 0, "to": 1}}}, "count:"),
        ({"vary": {"constants.speed": {"from": 0, "to": 1, "count": 0}}}, "at least 1"),
        ({"vary": {"constants.speed": {"from": 0, "to": 1, "count": 3, "scale": "logarithmic"}}}, "at or below 0"),
        ({"vary": {"constants.speed": {"from": 0, "to": "1 + x", "count": 3}}}, "unknown name 'x'"),
        ({"vary": {"constants.speed": {"from": 0, "to": 1, "number": 3}}}, "unknown key 'number'"),
        ({"vary": {"constants.speed": [1, 2], "constants.place": [1]}, "combine": "zipped"}, "equally long"),
        ({"vary": {"constants.speed": [1, 2]}, "sample": {"random": 5}}, "from: and to:"),
        ({"vary": {"constants.speed": {"from": 0, "to": 1}}, "sample": {"halton": 5}}, "random: count"),
        ({"vary": {"constants.speed": [1]}, "measure": ["end_tim"]}, "did you mean 'end_time'"),
        ({"vary": {"constants.speed": [1]}, "measure": [{"distance": {"of": "bal"}}]}, "ball"),
        ({"vary": {"constants.speed": [1]}, "stop": ["speed"]}, "bounds"),
        ({"measure": ["end_time"]}, "vary"),
        ({"vary": {"constants.speed": [1]}, "measure": []}, "expects nothing"),
    ],
)
def test_a_faulty_block_is_refused_in_words(sweep, said):
    with pytest.raises(SceneError, match="sweep") as error:
        load_scene({**SCENE, "sweep": {"measure": ["end_time"], **sweep}})
    assert said in str(error.value)


def test_a_fault_is_placed_at_its_line(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "particles: [{body: {mass: 1, position: [0, 0, 0]}}]\nintegrator: {leapfrog: {dt: 1}}\nrun: {duration: 4}\n"
        "sweep:\n  vary:\n    seed: {from: 0, to: x, count: 3}\n  measure: [end_time]\n"
    )
    with pytest.raises(SceneError, match=r"s\.yaml:6:\d+: sweep\.vary\.seed\.to: unknown name 'x'"):
        load_scene(tmp_path / "s.yaml")


@pytest.mark.parametrize("low, high, count", [(1, 40, 40), (1, 200, 200), (-3, 300, 102), (0, 10**9, 11)])
def test_a_range_of_whole_numbers_has_whole_numbers(low, high, count):
    values = along(AxisSpec("seed", low=low, high=high, count=count))
    np.testing.assert_array_equal(values, np.arange(low, high + 1, (high - low) // (count - 1)))


def test_decades_are_whole_numbers():
    values = along(AxisSpec("particles[0].gas.count", low=1, high=10**6, count=7, scale="logarithmic"))
    np.testing.assert_array_equal(values, 10.0 ** np.arange(7))
