"""F, p and AIC against statsmodels and scipy.stats, and the tail of p against series that do not underflow."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.special import betaln
from statsmodels.regression.linear_model import OLS

from wetwell.detector.statistics.curve_drift import pump_curve_f_test, system_curve_f_test
from wetwell.detector.statistics.f_distribution import log_f_survival
from wetwell.detector.statistics.f_test import nested_f_test
from wetwell.detector.statistics.rolling_f_test import RollingFTest, scan


def statsmodels_answer(null, extra, response):
    """F, log p, AIC of both models; the paper's AIC has no constant term, statsmodels' has m (1 + ln 2 pi)."""
    restricted = OLS(response, null).fit()
    full = OLS(response, np.column_stack([null, extra])).fit()
    f, p, _ = full.compare_f_test(restricted)
    constant = response.size * (1.0 + math.log(2.0 * math.pi))
    return f, math.log(p), restricted.aic - constant, full.aic - constant


def assert_same(test, null, extra, response):
    f, log_p, aic_null, aic_alternative = statsmodels_answer(null, extra, response)
    assert test.f == pytest.approx(f, rel=1e-8)
    assert test.log_p == pytest.approx(log_p, rel=1e-8, abs=1e-8)
    assert test.aic_null == pytest.approx(aic_null, rel=1e-8)
    assert test.aic_alternative == pytest.approx(aic_alternative, rel=1e-8)
    assert test.samples == response.size


def station_window(seed, samples=300, *, loss_m_per_s=0.0):
    """A pump at slowly varying speed on a rising main with a level-driven lift, 1 % noise; curves of the README."""
    rng = np.random.default_rng(seed)
    time_s = 86400.0 + np.arange(float(samples))
    speed = 0.95 + 0.05 * np.sin(time_s / 40.0)
    static_m = 2.0 + 0.5 * np.sin(time_s / 300.0)
    a, b = 6e-4 + 1.3333e-4, 0.02333 * speed
    c = static_m - 36.0 * speed**2 + loss_m_per_s * np.arange(samples)
    flow = (-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    head = static_m + 6e-4 * flow**2
    noise = 1.0 + 0.01 * rng.normal(size=(2, samples))
    return time_s, flow * noise[0], head * noise[1], speed


def scaled(values):
    return (values - values.mean()) / values.std()


def drift_designs(time_s, variable, degree):
    """Reference regressors: centred and scaled, as statsmodels' pseudo-inverse loses digits on raw Q² t."""
    null = np.vander(scaled(variable), degree + 1, increasing=True)
    return null, null * scaled(time_s)[:, None]


@pytest.mark.parametrize("seed", range(20))
def test_random_designs_agree_with_statsmodels(seed):
    rng = np.random.default_rng(seed)
    samples, p0, added = int(rng.integers(12, 400)), int(rng.integers(1, 5)), int(rng.integers(1, 5))
    null = np.column_stack([np.ones(samples), rng.normal(size=(samples, p0 - 1))])
    extra = rng.normal(size=(samples, added))
    response = null.sum(axis=1) + rng.uniform(0, 0.3) * extra[:, 0] + rng.normal(size=samples)
    assert_same(nested_f_test(null, extra, response), null, extra, response)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("loss_m_per_s", [0.0, 0.003])
def test_pump_and_system_windows_agree_with_statsmodels(seed, loss_m_per_s):
    time_s, flow, head, speed = station_window(seed, loss_m_per_s=loss_m_per_s)
    pump_test = pump_curve_f_test(time_s, flow, head, speed)
    assert_same(pump_test, *drift_designs(time_s, flow / speed, 2), head / speed**2)
    assert_same(system_curve_f_test(time_s, flow, head), *drift_designs(time_s, flow**2, 1), head)


def test_f_agrees_with_the_wald_form_of_statsmodels():
    time_s, flow, head, speed = station_window(3)
    null, extra = drift_designs(time_s, flow / speed, 2)
    fit = OLS(head / speed**2, np.column_stack([null, extra])).fit()
    wald = fit.f_test(np.eye(6)[3:])
    test = pump_curve_f_test(time_s, flow, head, speed)
    assert test.f == pytest.approx(float(wald.fvalue), rel=1e-8)
    assert math.exp(test.log_p) == pytest.approx(float(wald.pvalue), rel=1e-8)


