"""Every key of `--json` of `accuracy` against leapfrog in NumPy and a solution by SciPy.

The time budget decides how many runs there are, so that each row is compared with its own computation, and the verdict with the
rows. No independent number is there for times and energies of the machine, and for the choices that follow from times.
"""

import importlib.metadata
import platform
import statistics
from pathlib import Path

import numpy as np
import pytest
import yaml
from json_facts import SECONDS, SYSTEM, Between, Matching, asked, processor
from scipy.integrate import solve_ivp
from sprung_bodies import DT, MASS, PLACES, SCENE, STEPS, VELOCITIES, accelerations, energies, flight

import mpp_taichi
from mpp_taichi import component

SPAN = DT * STEPS
CLOSE = 1e-10
"""Of the size: SciPy's solution is good to some 10⁻¹², and 1,600 steps have a hundred times the roundings of sixteen."""
ADAPTIVE, CONTROLS = ("ias15", "taylor", "adaptive_dop853"), ("epsilon", "tolerance")
ERRORS = ("position", "position_rms", "energy", "momentum", "angular_momentum", "wanted")


@pytest.fixture(scope="module")
def exact():
    """Places at the end, and the size: the root mean square distance from the mean place of the run."""

    def rates(_, state):
        places, velocities = state.reshape(2, 2, 3)
        return np.concatenate([velocities.ravel(), accelerations(places).ravel()])

    start = np.concatenate([PLACES.ravel(), VELOCITIES.ravel()])
    looks = np.linspace(0.0, SPAN, 65)
    found = solve_ivp(rates, (0.0, SPAN), start, "DOP853", looks, rtol=1e-13, atol=1e-14)
    places = found.y.T[:, :6].reshape(-1, 2, 3)
    apart = places - places.mean(axis=(0, 1))
    return places[-1], float(np.sqrt(np.mean(np.sum(apart**2, axis=-1))))


def leapfrog_errors(steps, exact):
    """The errors of leapfrog in so many steps: of places over the size, and of the energy over its value."""
    end, size = exact
    states = flight(steps=steps, dt=SPAN / steps)
    apart = np.linalg.norm(states[-1][0] - end, axis=1) / size
    total = [sum(energies(*each)) for each in states]
    energy = np.abs(np.array(total) - total[0]).max()
    return {"position": apart.max(), "position_rms": np.sqrt(np.mean(apart**2)), "energy": energy / abs(total[0])}


def stated(found):
    """An error is a number or a bound, and without a quantity that is wanted neither."""
    return sum(found[key] is not None for key in ("value", "at_most"))


def check_row(row, exact):
    """All keys of a row; rows of other methods are steps of the search for a reference."""
    steps, own = row["steps"], row["integrator"] == "leapfrog" and row["steps"] == STEPS
    is_leapfrog, is_adaptive = row["integrator"] == "leapfrog", row["integrator"] in ADAPTIVE
    assert row["integrator"] in component.names("integrators") and (row["control"] in CONTROLS) == is_adaptive
    assert row == {
        "key": Matching(rf"{row['integrator']}-f64-cpu-{steps}.*"),
        "is_own": own,
        "integrator": row["integrator"],
        "steps": Between(1),
        "precision": "f64",
        "backend": "cpu",
        "control": row["control"] if is_adaptive else "",
        "tolerance": Between(1e-16, 1e-3) if is_adaptive else None,
        "dt": Between(0.0, SPAN) if is_adaptive else pytest.approx(SPAN / steps, rel=1e-12),
        "evaluations": steps if is_leapfrog else Between(1 if is_adaptive else steps),
        "status": "ok",
        "reason": "",
        "compile_seconds": SECONDS,
        "seconds": [SECONDS] * len(row["seconds"]),
        "times": row["times"],
        "energy_errors": row["energy_errors"],
        "joules": row["joules"] and SECONDS,
        "values": [],
        "along": row["along"] and SECONDS,
        "median_seconds": pytest.approx(statistics.median(row["seconds"]), rel=1e-12),
        "errors": row["errors"],
    }
    assert row["times"][0] == 0.0 and row["times"][-1] == pytest.approx(SPAN) and len(row["times"]) == len(row["energy_errors"])
    errors = row["errors"]
    assert tuple(errors) == ERRORS and all(each.keys() == {"value", "at_most"} for each in errors.values())
    assert [stated(errors[name]) for name in ERRORS] == [1, 1, 1, 1, 1, 0]
    if is_leapfrog:
        expected = leapfrog_errors(steps, exact)
        assert errors["position"]["value"] == pytest.approx(expected["position"], abs=CLOSE)
        assert errors["position_rms"]["value"] == pytest.approx(expected["position_rms"], abs=CLOSE)
        if steps <= 64:  # every step is a sample
            assert errors["energy"]["value"] == pytest.approx(expected["energy"], abs=CLOSE)


