"""The likelihood against dense matrices, and what it must and must not gain from."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wetwell.sim2real.likelihood.cells import cells_of
from wetwell.sim2real.likelihood.covariance import (
    CHANGING,
    CHANGING_FORM,
    CYCLE_SCALES,
    SHARED_FORM,
    SWING,
    Form,
    no_form,
    projected,
)
from wetwell.sim2real.likelihood.evidence import evidence, evidence_of_none
from wetwell.sim2real.likelihood.flexible import flexible_factor
from wetwell.sim2real.recording.regimes import IDLE, STEADY
from wetwell.sim2real.residuals.bins import FLOW, LEVEL, Bins

CYCLES, EACH = 12, 3


@pytest.fixture(params=[True, False], ids=["metered", "without inflow"])
def cells(request):
    """A flow that runs and a level at rest, three bins a cycle of each, in one span of time."""
    half = CYCLES * EACH
    signal = np.repeat([FLOW, LEVEL], half)
    cycle = np.tile(np.repeat(np.arange(CYCLES), EACH), 2)
    ones = np.ones(2 * half)
    bins = Bins(
        signal=signal,
        regime=np.where(signal == FLOW, STEADY, IDLE),
        cycle=cycle,
        pump=np.where(signal == FLOW, 0, -1),
        second=100 * cycle + np.tile(np.arange(EACH), 2 * CYCLES) // EACH,
        deviation=ones,
        floor=0.8 * ones,
        tolerance=0.1 * ones,
        material=np.where(signal == FLOW, 1.5, 0.7),
    )
    return cells_of(bins, np.zeros(bins.size, dtype=int), has_inflow=request.param)


def dense(cells, form, cycle_sd, offset=1.0, changing=1.0):
    """The covariance, written down."""
    f = form.signature
    diagonal = (
        cells.variance
        + (changing * CHANGING * cells.material) ** 2
        + (CHANGING_FORM * f) ** 2
        + (SWING * form.swinging) ** 2
    )
    together = cells.group[:, None] == cells.group[None, :]
    size = offset * cells.group_material[cells.group]
    whole = np.diag(diagonal) + together * (np.outer(size, size) + SHARED_FORM**2 * np.outer(f, f))
    shared = cells.shares_cycle[:, None] & cells.shares_cycle[None, :]
    return whole + cycle_sd**2 * (shared & (cells.cycle[:, None] == cells.cycle[None, :]))


def some_form(cells, rng):
    return Form(signature=rng.normal(size=cells.group.size), swinging=rng.random(cells.group.size))


def test_products_are_those_of_the_dense_covariance(cells):
    rng = np.random.default_rng(5)
    columns, form = rng.normal(size=(cells.group.size, 3)), some_form(cells, rng)
    found = list(projected(cells, columns, form, 3.0, 2.0))
    scales = CYCLE_SCALES if cells.shares_cycle.any() else (0.0,)
    assert len(found) == len(scales)
    for (products, log_det), scale in zip(found, scales, strict=True):
        whole = dense(cells, form, scale, 3.0, 2.0)
        np.testing.assert_allclose(products, columns.T @ np.linalg.solve(whole, columns), rtol=1e-9)
        assert log_det == pytest.approx(np.linalg.slogdet(whole)[1], rel=1e-9)


def test_the_evidence_of_none_is_a_normal_density(cells):
    residuals = np.random.default_rng(6).normal(size=cells.group.size)
    scales = CYCLE_SCALES if cells.shares_cycle.any() else (0.0,)
    logs = [multivariate_normal(cov=dense(cells, no_form(cells), scale)).logpdf(residuals) for scale in scales]
    expected = np.log(np.mean(np.exp(logs))) + 0.5 * residuals.size * np.log(2.0 * np.pi)
    assert evidence_of_none(cells, residuals).log == pytest.approx(expected, rel=1e-9)


def test_a_parameter_is_integrated_over_its_range(cells):
    """Against a sum over a fine grid of the parameter, whose prior is even over its range."""
    rng = np.random.default_rng(7)
    cells = replace(cells, shares_cycle=np.zeros_like(cells.shares_cycle))
    slope = 40.0 * rng.normal(size=cells.group.size)
    residuals = rng.normal(size=cells.group.size)
    grid = np.linspace(-0.5, 0.5, 20_001)
    density = multivariate_normal(cov=dense(cells, no_form(cells), 0.0))
    logs = density.logpdf(residuals + grid[:, None] * slope)
    best = int(np.argmax(logs))
    expected = float(np.log(np.mean(np.exp(logs - logs[best]))) + logs[best])
    found = evidence(cells, residuals + grid[best] * slope, slope[:, None], no_form(cells))
    assert found.log - 0.5 * residuals.size * np.log(2.0 * np.pi) == pytest.approx(expected, abs=0.1)


def test_an_offset_under_the_material_size_gains_nothing_and_one_over_it_does(cells):
    """However many cycles agree on it."""
    noise = np.sqrt(cells.variance) * np.random.default_rng(8).normal(size=cells.group.size)
    for size, least, most in ((0.5, -np.inf, 1.0), (8.0, 10.0, np.inf)):
        offset = size * cells.material
        with_effect = evidence(cells, noise, offset[:, None], Form(signature=offset, swinging=0.0 * offset)).log
        assert least < with_effect - evidence_of_none(cells, noise + offset).log < most, size


def test_only_what_is_far_over_the_material_size_asks_for_something_unknown(cells):
    noise = np.sqrt(cells.variance) * np.random.default_rng(9).normal(size=cells.group.size)
    assert flexible_factor(cells, noise, no_form(cells)) < 0.0
    assert flexible_factor(cells, noise + 0.7 * cells.material, no_form(cells)) < 0.0
    assert flexible_factor(cells, noise + 12.0 * cells.material, no_form(cells)) > 0.0
    wandering = np.random.default_rng(10).normal(size=cells.group.size) * 12.0 * cells.material
    assert flexible_factor(cells, noise + wandering, no_form(cells)) > 0.0


def test_an_inflow_that_nobody_measures_may_move_a_whole_cycle_of_the_level(cells):
    """The same wandering level is far less of a surprise where nobody knows the inflow."""
    rng = np.random.default_rng(11)
    common = 4.0 * rng.normal(size=CYCLES)[cells.cycle] * (cells.material < 1.0)
    noise = np.sqrt(cells.variance) * rng.normal(size=cells.group.size)
    rise = evidence_of_none(cells, noise).log - evidence_of_none(cells, noise + common).log
    assert (rise < 3.0 * CYCLES) == bool(cells.shares_cycle.any())