def test_units_and_origin_of_columns_do_not_matter():
    time_s, flow, head, speed = station_window(5)
    test = pump_curve_f_test(time_s, flow, head, speed)
    shifted = pump_curve_f_test((time_s - 1e6) / 3600.0, flow / 3600.0, head, speed)
    raw = np.vander(flow / speed / 1e5, 3, increasing=True)
    raw_test = nested_f_test(raw, raw * (time_s - time_s[0])[:, None], head / speed**2)
    assert shifted.f == pytest.approx(test.f, rel=1e-8)
    assert raw_test.f == pytest.approx(test.f, rel=1e-8)
    assert raw_test.aic_alternative == pytest.approx(test.aic_alternative, rel=1e-8)


@pytest.mark.parametrize("d1", [1, 2, 3, 5, 12])
@pytest.mark.parametrize("d2", [1, 4, 44, 294, 5000])
def test_log_p_agrees_with_scipy_where_that_is_finite(d1, d2):
    checked = 0
    for f in np.geomspace(1e-3, 1e6, 60):
        expected = float(stats.f.logsf(f, d1, d2))
        if expected > -690.0:
            assert log_f_survival(float(f), d1, d2) == pytest.approx(expected, rel=1e-9, abs=1e-13)
            checked += 1
    assert checked > 25


@pytest.mark.parametrize("d2", [4, 44, 294, 20000])
@pytest.mark.parametrize("f", [0.1, 10.0, 1e4, 1e12, 1e25])
def test_log_p_of_two_and_four_degrees_is_the_closed_form(f, d2):
    log_x = -math.log1p(2.0 * f / d2)
    assert log_f_survival(f, 2, d2) == pytest.approx(d2 / 2.0 * log_x, rel=1e-12)
    log_x4 = -math.log1p(4.0 * f / d2)
    closed = d2 / 2.0 * log_x4 + math.log1p(-d2 / 2.0 * math.expm1(log_x4))
    assert log_f_survival(f, 4, d2) == pytest.approx(closed, rel=1e-11)


def log_p_by_positive_series(f, d1, d2):
    """ln I_x(a, b) by x^a (1 - x)^b / (a B) * sum of (a + b)_n / (a + 1)_n x^n, all terms positive."""
    a, b = d2 / 2.0, d1 / 2.0
    log_x, log_rest = -math.log1p(d1 * f / d2), -math.log1p(d2 / (d1 * f))
    n = np.arange(60000.0)
    series = 1.0 + np.cumprod((a + b + n) / (a + 1.0 + n) * math.exp(log_x)).sum()
    return a * log_x + b * log_rest - math.log(a) - float(betaln(a, b)) + math.log(series)


@pytest.mark.parametrize("d1", [1, 3, 5, 40, 301])
@pytest.mark.parametrize("d2", [44, 294, 3000, 20000])
def test_log_p_far_in_the_tail_agrees_with_another_series(d1, d2):
    smallest = 0.0
    for f in np.geomspace(20.0, 1e9, 40):
        expected = log_p_by_positive_series(float(f), d1, d2)
        smallest = min(smallest, expected)
        assert log_f_survival(float(f), d1, d2) == pytest.approx(expected, rel=1e-10)
    assert smallest < -350.0
    if d2 == 20000:
        assert smallest < -1e5


def test_log_p_falls_without_a_step_where_the_series_takes_over():
    for d1, d2 in [(1, 30), (3, 294), (3, 20000), (200, 400)]:
        values = np.array([log_f_survival(float(f), d1, d2) for f in np.geomspace(1e-4, 1e15, 3000)])
        assert np.isfinite(values).all()
        assert (np.diff(values) <= 0.0).all()
        steps = np.diff(values[values < -300.0])
        if steps.size > 2:
            assert (np.abs(np.diff(steps)) < 0.1 * np.abs(steps[1:]) + 1e-9).all()
    assert log_f_survival(0.0, 3, 20) == 0.0


def test_false_rejections_under_the_null_are_as_many_as_promised():
    rng = np.random.default_rng(11)
    flow = 200.0 + 10.0 * rng.normal(size=(2000, 50))
    head = 36.0 - 1.3e-4 * flow**2 + 0.2 * rng.normal(size=flow.shape)
    tests = [pump_curve_f_test(np.arange(50.0), q, h, np.ones(50)) for q, h in zip(flow, head, strict=True)]
    rejected = sum(test.log_p < math.log(0.05) for test in tests)
    assert 70 <= rejected <= 130  # 100 expected, three standard deviations


