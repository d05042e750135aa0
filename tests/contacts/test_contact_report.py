"""The sums of a report of contacts: exact, and independent of how a run is divided into reports."""

import numpy as np
import pytest
import taichi as ti

from mpp_taichi.contacts._report import SUMS, ContactReport
from mpp_taichi.contacts.shared.contact_counts import Tally
from mpp_taichi.device import backends


def report(values):
    values = list(values)
    return ContactReport(**dict(zip(SUMS, values)), wall_impulse=tuple(values[len(SUMS) :]))


def grown(totals, looks):
    """The sum of the growths of totals between looks at them."""
    found, before = ContactReport(), ContactReport()
    for look in looks:
        now = report(totals[look])
        found, before = found + now.sums_since(before), now
    return found


def test_growths_add_up_to_the_last_total_however_often_they_are_taken():
    random = np.random.default_rng(1)
    totals = np.cumsum(
        random.standard_normal((200, len(SUMS) + 3)) * 10.0 ** random.uniform(-9, 9, (200, len(SUMS) + 3)), axis=0
    )
    for looks in ([199], range(200), [*range(0, 199, 7), 199]):
        found = grown(totals, looks)
        assert found == report(totals[-1])
        assert found.rests == ()


def test_two_phases_add_up_alike_however_often_they_are_looked_at():
    random = np.random.default_rng(2)
    phases = [np.cumsum(random.standard_normal((50, len(SUMS) + 3)) * scale, axis=0) for scale in (1e8, 1.0, 1e-8)]
    found = {tuple(step): sum((grown(phase, [*step, 49]) for phase in phases), ContactReport()) for step in ([], range(49))}
    once, often = found.values()
    assert once == often
    assert any(once.rests), "the sums of phases need more digits than one float has"
    plain = sum(phase[-1] for phase in phases)
    np.testing.assert_allclose([once.virial, *once.wall_impulse], [plain[0], *plain[len(SUMS) :]], rtol=3 * 2.0**-52)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, 1e308])
def test_sums_that_are_not_finite_end(value):
    found = ContactReport(virial=value) + ContactReport(virial=value)
    np.testing.assert_equal(found.virial, value + value)
    found = found.sums_since(found)
    assert not found.virial == 1.0


@ti.data_oriented
class Counted:
    """A tally to which numbers are added, one in each drift."""

    def __init__(self, wide):
        self.tally = Tally(64, 2, wide, apart=True)

    @ti.kernel
    def add(self, value: float):
        ti.loop_config(serialize=True)
        for i in range(64):
            self.tally.begin(i)
            self.tally.add_pair(i, value, 1.0, 3.0 * value, 0)
            self.tally.add_wall(i, 1, value, 0.0, 0, 0.0)
            self.tally.keep(i, i)


@pytest.mark.parametrize("wide", ["f32", "f64"])
@pytest.mark.sampled(3)
def test_sums_of_many_drifts_keep_the_digits_of_double_precision(wide):
    """In f32 without low parts, 1200 additions of 1/3 would be wrong by some 1e-6 of their sum."""
    backends.start("cpu", "f32")
    counted = Counted(getattr(ti, wide))
    third = float(np.float32(1.0 / 3.0))
    drifts, found = 1200, {}
    for between in (400, 1):
        total = ContactReport()
        for k in range(drifts):
            counted.add(third)
            if k % between == between - 1:
                total += counted.tally.collect()
        found[between] = total
        counted.tally.total_sum.fill(0), counted.tally.total_push.fill(0)
        if wide == "f32":
            counted.tally.low_sum.fill(0), counted.tally.low_push.fill(0)
        counted.tally.collect()
    assert found[1] == found[400]
    wanted = 64 * drifts * third
    # Each addition is right to 2^-53 of the sum, in f32 in two parts to 2^-48.
    np.testing.assert_allclose([found[1].virial, found[1].wall_impulse[1]], wanted, rtol=drifts * 2.0**-48)
    assert (found[1].pair_count, found[1].wall_count) == (64 * drifts, 64 * drifts)