def check_verdict(found, rows):
    """A named setting is a row, with the numbers of the row."""
    by_key = {row["key"]: row for row in rows}
    of_all = {"target", "quantity", "time_per_digit", "time_front", "evaluations_per_digit", "evaluations_front", "choice"}
    of_all |= {"slower", "elsewhere", "missed", "precisions", "too_rounded", "own", "methods_tried", "methods_suited"}
    assert found.keys() - {"film"} == of_all | {"budget_ended"}
    assert (found["target"], found["quantity"], found["elsewhere"]) == (1e-2, "position", [])
    assert set(found["time_front"]) | set(found["evaluations_front"]) <= by_key.keys()
    for name in {"choice", "slower", "own", "film"} & {key for key in found if found[key] is not None}:
        setting, row = found[name], by_key[found[name]["key"]]
        error = row["errors"]["position"]
        expected = {key: row[key] for key in ("key", "integrator", "precision", "backend", "dt", "joules", "evaluations")}
        expected |= {"seconds": row["median_seconds"], "error": error["value"], "error_at_most": error["at_most"]}
        more = {"own": {"status": "ok", "step_ratio": setting.get("step_ratio")}, "film": {"along": row["along"]}}.get(name, {})
        assert setting == expected | more | {"setting": Matching(r"(dt|epsilon) = .+")}, name
    ratio = found["own"]["step_ratio"]  # of a method of second order, whose next term is below a tenth of the first
    assert ratio is None or ratio == pytest.approx((1e-2 / found["own"]["error"]) ** 0.5, rel=0.1)
    assert found["own"]["key"] == f"leapfrog-f64-cpu-{STEPS}"
    assert (found["choice"]["error"] or found["choice"]["error_at_most"]) <= 1e-2
    assert 1 <= found["methods_tried"] <= found["methods_suited"] and isinstance(found["budget_ended"], bool)


@pytest.mark.sampled(3)
def test_every_key_of_a_study_is_that_of_its_computation(exact, capsys, tmp_path, monkeypatch):
    """A target that the scene's own step meets; its error was 6·10⁻³ of the size."""
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(SCENE, sort_keys=False), encoding="utf-8")
    words = ("--budget", "20s", "--target", "1e-2", "--precisions", "f64", "--integrators", "leapfrog", "--backends", "cpu")
    found = asked(capsys, "accuracy", "s.yaml", *words, "--quiet", "--out", "o")
    rows, reference = found["rows"], found["reference"]
    for row in rows:
        check_row(row, exact)
    check_verdict(found["verdict"], rows)
    assert any(row["is_own"] for row in rows)
    assert reference == {
        "integrator": Matching("|".join(row["integrator"] for row in rows)),
        "order": Between(2),
        "steps": Between(1),
        "size": pytest.approx(exact[1], rel=1e-9),
        "bar": Between(0.0, CLOSE),
        "bar_rms": Between(0.0, reference["bar"]),
        "trusted": True,
        "differences": [Between(0.0, 1.0)] * len(reference["differences"]),
        "meaning": None,
        "by_rounding": False,
        "control": Matching("|".join(("", *CONTROLS))),
        "tolerance": reference["tolerance"] and Between(1e-16, 1e-3),
    }
    chaos, fastest = found["chaos"], found["verdict"]["choice"]["integrator"]
    assert chaos is None or chaos.keys() == {"lyapunov_time", "rise", "span", "horizon_f64", "horizon_f32"}
    assert {key: value for key, value in found.items() if key not in ("rows", "reference", "verdict", "chaos")} == {
        "scene": "s.yaml",
        "title": SCENE["title"],
        "status": Matching("complete|partial"),
        "known": {
            "format": Between(1),
            "scene": Matching("[0-9a-f]{16}"),
            "asked_span": SPAN,
            "cpu": processor(),
            "system": SYSTEM,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "taichi": importlib.metadata.version("taichi"),
            "mpp_taichi": mpp_taichi.__version__,
        },
        "other_devices": {},
        "particle_count": len(MASS),
        "span": SPAN,
        "whole_span": SPAN,
        "quantity": "position",
        "wanted": None,
        "quantity_because": "positions at the end are known",
        "values": None,
        "remarks": found["remarks"],
        "budget_seconds": 20.0,
        "spent_seconds": SECONDS,
        "resumed_samples": 0,
        "sentence": Matching(rf"(?=.*1e-2 of position)(?=.*{fastest}).+"),
        "phases": [],
        "files": [str(Path("o", name)) for name in ("accuracy.json", "accuracy.html")],
    }
    assert all(Path(file).stat().st_size > 0 for file in found["files"])
