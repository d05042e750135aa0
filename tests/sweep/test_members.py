"""Members of a sweep: each has the motion that it has by itself, whatever runs beside it."""

import math
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi import Simulation, load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.sweep.alone import AloneSample
from mpp_taichi.sweep.cost import compiled_share, cost_of
from mpp_taichi.sweep.replicas import Bench, MemberDevice
from mpp_taichi.sweep.runner import run_members
from mpp_taichi.sweep.store import SweepStore

KEPLER = {
    "constants": {"speed": 0.8, "mass": 1.0, "G": 1.0},
    "dimensions": 2,
    "particles": [
        {"body": {"name": "star", "mass": "mass", "position": [0, 0], "velocity": [0, 0]}},
        {"body": {"name": "planet", "mass": 0.01, "position": [1, 0], "velocity": [0, "speed"]}},
    ],
    "forces": [{"newtonian_gravity": {"strength": "G"}}],
    "integrator": {"leapfrog": {"dt": 0.01}},
    "run": {"duration": 5.003},
    "sweep": {"vary": {"constants.speed": {"from": 0.6, "to": 1.2, "count": 7}}, "measure": ["end_time"]},
}
DISTANCE = {"distance": {"between": ["star", "planet"], "when": "smallest"}}


def sweep(scene, *, precision="f64", backend="cpu", **block):
    spec = load_scene({**scene, "sweep": {**scene["sweep"], **block}})
    return SweepStore(Path("unused"), spec.resolved, "scene", {"backend": backend, "precision": precision}, 4)


def rows_of(store, numbers=None, bench=None):
    numbers = list(range(store.plan.count)) if numbers is None else list(numbers)
    bench = bench or Bench(MemberDevice(store.device["backend"], store.device["precision"], 1))
    return run_members(numbers, store.plan.values(numbers), store.resolved, store.source, bench, store.own)


def bits(rows):
    return [(row.number, row.status, np.array(row.values).tobytes(), row.time, row.steps) for row in rows]


VARIED = {
    "starts": {"constants.speed": {"from": 0.6, "to": 1.2, "count": 7}},
    "masses": {"constants.mass": {"from": 0.5, "to": 2, "count": 7}},
    "strengths": {"forces.newtonian_gravity.strength": {"from": 0.5, "to": 2, "count": 7}},
    "steps": {"integrator.leapfrog.dt": [0.01, 0.02, 0.005]},
    "all": {
        "constants.speed": [0.7, 1.1],
        "constants.mass": [1, 2],
        "constants.G": [1, 1.5],
        "integrator.leapfrog.dt": [0.01, 0.02],
    },
}
MEASURES = [
    {"position": {"of": "planet", "axis": "x"}},
    DISTANCE,
    {"eccentricity": {"of": "planet", "around": "star"}},
    {"total_energy": {}},
    "relative_energy_error_max",
    "end_time",
    "steps",
]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("method", "varied"),
    [*(("leapfrog", each) for each in VARIED), ("rk4", "all"), ("implicit_midpoint", "all"), ("ias15", "masses")],
)
def test_a_member_moves_as_the_scene_does_by_itself(varied, method):
    scene = {**KEPLER, "integrator": {method: {"dt": 0.01}}}
    vary = {path.replace("leapfrog", method): values for path, values in VARIED[varied].items()}
    store = sweep(scene, vary=vary, measure=MEASURES)
    some = range(0, store.plan.count, 3)
    for row, values in zip(rows_of(store, some), store.plan.values(some)):
        with Simulation({**scene, "sweep": store.resolved["sweep"]}, backend="cpu", overrides=values) as simulation:
            simulation.run(judge="off")
            alone, energies = simulation.snapshot(), simulation.diagnostics()
        assert row.status == "ok" and row.time == pytest.approx(5.003, rel=1e-14) and row.steps == simulation.step_count
        # Other plans add in another order: each of n steps of s stages rounds by 1.1e-16, and on an orbit of eccentricity below
        # 0.7 a rounding grows to 1 + 3 φ/(1 − e) times its size over φ = 10 radians. ias15 itself keeps 1e-13 a step.
        rounding = math.sqrt(3 * row.steps * 4) * 1.1e-16 * (1 + 30 / 0.3)
        allowed = max(rounding, 1e-11) if method in ("ias15", "implicit_midpoint") else rounding
        assert row.values[0] == pytest.approx(alone.position[1, 0], abs=allowed)
        assert row.values[3] == pytest.approx(energies["total_energy"], rel=allowed)
        assert row.values[5] == row.time and row.values[6] == row.steps


