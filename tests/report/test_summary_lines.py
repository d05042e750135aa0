"""Every line of a summary, word by word: facts whose numbers all differ, so that no other fact can stand in a line."""

from dataclasses import dataclass

import pytest

from mpp_taichi.report.summary_lines import lines

PHASES = [
    {"at": 1.5, "changes": ["forces", "dt"], "effects": ["coulomb", "linear_drag"], "work": 0.125},
    {"at": 2.5, "changes": ["springs"], "effects": [], "work": -3.0},
]
FOUND = {
    "status": "ok",
    "title": "Two stars",
    "scene": "stars.yaml",
    "units": None,
    "particle_count": 1234,
    "spring_count": 0,
    "steps": 56789,
    "time": 4.25,
    "conserves_energy": True,
    "conserves_momentum": True,
    "conserves_angular_momentum": True,
    "relative_energy_error_max": 1.1e-3,
    "momentum_error_max": 2.2e-4,
    "angular_momentum_error_max": 3.3e-5,
    "wall_seconds": 9.5,
    "steps_per_second": 99.95,
    "steps_per_second_overall": 100.4,
    "pair_interactions_per_second": None,
    "setup_seconds": 1.0,
    "compile_seconds": 2.0,
    "step_seconds": 0.004,
    "encode_seconds": 0.005,
    "effects": ["newtonian_gravity", "thrust"],
    "integrator": "leapfrog",
    "dt": 0.0078125,
    "precision": "f64",
    "phases": [],
    "backend": "cpu",
    "device": "a processor",
    "threads": 2,
    "plan": "serial",
    "plan_reason": "few particles",
}

CONTACTS = {
    "solver": "swept",
    "pair_count": 1234,
    "wall_count": 5678,
    "elastic_count": 0,
    "collisions_per_particle_and_time": None,
    "dissipated_energy": 0.0,
    "largest_overlap": 1.5e-9,
}


def told(verbose=False, verdicts=(), files=(), error=None, **more):
    """The lines, split into their names and texts."""
    found = lines(FOUND | more, verbose=verbose, verdicts=verdicts, files=files, error=error)
    assert all(line[:2] == "  " and line[10:] for line in found), "a line without a text is left out"
    return [(line[2:10].strip(), line[10:]) for line in found]


def of(name, **more):
    """The texts of the lines of a name."""
    return [text for each, text in told(verbose=True, **more) if each == name]


@dataclass
class MadeUpVerdict:
    """The verdict of an expectation."""

    passed: bool
    label: str
    told: str
    bound: str
    reason: str = ""
    named: str = ""


def test_a_plain_summary_has_these_lines_in_this_order():
    assert told() == [
        ("status", "ok"),
        ("scene", "Two stars: 1,234 particles"),
        ("reached", "t = 4.25 in 56,789 steps"),
        ("errors", "energy 0.0011, momentum 0.00022, angular momentum 3.3e-05"),
        ("time", "9.50 s, 100 steps/s with samples, pictures and files"),
    ]
    assert told(verbose=True)[5:] == [
        ("effects", "newtonian_gravity, thrust"),
        ("method", "leapfrog, dt 0.0078125, f64"),
        ("device", "cpu: a processor, 2 threads"),
        ("plan", "serial: few particles"),
        ("rate", "100 steps/s, in the steps alone"),
        ("seconds", "setup 1.00, compile 2.00, encode 0.01, other 6.49"),
    ]


def test_what_is_valid_comes_after_the_errors_and_before_the_contacts():
    found = told(horizon={"sentence": "valid until t = 3"}, contacts=CONTACTS)
    assert [name for name, _ in found][3:6] == ["errors", "valid", "contact"]
    off = {"fast_taichi_off": ["launch_cache"], "fast_taichi_reason": "asked for"}
    assert [name for name, _ in told(**off)][2:5] == ["reached", "off", "errors"]


