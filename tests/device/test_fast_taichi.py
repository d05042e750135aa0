"""The parts around Taichi: one table, one place of installation, and a switch for the user."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi import ArgumentError
from mpp_taichi.cli.main import main
from mpp_taichi.device import backends, fast_taichi
from mpp_taichi.device.fast_taichi import switch

ROOT = Path(__file__).parents[2]
HALVES = (",".join(switch.NAMES[::2]), ",".join(switch.NAMES[1::2]))
PROGRAM = """
import json, sys
from pathlib import Path
import taichi as ti
{before}
from mpp_taichi import Simulation
from mpp_taichi.device import backends
from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi import switch
from scenes import cluster

backends.import_taichi()
from taichi.lang.ast.ast_transformer import ASTTransformer
from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext

def end(integrator, plan):
    with Simulation(cluster(20, integrator=integrator), backend="cpu", precision="f64", plan=plan, threads=2) as simulation:
        tasks = [(task / "comm").read_text().strip() for task in Path("/proc/self/task").glob("*")]
        return simulation.run(steps=4).snapshot().position.tolist(), "mpp_taichi" in tasks

def wrapped(function):
    while function is not None:
        yield function
        function = getattr(function, "__wrapped__", None)

ends = [end(*which) for which in (("leapfrog", "serial"), ("implicit_midpoint", "parallel"))]
print(json.dumps({{
    "ends": [position for position, _ in ends],
    "replaced": {{
        "source_cache": hasattr(ASTTransformerContext.get_pos_info, "__wrapped__"),
        "launch_cache": hasattr(ti.lang.kernel_impl.Kernel.__call__, "__wrapped__"),
        "serial_loops": not hasattr(ASTTransformer.build_For, "__name__"),
        "worker_threads": any(each.__globals__["__name__"].endswith(".worker_threads") for each in wrapped(ti.lang.impl.reset)),
    }},
    "threads": ends[-1][1],
    **switch.facts(),
}}))
"""


def run(variable, before=""):
    """What a program in a process of its own finds, with the variable set so."""
    environment = {name: value for name, value in os.environ.items() if name != switch.VARIABLE}
    environment |= {switch.VARIABLE: variable} if variable is not None else {}
    environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), str(ROOT / "tests" / "support")])
    command = [sys.executable, "-c", PROGRAM.format(before=before)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def everything():
    """The program with all parts on."""
    return run(None)


def test_the_table_names_every_part_once():
    rows = [line.split("|")[1].strip() for line in fast_taichi.__doc__.splitlines() if line.startswith("| ")]
    assert tuple(rows[1:]) == switch.NAMES
    assert set(fast_taichi.REPLACING) < set(switch.NAMES)


@pytest.mark.sampled(3)
def test_every_part_is_on_where_nothing_is_said(everything):
    assert all(everything["replaced"].values()) and "fast_taichi_off" not in everything
    assert everything["threads"] == (sys.platform == "linux" and os.uname().machine == "x86_64")


@pytest.mark.parametrize("variable", ["off", *HALVES])
def test_what_is_off_is_not_installed_and_results_stay(variable, everything):
    off = switch.NAMES if variable == "off" else tuple(variable.split(","))
    found = run(variable)
    assert found["fast_taichi_off"] == [name for name in switch.NAMES if name in off]
    assert found["fast_taichi_reason"] == f"MPP_TAICHI_FAST={variable}"
    assert found["replaced"] == {name: name not in off for name in found["replaced"]}
    assert not (found["threads"] and "worker_threads" in off)
    for position, expected in zip(found["ends"], everything["ends"], strict=True):
        np.testing.assert_allclose(position, expected, rtol=0, atol=1e-11)  # Newton's method ends at 1e-12 of a step


@pytest.mark.sampled(3)
def test_another_version_of_taichi_runs_with_none_of_them(everything):
    found = run(None, before="ti.__version__ = (1, 8, 0)")
    assert found["fast_taichi_off"] == list(switch.NAMES) and found["fast_taichi_reason"].startswith("this is Taichi 1.8.0")
    assert not any(found["replaced"].values()) and not found["threads"]
    np.testing.assert_allclose(found["ends"], everything["ends"], rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("text", "off"),
    [("", ()), ("off", switch.NAMES), (" prefetch , source_cache,", ("source_cache", "prefetch")), (",", ())],
)
def test_a_value_of_the_variable_names_parts(text, off):
    assert switch.parts_off(text, switch.KNOWN_TAICHI)[0] == off


@pytest.mark.parametrize("text", ["on", "0", "prefetching", "off,prefetch", "Off"])
def test_an_unknown_name_is_one_line_with_what_is_allowed(text, monkeypatch, capsys):
    with pytest.raises(ArgumentError, match="is unknown, allowed: off, or names"):
        switch.parts_off(text, switch.KNOWN_TAICHI)
    monkeypatch.setenv(switch.VARIABLE, text)
    assert main(["check", "scenes/sun_earth.yaml"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and said[0].startswith(f"{switch.VARIABLE}={text}: ")


@pytest.mark.parametrize("command", [["info"], ["run", "scenes/sun_earth.yaml", "--headless", "--steps", "2"]])
@pytest.mark.sampled(3)
def test_reports_name_what_is_off_and_say_nothing_else(command, monkeypatch, capsys):
    backends.import_taichi()  # which installs the parts of this process, before the reports are made to name others
    monkeypatch.chdir(ROOT)
    monkeypatch.delenv(switch.VARIABLE, raising=False)
    for parts, line in (
        (switch._Parts(decided=True), ""),
        (switch._Parts(set(), ("source_cache", "large_pages"), "the reason", True), "source_cache, large_pages"),
    ):
        monkeypatch.setattr(switch, "_parts", parts)
        assert main([*command, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert ("fast_taichi_off" in found) == bool(line)
        assert main(command) == 0
        said = "".join(capsys.readouterr())
        lines = [words for words in said.splitlines() if words.strip().startswith("off")]
        assert [" ".join(words.split()) for words in lines] == ([f"off {line} of fast_taichi (the reason)"] if line else [])
