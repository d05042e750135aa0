"""The standard errors of rates of a gas against the scatter of the rates over repeated seeds."""

import numpy as np
import pytest
from repeated_seeds import allowed_share, claims_hold, share_of_scatter

from mpp_taichi import Simulation
from mpp_taichi.diagnostics._gas import BLOCKS, Total

SEEDS = 400
PER_BLOCK = 40  # samples


def of_series(growth):
    """Rate and standard error of a total that grows so from sample to sample, at times 0, 1, 2 …"""
    total = Total()
    for time, value in enumerate([0.0, *np.cumsum(growth)]):
        total.add(float(time), float(value))
    return total.rate(), total.standard_error()


def correlated(random, count, memory):
    """Normal numbers of variance 1 about 3, of which neighbours have the correlation `memory`: an AR(1) series."""
    shocks = random.normal(size=count) * np.sqrt(1.0 - memory**2)
    found = np.empty(count)
    found[0] = random.normal()
    for k in range(1, count):
        found[k] = memory * found[k - 1] + shocks[k]
    return 3.0 + found


def share_of_theory(memory):
    """The variance of the mean of the whole series over the mean of the squares of the claims, from the covariances.

    C is the covariance of the means of the ten blocks. The variance of the mean is 1ᵀC1/100, and the expectation of the claim,
    the variance among blocks over 10, is (tr C − 1ᵀC1/10)/90.
    """
    lags = np.abs(np.subtract.outer(np.arange(BLOCKS * PER_BLOCK), np.arange(BLOCKS * PER_BLOCK)))
    blocks = (memory**lags).reshape(BLOCKS, PER_BLOCK, BLOCKS, PER_BLOCK).mean(axis=(1, 3))
    whole = blocks.sum()
    return (whole / BLOCKS**2) / ((np.trace(blocks) - whole / BLOCKS) / (BLOCKS * (BLOCKS - 1)))


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.8])
def test_the_standard_error_of_a_rate_is_its_scatter_where_blocks_outlast_the_memory(memory):
    """Neighbours of correlation 0.8 remember over 4.5 samples, a ninth of a block: the claim is then short by six per cent.

    The blocks' means are normal, so that a claim has nine degrees of freedom; their small correlation is in the theory.
    """
    random = np.random.default_rng([27, round(10 * memory)])
    found = [of_series(correlated(random, BLOCKS * PER_BLOCK, memory)) for _ in range(SEEDS)]
    theory = share_of_theory(memory)
    assert 1.0 <= theory < 1.3
    assert claims_hold(*np.transpose(found), BLOCKS - 1, truth=theory)


def test_the_claim_is_too_small_where_blocks_are_shorter_than_the_memory():
    """This is the limit that the docstring states: a memory of 200 samples in blocks of 40."""
    random = np.random.default_rng(28)
    found = [of_series(correlated(random, BLOCKS * PER_BLOCK, 0.995)) for _ in range(SEEDS)]
    assert share_of_scatter(*np.transpose(found)) > allowed_share(SEEDS, BLOCKS - 1)[1]


GAS = {"count": 24, "lower": [0, 0], "upper": [4, 4], "radius": 0.15, "speed": 1}
SCENE = {
    "dimensions": 2,
    "seed": 27,
    "particles": [{"gas": GAS}],
    "contacts": {"hard_spheres": {"solver": "event_driven"}},
    "walls": [{"box": {"lower": [0, 0], "upper": [4, 4]}}],
    "integrator": {"event_driven": {"dt": 40.0}},
}
STRETCHES, SAMPLES = 60, 40  # a stretch is 1600 units of time long


def stretch(simulation):
    """Rate and standard error of the collisions, and of the momentum given to walls, in the next stretch of a run."""
    totals = Total(), Total()
    for number in range(SAMPLES + 1):
        if number:
            simulation.run(steps=1)
        report = simulation.contact_report
        for total, count in zip(totals, (report.pair_count, sum(report.wall_impulse))):
            total.add(simulation.time, count)
    return [(total.rate(), total.standard_error()) for total in totals]


@pytest.mark.sampled(3)
def test_the_rates_of_a_gas_scatter_from_stretch_to_stretch_as_each_claims():
    """Stretches of a run stand for seeds.

    A particle collides 1.4 times in a unit of time and crosses the box in four. The momentum of the walls needs long blocks:
    its growth is, in part, the change of a bounded quantity, Σ r·v, which adds the same scatter to the total of a short block
    and of a long block. With the variance A T + B of the total in a time T, the square of the claim from ten blocks is
    (A T + 10 B)/T², too long by 9 B/(A T). In stretches of 100 units of time the claim is 2.9 times the variance, and in these
    the excess, 16 times smaller, is 0.12, which is within what chance allows to 60 stretches.
    """
    with Simulation(SCENE, backend="cpu", precision="f64") as simulation:
        simulation.run(duration=160.0)
        found = np.array([stretch(simulation) for _ in range(STRETCHES)])
    for number, name in enumerate(("collisions", "momentum of walls")):
        assert claims_hold(*found[:, number].T, BLOCKS - 1), name
