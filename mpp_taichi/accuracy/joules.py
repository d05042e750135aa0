"""Joules: the electrical energy of a run, on machines that count it."""

import time

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.sample import Configuration
from mpp_taichi.device.energy_counters import EnergyMeasurement, energy_counters

LEAST_SECONDS = 0.2  # of a measurement: processors renew their counters about every 1 ms, GPUs every 20 to 100 ms


def joules_of(machine: Machine, configuration: Configuration, budget: Budget) -> float | None:
    """The energy of a run [J], the mean of as many runs as take LEAST_SECONDS; None where the machine has no counter.

    A counter belongs to the whole machine: it also counts what the machine uses at rest, and what other programs use.

    Raises:
        OutOfTime: the budget ended first.
    """
    counters = energy_counters()
    if not counters:
        return None
    runs, began = 0, time.perf_counter()
    measurement = EnergyMeasurement(counters)
    while not runs or time.perf_counter() - began < LEAST_SECONDS:
        machine.steps_alone(configuration, budget)
        runs += 1
    used = measurement.joules()
    return None if used is None else used / runs