@pytest.mark.sampled(3)
def test_bits_do_not_depend_on_neighbours_chunks_or_threads():
    store = sweep(KEPLER, vary=VARIED["all"], measure=MEASURES)
    together = bits(rows_of(store))
    bench = Bench(MemberDevice("cpu", "f64", 1))
    one_by_one = [bits(rows_of(store, [number], bench))[0] for number in range(store.plan.count)]
    backwards = bits(rows_of(store, reversed(range(store.plan.count))))[::-1]
    threads = bits(rows_of(store, bench=Bench(MemberDevice("cpu", "f64", 2))))
    assert together == one_by_one == backwards == threads


@pytest.mark.sampled(3)
def test_chaos_of_a_member_has_the_bits_of_a_run_of_its_own():
    measures = ["megno", "lyapunov", "fli"]
    store = sweep(KEPLER, vary=VARIED["masses"], measure=measures)
    together = bits(rows_of(store))
    bench = Bench(MemberDevice("cpu", "f64", 1))
    assert together == [bits(rows_of(store, [number], bench))[0] for number in range(store.plan.count)]
    assert together == bits(rows_of(store, bench=Bench(MemberDevice("cpu", "f64", 2))))
    scene = {**KEPLER, "sweep": store.resolved["sweep"]}
    for row, values in list(zip(rows_of(store), store.plan.values(range(store.plan.count))))[::5]:
        with Simulation(scene, backend="cpu", precision="f64", overrides=values) as simulation:
            simulation.run(judge="off")
            growth = simulation.phase.read_tangent()
        assert row.values[0] == growth.megno[0] and row.values[2] == growth.largest[0]
        assert row.values[1] == growth.growth[0] / growth.time[0]


def test_a_member_may_end_where_its_motion_is_found_to_be_chaotic():
    bound = {"fli": {"below": 4}}
    for row in rows_of(sweep(KEPLER, measure=["fli"], stop=[bound])):
        assert (row.status == "ok") == (row.values[0] < 4)
        assert row.status == "ok" or "fli = " in row.reason and row.time < 5


@pytest.mark.sampled(3)
def test_a_bench_that_was_used_before_gives_the_same_bits():
    store = sweep(KEPLER, vary=VARIED["masses"], measure=MEASURES)
    bench = Bench(MemberDevice("cpu", "f64", 1))
    first = bits(rows_of(store, bench=bench))
    rows_of(sweep(KEPLER, vary=VARIED["starts"], measure=MEASURES), bench=bench)
    assert bits(rows_of(store, bench=bench)) == first


def test_the_least_distance_is_the_pericentre_of_each_orbit():
    store = sweep(KEPLER, vary={"constants.speed": {"from": 0.5, "to": 0.99, "count": 8}}, measure=[DISTANCE], **{})
    for row, values in zip(rows_of(store), store.plan.values(range(8))):
        mu, speed = 1.01, values["constants.speed"]
        axis = 1.0 / (2.0 - speed**2 / mu)
        # The planet starts in its apocentre. Half of the period is below the duration; a leapfrog's orbit is wrong by (ω dt)²
        # at the pericentre, ω its angular velocity there.
        pericentre = 2.0 * axis - 1.0
        fastest = speed / pericentre**2
        assert row.values[0] == pytest.approx(pericentre, rel=max(1e-5, (fastest * 0.01) ** 2))


def test_a_member_that_ends_early_is_not_run_on_and_the_others_are():
    store = sweep(
        KEPLER,
        vary={"constants.speed": {"from": 0.5, "to": 1.6, "count": 6}},
        measure=["end_time", {"distance": {"between": ["star", "planet"]}}],
        stop=[{"distance": {"between": ["star", "planet"], "below": 2}}],
    )
    rows = rows_of(store)
    assert [row.status for row in rows] == ["ok"] * 4 + ["stopped"] * 2
    for row in rows[4:]:
        assert row.time == row.values[0] < 5.0 and row.values[1] >= 2.0 and "distance" in row.reason
        # A sample is taken at least 200 times in a run, and the planet is slower than 1.6.
        assert row.values[1] < 2.0 + 1.6 * 5.003 / 100
    assert all(row.values[1] < 2.0 for row in rows[:4])


