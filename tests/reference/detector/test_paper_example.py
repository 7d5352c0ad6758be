"""The worked example of the paper (its Table 1 and I_W) under two readings of its set-up, 300 seeds each.

The paper prints F = 196.58, AIC0 = 89.31, AIC1 = -38.07 and I_W = 0.746 with the 95 % interval [0.660, 0.813].
As written (A0 = 15, duty points of the worn pump at the speed of the instant) these cannot come out. They are typical
draws if A0 = 45, Q is that of the healthy pump at nominal speed, H the worn pump's head at that Q, and both are then
scaled by f as if they had been measured at f. In that reading the index does not tell a worn pump from a healthy one.
Quantiles below come from this code; the tolerances are three standard errors of a quantile of 300 seeds, or more.
"""

import functools

import numpy as np
import pytest

from wetwell.detector.statistics.bootstrap import block_bootstrap_interval
from wetwell.detector.statistics.curve_drift import pump_curve_f_test
from wetwell.detector.statistics.tangent import (
    attribution_index,
    normalise,
    pump_slope,
    system_slope,
    tangent_residuals,
)

FRICTION_H2_M5 = 6e-4
CURVE = (45.0, -5e-4, -9e-4)
SEEDS = 300


def duty_flow(a0, a1, a2, speed):
    """Flow where A0 N² - A1 N Q - A2 Q² meets 2 + 6e-4 Q²."""
    a, b, c = a2 + FRICTION_H2_M5, a1 * speed, 2.0 - a0 * speed**2
    return (-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)


def noise_free(shutoff_m, *, literal, worn, speed):
    t = np.arange(50.0) * worn
    a0, a1, a2 = shutoff_m - 0.1 * t, 5e-4 + 1e-6 * t, 9e-4 + 5e-6 * t
    if literal:
        flow = duty_flow(a0, a1, a2, speed)
        return flow, a0 * speed**2 - a1 * speed * flow - a2 * flow**2
    flow = np.full(50, duty_flow(shutoff_m, 5e-4, 9e-4, 1.0))
    return flow, a0 - a1 * flow - a2 * flow**2


def paper_residuals(flow, head, speed):
    """Tangent residuals as printed, both at nominal speed (without the correction for the static head)."""
    nominal_flow, nominal_head = normalise(flow, head, speed)
    middle, step = (nominal_flow[1:] + nominal_flow[:-1]) / 2.0, np.diff(nominal_flow)
    return (
        np.diff(nominal_head) - pump_slope(middle, CURVE) * step,
        np.diff(nominal_head) - system_slope(middle, FRICTION_H2_M5) * step,
    )


@functools.cache
def draws(*, literal, worn=True):
    """Per seed: F, AIC0, AIC1, index as printed, index with corrected system residual, interval of the first."""
    rows = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        speed = (50.0 - 0.1 * np.arange(50.0) + rng.normal(size=50)) / 50.0
        flow, head = noise_free(15.0 if literal else 45.0, literal=literal, worn=worn, speed=speed)
        flow, head = flow + rng.normal(size=50), head + 0.5 * rng.normal(size=50)
        test = pump_curve_f_test(np.arange(50.0), flow, head, speed)
        psi = paper_residuals(flow, head, speed)
        corrected = tangent_residuals(flow, head, speed, curve=CURVE, friction_h2_m5=FRICTION_H2_M5)
        interval = block_bootstrap_interval(*psi, block=5, resamples=400, confidence=0.95, rng=rng)
        rows.append(
            (
                test.f,
                test.aic_null,
                test.aic_alternative,
                attribution_index(*psi),
                attribution_index(*corrected),
                *interval,
            )
        )
    return np.array(rows)


def quantiles(column, **reading):
    return np.quantile(draws(**reading)[:, column], [0.05, 0.5, 0.95])


def test_as_written_the_null_model_fits_perfectly():
    f, aic_null, aic_alternative, index = draws(literal=True)[:, :4].T
    assert np.median(f) == pytest.approx(1.3, abs=0.25)
    assert np.median(index) == pytest.approx(0.505, abs=0.01)
    assert np.median(aic_null) == pytest.approx(np.median(aic_alternative), abs=3.0)
    assert f.max() < 196.58 / 10.0
    assert aic_null.max() < 89.31 / 2.0


def test_as_written_without_noise_the_worn_pump_lies_on_one_quadratic():
    speed = (50.0 - 0.1 * np.arange(50.0) + np.random.default_rng(0).normal(size=50)) / 50.0
    flow, head = noise_free(15.0, literal=True, worn=True, speed=speed)
    assert np.allclose(head, 2.0 + FRICTION_H2_M5 * flow**2, rtol=0.0, atol=1e-9)
    steady_flow, steady_head = noise_free(15.0, literal=True, worn=True, speed=np.ones(50))
    assert pump_curve_f_test(np.arange(50.0), steady_flow, steady_head, np.ones(50)).f == 0.0


def test_the_other_reading_gives_the_f_of_table_1():
    assert quantiles(0, literal=False) == pytest.approx([144.0, 238.0, 393.0], rel=0.1)
    assert quantiles(0, literal=False)[0] < 196.58 < quantiles(0, literal=False)[2]


def test_the_other_reading_gives_the_aic_of_table_1():
    assert quantiles(1, literal=False) == pytest.approx([70.0, 87.0, 103.0], abs=4.0)
    assert quantiles(2, literal=False) == pytest.approx([-68.0, -49.0, -32.0], abs=5.0)
    assert quantiles(1, literal=False)[0] < 89.31 < quantiles(1, literal=False)[2]
    assert quantiles(2, literal=False)[0] < -38.07 < quantiles(2, literal=False)[2]


def test_the_other_reading_gives_the_index_and_its_interval():
    assert quantiles(3, literal=False) == pytest.approx([0.68, 0.74, 0.79], abs=0.015)
    assert quantiles(3, literal=False)[0] < 0.746 < quantiles(3, literal=False)[2]
    assert quantiles(5, literal=False)[0] < 0.660 < quantiles(5, literal=False)[2]
    assert quantiles(6, literal=False)[0] < 0.813 < quantiles(6, literal=False)[2]


def test_the_printed_interval_is_wider_than_most():
    widths = draws(literal=False)[:, 6] - draws(literal=False)[:, 5]
    assert np.median(widths) == pytest.approx(0.115, abs=0.015)
    assert 0.05 < np.mean(widths > 0.813 - 0.660) < 0.20


def test_the_other_reading_calls_a_healthy_pump_faulty_too():
    healthy = draws(literal=False, worn=False)
    assert np.median(healthy[:, 3]) == pytest.approx(0.786, abs=0.01)
    assert np.mean(healthy[:, 5] > 0.6) > 0.9
    assert np.median(healthy[:, 0]) < 1.5


def test_the_correction_for_the_static_head_does_not_save_the_index():
    assert np.median(draws(literal=False)[:, 4]) < np.median(draws(literal=False, worn=False)[:, 4])