def test_verdicts_files_and_reasons_come_first():
    good = MadeUpVerdict(True, "label", "0.5", "< 1", named="named")
    bad = MadeUpVerdict(False, "other", "3", "> 4", reason="too early")
    found = told(
        status="failed",
        verdicts=[good, bad],
        files=["film.mp4", "table.csv"],
        error=ValueError("a  bad\n step"),
        findings=[{"message": "a body is lost"}],
        rewound="to step 3",
        horizon={"sentence": "valid until t = 3"},
    )
    assert found[:8] == [
        ("status", "failed"),
        ("because", "a bad step"),
        ("because", "1 of 2 expectations not met"),
        ("because", "a body is lost"),
        ("wrote", "film.mp4"),
        ("wrote", "table.csv"),
        ("expect", "pass  named = 0.5, expected < 1"),
        ("expect", "FAIL  other = 3, expected > 4 (too early)"),
    ]
    assert found[10:12] == [("rewound", "to step 3"), ("errors", "energy 0.0011, momentum 0.00022, angular momentum 3.3e-05")]
    assert found[12] == ("valid", "valid until t = 3")


@pytest.mark.parametrize(
    "more, expected",
    [
        ({"spring_count": 5678}, "Two stars: 1,234 particles, 5,678 springs"),
        ({"spring_count": 5678, "rod_count": 3}, "Two stars: 1,234 particles, 5,678 springs, 3 rods"),
        ({"rod_count": 0, "title": ""}, "stars.yaml: 1,234 particles"),
    ],
)
def test_the_scene_is_counted(more, expected):
    assert of("scene", **more) == [expected]


@pytest.mark.parametrize(
    "more, expected",
    [
        ({"conserves_energy": False}, "energy 0.0011 (a force does work here), momentum 0.00022, angular momentum 3.3e-05"),
        (
            {"conserves_energy": False, "driven_bodies": 1},
            "energy 0.0011 (work is done on bodies on paths), momentum 0.00022, angular momentum 3.3e-05",
        ),
        (
            {"conserves_energy": False, "contacts": CONTACTS, "conserved_energy_error_max": 4.4e-6},
            "energy 0.0011 (contacts or walls change it), 4.4e-06 where none does, momentum 0.00022, angular momentum 3.3e-05",
        ),
        (
            {"conserves_momentum": False},
            "energy 0.0011; momentum changes by 0.00022, as external forces, walls or held particles may change it",
        ),
        (
            {"conserves_momentum": False, "effects": ["newtonian_gravity", "einstein_infeld_hoffmann"]},
            "energy 0.0011; momentum changes by 0.00022, "
            "as terms of 1/c², external forces, walls or held particles may change it",
        ),
        (
            {"conserves_angular_momentum": False},
            "energy 0.0011, momentum 0.00022; angular momentum is not conserved in a periodic box",
        ),
    ],
)
def test_errors_are_errors_only_of_what_is_conserved(more, expected):
    assert of("errors", **more) == [expected]


def test_a_run_without_samples_tells_no_errors():
    found = {key: value for key, value in FOUND.items() if key != "relative_energy_error_max"}
    assert not [line for line in lines(found) if "errors" in line]


def test_units_and_a_time_that_is_easier_to_read_follow_the_time():
    assert of("reached", units={"length": "m", "time": "s", "mass": "kg"}, time=1666656.0) == [
        "t = 1666656 s (19.3 d) in 56,789 steps"
    ]


def test_an_energy_balance_and_the_damping_of_the_method_are_told():
    balance = {"dissipated_energy": 1.5, "work": 2.5, "energy_balance_error_max": 3.5e-7}
    assert of("balance", **balance) == ["dissipated 1.5, work 2.5, closes to 3.5e-07 of the energy turned over"]
    damping = {
        "energy_lost": 0.5,
        "per_time": 0.25,
        "per_oscillation": 0.125,
        "share_per_oscillation": 0.0625,
        "oscillations": 7.0,
    }
    assert of("damping", numerical_damping=damping) == [
        "the method itself lost 0.5, 0.25 per unit time, 0.125 or 0.0625 of it per oscillation, 7 of them"
    ]
    gained = {key: -value for key, value in damping.items()} | {"oscillations": 7.0}
    assert of("damping", numerical_damping=gained) == [
        "the method itself gained 0.5, 0.25 per unit time, 0.125 or 0.0625 of it per oscillation, 7 of them"
    ]
    assert of("damping", numerical_damping=damping | {"per_oscillation": None, "problem": "why"}) == [
        "the method itself lost 0.5, 0.25 per unit time; per oscillation not determinable: why"
    ]
    assert of("damping", numerical_damping=damping | {"per_time": None, "problem": "why"}) == [
        "by the method itself not determinable: why"
    ]
    assert of("damping", numerical_damping=damping | {"energy_lost": 0.0})[0].startswith("the method itself lost 0,")