def test_a_promise_that_is_broken_is_told_with_its_bound():
    store = sweep(KEPLER, measure=[{"distance": {"between": ["star", "planet"], "when": "largest", "below": 1.2}}])
    rows = rows_of(store)
    assert {row.status for row in rows} == {"ok", "broken"}
    for row in rows:
        assert (row.status == "broken") == (row.values[0] >= 1.2)
        assert ("1.2" in row.reason) == (row.status == "broken")


def test_a_member_that_diverges_is_a_row_and_its_neighbours_go_on():
    scene = {
        **KEPLER,
        "particles": [{"body": {"mass": 1, "position": [1, 0], "velocity": ["speed", 0]}}],
        "forces": [{"uniform_gravity": {"acceleration": ["G", 0]}}],
        "integrator": {"leapfrog": {"dt": 100}},
        "run": {"duration": 60_000},
    }
    # x = a t²/2 passes the largest number, 1.8e308, at t = 1.9e4 with a = 1e300. A sample is taken at least each 300.
    rows = rows_of(sweep(scene, vary={"constants.G": [0, 1e300, 1]}, measure=[{"position": {"axis": "x", "of": 0}}]))
    assert [row.status for row in rows] == ["ok", "diverged", "ok"]
    assert rows[1].particle == 0 and "particle 0" in rows[1].reason and 1.88e4 < rows[1].time < 1.92e4 + 300
    # A leapfrog follows a parabola exactly, but for a rounding of each of the 600 steps.
    for row, expected in ((rows[0], 1 + 0.8 * 6e4), (rows[2], 1 + 0.8 * 6e4 + 0.5 * 3.6e9)):
        assert row.values[0] == pytest.approx(expected, rel=600 * 1.2e-16)


def test_a_member_that_the_scene_refuses_is_a_row():
    rows = rows_of(sweep(KEPLER, vary={"constants.mass": [1, -1, 2]}, measure=["end_time"]))
    assert [row.status for row in rows] == ["ok", "refused", "ok"]
    assert "-1" in rows[1].reason and "at least 0" in rows[1].reason


def test_a_member_that_runs_alone_is_seen_as_the_only_one_of_several():
    scene = {key: value for key, value in KEPLER.items() if key != "sweep"}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=3)
        seen, now = AloneSample(simulation), simulation.snapshot()
        assert seen.time == simulation.time and seen.one(0).time == simulation.time
        for name in ("position", "velocity", "mass"):
            assert np.array_equal(getattr(seen.snapshot, name), getattr(now, name)[None])
        assert seen.potential_energy.tolist() == [simulation.mechanics()["potential_energy"]]


@pytest.mark.sampled(3)
def test_members_of_other_structures_run_in_one_sweep():
    scene = {**KEPLER, "constants": {**KEPLER["constants"], "count": 2}}
    scene["particles"] = [
        *KEPLER["particles"],
        {"ring": {"count": "count", "around": "star", "inner_radius": 8, "outer_radius": 9}},
    ]
    rows = rows_of(sweep(scene, vary={"constants.count": [3, 5]}, measure=[DISTANCE]))
    assert [row.status for row in rows] == ["ok"] * 2, [row.reason for row in rows]
    # The ring has no mass, so that both are the same orbit; the sum of forces has other roundings, of 1.1e-16 in 500 steps.
    assert np.ptp([row.values[0] for row in rows]) < 500 * 1.1e-16 * 30


def test_a_measure_that_is_not_defined_is_no_number():
    both = {"distance": {"of": "planet", "to": "star", "point": [0, 0]}}
    late = {"speed": {"of": "planet", "at": 100}}
    for row in rows_of(sweep(KEPLER, measure=[both, late, {"mass": {"of": "planet"}}])):
        assert row.status == "ok" and np.isnan(row.values[:2]).all() and row.values[2] == 0.01


GAS = {
    "dimensions": 2,
    "particles": [{"gas": {"count": 30, "radius": 0.02, "lower": [0, 0], "upper": [1, 1], "temperature": 1}}],
    "walls": [{"box": {"lower": [0, 0], "upper": [1, 1]}}],
    "contacts": {"hard_spheres": {"solver": "event_driven", "restitution": 1}},
    "run": {"duration": 0.5},
    "sweep": {"vary": {"seed": [1, 2, 3]}, "measure": ["collision_count", "kinetic_energy", "end_time"]},
}


