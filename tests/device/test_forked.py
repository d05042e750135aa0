"""Children that were forked from a process in which Taichi runs: refused in one line, and their exit ends."""

import os

import pytest
from test_foreign_starts import run

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")

# Python from 3.12 on warns whenever a process with threads forks: these tests fork on purpose, and look at all other output.
QUIET = """
import warnings
warnings.filterwarnings("ignore", ".*multi-threaded, use of fork.*", DeprecationWarning)
"""

FORK = (
    QUIET
    + """
import os, sys, time

def child(call):
    '''The exit status of a forked child in which `call` is called before sys.exit(7), or "hangs".'''
    sys.stdout.flush()
    number = os.fork()
    if not number:
        call()
        sys.stdout.flush()
        sys.exit(7)
    for _ in range(600):
        ended, status = os.waitpid(number, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.05)
    os.kill(number, 9)
    return "hangs"

def refused(*calls):
    for call in calls:
        try:
            call()
            print("went on")
        except mpp.MppError as error:
            print("fork" in str(error) and "\\n" not in str(error))
"""
)


@pytest.mark.sampled(3)
def test_a_child_is_refused_and_its_exit_ends():
    found = run(f"""{FORK}
simulation = open_simulation().run(steps=2)
print(child(lambda: None))
print(child(lambda: refused(lambda: simulation.run(steps=2), simulation.snapshot, open_simulation)))
print(child(simulation.close), simulation.run(steps=2).step_count)
""")
    assert found == ["7", *["True"] * 3, "7", "7 4"]


@pytest.mark.sampled(3)
def test_a_child_of_a_process_that_has_closed_all_works():
    found = run(f"""{FORK}
simulation = open_simulation().run(steps=2)
simulation.close()
print(child(lambda: print(open_simulation().run(steps=2).step_count)))
""")
    assert found == ["2", "7"]


def test_a_pool_of_forked_processes_works_beside_an_open_simulation():
    found = run(f"""{QUIET}
import multiprocessing
simulation = open_simulation().run(steps=2)
with multiprocessing.get_context("fork").Pool(2) as pool:
    print(pool.map(abs, [-1, -2, -3]))
print(simulation.run(steps=2).step_count)
""")
    assert found == ["[1, 2, 3]", "4"]
