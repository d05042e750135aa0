"""OpenCL devices are identified by their driver version; components without an OpenCL kernel are refused by name."""

import dataclasses
import os
import re
import shutil
import subprocess
import sys

import pytest
from opencl_models import loaded, spheres

from mpp_taichi import load_scene
from mpp_taichi.compare import opencl_package
from mpp_taichi.compare.opencl_package import load_opencl
from scenes import cluster, everything

POCL = "OpenCL 3.0 PoCL 3.1+debian  Linux, None+Asserts, RELOC, SPIR, LLVM 15.0.6, SLEEF, DISTRO, POCL_DEBUG"
VERSIONS = {
    POCL: "PoCL 3.1+debian",
    "OpenCL 3.0 PoCL 3.0-rc2  Linux, Release, RELOC, LLVM 14": "PoCL 3.0-rc2",
    "OpenCL 3.0 CUDA 12.4.131": "CUDA 12.4.131",
    "OpenCL 1.2": "OpenCL 1.2",
    "OpenCL 3.0 LINUX": "LINUX",
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("text", VERSIONS)
def test_the_version_is_what_the_driver_says_of_itself(text):
    assert load_opencl("devices").driver_version(text) == VERSIONS[text]


def several_devices(module):
    """Two PoCL of one name, two like GPUs, as `devices` would list them."""
    made = []
    for name, platform, version, kind, number in (
        ("pthread-epyc", "Portable Computing Language", "PoCL 3.1+debian", "cpu", ""),
        ("pthread-epyc", "Portable Computing Language", "PoCL 3.0-rc2", "cpu", ""),
        ("NVIDIA H200", "NVIDIA CUDA", "CUDA 12.4.131", "gpu", ""),
        ("NVIDIA H200", "NVIDIA CUDA", "CUDA 12.4.131", "gpu", " #2"),
    ):
        made.append(module.Device(name, platform, version, kind, f"{version} / {name}{number}", None))
    return made, ""


def test_a_device_is_chosen_by_words_of_name_and_version(monkeypatch):
    module = load_opencl("devices")
    monkeypatch.setattr(module, "devices", lambda: several_devices(module))
    assert module.choose("pocl 3.0").version == "PoCL 3.0-rc2"
    assert module.choose("Portable 3.1").version == "PoCL 3.1+debian"
    assert module.choose("h200 #2").id.endswith("#2")
    assert module.choose("CUDA 12.4.131 / NVIDIA H200").id == "CUDA 12.4.131 / NVIDIA H200"  # exact, though both begin so
    assert module.choose().type == "gpu"
    with pytest.raises(module.Refused, match="2 OpenCL devices match 'portable', say which: PoCL 3.1.*; PoCL 3.0-rc2"):
        module.choose("portable")
    with pytest.raises(module.Refused, match="no OpenCL device matches 'radeon', there are: PoCL 3.1"):
        module.choose("radeon")
    monkeypatch.setattr(module, "devices", lambda: ([], "no OpenCL platform: none"))
    with pytest.raises(module.Refused, match="^no OpenCL platform: none$"):
        module.choose()


def test_without_pyopencl_there_are_no_devices_and_a_reason(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyopencl", None)  # as Python has it of a module that cannot be imported
    found, reason = load_opencl().devices()
    assert found == [] and reason.startswith("pyopencl cannot be imported: ") and "\n" not in reason


def test_f64_is_refused_where_the_device_has_none(opencl):
    """And f32 is not, as far as the checks go."""
    coverage, device = load_opencl("coverage"), opencl.choose()
    spec, start = loaded(cluster(5))
    without = dataclasses.replace(device, handle=type("Handle", (), {"double_fp_config": 0}))
    with pytest.raises(opencl.Refused, match="f64 on .*, which has none"):
        coverage.problem_of(spec, start, without, "f64")
    assert coverage.problem_of(spec, start, without, "f32").precision == "f32"


def test_a_device_that_is_here_is_found_by_its_id(opencl):
    found, reason = opencl.devices()
    assert reason == "" and len({device.id for device in found}) == len(found)
    for device in found:
        assert opencl.choose(device.id) == device and device.type in ("cpu", "gpu", "accelerator")


SWEPT = spheres(5) | {"contacts": {"hard_spheres": {"solver": "swept"}}}
DRIVEN = cluster(5) | {"forces": [{"harmonic_drive": {"force": [1, 0, 0], "angular_frequency": 1.0}}]}
CHANGING = everything() | {"timeline": [{"at": 0.1, "set": {"forces.linear_drag.coefficient": 0.5}}]}
BIN = [{"polygon": {"points": [[0, 0, 0], [90, 0, 0], [90, 90, 0]], "closed": False}}]
REFUSALS = {
    "integrator": (cluster(5, integrator="yoshida4"), {}, "integrator yoshida4, there are leapfrog, velocity_verlet, rk4"),
    "force": (DRIVEN, {}, "force harmonic_drive, there are newtonian_gravity, "),
    "solver": (SWEPT, {}, "contact solver swept, there is pairwise"),
    "wall": (spheres(5, walls=BIN), {}, "walls[1].polygon, side 0, there are planes, cylinders and spheres"),
    "timeline": (CHANGING, {}, "timeline"),
    "precision": (cluster(5), {"precision": "ds"}, "precision ds, there are f32, f64"),
    "variant": (cluster(5), {"variant": "tree"}, "no variant 'tree' of the direct sum"),
    "device": (cluster(5), {"device": "no such device"}, "no OpenCL device matches 'no such device'"),
}


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", REFUSALS)
def test_what_there_is_no_kernel_for_is_refused_by_name(opencl, name):
    scene, options, message = REFUSALS[name]
    spec, start = loaded(scene)
    with pytest.raises(opencl.Refused) as caught:
        opencl.Runner(spec, start, **options)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_the_refusal_of_an_integrator_offers_an_option_that_works(opencl):
    scene = cluster(5, integrator="yoshida4")
    spec, start = loaded(scene)
    with pytest.raises(opencl.Refused) as caught:
        opencl.Runner(spec, start)
    option = re.search(r'--set "([^"]+)" has one$', str(caught.value))[1]
    offered, start = loaded(load_scene(scene, overrides=[option]))
    assert offered.integrator.parameters["dt"] == spec.integrator.parameters["dt"]
    opencl.Runner(offered, start).close()
    spec, start = loaded({**DRIVEN, "integrator": {"yoshida4": {"dt": 0.1}}})
    with pytest.raises(opencl.Refused) as caught:
        opencl.Runner(spec, start)
    assert "--set" not in str(caught.value), "a force is missing too"


def test_a_force_that_gained_a_parameter_is_refused_unless_it_is_off(opencl):
    """A solver that is not the direct sum, say: the kernels would compute something else."""
    spec, start = loaded(cluster(5))
    gravity = spec.forces[0]
    for value, refused in (("tree", True), ("direct", False), (None, False)):
        changed = dataclasses.replace(gravity, parameters={**gravity.parameters, "solver": value})
        scene = dataclasses.replace(spec, forces=(changed,))
        if refused:
            with pytest.raises(opencl.Refused, match="newtonian_gravity with solver: tree"):
                opencl.Runner(scene, start)
        else:
            opencl.Runner(scene, start).close()


def test_the_fastest_way_is_taken_and_remembered(monkeypatch):
    """By a clock that only the attempts move; first attempts, which compile, take long and do not count."""
    tuning = load_opencl("tuning")
    cost, tried, now = {"slow": 0.03, "fast": 0.02, "hopeless": 0.09}, [], [0.0]

    def attempt(way):
        now[0] += cost[way] + (1.0 if way not in tried else 0.0)
        tried.append(way)

    monkeypatch.setattr(tuning.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(tuning, "_remembered", {})
    assert tuning.fastest("key", list(cost), attempt) == "fast"
    assert tried.count("hopeless") == 2  # one more than to compile
    tried.clear()
    assert tuning.fastest("key", list(cost), attempt) == "fast" and not tried


def test_the_folder_is_found_whatever_else_is_called_opencl(tmp_path):
    """Another package of the name is neither imported nor hidden, and no Taichi is imported."""
    (tmp_path / "opencl").mkdir()
    (tmp_path / "opencl" / "__init__.py").write_text("MINE = True\n")
    code = (
        "import sys, opencl; from mpp_taichi.compare.opencl_package import load_opencl; runner = load_opencl();"
        "print(opencl.MINE, runner.__name__, 'taichi' in sys.modules, 'pyopencl' in sys.modules)"
    )
    paths = os.pathsep.join([str(tmp_path), str(opencl_package.PLACES[1].parent)])
    environment = {**os.environ, "PYTHONPATH": paths}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["True", "mpp_taichi_opencl.runner", "False", "False"]


def test_it_is_found_inside_the_package_as_it_is_installed(tmp_path):
    """A wheel has the folder inside `mpp_taichi`."""
    source = opencl_package.PLACES[1].parent
    shutil.copytree(source / "mpp_taichi", tmp_path / "mpp_taichi", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(source / "opencl", tmp_path / "mpp_taichi" / "opencl", ignore=shutil.ignore_patterns("__pycache__"))
    code = "from mpp_taichi.compare.opencl_package import load_opencl; print(load_opencl('program').read('springs')[:2])"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "/*"
