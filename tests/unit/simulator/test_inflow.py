"""Inflow models against their own definitions. Seeds are fixed; bounds are those of the statistics named."""

import math

import numpy as np
import pytest
from scipy import stats

from wetwell.simulator.inflow.catchment import HOURS, CatchmentInflow
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.empirical import PAPER_QUANTILES, EmpiricalInflow
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.inflow.surges import Surges

NO_SURGES = Surges(rate_per_s=0)


def taken(inflow, seconds, seed=1):
    return inflow.stream(np.random.default_rng(seed)).next_seconds(seconds)


@pytest.mark.parametrize("quantiles", [PAPER_QUANTILES, ((0.0, 5.0), (0.2, 30.0), (1.0, 40.0))])
def test_empirical_draws_follow_the_table(quantiles):
    """Kolmogorov distance under its 1 % point, 1.63 / sqrt(n)."""
    draws_m3h = taken(EmpiricalInflow(quantiles=quantiles, surges=NO_SURGES), 200_000)
    probabilities, flows_m3h = np.array(quantiles).T
    result = stats.kstest(draws_m3h, lambda flow: np.interp(flow, flows_m3h, probabilities))
    assert result.statistic < 1.63 / math.sqrt(200_000)


def test_empirical_default_has_the_quantiles_of_the_paper():
    """0.016, 0.032 and 0.040 m³/s, to five errors of a quantile: sqrt(p (1 - p) / n) / density."""
    draws_m3h = taken(EmpiricalInflow(surges=NO_SURGES), 400_000)
    for probability, flow_m3s, density in (
        (0.5, 0.016, 0.45 / 57.6),
        (0.95, 0.032, 0.04 / 28.8),
        (0.99, 0.040, 0.01 / 36.0),
    ):
        error_m3h = math.sqrt(probability * (1 - probability) / 400_000) / density
        assert np.quantile(draws_m3h, probability) == pytest.approx(3600 * flow_m3s, abs=5 * error_m3h)


def test_empirical_draws_are_independent():
    draws_m3h = taken(EmpiricalInflow(surges=NO_SURGES), 100_000)
    correlation = np.corrcoef(draws_m3h[1:], draws_m3h[:-1])[0, 1]
    assert abs(correlation) < 4 / math.sqrt(100_000)


def test_surges_arrive_as_a_poisson_process():
    """Pulses of one second count the arrivals: number within four standard deviations, gaps exponential."""
    rate_per_s, seconds = 5e-3, 1_000_000
    surges = Surges(rate_per_s=rate_per_s, flow_m3h=30.0, duration_s=1)
    arrivals = surges.stream(np.random.default_rng(2)).next_seconds(seconds) / 30.0
    expected = rate_per_s * seconds
    assert arrivals.sum() == pytest.approx(expected, abs=4 * math.sqrt(expected))
    gaps_s = np.diff(np.flatnonzero(arrivals))
    # Gaps of whole seconds are geometric; jittered inside the second they are exponential to 1e-3.
    jitter_s = np.random.default_rng(3).random(gaps_s.size) - 0.5
    assert stats.kstest(gaps_s + jitter_s, stats.expon(scale=1 / rate_per_s).cdf).pvalue > 0.01


def test_surges_add_up_to_rate_times_volume():
    """Total volume is Poisson(rate · T) pulses of height times length: within four standard deviations."""
    rate_per_s, seconds, duration_s = 0.01, 1_000_000, 50
    surges = Surges(rate_per_s=rate_per_s, flow_m3h=20.0, duration_s=duration_s)
    flow_m3h = surges.stream(np.random.default_rng(4)).next_seconds(seconds)
    pulses = flow_m3h.sum() / 20.0 / duration_s
    assert pulses == pytest.approx(rate_per_s * seconds, abs=4 * math.sqrt(rate_per_s * seconds))
    active = np.rint(flow_m3h / 20.0)
    np.testing.assert_allclose(flow_m3h, 20.0 * active)
    assert active.mean() == pytest.approx(rate_per_s * duration_s, rel=0.05)
    assert active.var() == pytest.approx(rate_per_s * duration_s, rel=0.1)


