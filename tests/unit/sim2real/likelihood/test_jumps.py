"""Jumps of an inflow without a meter: learnt at rest, told apart cell by cell."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.likelihood.cells import Jumps, cells_of
from wetwell.sim2real.likelihood.covariance import expected_squares, no_form
from wetwell.sim2real.likelihood.evidence import evidence_of_none
from wetwell.sim2real.likelihood.flexible import flexible_factor
from wetwell.sim2real.likelihood.jumps import jumping, with_jumps
from wetwell.sim2real.recording.regimes import IDLE, STEADY
from wetwell.sim2real.residuals.bins import LEVEL, NO_PUMP, Bins

CYCLES = 60
SECONDS_S = (0, 30, 70, 100, 130, 170)
BETWEEN = Jumps(probability=0.12, quiet=0.06, jumping=8.0)


def level(regime=IDLE):
    """A level in bins of half a minute, three of them more than a minute after the regime began."""
    cycle = np.repeat(np.arange(CYCLES), len(SECONDS_S))
    ones = np.ones(cycle.size)
    bins = Bins(
        signal=np.full(cycle.size, LEVEL),
        regime=np.full(cycle.size, regime),
        cycle=cycle,
        pump=np.full(cycle.size, NO_PUMP),
        second=1000 * cycle + np.tile(SECONDS_S, CYCLES),
        deviation=ones,
        floor=0.95 * ones,
        tolerance=0.05 * ones,
        material=0.1 * ones,
    )
    return bins, cells_of(bins, np.zeros(bins.size, dtype=int), has_inflow=False, is_each_second=True)


def errors(bins, seed, jumps=BETWEEN):
    rng = np.random.default_rng(seed)
    jumped = rng.random(bins.size) < jumps.probability
    return rng.normal(size=bins.size) * np.sqrt(np.where(jumped, jumps.jumping, jumps.quiet)), jumped


def factor(cells, residuals):
    return flexible_factor(evidence_of_none(cells, residuals), no_form(cells))


def test_jumps_are_learnt_as_they_are():
    found = []
    for seed in range(20):
        bins, cells = level()
        (block,) = with_jumps(cells, bins, errors(bins, seed)[0]).blocks
        found.append([block.jumps.probability, block.jumps.quiet, block.jumps.jumping])
    assert np.median(found, axis=0) == pytest.approx([BETWEEN.probability, BETWEEN.quiet, BETWEEN.jumping], rel=0.25)


def test_an_inflow_that_wanders_evenly_jumps_nowhere():
    told = 0
    for seed in range(40):
        bins, cells = level()
        residuals = np.random.default_rng(seed).normal(size=bins.size)
        told += with_jumps(cells, bins, residuals) is not cells
    assert told <= 2


@pytest.mark.parametrize("regime", [IDLE, STEADY])
def test_without_a_rest_none_are_learnt(regime):
    bins, _ = level(regime)
    early = replace(bins, second=1000 * bins.cycle + np.tile(np.arange(len(SECONDS_S)), CYCLES))
    cells = cells_of(early, np.zeros(bins.size, dtype=int), has_inflow=False, is_each_second=True)
    assert with_jumps(cells, early, errors(early, 1)[0]) is cells


def test_what_pumps_move_teaches_nothing_of_jumps():
    """A minute after the stop the level shows the inflow alone; before that it may show what is wrong with a pump."""
    bins, cells = level()
    residuals = errors(bins, 3)[0]
    changed = np.where(np.tile(SECONDS_S, CYCLES) < 60, 40.0, residuals)
    assert with_jumps(cells, bins, residuals).blocks[0].jumps == with_jumps(cells, bins, changed).blocks[0].jumps


def test_jumps_are_summed_over_as_they_would_be_cell_by_cell():
    bins, cells = level()
    block = replace(cells.blocks[0], jumps=BETWEEN, surge=1.0)
    residuals, _ = errors(bins, 5)
    means = cells.means(residuals)
    found, unsure = jumping(block, means)
    logs = []
    for times in (BETWEEN.quiet, BETWEEN.jumping):
        expected = expected_squares(replace(block, variance=times * block.variance)) + block.of_inflow
        logs.append(-0.5 * (means**2 / expected + np.log(expected)))
    either = np.logaddexp(logs[0] + np.log(1.0 - BETWEEN.probability), logs[1] + np.log(BETWEEN.probability))
    is_jump = found.variance > block.variance
    assert is_jump.any()
    assert unsure == pytest.approx(float(np.sum(either - np.where(is_jump, logs[1], logs[0]))))
    assert np.allclose(found.of_inflow, block.variance)


def test_jumps_of_one_sign_are_no_error_of_the_model_and_an_error_of_the_model_is_no_jump():
    bins, cells = level(STEADY)
    block = replace(cells.blocks[0], jumps=BETWEEN)
    cells = replace(cells, blocks=(block,))
    residuals, jumped = errors(bins, 7)
    fell = np.where(jumped, -np.abs(residuals), residuals)
    assert factor(cells, cells.means(fell)) < 0.0
    assert factor(cells, cells.means(residuals + 1.0)) > 5.0
