"""The sparse regression of a correction against dense algebra, and on residuals whose cause is known."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wetwell.sim2real.correction.bin_covariates import Place
from wetwell.sim2real.correction.dictionary import dictionary
from wetwell.sim2real.correction.means import Means
from wetwell.sim2real.correction.selection import SIZE_PRIOR, TEMPER, Addends, Gram, proposals
from wetwell.sim2real.correction.target import Target, targets_of
from wetwell.simulator.parameters import plant_parameters

CELLS = 240
LOSS, SPEED = (Target(term=term, pump=0, main=0, log_prior=-2.0) for term in ("head_loss", "speed"))


@pytest.fixture
def means():
    """Two bins a cell, a group of twelve cells each."""
    rng = np.random.default_rng(5)
    spread = rng.uniform(0.5, 2.0, CELLS)
    group_material = rng.uniform(0.2, 1.0, CELLS // 12)
    return Means(
        of_bin=np.repeat(np.arange(CELLS), 2),
        counts=np.full(CELLS, 2.0),
        group=np.arange(CELLS) // 12,
        weight=1.0 / spread,
        allowed=np.ones(CELLS),
        group_material=group_material,
        group_wrong=2.0 * group_material,
    )


def covariance(means):
    found = np.diag(1.0 / means.weight)
    for group, size in enumerate(means.group_wrong):
        own = (means.group == group) * 1.0
        found += size**2 * np.outer(own, own)
    return found


def test_products_are_those_of_the_whole_covariance(means):
    columns = np.random.default_rng(1).normal(size=(2 * CELLS, 3))
    cells = columns.reshape(CELLS, 2, 3).mean(axis=1)
    np.testing.assert_allclose(means.of(columns), cells)
    dense = cells.T @ np.linalg.solve(covariance(means), cells)
    np.testing.assert_allclose(means.products(means.of(columns)), dense, rtol=1e-9)


def test_evidence_is_that_of_a_normal_distribution(means):
    rng = np.random.default_rng(2)
    residuals, columns = rng.normal(size=2 * CELLS), rng.normal(size=(2 * CELLS, 2))
    r, a, c = means.of(residuals[:, None])[:, 0], means.of(columns), covariance(means) / TEMPER
    gram = Gram(means.products(np.column_stack([r, a])))
    dense = multivariate_normal.logpdf(r, cov=c + SIZE_PRIOR**2 * a @ a.T) - multivariate_normal.logpdf(r, cov=c)
    log, sizes = gram.gain([0, 1])
    assert log - gram.nothing == pytest.approx(dense, rel=1e-8)
    moved = Gram(means.products(np.column_stack([r + a @ sizes, a])))
    assert moved.at(sizes) == pytest.approx(log, rel=1e-9)
    spread = np.linalg.inv(a.T @ np.linalg.solve(c, a) + np.eye(2) / SIZE_PRIOR**2)
    np.testing.assert_allclose(gram.covariance([0, 1]), spread, rtol=1e-8)


@pytest.fixture
def covariates():
    rng = np.random.default_rng(3)
    hours = np.linspace(0.0, 30.0, 2 * CELLS)
    return {
        Place("level_m"): rng.uniform(0.5, 1.5, 2 * CELLS),
        Place("hour_of_day"): hours % 24.0,
        Place("column", "rain_mm_h"): np.abs(rng.normal(0.0, 4.0, 2 * CELLS)),
    }


@pytest.mark.parametrize("seed", range(6))
def test_term_covariate_and_size_of_a_known_cause_are_found(means, covariates, seed):
    rng = np.random.default_rng([9, seed])
    atoms, left_out = dictionary(covariates, np.ones(2 * CELLS, dtype=bool))
    assert left_out == {}
    slopes = {target: rng.normal(0.0, 60.0, 2 * CELLS) for target in (LOSS, SPEED)}
    wave = 0.2 * np.cos(2.0 * np.pi * (covariates[Place("hour_of_day")] - 5.0) / 24.0)
    residuals = rng.normal(0.0, 1.0, 2 * CELLS) - slopes[SPEED] * wave
    addends = Addends(means, atoms)
    best = proposals(addends, residuals, slopes)[0]
    assert best.target == SPEED
    assert [atom.place for atom in best.atoms] == [Place("hour_of_day")]
    part = best.atoms[0].part(best.sizes[1:])
    assert part.size == pytest.approx(0.2, rel=0.1)
    assert part.centre == pytest.approx(5.0, abs=0.4)


@pytest.mark.parametrize("seed", range(20))
def test_noise_has_no_correction(means, covariates, seed):
    rng = np.random.default_rng([10, seed])
    atoms, _ = dictionary(covariates, np.ones(2 * CELLS, dtype=bool))
    slopes = {target: rng.normal(0.0, 60.0, 2 * CELLS) for target in (LOSS, SPEED)}
    addends = Addends(means, atoms)
    assert proposals(addends, rng.normal(0.0, 1.0, 2 * CELLS), slopes)[0].log < 0.0


def test_columns_that_say_nothing_are_named_with_the_reason(covariates):
    more = {
        Place("column", "constant"): np.full(2 * CELLS, 3.0),
        Place("column", "empty"): np.full(2 * CELLS, np.nan),
        Place("column", "twice"): 2.0 * covariates[Place("column", "rain_mm_h")] + 1.0,
        Place("column", "height"): 100.0 * covariates[Place("level_m")],
    }
    atoms, left_out = dictionary(covariates | more, np.ones(2 * CELLS, dtype=bool))
    assert left_out == {
        "constant": "is constant (3)",
        "empty": "has no values while a pump runs",
        "twice": "is a copy of rain_mm_h (correlation 1.0000)",
        "height": "is a copy of level_m (correlation 1.0000)",
    }
    assert {atom.place for atom in atoms} == set(covariates)


def test_one_pump_is_as_probable_as_all_of_them(alpha):
    targets = targets_of(plant_parameters(alpha))
    assert sum(np.exp(target.log_prior) for target in targets) == pytest.approx(1.0)
    speeds = {one.pump: float(np.exp(one.log_prior)) for one in targets if one.term == "speed"}
    assert speeds == pytest.approx({0: 1.0 / 24.0, 1: 1.0 / 72.0, 2: 1.0 / 72.0, 3: 1.0 / 72.0})
    assert [(one.pump, one.main) for one in targets if one.term == "level_balance"] == [(0, 0)]