def test_the_first_changes_are_told_and_the_others_counted():
    assert of("phase", phases=PHASES) == [
        "from t = 1.5: forces, dt changed, then coulomb, linear_drag; energy +0.125",
        "from t = 2.5: springs changed, then no effect; energy -3",
    ]
    many = [PHASES[0] | {"at": float(k)} for k in range(12)]
    found = of("phase", phases=many)
    assert len(found) == 9 and found[7].startswith("from t = 7:") and found[8] == "… and 4 more changes, the last at t = 11"
    assert len(of("phase", phases=many[:8])) == 8


def test_the_work_of_an_implicit_solver_is_told():
    solver = {
        "linear_solver": "ConjugateGradients",
        "newton_iterations_per_step": 1.25,
        "newton_iterations_most": 6,
        "linear_iterations_per_step": 7.75,
        "cut_steps": 8,
        "gaining_pieces": 9,
        "unsolved_steps": 10,
    }
    assert of("solver", **solver) == [
        "1.25 Newton iterations a step, at most 6, 7.8 of conjugate gradients a step; 8 steps cut in pieces, "
        "9 pieces gained energy, 10 not solved"
    ]
    assert of("solver", **solver | {"linear_solver": "Banded", "gaining_pieces": 0}) == [
        "1.25 Newton iterations a step, at most 6, factors of a banded matrix in each; 8 steps cut in pieces, 10 not solved"
    ]


def test_the_right_half_of_a_film_is_told():
    right = {
        "integrator": "rk4",
        "dt": 0.5,
        "backend": "cpu",
        "precision": "f32",
        "rms_distance": 0.375,
        "settings": ["a", "b"],
    }
    assert of("beside", beside=right) == ["a, b: rk4, dt 0.5, cpu f32; at the end 0.375 apart (rms)"]
    assert of("beside", beside=right | {"rms_distance": None}) == ["a, b: rk4, dt 0.5, cpu f32"]


def test_rates_are_whole_numbers_from_a_hundred_on():
    assert of("rate", steps_per_second=99.94, pair_interactions_per_second=1.25e9) == [
        "99.9 steps/s, 1.25e+09 pair interactions/s, in the steps alone"
    ]
    assert of("rate", steps_per_second=100.0) == ["100 steps/s, in the steps alone"]
    assert of("rate", steps_per_second=None) == []
    assert of("time", steps_per_second_overall=None) == ["9.50 s"]


def test_no_effect_and_no_threads_are_told():
    assert of("effects", effects=[]) == ["none: every particle moves on a straight line"]
    assert of("device", threads=0) == ["cpu: a processor"]


@pytest.mark.parametrize(
    "more, expected",
    [
        ({}, "swept: 1,234 collisions of spheres, 5,678 with walls; largest overlap 1.5e-09 radii"),
        (
            {"collisions_per_particle_and_time": 0.25, "elastic_count": 9012, "dissipated_energy": 2.5},
            "swept: 1,234 collisions of spheres (0.25 per particle and time), 5,678 with walls, 9,012 made elastic; "
            "2.5 of energy lost; largest overlap 1.5e-09 radii",
        ),
        (
            {"merge_count": 3456, "spheres_left": 7890, "potential_change": -0.5, "dissipated_energy": 2.5},
            "swept: 3,456 merged, 7,890 spheres left, 5,678 with walls; 2.5 of kinetic energy lost, -0.5 of potential energy",
        ),
    ],
)
def test_contacts_are_counted(more, expected):
    assert of("contact", contacts=CONTACTS | more) == [expected]


def test_the_steps_of_an_adaptive_method_are_told():
    control = {"replicas": 1, "steps": 1234, "refused": 2, "force_evaluations": 27148, "last_step": 0.0123}
    expected = "1,234 steps of its own{}, 2 refused, 27,148 evaluations of the force; the last step is 0.0123"
    assert of("control", step_control=control) == [expected.format("")]
    assert of("control", step_control=control | {"replicas": 3}) == [expected.format(" in 3 replicas")]
    assert of("method", step_control=control) == ["leapfrog, dt 0.0078125 between samples, f64"]