def test_dependent_columns_do_not_count_as_parameters():
    rng = np.random.default_rng(2)
    t = np.arange(40.0)
    null, extra, response = np.ones((40, 1)), t[:, None], 3.0 + 0.1 * t + rng.normal(size=40)
    plain = nested_f_test(null, extra, response)
    doubled = nested_f_test(
        np.column_stack([null, 2.0 * null, np.zeros(40)]), np.column_stack([null, extra, 5.0 - extra]), response
    )
    assert doubled.f == pytest.approx(plain.f, rel=1e-9)
    assert doubled.aic_null == pytest.approx(plain.aic_null, rel=1e-9)
    assert doubled.aic_alternative == pytest.approx(plain.aic_alternative, rel=1e-9)
    nothing_added = nested_f_test(null, 2.0 * null, response)
    assert (nothing_added.f, nothing_added.log_p) == (0.0, 0.0)
    assert nothing_added.aic_null == nothing_added.aic_alternative


def test_constant_flow_leaves_a_test_of_the_offset_alone():
    rng = np.random.default_rng(4)
    t = np.arange(60.0)
    head = 20.0 + 0.05 * t + rng.normal(size=60)
    expected = nested_f_test(np.ones((60, 1)), t[:, None], head)
    for test in (
        pump_curve_f_test(t, np.full(60, 180.7), head, np.ones(60)),
        system_curve_f_test(t, np.full(60, 180.7), head),
    ):
        assert test.f == pytest.approx(expected.f, rel=1e-9)
        assert test.aic_alternative == pytest.approx(expected.aic_alternative, rel=1e-9)


def test_perfect_fits_and_empty_motion_give_finite_answers():
    t = np.arange(30.0)
    flow = 150.0 + 20.0 * np.sin(t)
    healthy = pump_curve_f_test(t, flow, 36.0 - 1e-4 * flow**2, np.ones(30))
    drifting = pump_curve_f_test(t, flow, 36.0 - 0.1 * t - 1e-4 * flow**2, np.ones(30))
    standing = system_curve_f_test(np.zeros(30), np.zeros(30), np.zeros(30))
    assert (healthy.f, healthy.log_p) == (0.0, 0.0)
    assert drifting.f > 1e18
    assert drifting.log_p < -400.0
    assert drifting.aic_alternative < drifting.aic_null
    assert standing.f == 0.0
    for test in (healthy, drifting, standing):
        assert all(map(math.isfinite, (test.f, test.log_p, test.aic_null, test.aic_alternative)))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("column", range(4))
def test_values_that_are_not_finite_are_refused(bad, column):
    window = [values.copy() for values in station_window(1, 20)]
    window[column][7] = bad
    with pytest.raises(ValueError, match="finite"):
        pump_curve_f_test(*window)
    if column < 3:
        with pytest.raises(ValueError, match="finite"):
            system_curve_f_test(*window[:3])
        with pytest.raises(ValueError, match="finite"):
            nested_f_test(np.ones((20, 1)), window[column][:, None], np.ones(20))


def test_wrong_shapes_speeds_and_too_few_samples_are_refused():
    window = station_window(1, 7)
    assert pump_curve_f_test(*window).samples == 7
    with pytest.raises(ValueError, match="samples must exceed the 6 parameters of the alternative, got 6"):
        pump_curve_f_test(*(values[:6] for values in window))
    with pytest.raises(ValueError, match="samples must exceed the 4 parameters"):
        system_curve_f_test(*(values[:4] for values in window[:3]))
    with pytest.raises(ValueError, match="head_m must be one-dimensional"):
        pump_curve_f_test(window[0], window[1], window[2][:5], window[3])
    with pytest.raises(ValueError, match="speed_ratio must be positive, got 0"):
        pump_curve_f_test(*window[:3], np.zeros(7))
    with pytest.raises(ValueError, match="must agree in m"):
        nested_f_test(np.ones((5, 1)), np.ones((6, 1)), np.ones(5))
    with pytest.raises(ValueError, match="samples must exceed"):
        pump_curve_f_test([], [], [], [])


def assert_close(test, expected):
    for name in ("f", "log_p", "aic_null", "aic_alternative", "samples"):
        assert getattr(test, name) == pytest.approx(getattr(expected, name), rel=1e-8, abs=1e-8), name


def test_rolling_is_the_window_computed_from_scratch_at_every_step_with_a_spike_passing_through():
    window = 50
    time_s, flow, head, speed = station_window(8, 260)
    flow[90], head[120] = 1e7, -1e7
    rolling = RollingFTest(window)
    for n in range(260):
        rolling.update(time_s[n], flow[n], head[n], speed[n])
        tests = rolling.value()
        part = slice(max(0, n + 1 - window), n + 1)
        if n + 1 < 7:
            assert tests is None
            continue
        assert_close(tests.pump, pump_curve_f_test(time_s[part], flow[part], head[part], speed[part]))
        assert_close(tests.system, system_curve_f_test(time_s[part], flow[part], head[part]))
        assert math.isfinite(tests.pump.log_p + tests.pump.aic_null + tests.system.log_p + tests.system.aic_null)


