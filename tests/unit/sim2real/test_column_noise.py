"""Errors of a user's column against those that were put in, and the smoother against that of statsmodels."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from statsmodels.tsa.statespace.structural import UnobservedComponents

from wetwell.sim2real.recording.column_noise import course_of, noise_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.simulator.corrections.parts import Column
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SECONDS = 7200


@pytest.fixture(scope="module")
def made(quiet_alpha):
    return replace(
        Simulation(quiet_alpha, Scenario(name="h", initial_level_m=1.5), seed=4).advance(SECONDS), truth={}
    )


def traces_with(made, station, values, every=1, value="instant"):
    columns = {**made.columns, "covariate_rain_mm_h": values}
    rows = slice(every - 1, None, every)
    columns = {name: column[rows] for name, column in columns.items()}
    return traces_of(replace(made, time_ns=made.time_ns[rows], columns=columns, value=value), station)


def walk(seed, step=0.1):
    return np.cumsum(np.random.default_rng(seed).normal(0.0, step, SECONDS))


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("seed", range(3))
def test_noise_is_what_was_put_in(made, quiet_alpha, seed, every):
    errors = np.random.default_rng([1, seed]).normal(0.0, 2.0, SECONDS)
    traces = traces_with(made, quiet_alpha, walk(seed) + errors, every)
    assert noise_of(traces, "rain_mm_h") == pytest.approx(2.0, rel=0.12)


def test_what_only_wanders_or_stands_has_next_to_none(made, quiet_alpha):
    assert noise_of(traces_with(made, quiet_alpha, walk(1)), "rain_mm_h") < 0.02
    stairs = np.repeat(np.cumsum(np.random.default_rng(2).normal(size=SECONDS // 300)), 300)
    assert noise_of(traces_with(made, quiet_alpha, stairs), "rain_mm_h") < 0.7


def test_a_gauge_that_tells_every_five_minutes_has_the_errors_of_its_values(made, quiet_alpha):
    rng = np.random.default_rng(3)
    gauge = np.repeat(walk(3)[::60] + rng.normal(0.0, 2.0, SECONDS // 60), 60)
    traces = traces_with(made, quiet_alpha, gauge)
    assert noise_of(traces, "rain_mm_h") == pytest.approx(2.0, rel=0.25)
    smooth = course_of(traces, Column(name="rain_mm_h", noise=2.0))
    assert np.std(smooth - np.repeat(walk(3)[::60], 60)) < 0.7 * np.std(gauge - np.repeat(walk(3)[::60], 60))
    assert np.all(np.diff(smooth.reshape(-1, 60)[:, 5:-5], axis=1) == 0.0)


def test_smoother_is_that_of_a_local_level(made, quiet_alpha):
    values = walk(4) + np.random.default_rng(5).normal(0.0, 1.0, SECONDS)
    found = course_of(traces_with(made, quiet_alpha, values), Column(name="rain_mm_h", noise=1.0))
    model = UnobservedComponents(values, level="local level")
    best = minimize_scalar(lambda log: -model.loglike([1.0, np.exp(log)]), bounds=(-9.0, 0.0), method="bounded")
    expected = model.smooth([1.0, np.exp(best.x)]).level.smoothed
    np.testing.assert_allclose(found[200:-200], expected[200:-200], atol=0.02)
    np.testing.assert_allclose(found, expected, atol=0.4)


def test_without_errors_a_column_is_as_it_was(made, quiet_alpha):
    traces = traces_with(made, quiet_alpha, walk(6))
    assert course_of(traces, Column(name="rain_mm_h")) is traces.columns["rain_mm_h"]


@pytest.mark.parametrize("value", ["instant", "mean"])
def test_slow_rows_are_smoothed_as_rows(made, quiet_alpha, value):
    values = walk(7) + np.random.default_rng(8).normal(0.0, 2.0, SECONDS)
    traces = traces_with(made, quiet_alpha, values, 10, value)
    smooth = course_of(traces, Column(name="rain_mm_h", noise=2.0))
    assert np.isfinite(smooth).all()
    raw = traces.columns["rain_mm_h"]
    truth = walk(7)[: traces.seconds]
    assert np.std(smooth - truth) < 0.6 * np.std(raw - truth)


def test_where_a_part_lacks_the_column_nothing_is_made_up(made, quiet_alpha):
    traces = traces_with(made, quiet_alpha, walk(9))
    course = traces.columns["rain_mm_h"].copy()
    course[2000:3000] = np.nan
    traces = replace(traces, columns={"rain_mm_h": course})
    smooth = course_of(traces, Column(name="rain_mm_h", noise=0.3))
    assert np.array_equal(np.isnan(smooth), np.isnan(course))
