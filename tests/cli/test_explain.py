"""`explain` counts launches as Taichi's profiler does, and its shares of the time have the sum 1."""

import json

import pytest
import yaml

from mpp_taichi import Simulation, component
from mpp_taichi.cli._costs import measure
from mpp_taichi.cli.main import main
from mpp_taichi.device import backends
from mpp_taichi.scene.load import load_scene
from scenes import KINDS_OF_STEP, cluster, everything, kepler


def profiled_loops(simulation):
    """Parallel loops that one step more starts, as Taichi's own profiler records them; the rest are single-thread preambles."""
    import taichi as ti
    from taichi.lang import impl

    simulation.run(steps=2)
    program = impl.get_runtime().prog

    def loops(steps):
        ti.sync()
        program.clear_kernel_profiler()
        simulation.launcher.advance(simulation.time, simulation.dt, 0, steps)
        ti.sync()
        program.update_kernel_profiler()
        return sum("range_for" in record.name for record in program.get_kernel_profiler_records())

    return loops(3) - loops(2)


@pytest.fixture
def profiler(monkeypatch):
    """Every start of Taichi in this test has its profiler on."""
    ti = backends.import_taichi()
    original = ti.init
    monkeypatch.setattr(ti, "init", lambda *arguments, **options: original(*arguments, kernel_profiler=True, **options))


IMPLICIT = [name for name in KINDS_OF_STEP if component.declaration("integrators", name).base == "Implicit"]
# Of the methods made from a table, one of each way through its stages: kicks that end a step and begin the next, kicks alone,
# drifts first, stages looked up; a Runge–Kutta step. Of implicit ones nothing is launched.
COUNTED = ("leapfrog", "symplectic_euler", "velocity_verlet", "kahan_li6", "rk4", "hermite4", "chin4a", "janus", *IMPLICIT)


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    ("scene", "integrator"), [*((everything, name) for name in COUNTED), (cluster, "leapfrog"), (cluster, "hermite4")]
)
def test_parallel_loops_are_those_that_the_profiler_counts(integrator, scene, profiler):
    with Simulation(scene(integrator=integrator), backend="cpu", plan="parallel") as simulation:
        told = simulation.launcher.launches_per_step()
        assert told is None if integrator in IMPLICIT else told == profiled_loops(simulation)


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("count", "loops"), [(600, 1), (1100, 1), (4200, 3)])
def test_what_one_thread_does_before_another_is_awake_starts_no_parallel_loop(count, loops, profiler):
    with Simulation(cluster(count), backend="cpu", plan="parallel") as simulation:
        assert simulation.launcher.launches_per_step() == profiled_loops(simulation) == loops


def hanging_sheet(integrator, damping):
    """A sheet of 16 × 16 masses, whose springs are summed in slices where the processor can."""
    links = {"of": "sheet", "stiffness": 4.0, "damping": damping, "neighbors": "diagonal"}
    return {
        "title": "Sheet",
        "particles": [{"lattice": {"name": "sheet", "shape": [16, 16], "lower": [0, 0, 0], "upper": [1, 1, 0], "mass": 1.0}}],
        "springs": [{"lattice_links": links}],
        "forces": [{"uniform_gravity": {"acceleration": [0, -1, 0]}}],
        "integrator": {integrator: {"dt": 0.01}},
        "run": {"duration": 1.0},
    }


@pytest.mark.sampled(3)
@pytest.mark.parametrize("damping", [0.0, 0.1])
@pytest.mark.parametrize("integrator", ["leapfrog", "velocity_verlet", "symplectic_euler", "kahan_li6", "rk4"])
def test_loops_over_slices_are_counted_as_well(integrator, damping, profiler):
    with Simulation(hanging_sheet(integrator, damping), backend="cpu", plan="parallel") as simulation:
        assert simulation.launcher.launches_per_step() == profiled_loops(simulation)


def test_a_serial_step_starts_no_parallel_loop(profiler):
    with Simulation(kepler(), backend="cpu", plan="serial") as simulation:
        assert simulation.launcher.launches_per_step() == profiled_loops(simulation) == 0


@pytest.mark.sampled(3)
def test_pair_forces_take_most_of_a_step_of_many_bodies():
    with Simulation(load_scene(cluster(count=300)), backend="cpu", plan="serial") as simulation:
        step, shares, absent = measure(simulation)
    (gravity,) = shares
    assert gravity.name == "newtonian_gravity" and 0.5 < gravity.seconds / step.seconds <= 1.0
    assert {cost.name for cost in absent} == {"coulomb", "harmonic_drive", "linear_drag", "thrust", "uniform_gravity"}
    cost = {entry.name: entry.seconds / step.seconds for entry in absent}
    assert cost["coulomb"] > cost["uniform_gravity"]  # N² against N


@pytest.fixture(scope="module")
def costs():
    """What was measured: all variants of a scene's forces are compiled for it."""
    return []


@pytest.fixture
def measured_once(costs, monkeypatch):
    """The costs of `everything` are measured for the first who asks."""

    def asked(simulation):
        if not costs:
            costs.append(measure(simulation))
        return costs[0]

    monkeypatch.setattr("mpp_taichi.cli._costs.measure", asked)


@pytest.mark.sampled(6)
def test_explain_tells_fields_and_effects(tmp_path, capsys, measured_once):
    path = tmp_path / "everything.yaml"
    path.write_text(yaml.safe_dump(everything()), encoding="utf-8")
    assert main(["explain", str(path), "--json", "-q"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["effects"] == ["newtonian_gravity", "coulomb", "uniform_gravity", "linear_drag", "spring"]
    assert [row["effect"] for row in found["shares"]] == found["effects"]
    assert [row["effect"] for row in found["absent"]] == ["harmonic_drive", "thrust"]
    assert found["fields"]["position"] == 5 * 3 * 8 and found["fields"]["spring_neighbor"] == 2 * 5 * 4
    assert found["field_bytes"] == sum(found["fields"].values())
    assert (
        found["dt_limit"] >= found["dt_limit_any_arrangement"] > found["dt"]
        and "the spring between" in found["dt_limit_set_by"]
    )
    assert found["seconds_per_step"] > 0


@pytest.mark.sampled(3)
def test_explain_says_it_in_words(tmp_path, capsys, measured_once):
    path = tmp_path / "everything.yaml"
    path.write_text(yaml.safe_dump(everything()), encoding="utf-8")
    assert main(["explain", str(path), "-q"]) == 0
    out = capsys.readouterr().out
    assert "one launch holds many steps" in out and "linear_drag" in out and "leapfrog is stable up to" in out


@pytest.mark.sampled(3)
def test_bonds_are_left_out_together_with_the_springs_that_they_act_along():
    """A bond without springs is refused, so the variant without springs is a variant without bonds too."""
    scene = {
        "particles": [{"body": {"mass": 1.0, "position": [float(k), 0.0, 0.0]}} for k in range(3)],
        "springs": [{"link": {"between": [k, k + 1], "stiffness": 1.0}} for k in range(2)],
        "forces": [{"bond": {"potential": "(l - 1)^4"}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"steps": 10},
    }
    with Simulation(load_scene(scene), backend="cpu", plan="serial") as simulation:
        _step, shares, _absent = measure(simulation)
    assert [each.name for each in shares] == ["bond", "spring with bond"]
