"""Every key of `--json` of the verbs that examine scenes, files and the machine, against the scene's text and the files.

Whole objects are compared, see test_json_of_runs.py. No independent number is there for the measured times and the work of a
step, which are bounded, nor for the probes of other devices than the CPU.
"""

import hashlib
import importlib.metadata
import json
import os
import platform
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from json_facts import SYSTEM, Between, Matching, asked, processor
from sprung_bodies import DT, MASS, ROUNDING, SCENE, STEPS, STIFFNESS, energies, flight, frequencies

import mpp_taichi
from mpp_taichi import Simulation, Snapshot
from mpp_taichi.cli._costs import EffectCost, StepTime
from mpp_taichi.simulation.run_archive import RunArchive, header_of

pytestmark = pytest.mark.skipif(bool(os.environ.get("MPP_TAICHI_FAST")), reason="parts that are off have keys of their own")
WHERE = ("--backend", "cpu", "--precision", "f64", "--plan", "serial", "--threads", "1", "--quiet")
CPU = {"backend": "cpu", "device": processor(), "precision": "f64"}
EFFECTS = ["newtonian_gravity", "spring"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    Path("s.yaml").write_text(yaml.safe_dump(SCENE, sort_keys=False), encoding="utf-8")


def stability():
    """The limits of the step by the frequency ω of the spring: leapfrog is stable up to 2/ω.

    In any arrangement ω² is at most the largest sum of absolute values in a row of the matrix K_ij / √(m_i m_j) of a line.
    """
    root = 1.0 / np.sqrt(MASS)
    fastest, bound = frequencies().max(), np.sqrt(STIFFNESS * np.max(root * root.sum()))
    spring = r"the spring between particle 0 \(sun\) and particle 1 \(earth\), D = 0\.5 \(springs\[0\]\.link, s\.yaml:\d+:\d+\)"
    return {
        "dt_limit": pytest.approx(2.0 / fastest, rel=1e-12),
        "dt_limit_placed": pytest.approx(2.0 / fastest, rel=1e-12),
        "dt_limit_any_arrangement": pytest.approx(2.0 / bound, rel=1e-12),
        "dt_limit_decided_by": "the springs as placed",
        "dt_limit_set_by": Matching(spring),
        "largest_frequency": pytest.approx(fastest, rel=1e-12),
        "largest_frequency_bound": pytest.approx(bound, rel=1e-12),
        "largest_damping_rate_bound": 0.0,
    }, Matching(
        rf"leapfrog is stable up to {2.0 / fastest:.6g} \(the springs as placed; {2.0 / bound:.6g} in any arrangement\), "
        rf"set by {spring}; largest frequency {fastest:.6g}, at most {bound:.6g}"
    )


def test_every_key_of_a_dry_run_is_the_text_of_the_scene(capsys):
    limits, _ = stability()
    assert asked(capsys, "run", "s.yaml", "--dry-run", "--headless", "--snapshot", "a.npz", *WHERE) == {
        "scene": "s.yaml",
        "title": SCENE["title"],
        "dimensions": 3,
        "effects": EFFECTS,
        "integrator": "leapfrog",
        "dt": DT,
        "timeline": [],
        "particle_count": 2,
        "spring_count": 1,
        "pair_interactions_per_evaluation": 2,
        "steps": STEPS,
        "time": DT * STEPS,
        "bytes": Between(sum(field_bytes().values())),
        "backend": "cpu",
        "precision": "f64",
        "plan": "serial",
        "expect": ["relative_energy_error_max"],
        "files": ["a.npz"],
        "resolved": SCENE,
        "status": "ok",
        "exit_code": 0,
        **limits,
    }


def field_bytes():
    """Numbers of eight bytes, and indices of four; the two ends of a spring have a number each."""
    vector, half_springs = 2 * 3 * 8, 2
    return {
        **dict.fromkeys(("position", "velocity", "acceleration"), vector),
        "mass": 2 * 8,
        "spring_start": (2 + 1) * 4,
        "spring_neighbor": half_springs * 4,
        "spring_stiffness": half_springs * 8,
        "spring_rest_length": half_springs * 8,
    }


def test_every_key_of_an_explanation_is_the_scene_s_or_what_was_measured(capsys, monkeypatch):
    """Measured times are planted: 40 ns a step, of which gravity takes a quarter; drag would take an eighth more."""
    times = StepTime(4e-8, 1e-9), [EffectCost("newtonian_gravity", 1e-8, 2e-9)], [EffectCost("linear_drag", 5e-9, 4e-9)]
    monkeypatch.setattr("mpp_taichi.cli._costs.measure", lambda _: times)
    limits, told = stability()
    fastest = pytest.approx(frequencies().max(), rel=1e-12)
    x = 0.5 * DT * frequencies().max()
    damping = {"angular_frequency": fastest, "energy_loss_per_oscillation": 0.0}
    damping["relative_frequency_error"] = pytest.approx(np.arcsin(x) / x - 1.0, rel=1e-9)  # 2⁻⁵² over an error of 10⁻³
    assert asked(capsys, "explain", "s.yaml", *WHERE) == {
        "scene": "s.yaml",
        **CPU,
        "particle_count": 2,
        "spring_count": 1,
        "rod_count": 0,
        "effects": EFFECTS,
        "integrator": "leapfrog",
        "contacts": None,
        "walls": [],
        "force_evaluations_per_step": 1,
        "plan": "serial",
        "plan_reason": "asked for",
        "work_per_step": Between(2),  # two ordered pairs at least
        "crossover_work": Between(2),
        "launches_per_step": 0,  # no parallel loop
        "fields": field_bytes(),
        "field_bytes": sum(field_bytes().values()),
        "bytes_per_particle": sum(field_bytes().values()) / 2,
        "process_bytes": Between(10_000_000, 100_000_000_000),
        "dt": DT,
        **limits,
        "dt_said": told,
        "conserves_energy": True,
        "zero_frequency_modes": 5,
        "rigid_motions": 5,
        "mechanism_modes": 0,
        "second_order_modes": 0,
        "unstable_modes": 0,
        "vibrating_modes": 1,
        "lowest_angular_frequencies": [fastest],
        "highest_angular_frequency": fastest,
        "predicted_damping": [{"at": at, **damping} for at in ("lowest", "highest")],
        "seconds_per_step": 4e-8,
        "spread": 1e-9,
        "shares": [{"effect": "newtonian_gravity", "seconds": 1e-8, "share": 0.25, "noise": pytest.approx(0.05, rel=1e-12)}],
        "absent": [{"effect": "linear_drag", "seconds": 5e-9, "share": 0.125, "noise": pytest.approx(0.1, rel=1e-12)}],
        "timeline": [],
    }


def test_every_key_of_a_list_of_scenes_is_the_text_of_the_scene(capsys):
    Path("own").mkdir()
    texts = {
        "a_fall": {"title": "Fall", "description": "A stone\nfalls.", "forces": [{"uniform_gravity": {}}]},
        "b_pull": {"title": "Pull", "forces": [{"newtonian_gravity": {}}]},
        "c_net": {"title": "Net", "springs": [], "forces": [{"newtonian_gravity": {}}]},
        "d_balls": {"title": "Balls", "contacts": {}, "springs": []},
    }
    for name, scene in texts.items():
        Path("own", f"{name}.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    Path("own", "e_torn.yaml").write_text("title: [", encoding="utf-8")
    found = asked(capsys, "scenes", "own")
    topics = {"b_pull": "Gravity", "c_net": "Springs", "d_balls": "Hard spheres", "a_fall": "Other forces"}
    rows = [
        {
            "name": name,
            "file": str(Path("own", f"{name}.yaml")),
            "title": texts[name]["title"],
            "description": " ".join(texts[name].get("description", "").split()),
            "topic": topic,
        }
        for name, topic in topics.items()
    ]
    torn = {"name": "e_torn", "file": str(Path("own", "e_torn.yaml")), "title": "", "description": "", "topic": "Other forces"}
    assert found == {"scenes": [*rows, torn | {"fault": Matching(r"own.e_torn\.yaml:\d+:\d+: .+")}], "status": "ok"}


def test_every_key_of_a_conversion_is_what_the_file_holds(capsys):
    path = Path("t.npz")
    assert asked(capsys, "run", "s.yaml", "--headless", "--trajectory", path, "--every", "4", *WHERE)["files"] == ["t.npz"]
    told = {"particle_count": 2, "spring_count": 1, "time": 0.0, "frame_count": 1, "status": "ok"}
    assert asked(capsys, "convert", "s.yaml", "a.csv") == {"source": "s.yaml", "target": "a.csv", **told}
    assert len(Path("a.csv").read_text().splitlines()) == 1 + told["particle_count"]
    found = asked(capsys, "convert", path, "a.xyz")
    frames = 1 + STEPS // 4
    assert found == {"source": "t.npz", "target": "a.xyz", **told, "spring_count": 0, "frame_count": frames}
    assert len(Path("a.xyz").read_text().splitlines()) == frames * (2 + told["particle_count"])


@pytest.mark.parametrize("is_verified", [False, True])
@pytest.mark.sampled(3)
def test_every_key_of_a_passport_is_the_scene_s_or_the_machine_s(is_verified, capsys, monkeypatch):
    kept, counts = Path("verified.json"), {"solved": 5, "refused": 2, "failed": 0, "length": "quick", "date": "2026-11-01"}
    monkeypatch.setattr("mpp_taichi.cli._passport._verdicts_file", lambda: kept)
    versions = {name: importlib.metadata.version(name.replace("_", "-")) for name in ("mpp_taichi", "taichi", "numpy")}
    versions["python"] = platform.python_version()
    device = asked(capsys, "run", "s.yaml", "--headless", "--steps", "1", *WHERE)["device"]
    if is_verified:
        kept.write_text(json.dumps({"cpu f64": {**counts, **versions, "device": device}}), encoding="utf-8")
    asked(capsys, "run", "s.yaml", "--headless", "--snapshot", "a.npz", *WHERE)
    assert asked(capsys, "passport", "a.npz") == {
        "title": SCENE["title"],
        "scene_file": "s.yaml",
        "scene_sha256": hashlib.sha256(json.dumps(SCENE, sort_keys=True).encode()).hexdigest(),
        **versions,
        "system": SYSTEM,
        **CPU,
        "plan": "serial",
        "integrator": SCENE["integrator"],
        "verified": counts if is_verified else "not verified",
    }


def test_every_key_of_a_replay_is_that_of_the_moment(capsys):
    with Simulation("s.yaml", backend="cpu", precision="f64") as simulation:
        archive = RunArchive(Path("a.run"), header_of(simulation), {})
        simulation.run(steps=8)
        archive.record(simulation)
    found = asked(capsys, "replay", "a.run", "--at", 12 * DT, "--snapshot", "a.npz", "--still", "a.png", "--size", "64x48")
    places, velocities = flight()[12]
    assert found == {
        "archive": "a.run",
        "time": 12 * DT,
        "step": 12,
        "record_time": 8 * DT,
        "record_step": 8,
        "total_energy": pytest.approx(sum(energies(places, velocities)), abs=ROUNDING),
        "status": "ok",
        "files": ["a.npz", "a.png"],
        "exit_code": 0,
    }
    np.testing.assert_allclose(Snapshot.load("a.npz").position, places, atol=ROUNDING)


def test_every_key_of_the_examination_of_the_machine_is_a_fact_or_says_why_not(capsys):
    found = asked(capsys, "info")
    packages = ("taichi", "numpy", "pydantic", "PyYAML", "pillow", "rich", "imageio-ffmpeg", "pyopencl")
    installed = {each.metadata["Name"].lower(): each.version for each in importlib.metadata.distributions()}
    backends, encoder = found.pop("backends"), found.pop("encoder")
    devices = {name: found.pop(name) for name in ("vulkan_devices", "opencl_devices")}
    assert found == {
        "mpp_taichi": mpp_taichi.__version__,
        "python": ".".join(map(str, sys.version_info[:3])),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cpu_threads": os.cpu_count(),
        "packages": {name: installed.get(name.lower()) for name in packages},
        "display": {"window": False, "problem": "there is no display"},
    }
    assert list(backends) == ["cpu", "cuda", "vulkan", "metal"]
    every = dict.fromkeys(("float64", "compensation", "low_parts", "finds_nan", "double_single"), True)
    arithmetic = {"loop_limit": None, **every}
    cpu = {"available": True, "reason": "", "device": processor(), "software": False, "probes": arithmetic}
    assert backends["cpu"] == cpu
    for name in ("cuda", "vulkan", "metal"):
        report = backends[name]
        if not report["available"]:
            assert report == {"available": False, "reason": Matching(".+"), "device": "", "software": False}
        elif "problem" not in report:
            assert report.keys() == cpu.keys() and report["probes"].keys() == arithmetic.keys()
            assert report["reason"] == "" and report["device"] and isinstance(report["software"], bool)
    assert sys.platform == "darwin" or not backends["metal"]["available"]
    if backends["vulkan"]["available"]:
        assert backends["vulkan"]["device"] in [each["name"] for each in devices["vulkan_devices"]["devices"]]
    assert encoder == {"path": encoder["path"], "problem": ""} and os.access(encoder["path"], os.X_OK)
    check_devices(**devices)


def check_devices(vulkan_devices, opencl_devices):
    """Each list has devices or a reason; the devices of OpenCL are those that pyopencl lists here."""
    for found in (vulkan_devices, opencl_devices):
        assert found.keys() == {"devices", "problem"} and bool(found["devices"]) != bool(found["problem"])
    kinds = {"other", "integrated", "discrete", "virtual", "software"}
    assert all(each.keys() == {"name", "kind"} and each["kind"] in kinds for each in vulkan_devices["devices"])
    if opencl_devices["devices"]:
        import pyopencl

        here = [(each, device) for each in pyopencl.get_platforms() for device in each.get_devices()]
        assert opencl_devices["devices"] == [
            {
                "platform": each.get_info(pyopencl.platform_info.NAME).strip(),
                "version": each.get_info(pyopencl.platform_info.VERSION).strip(),
                "device": device.get_info(pyopencl.device_info.NAME).strip(),
                "float64": device.get_info(pyopencl.device_info.DOUBLE_FP_CONFIG) != 0,
                "compute_units": device.get_info(pyopencl.device_info.MAX_COMPUTE_UNITS),
            }
            for each, device in here
        ]
