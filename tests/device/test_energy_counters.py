"""Energy counters add up the packages of a machine, and count on where a counter begins again."""

import math

import pytest

from mpp_taichi.device import energy_counters as energy_counters_module
from mpp_taichi.device.energy_counters import EnergyMeasurement, energy_counters


@pytest.fixture
def powercap(tmp_path, monkeypatch):
    """Two packages, and a part of the first one; no GPU."""
    monkeypatch.setattr(energy_counters_module, "NVML", "no-such-library")
    for folder, name in (("intel-rapl:0", "package-0"), ("intel-rapl:0:0", "core"), ("intel-rapl:1", "package-1")):
        counter = tmp_path / folder
        counter.mkdir()
        (counter / "name").write_text(name + "\n")
        (counter / "energy_uj").write_text("1000000\n")
        (counter / "max_energy_range_uj").write_text("5000000\n")
    return tmp_path


def count(powercap, folder, microjoules):
    (powercap / folder / "energy_uj").write_text(f"{microjoules}\n")


def test_the_packages_are_added_and_their_parts_are_not(powercap):
    measurement = EnergyMeasurement(energy_counters(powercap))
    count(powercap, "intel-rapl:0", 1_500_000)
    count(powercap, "intel-rapl:0:0", 1_400_000)
    count(powercap, "intel-rapl:1", 1_250_000)
    assert math.isclose(measurement.joules(), 0.75)


def test_a_counter_that_begins_again_counts_on(powercap):
    count(powercap, "intel-rapl:0", 4_900_000)
    measurement = EnergyMeasurement(energy_counters(powercap))
    count(powercap, "intel-rapl:0", 200_000)
    assert math.isclose(measurement.joules(), 0.3)


def test_a_machine_without_a_readable_counter_tells_no_energy(powercap, tmp_path):
    for folder in ("intel-rapl:0", "intel-rapl:1"):
        (powercap / folder / "energy_uj").unlink()
    assert EnergyMeasurement(energy_counters(powercap)).joules() is None
    assert EnergyMeasurement(energy_counters(tmp_path / "absent")).joules() is None
