"""The likelihood against dense matrices, and what it must and must not gain from."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wetwell.sim2real.likelihood.cells import cells_of
from wetwell.sim2real.likelihood.covariance import GOOD, OFFSET, POOR, SWING, Allowance, Form, no_form, projected
from wetwell.sim2real.likelihood.evidence import POORLY, evidence, evidence_of_none
from wetwell.sim2real.likelihood.flexible import flexible_factor
from wetwell.sim2real.recording.regimes import IDLE, STEADY
from wetwell.sim2real.residuals.bins import FLOW, LEVEL, Bins

CYCLES, EACH = 12, 3


@pytest.fixture
def cells():
    """As `made`, with a meter of the inflow."""
    return made(has_inflow=True)


def made(*, has_inflow):
    """A flow that runs and a level at rest: two spans of time in a cycle, the first of one bin, the next of two."""
    half = CYCLES * EACH
    signal = np.repeat([FLOW, LEVEL], half)
    cycle = np.tile(np.repeat(np.arange(CYCLES), EACH), 2)
    ones = np.ones(2 * half)
    bins = Bins(
        signal=signal,
        regime=np.where(signal == FLOW, STEADY, IDLE),
        cycle=cycle,
        pump=np.where(signal == FLOW, 0, -1),
        second=1000 * cycle + np.tile([0, 70, 80], 2 * CYCLES),
        deviation=ones,
        floor=0.8 * ones,
        tolerance=0.1 * ones,
        material=np.where(signal == FLOW, 1.5, 0.7),
    )
    return cells_of(bins, np.zeros(bins.size, dtype=int), has_inflow=has_inflow)


def dense(block, form, allowance):
    """The covariance, written down."""
    f, allowed = form.signature, block.allowed
    changing = 0.5 * ((allowance.change * allowed) ** 2 + block.surge * block.variance)
    in_cycle = np.sqrt(changing + (SWING * form.swinging) ** 2)
    whole = np.diag(block.variance + changing + (allowance.changing_form * f) ** 2)
    whole += (block.cycle[:, None] == block.cycle[None, :]) * np.outer(in_cycle, in_cycle)
    shared = 0.5 * (1.0 + (block.group[:, None] == block.group[None, :]))
    return whole + shared * (allowance.offset**2 * np.outer(allowed, allowed) + allowance.form**2 * np.outer(f, f))


def some_form(cells, rng):
    return Form(signature=rng.normal(size=cells.group.size), swinging=rng.random(cells.group.size))


def test_cells_are_the_means_of_spans_in_cycles(cells):
    assert len(cells.blocks) == 2
    assert sorted(np.concatenate([block.rows for block in cells.blocks]).tolist()) == list(range(4 * CYCLES))
    np.testing.assert_allclose(np.sort(np.unique(cells.variance)), [0.4, 0.8])
    np.testing.assert_allclose(np.unique(cells.allowed.round(9)), np.hypot([0.7, 1.5], np.sqrt(0.2)).round(9))


@pytest.mark.parametrize(
    "allowance", [GOOD, POOR, Allowance(offset=3.0, change=2.0, form=0.3, changing_form=0.7)], ids=str
)
@pytest.mark.parametrize("has_form", [True, False])
@pytest.mark.parametrize("surge", [0.0, 3.0])
def test_products_are_those_of_the_dense_covariance(cells, allowance, has_form, surge):
    rng = np.random.default_rng(5)
    columns, form = rng.normal(size=(cells.group.size, 3)), some_form(cells, rng) if has_form else no_form(cells)
    for without in cells.blocks:
        block = replace(without, surge=surge)
        own = form.chosen(block.rows)
        products, log_det = projected(block, columns[block.rows], own, allowance)
        whole = dense(block, own, allowance)
        expected = columns[block.rows].T @ np.linalg.solve(whole, columns[block.rows])
        np.testing.assert_allclose(products, expected, rtol=1e-9)
        assert log_det == pytest.approx(np.linalg.slogdet(whole)[1], rel=1e-9)


def log_densities(cells, residuals):
    """Of each way in which groups may be poor, block by block, but for the factors of 2π: (blocks, ways, ...)."""
    found = []
    for block in cells.blocks:
        ways = []
        for poor in product((False, True), repeat=int(block.group.max()) + 1):
            is_poor = np.array(poor)
            loose = replace(block, allowed=np.where(is_poor[block.group], 1.0 / OFFSET, 1.0) * block.allowed)
            density = multivariate_normal(cov=dense(loose, no_form(cells).chosen(block.rows), GOOD))
            log = density.logpdf(residuals[..., block.rows]) + 0.5 * block.rows.size * np.log(2.0 * np.pi)
            ways.append(log + is_poor.sum() * np.log(POORLY) + (~is_poor).sum() * np.log(1.0 - POORLY))
        found.append(ways)
    return np.array(found)


@pytest.mark.parametrize("poor", [0.0, 4.0], ids=["good", "one group poor"])
def test_the_evidence_of_none_is_that_of_the_likeliest_way_to_be_poor(cells, poor):
    residuals = 0.5 * np.sqrt(cells.variance) * np.random.default_rng(6).normal(size=cells.group.size)
    residuals += poor * cells.allowed * (cells.group == 1)
    ways = log_densities(cells, residuals)
    assert int(np.argmax(ways, axis=1).sum() > 0) == int(poor > 0.0)
    assert evidence_of_none(cells, residuals).log == pytest.approx(ways.max(axis=1).sum(), rel=1e-9)


def test_a_parameter_is_integrated_over_its_range(cells):
    """Against a sum over a fine grid of the parameter, whose prior is even over its range."""
    rng = np.random.default_rng(7)
    slope = 40.0 * rng.normal(size=cells.group.size)
    residuals = 0.5 * rng.normal(size=cells.group.size)
    grid = np.linspace(-0.5, 0.5, 20_001)
    logs = log_densities(cells, residuals + grid[:, None] * slope)[:, 0].sum(axis=0)
    best = int(np.argmax(logs))
    expected = float(np.log(np.mean(np.exp(logs - logs[best]))) + logs[best])
    found = evidence(cells, residuals + grid[best] * slope, slope[:, None], no_form(cells))
    assert found.log == pytest.approx(expected, abs=0.1)
    inner = np.exp(logs - logs[best])
    variance = float(np.sum(inner * (grid - grid[best]) ** 2) / inner.sum())
    assert 1.0 / found.precision[0, 0] == pytest.approx(variance, rel=0.2)


def test_an_offset_under_the_allowed_size_gains_little_and_one_over_it_does(cells):
    """However many cycles agree on it."""
    noise = np.sqrt(cells.variance) * np.random.default_rng(8).normal(size=cells.group.size)
    for size, least, most in ((0.3, -np.inf, 1.0), (8.0, 10.0, np.inf)):
        offset = size * cells.allowed
        with_effect = evidence(cells, noise, offset[:, None], Form(signature=offset, swinging=0.0 * offset)).log
        assert least < with_effect - evidence_of_none(cells, noise + offset).log < most, size


def test_only_what_is_far_over_the_allowed_size_asks_for_something_unknown(cells):
    rng = np.random.default_rng(9)
    noise = np.sqrt(cells.variance) * rng.normal(size=cells.group.size)

    def factor(residuals):
        return flexible_factor(cells, evidence_of_none(cells, residuals), no_form(cells))

    assert factor(noise) < 0.0
    assert factor(noise + 0.7 * cells.allowed) < 0.0
    assert factor(noise + 12.0 * cells.allowed) > 0.0
    assert factor(noise + 12.0 * rng.normal(size=cells.group.size) * cells.allowed) > 0.0


def test_an_error_of_a_whole_cycle_is_less_of_a_surprise_than_as_many_of_single_cells(cells):
    rng = np.random.default_rng(11)
    level = next(block for block in cells.blocks if block.signal == LEVEL)
    shared, single = np.zeros(cells.group.size), np.zeros(cells.group.size)
    shared[level.rows] = np.repeat(2.0, level.rows.size) * rng.choice([-1.0, 1.0], CYCLES)[level.cycle]
    single[level.rows] = 2.0 * rng.choice([-1.0, 1.0], level.rows.size)
    assert evidence_of_none(cells, shared).log > evidence_of_none(cells, single).log


def test_surges_of_an_inflow_without_a_meter_are_no_surprise_in_the_level_and_one_in_the_flow():
    with_meter, without = made(has_inflow=True), made(has_inflow=False)
    noise = np.random.default_rng(12).normal(size=with_meter.group.size) * np.sqrt(with_meter.variance)
    for signal, gains in ((LEVEL, True), (FLOW, False)):
        (rows,) = [block.rows for block in with_meter.blocks if block.signal == signal]
        residuals = noise.copy()
        residuals[rows] *= 2.5
        gain = evidence_of_none(without, residuals).log - evidence_of_none(with_meter, residuals).log
        assert (gain > 1.0) == gains
        factors = [
            flexible_factor(each, evidence_of_none(each, residuals), no_form(each)) for each in (with_meter, without)
        ]
        assert (factors[1] < factors[0] - 0.1) == gains