@pytest.mark.sampled(3)
def test_gases_run_one_after_the_other_with_the_bits_of_a_run():
    store = sweep(GAS)
    for row, values in zip(rows_of(store), store.plan.values(range(3))):
        with Simulation(GAS, backend="cpu", overrides=values) as simulation:
            simulation.run()
            assert (
                row.status == "ok"
                and row.values[0] == simulation.contact_report.pair_count + simulation.contact_report.wall_count > 0
            )
            assert row.values[1] == simulation.diagnostics()["kinetic_energy"]


SOLVERS = {
    "event_driven": {"event_driven": {"dt": 0.05}},
    "swept": {"leapfrog": {"dt": 0.005}},
    "pairwise": {"leapfrog": {"dt": 0.005}},
    "simultaneous": {"leapfrog": {"dt": 0.005}},
    "resting": {"leapfrog": {"dt": 0.005}},
    "merging": {"leapfrog": {"dt": 0.005}},
    "located": {"adaptive_bogacki_shampine": {"dt": 0.05}},
}
WALLS = {
    "box": [{"box": {"lower": [0, 0], "upper": [1, 1]}}],
    "periodic": [{"periodic_box": {"lower": [0, 0], "upper": [1, 1]}}],
    "none": [],
}


@pytest.mark.parametrize(
    "solver, walls",
    [*((each, "box") for each in SOLVERS if each != "merging"), ("event_driven", "periodic"), ("swept", "none")]
    + [("event_driven", "none"), ("merging", "none")],
)
@pytest.mark.sampled(5)
def test_members_that_use_one_simulation_in_turn_have_the_bits_of_members_that_do_not(solver, walls):
    scene = {
        **GAS,
        "contacts": {"hard_spheres": {"solver": solver}},
        "integrator": SOLVERS[solver],
        "walls": WALLS[walls],
        "forces": [{"uniform_gravity": {"acceleration": [0, -1]}}] if walls == "box" else [],
    }
    measure = ["collision_count", "kinetic_energy", {"position": {"of": 3, "axis": "x"}}, "momentum", "end_time"]
    store = sweep(scene, vary={"seed": [1, 2, 3, 4]}, measure=measure)
    bench = Bench(MemberDevice("cpu", "f64", 1))
    together = rows_of(store, [3, 0, 2, 1], bench)
    again = rows_of(store, [1, 0], bench)
    assert all(row.status == "ok" and (row.values[0] > 5 or solver == "merging") for row in together)
    alone = [row for number in (0, 1, 3) for row in rows_of(store, [number])]
    known = dict(zip((each[0] for each in bits(alone)), bits(alone), strict=True))
    for row in [*bits(together), *bits(again)]:
        assert row[0] == 2 or row == known[row[0]]


@pytest.mark.sampled(3)
def test_members_use_one_simulation_in_turn_only_where_places_and_velocities_differ(monkeypatch):
    made = []
    monkeypatch.setattr("mpp_taichi.sweep.replicas.Simulation", lambda *a, **k: made.append(1) or Simulation(*a, **k))
    vary = {"seed": [1, 2], "contacts.hard_spheres.restitution": [1, 0.5], "particles[0].gas.radius": [0.02, 0.021]}
    store = sweep(GAS, vary=vary, measure=["collision_count", "kinetic_energy"])
    rows = rows_of(store)
    assert len(made) == 2 and len({tuple(row.values) for row in rows}) == 8
    for number in (1, 2, 6):  # radius, restitution, seed
        assert bits(rows_of(store, [number])) == bits(rows[number : number + 1])


def test_the_cost_of_gases_depends_on_how_many_are_compiled():
    def share(vary):
        store = sweep(GAS, vary=vary)
        return compiled_share(store.resolved, "gas", store.plan, 30)

    assert share({"seed": {"from": 1, "to": 100, "count": 100}}) == pytest.approx(1 / 12)
    assert share({"particles[0].gas.radius": {"from": 0.01, "to": 0.02, "count": 100}}) == 1.0
    seconds = [cost_of(sweep(GAS).scene, 100, assemble(sweep(GAS).scene), compiled).seconds for compiled in (1 / 12, 1.0)]
    assert seconds[1] > 3 * seconds[0]


