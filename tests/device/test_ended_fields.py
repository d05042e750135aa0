"""Fields and kernels of a runtime that has ended raise MppError, where Taichi alone ends the process.

Each case is a process of its own, as a fault here ends the interpreter.
"""

import pytest
from test_foreign_starts import INIT, RESET, run

TELL = """
import numpy as np

def tell(**calls):
    for name, call in calls.items():
        try:
            call()
            print(name, "went on")
        except mpp.MppError as error:
            print(name, "ended" in str(error) and "\\n" not in str(error))
"""


@pytest.mark.parametrize(
    "act", [INIT + "; own = ti.field(ti.f32, shape=4); own.fill(1)", RESET, "mpp.Simulation(kepler(), precision='f32')"]
)
@pytest.mark.sampled(3)
def test_what_lies_below_a_simulation_says_so_too(act):
    found = run(f"""{TELL}
simulation = open_simulation().run(steps=3)
field, phase = simulation.state.position, simulation.phase
phase.energy_meter.potential_energy(0.0)
{act}
tell(
    read=lambda: field.to_numpy(),
    write=lambda: field.from_numpy(np.zeros((2, 3))),
    fill=lambda: field.fill(0.0),
    entry=lambda: field[0],
    launch=lambda: phase.launcher.advance(0.0, 0.01, 0, 3), energy=lambda: phase.energy_meter.potential_energy(0.0),
    save=phase.save,
)
phase.destroy()
""")
    assert found == [f"{name} True" for name in ("read", "write", "fill", "entry", "launch", "energy", "save")]


@pytest.mark.sampled(3)
def test_fields_of_a_program_end_with_a_warning_when_a_simulation_starts():
    found = run(f"""{TELL}
import logging
logging.basicConfig(stream=__import__("sys").stdout, format="%(message)s")
{INIT}
own = ti.field(ti.f32, shape=4)
own.fill(1.0)
with open_simulation() as simulation:
    tell(own=lambda: own[0])
    later = ti.field(ti.f32, shape=2)
    later[1] = 5.0
    print(simulation.run(steps=2).step_count, later[1])
""")
    assert found[0].startswith("the fields of Taichi that this program made have ended: ")
    assert found[1:] == ["own True", "2 5.0"]


@pytest.mark.sampled(3)
def test_a_program_that_starts_taichi_again_and_again_meets_taichi_alone():
    found = run(f"""
open_simulation().close()
for k in range(2):
    {INIT}
    own = ti.field(ti.f32, shape=4)
    own.fill(k)
print(type(own).__name__, own[3])
""")
    assert found == ["ScalarField 1.0"]


@pytest.mark.sampled(3)
def test_a_closed_simulation_keeps_no_thread_of_taichi():
    found = run("""
import os
held = []
def threads():
    return len(os.listdir("/proc/self/task"))
counts = []
for _ in range(4):
    with open_simulation() as simulation:
        simulation.run(steps=2)
    held.append(simulation)
    counts.append(threads())
print(counts[-1] - counts[0])
""")
    assert found == ["0"]
