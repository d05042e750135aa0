"""Interrupts of a simulation at a chosen place: a KeyboardInterrupt is raised at one of the calls of Python that it makes."""

import sys

from mpp_taichi import Simulation


def speed(scene):
    """The largest velocity after a short run, to the last bit."""
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        return float(abs(simulation.run(steps=20).snapshot().velocity).max()).hex()


def calls(act):
    """How many functions of Python an act calls."""
    return _watched(act, None)


def interrupt(act, number):
    """Raise KeyboardInterrupt at the call of this number; False where the act was over before, or caught it."""
    try:
        _watched(act, number)
    except KeyboardInterrupt:
        return True
    return False


def _watched(act, number):
    count = 0

    def watch(frame, event, argument):
        nonlocal count
        if event == "call":
            count += 1
            if count == number:
                sys.setprofile(None)
                raise KeyboardInterrupt

    sys.setprofile(watch)
    try:
        act()
    finally:
        sys.setprofile(None)
    return count