@pytest.mark.parametrize("duration_s", [1, 7, 900])
def test_a_surge_that_stays_alone_has_its_height_and_length(duration_s):
    """A stretch of flow at no more than one height is one pulse, or pulses back to back."""
    surges = Surges(rate_per_s=2e-5, flow_m3h=30.0, duration_s=duration_s)
    flow_m3h = surges.stream(np.random.default_rng(5)).next_seconds(1_000_000)
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], flow_m3h > 0, [0.0]])))
    stretches = list(zip(edges[::2], edges[1::2], strict=True))
    lengths_s = [last - first for first, last in stretches if flow_m3h[first:last].max() == 30.0]
    assert len(lengths_s) >= 10
    assert set(lengths_s) == {duration_s}
    assert set(flow_m3h) <= {0.0, 30.0, 60.0, 90.0}


def test_surges_are_added_to_the_inflow():
    for model in (EmpiricalInflow, DiurnalInflow):
        calm_m3h = taken(model(surges=NO_SURGES), 20_000)
        added_m3h = taken(model(surges=Surges(flow_m3h=25.0, duration_s=100, rate_per_s=0.01)), 20_000) - calm_m3h
        assert added_m3h.max() >= 25 - 1e-9
        np.testing.assert_allclose(added_m3h / 25, np.rint(added_m3h / 25), atol=1e-9)


def test_diurnal_inflow_is_the_sine_it_says():
    inflow = DiurnalInflow(mean_m3h=60, amplitude_m3h=20, noise_m3h=0, period_s=400, surges=NO_SURGES)
    flow_m3h = taken(inflow, 800)
    assert flow_m3h[[0, 100, 200, 300, 400]] == pytest.approx([60, 80, 60, 40, 60])
    assert flow_m3h[50] == pytest.approx(60 + 20 * math.sqrt(0.5))
    assert flow_m3h[:400] == pytest.approx(flow_m3h[400:])


def test_diurnal_noise_has_its_deviation():
    """Five standard errors, 5 / sqrt(2 n)."""
    inflow = DiurnalInflow(mean_m3h=60, amplitude_m3h=0, noise_m3h=5, surges=NO_SURGES)
    flow_m3h = taken(inflow, 50_000)
    assert flow_m3h.std() == pytest.approx(5.0, rel=5 / math.sqrt(100_000))
    assert flow_m3h.mean() == pytest.approx(60.0, abs=5 * 5.0 / math.sqrt(50_000))


def test_diurnal_inflow_is_never_negative():
    flow_m3h = taken(DiurnalInflow(mean_m3h=5, amplitude_m3h=-50, noise_m3h=20, period_s=1000), 5000)
    assert flow_m3h.min() == 0
    assert (flow_m3h == 0).mean() > 0.2


def test_recorded_series_holds_and_repeats():
    """The last value holds for the median step of 15 s, so that the series repeats after 45 s."""
    inflow = RecordedInflow(time_s=[0, 10, 30], flow_m3h=[1, 2, 3])
    once = [1.0] * 10 + [2.0] * 20 + [3.0] * 15
    assert taken(inflow, 100).tolist() == (once * 3)[:100]


def test_recorded_series_of_one_value_is_constant():
    assert taken(RecordedInflow(time_s=[0], flow_m3h=[7.5]), 50).tolist() == [7.5] * 50


def test_recorded_series_faster_than_a_second_is_sampled():
    inflow = RecordedInflow(time_s=[0, 0.5, 1.0, 1.5], flow_m3h=[1, 2, 3, 4])
    assert taken(inflow, 5).tolist() == [1, 3, 1, 3, 1]


def test_catchment_default_has_about_the_quantiles_of_the_paper():
    """0.016 and 0.032 m³/s within 10 %, over eight weeks; 0.040 within 15 %, as few storms make it."""
    flow_m3h = taken(CatchmentInflow(), 56 * 86_400)[::20]
    for probability, flow_m3s, tolerance in ((0.5, 0.016, 0.1), (0.95, 0.032, 0.1), (0.99, 0.040, 0.15)):
        assert np.quantile(flow_m3h, probability) == pytest.approx(3600 * flow_m3s, rel=tolerance)