@pytest.mark.parametrize("spiked", ["flow", "head", "both"])
def test_rolling_agrees_with_statsmodels_after_a_spike_has_left(spiked):
    window = 60
    time_s, flow, head, speed = station_window(12, 200, loss_m_per_s=0.002)
    seen_flow, seen_head = flow.copy(), head.copy()
    if spiked != "head":
        seen_flow[99] = 1e7
    if spiked != "flow":
        seen_head[99] = 1e7
    rolling = RollingFTest(window)
    for n in range(200):
        rolling.update(time_s[n], seen_flow[n], seen_head[n], speed[n])
        if n < 99 + window or (n + 1) % 10:
            continue
        part = slice(n + 1 - window, n + 1)
        tests = rolling.value()
        pump_head = head[part] / speed[part] ** 2
        assert_same(tests.pump, *drift_designs(time_s[part], flow[part] / speed[part], 2), pump_head)
        assert_same(tests.system, *drift_designs(time_s[part], flow[part] ** 2, 1), head[part])


def test_a_spike_that_has_left_leaves_no_trace_and_a_refused_sample_none_either():
    time_s, flow, head, speed = station_window(9, 160)
    clean, hit = RollingFTest(60), RollingFTest(60)
    for n in range(160):
        clean.update(time_s[n], flow[n], head[n], speed[n])
        hit.update(time_s[n], 1e7 if n == 99 else flow[n], head[n], speed[n])
        for bad in ((math.nan, 20.0, 1.0), (200.0, math.inf, 1.0), (200.0, 20.0, 0.0), (200.0, 20.0, math.nan)):
            with pytest.raises(ValueError, match="a sample must be finite"):
                hit.update(time_s[n], *bad)
        if n >= 99:
            assert (clean.value().pump.f == pytest.approx(hit.value().pump.f, rel=1e-8)) == (n >= 159)
    assert_close(hit.value().pump, clean.value().pump)
    assert_close(hit.value().system, clean.value().system)
    assert clean.value().pump.samples == 60


def test_rolling_restores_from_its_samples_and_takes_the_total_flow():
    time_s, flow, head, speed = station_window(10, 120)
    rolling = RollingFTest(80)
    for n in range(120):
        rolling.update(time_s[n], flow[n], head[n], speed[n], total_flow_m3h=1.5 * flow[n] + math.sin(n))
    restored = RollingFTest(80)
    for row in rolling.samples().T:
        restored.update(*row.tolist())
    total = 1.5 * flow[40:] + np.sin(np.arange(40.0, 120.0))
    assert_close(restored.value().pump, rolling.value().pump)
    assert rolling.value().system.f == pytest.approx(system_curve_f_test(time_s[40:], total, head[40:]).f, rel=1e-10)
    with pytest.raises(ValueError, match="window_samples must be 7 or more, got 6"):
        RollingFTest(6)


@pytest.mark.parametrize("gap_s", [0.0, 1e3, 1e6])
@pytest.mark.parametrize("window", [20, 60, 300])
def test_a_scan_agrees_with_statsmodels_at_every_sample_across_spikes_and_pauses(window, gap_s):
    time_s, flow, head, speed = station_window(13, 1500, loss_m_per_s=0.0005)
    time_s[700:] += gap_s
    flow[300], head[400], flow[800], head[800] = 1e7, 1e7, -1e7, 1e7
    figures = scan(np.array([time_s, flow, head, speed, 1.1 * flow]), window)
    assert np.isnan(figures[:6]).all()
    assert np.isfinite(figures[6:]).all()
    spiked = np.isin(np.arange(1500), [300, 400, 800])
    checked = 0
    for n in range(window - 1, 1500, 7):
        part = slice(n + 1 - window, n + 1)
        if spiked[part].any():
            continue  # statsmodels' pseudo-inverse loses the digits itself; see the window computed from scratch
        checked += 1
        designs = (
            (*drift_designs(time_s[part], flow[part] / speed[part], 2), head[part] / speed[part] ** 2),
            (*drift_designs(time_s[part], (1.1 * flow[part]) ** 2, 1), head[part]),
        )
        for found, design in zip(figures[n], designs, strict=True):
            np.testing.assert_allclose(found, statsmodels_answer(*design), rtol=1e-8, atol=1e-8)
    assert checked > 60
