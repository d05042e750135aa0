"""Variants of integrators as methods of a study: their names, their parameters, and what a choice writes into the scene."""

import dataclasses
from pathlib import Path

import pytest

from mpp_taichi import component
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.chosen import Choice
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.method_variants import split_variant, variants_of
from mpp_taichi.accuracy.methods import methods
from mpp_taichi.accuracy.problem import defaults, pose
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from scenes import kepler

PLANETS = Path(__file__).parents[2] / "scenes" / "outer_solar_system.yaml"
LAZY = "wisdom_holman+lazy"
EVERY = [name for integrator in component.names("integrators") for name in variants_of(integrator)]


@pytest.mark.parametrize("name", EVERY)
def test_a_variant_has_other_parameters_than_the_defaults(name):
    integrator, parameters = split_variant(name)
    usual = defaults(integrator)
    assert parameters and all(usual[key] != value for key, value in parameters.items())
    component.build("integrators", integrator, {**usual, **parameters, "dt": 0.1})


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["leapfrog", "leapfrog+tree-1e-3", "leapfrog+lazy", "nothing+lazy", "wisdom_holman+quick"])
def test_other_names_are_no_variants(name):
    assert split_variant(name) == (name, {})


def test_a_variant_is_tried_where_its_integrator_is_but_not_beside_itself():
    def found(**integrator):
        return methods(pose(load_scene(PLANETS, overrides={"integrator": integrator} if integrator else {})))

    plain = found()
    assert LAZY in plain and plain[LAZY].evaluations == 2.0 * plain["wisdom_holman"].evaluations
    assert plain[LAZY].family == plain["wisdom_holman"].family
    assert LAZY not in found(wisdom_holman={"dt": 175.0, "kernel": "lazy"})
    assert LAZY in found(leapfrog={"dt": 10.0})
    assert LAZY not in methods(pose(load_scene({**kepler(0.3), "run": {"duration": 1.0}, "forces": []})))


@pytest.mark.sampled(3)
def test_the_lazy_kernel_leaves_a_far_smaller_error_in_the_same_steps():
    """ε² dt² becomes ε² dt⁴: with 25 steps in the shortest orbit, (ω dt)² is 2π/25 squared, a sixteenth."""
    problem = pose(load_scene(PLANETS)).shortened(4000.0)
    steps, ends = round(4000.0 / 173.3), []  # Jupiter's period is 4,333 days
    for name, counts in ((LAZY, (64 * steps, steps)), ("wisdom_holman", (steps,))):
        machine = Machine(problem, name, backend="cpu", precision="f64")
        assert machine.integrator.kernel == ("lazy" if name == LAZY else "kick")
        ends += [machine.run(machine.configuration(count), Budget(1e9))[0].end for count in counts]
        machine.close()
    exact, lazy, kick = ends
    assert 0.0 < abs(lazy - exact).max() < abs(kick - exact).max() / 16.0


def test_a_choice_writes_the_parameters_of_a_variant_into_the_scene():
    fields = {field.name: None for field in dataclasses.fields(Choice)}
    spec = load_scene(PLANETS)
    for name, kernel in ((LAZY, "lazy"), ("wisdom_holman", "kick")):
        made = Choice(**fields | {"integrator": name, "dt": 140.0, "control": ""}).settle(spec)
        for scene in (made, load_scene(made.resolved)):
            assert scene.integrator.name == "wisdom_holman"
            assert (scene.integrator.parameters["kernel"], scene.integrator.parameters["dt"]) == (kernel, 140.0)


def test_a_variant_that_does_not_exist_is_wrong_usage(capsys):
    assert main(["accuracy", str(PLANETS), "--integrators", "wisdom_holman+quick"]) == 2
    assert "--integrators wisdom_holman+quick: allowed are" in capsys.readouterr().err