@pytest.mark.parametrize("precision", ["f32", "f32c", "ds"])
@pytest.mark.sampled(3)
def test_other_precisions(precision):
    store = sweep(KEPLER, precision=precision, measure=MEASURES)
    exact = rows_of(sweep(KEPLER, measure=MEASURES))
    # In f32 each of 500 steps rounds by 6e-8, which grows a hundred times at most.
    for row, right in zip(rows_of(store), exact):
        assert row.status == "ok" and row.values[0] == pytest.approx(right.values[0], abs=math.sqrt(3 * 500) * 6e-8 * 100)


@pytest.mark.sampled(3)
def test_on_software_vulkan(software_vulkan):
    store = sweep(KEPLER, precision="f32", backend="vulkan", measure=MEASURES)
    for row, right in zip(rows_of(store), rows_of(sweep(KEPLER, measure=MEASURES))):
        assert row.status == "ok" and row.values[0] == pytest.approx(right.values[0], abs=math.sqrt(3 * 500) * 6e-8 * 100)


@pytest.mark.sampled(3)
def test_an_adaptive_method_on_software_vulkan(software_vulkan):
    """The errors of a step differ by 1e-5 of themselves (test_copies_elsewhere.py), and are 1e-9 of the orbit."""
    own = KEPLER | {"integrator": {"adaptive_dop853": {"dt": KEPLER["integrator"]["leapfrog"]["dt"]}}}
    store = sweep(own, precision="f64", backend="vulkan", measure=MEASURES)
    for row, right in zip(rows_of(store), rows_of(sweep(own, measure=MEASURES))):
        assert row.status == "ok" and row.values[0] == pytest.approx(right.values[0], abs=1e-9)


CHAIN = {
    "constants": {"stiffness": 40, "damping": 0.1, "stretch": 1.1, "mass": 1},
    "dimensions": 2,
    "particles": [
        {"body": {"name": "wall", "mass": 1, "position": [0, 0], "free": False}},
        {"body": {"name": "a", "mass": "mass", "position": [1, 0]}},
        {"body": {"name": "b", "mass": 2, "position": [2, 0.3]}},
    ],
    "springs": [
        {"link": {"between": ["wall", "a"], "stiffness": "stiffness", "damping": "damping", "prestretch": "stretch"}},
        {"link": {"between": ["a", "b"], "stiffness": 25}},
    ],
    "integrator": {"leapfrog": {"dt": 0.01}},
    "run": {"duration": 2},
    "sweep": {
        "vary": {"constants.stiffness": [10, 40, 90], "constants.stretch": [1, 1.2], "constants.mass": [1, 3]},
        "measure": [{"position": {"of": "b", "axis": "x"}}, {"position": {"of": "a", "axis": "y"}}, {"potential_energy": {}}],
    },
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", ["leapfrog", "rk4", "implicit_midpoint", "energy_momentum", "bdf2", "hermite4"])
def test_each_member_has_springs_of_its_own(method):
    undamped = method == "hermite4"
    scene = {**CHAIN, "integrator": {method: {"dt": 0.01}}}
    scene["constants"] = {**CHAIN["constants"], "damping": 0 if undamped else 0.1}
    store = sweep(scene)
    rows = rows_of(store)
    for row, values in list(zip(rows, store.plan.values(range(12))))[::5]:
        with Simulation({**scene, "sweep": store.resolved["sweep"]}, backend="cpu", overrides=values) as simulation:
            simulation.run(judge="off")
            alone, energies = simulation.snapshot(), simulation.diagnostics()
        # 200 steps of four stages round by 1.1e-16 each; the solution of an implicit step is right to 1e-11 of its length.
        allowed = 1e-10 if method in ("implicit_midpoint", "energy_momentum", "bdf2") else 1e-13
        assert row.status == "ok", row.reason
        assert row.values[0] == pytest.approx(alone.position[2, 0], abs=allowed)
        assert row.values[1] == pytest.approx(alone.position[1, 1], abs=allowed)
        assert row.values[2] == pytest.approx(energies["potential_energy"], abs=100 * allowed)
    # A chain that is not stretched stays as it is, whatever its stiffness and masses.
    assert len({row.values[0] for row in rows}) == 6 + 1


@pytest.mark.sampled(3)
def test_a_spring_that_is_too_stiff_for_the_step_is_refused_for_its_member_alone():
    rows = rows_of(sweep(CHAIN, vary={"constants.stiffness": [40, 1e6, 90]}))
    assert [row.status for row in rows] == ["ok", "refused", "ok"] and "step" in rows[1].reason
    alone = rows_of(sweep(CHAIN, vary={"constants.stiffness": [40]}))
    assert alone[0].values == rows[0].values