def test_dry_catchment_meets_its_hours_and_is_smooth():
    inflow = CatchmentInflow(mean_m3h=50, noise_m3h=0, storms_per_day=0, weekend_factor=1.2, first_weekday=5)
    flow_m3h = taken(inflow, 8 * 86_400)
    day_m3h = 50 * np.array(HOURS) / np.mean(HOURS)
    by_hour_m3h = flow_m3h[::3600].reshape(8, 24)
    for day, factor in enumerate([1.0, 1.2, 1.2, 1.0, 1.0, 1.0, 1.0, 1.0]):
        np.testing.assert_allclose(by_hour_m3h[day], factor * day_m3h, rtol=1e-12)
    assert flow_m3h[4 * 86_400 : 5 * 86_400].mean() == pytest.approx(50, rel=1e-3)
    # An hour changes by 36 m³/h at most; a spline is nowhere more than twice as steep, and its slope does not jump.
    assert np.abs(np.diff(flow_m3h)).max() < 2 * 36 / 3600
    assert np.abs(np.diff(flow_m3h, 2)).max() < 1e-4


def test_catchment_noise_is_stationary_with_its_deviation_and_correlation():
    """Correlation time of 20 s in 400 000 s: 10 000 independent values, five standard errors."""
    inflow = CatchmentInflow(
        mean_m3h=500, hours=(1.0,) * 24, weekend_factor=1, noise_m3h=8, correlation_s=20, storms_per_day=0
    )
    noise_m3h = taken(inflow, 400_000) - 500
    assert noise_m3h.mean() == pytest.approx(0, abs=5 * 8 / math.sqrt(10_000))
    assert noise_m3h.std() == pytest.approx(8, rel=5 / math.sqrt(20_000))
    for lag_s in (1, 20, 40):
        correlation = np.corrcoef(noise_m3h[lag_s:], noise_m3h[:-lag_s])[0, 1]
        assert correlation == pytest.approx(math.exp(-lag_s / 20), abs=0.05)
    first_m3h = [taken(inflow, 1, seed)[0] - 500 for seed in range(400)]
    assert np.std(first_m3h) == pytest.approx(8, rel=5 / math.sqrt(800))


def test_storms_have_their_number_shape_and_volume():
    """Volume of a storm: peak · t_p · n! e^n / n^(n+1), the gamma integral; Poisson and exponential together."""
    inflow = CatchmentInflow(
        mean_m3h=0, noise_m3h=0, storms_per_day=200, storm_peak_m3h=40, storm_time_to_peak_s=60, storm_shape=3
    )
    flow_m3h = taken(inflow, 20 * 86_400)
    expected = 200 * 20
    volume = 40 * 60 * 6 * math.exp(3) / 3**4
    # A sum of N exponential volumes, N Poisson: variance 2 N volume².
    assert flow_m3h.sum() == pytest.approx(expected * volume, rel=5 * math.sqrt(2 / expected))
    rare = CatchmentInflow(mean_m3h=0, noise_m3h=0, storms_per_day=1, storm_time_to_peak_s=600, storm_shape=3)
    flow_m3h = taken(rare, 3 * 86_400)
    begin = int(np.flatnonzero(flow_m3h)[0])
    peak = begin + int(np.argmax(flow_m3h[begin : begin + 3000]))
    assert peak - begin == pytest.approx(600, abs=2)
    age = np.arange(3000) / 600
    np.testing.assert_allclose(
        flow_m3h[begin : begin + 3000] / flow_m3h[peak], age**3 * np.exp(3 * (1 - age)), atol=6e-3
    )


@pytest.mark.parametrize("seconds", [0, 1])
@pytest.mark.parametrize(
    "inflow",
    [EmpiricalInflow(), DiurnalInflow(), CatchmentInflow(), RecordedInflow(time_s=[0], flow_m3h=[1])],
    ids=lambda i: i.kind,
)
def test_short_blocks(inflow, seconds):
    assert taken(inflow, seconds).shape == (seconds,)
