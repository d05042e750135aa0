"""The facts of a summary against the run that they are about: every key of a run with contacts, springs and a timeline."""

import pytest

from mpp_taichi import Simulation
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.report.contact_summary import contact_facts
from mpp_taichi.report.summary import Stopwatch, phase_facts, plan_reason, summarize

SCENE = {
    "title": "Two balls and a wall",
    "units": {"length": "m", "time": "s", "mass": "kg"},
    "particles": [
        {"body": {"name": "a", "mass": 1, "radius": 0.25, "position": [1, 0.5, 0], "velocity": [2, 0, 0]}},
        {"body": {"name": "b", "mass": 2, "radius": 0.25, "position": [3, 0.5, 0], "velocity": [-1, 0, 0]}},
        {"body": {"name": "c", "mass": 3, "radius": 0.25, "position": [8, 4, 0]}},
    ],
    "springs": [{"link": {"between": ["b", "c"], "stiffness": 0.125}}],
    "walls": [{"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}],
    "contacts": {"hard_spheres": {"solver": "pairwise", "restitution": 0.5}},
    "integrator": {"leapfrog": {"dt": 0.015625}},
    "timeline": [
        {"at": 1.0, "set": {"springs[0].link.stiffness": 0.25}},
        {"at": 1.5, "set": {"springs[0].link.stiffness": 0.5}},
    ],
    "run": {"duration": 4},
}


@pytest.fixture(scope="module")
def run():
    """The run, its table and its facts; what is read from the device is read before the first test ends."""
    with Simulation(SCENE, backend="cpu", precision="f64") as simulation:
        table = TableRecorder(16)
        simulation.run(duration=4.0, recorders=[table])
        found = summarize(simulation, table, Stopwatch(), plan_asked="auto")
        assert found["contacts"] == contact_facts(simulation)["contacts"] and found["phases"] == phase_facts(simulation)
        return simulation, table, found, simulation.contact_report


@pytest.mark.sampled(3)
def test_the_scene_and_the_device_are_those_of_the_run(run):
    simulation, _, found, _ = run
    expected = {
        "title": "Two balls and a wall",
        "units": {"length": "m", "time": "s", "mass": "kg"},
        "backend": "cpu",
        "device": simulation.device.name,
        "threads": simulation.device.threads,
        "precision": "f64",
        "plan": "serial",
        "integrator": "leapfrog",
        "dt": 0.015625,
        "particle_count": 3,
        "spring_count": 1,
        "rod_count": 0,
        "steps": 256,
        "time": 4.0,
        "conserves_energy": False,
        "conserves_momentum": False,
        "pair_interactions_per_second": None,
        "setup_seconds": simulation.timings.setup_seconds,
        "compile_seconds": simulation.timings.compile_seconds,
        "step_seconds": simulation.timings.advance_seconds,
        "launches_per_step": simulation.timings.launch_count / 256,
    }
    assert {key: found[key] for key in expected} == expected
    assert found["effects"] == simulation.phases[0].effects != []


def test_every_change_has_its_time_its_keys_and_its_work(run):
    """The energy of the spring, ½ D (l − L)², doubles at both changes."""
    simulation, table, found, _ = run
    assert [phase["at"] for phase in found["phases"]] == [1.0, 1.5]
    for number, phase in enumerate(found["phases"]):
        assert phase.keys() == {"at", "changes", "effects", "integrator", "work"}
        assert phase["changes"] == simulation.phases[number + 1].changes and phase["integrator"] == "leapfrog"
        assert phase["work"] == simulation.phase_work[number] != 0.0
        row = [row for row in table.rows if row["time"] == phase["at"]][-1]
        # The last sample at the time of the change is taken after it, with a spring of twice the stiffness.
        assert phase["work"] == pytest.approx(row["potential_energy"] / 2, rel=1e-12)


def test_contacts_are_those_of_the_report(run):
    _, _, found, report = run
    facts = found["contacts"]
    for key in ("pair_count", "wall_count", "elastic_count", "dissipated_energy", "largest_overlap", "unresolved"):
        assert facts[key] == getattr(report, key)
    assert facts["solver"] == "pairwise" and report.pair_count > 0 and report.wall_count > 0
    assert facts["collisions_per_particle_and_time"] == 2 * report.pair_count / (3 * 4.0)
    assert list(facts["wall_impulse"].values()) == list(report.wall_impulse)
    assert "merge_count" not in facts


def test_the_first_and_the_last_energies_are_those_of_the_table(run):
    _, table, found, _ = run
    first, last = table.rows[0], table.rows[-1]
    assert found["total_energy_initial"] == first["total_energy"] != last["total_energy"]
    for key in ("total_energy", "kinetic_energy", "potential_energy"):
        assert found[f"{key}_final"] == last[key]
    for key in ("relative_energy_error", "momentum_error", "angular_momentum_error", "center_of_mass_error"):
        assert found[f"{key}_max"] == max(row[key] for row in table.rows)


def test_the_reason_of_a_plan_is_told(run):
    simulation, *_ = run
    assert plan_reason(simulation, "serial") == "asked for"
    assert plan_reason(simulation, "auto").startswith(f"work of a step {simulation.phase.work:,}, below the crossover")
