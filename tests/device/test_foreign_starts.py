"""Programs that start or reset Taichi by themselves: a Simulation keeps its own precision, or reports its end.

Each case is a process of its own, as a fault here may end the interpreter.
"""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BEGIN = """
import taichi as ti
import mpp_taichi as mpp
from scenes import kepler

def open_simulation():
    return mpp.Simulation(kepler(0.5), backend="cpu", precision="f64")

def speed(simulation):
    return float(abs(simulation.run(steps=50).snapshot().velocity).max()).hex()

def config():
    found = ti.lang.impl.current_cfg()
    return found.default_fp, found.fast_math
"""
INIT, RESET = "ti.init(arch=ti.cpu, default_fp=ti.f32, fast_math=True, log_level=ti.ERROR)", "ti.reset()"


def run(code):
    """What a program prints; it ends in good order and says nothing else."""
    command = [sys.executable, "-c", BEGIN + code]
    done = subprocess.run(command, cwd=ROOT / "tests" / "support", capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr[-2000:]
    return [line for line in done.stdout.splitlines() if not line.startswith("[Taichi]")]


@pytest.mark.parametrize("act", [INIT, RESET])
def test_the_next_simulation_has_the_precision_asked_for(act):
    found = run(f"""
{act}
before = open_simulation()
assert config() == (ti.f64, False)
right = speed(before)
{act}
between = open_simulation()
assert config() == (ti.f64, False) and not before.is_alive and between.is_alive
assert speed(between) == right
before.close()
assert between.is_alive
{act}
{act}
between.close()
with open_simulation() as last:
    assert speed(last) == right
print("ok")
""")
    assert found == ["ok"]


@pytest.mark.parametrize("act", [INIT, RESET])
@pytest.mark.sampled(3)
def test_a_simulation_without_its_runtime_says_so_whatever_it_is_asked(act):
    found = run(f"""
from functools import partial
simulation = open_simulation()
simulation.keep_energy_balance()
mark, bookmark = simulation.run(steps=3).mark(), simulation.bookmark()

def change():
    with simulation.parameter_change():
        pass

{act}
calls = {{
    "run": partial(simulation.run, steps=1), "snapshot": simulation.snapshot, "diagnostics": simulation.diagnostics,
    "mechanics": simulation.mechanics, "accelerations": simulation.accelerations, "restart": simulation.restart,
    "mark": simulation.mark, "return_to": partial(simulation.return_to, mark), "bookmark": simulation.bookmark,
    "go_back": partial(simulation.go_back, bookmark), "try_steps": partial(simulation.try_steps, 1),
    "snapshot_ahead": partial(simulation.snapshot_ahead, 0.001), "checkpoint": partial(simulation.checkpoint, "no/where.npz"),
    "set": partial(simulation.set, "integrator.dt", 0.01), "picture": simulation.picture, "parameter_change": change,
    "restart_as_written": partial(simulation.restart, as_written=True), "keep_energy_balance": simulation.keep_energy_balance,
}}
for name, call in calls.items():
    try:
        call()
    except mpp.MppError as error:
        assert "has ended" in str(error) and "\\n" not in str(error)
        print(name)
assert "ended" in repr(simulation)
simulation.close()
print(len(calls), simulation.time > 0.0)
""")
    assert int(found[-1].split()[0]) == len(found) - 1


@pytest.mark.sampled(3)
def test_a_recorder_that_starts_taichi_ends_the_run_by_name():
    found = run(f"""
class Starter:
    def steps_until_due(self, simulation):
        return 5 - simulation.step_count

    def record(self, simulation):
        {INIT}

try:
    open_simulation().run(steps=20, recorders=[Starter()])
except mpp.MppError as error:
    print("has ended" in str(error))
""")
    assert found == ["True"]


@pytest.mark.sampled(3)
def test_the_end_of_a_simulation_leaves_a_runtime_of_the_program_alone():
    found = run(f"""
with open_simulation() as simulation:
    simulation.run(steps=2)
    {INIT}
    own = ti.field(ti.f32, shape=4)
    own.fill(3.0)
del simulation
print(own.to_numpy().sum(), config() == (ti.f32, True))
""")
    assert found == ["12.0 True"]
