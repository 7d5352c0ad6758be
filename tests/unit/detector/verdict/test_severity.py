"""How bad a fault is: the loss of speed against the affinity law solved by SciPy."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from wetwell.detector.verdict.severity import severity, speed_loss

CURVES = [(36.0, -0.02333, -1.3333e-4), (36.0, 0.0, -2.5e-4), (12.0, -0.03, -1e-5)]


def head_m(curve, flow_m3h, speed):
    return curve[0] * speed**2 + curve[1] * speed * flow_m3h + curve[2] * flow_m3h**2


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("flow_m3h", [10.0, 80.0, 200.0])
@pytest.mark.parametrize("shift_m", [-6.0, -1.0, -0.05, 0.05, 1.5])
def test_the_loss_solves_the_affinity_law(curve, flow_m3h, shift_m):
    def missing_m(loss):
        return head_m(curve, flow_m3h, 1.0 - loss) - head_m(curve, flow_m3h, 1.0) - shift_m

    bottom = 1.0 + curve[1] * flow_m3h / (2.0 * curve[0])
    is_possible = missing_m(bottom) < 0.0
    expected = brentq(missing_m, -1.0, bottom) if is_possible else 1.0
    assert speed_loss(shift_m, curve, flow_m3h) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("loss", [0.01, 0.05, 0.4, 0.8])
def test_a_loss_of_speed_is_found_again(loss):
    curve, flow_m3h = CURVES[0], 120.0
    shift_m = head_m(curve, flow_m3h, 1.0 - loss) - head_m(curve, flow_m3h, 1.0)
    assert speed_loss(shift_m, curve, flow_m3h) == pytest.approx(loss)


def test_no_shift_is_no_loss_and_a_dead_pump_has_lost_all():
    for curve in CURVES:
        assert speed_loss(0.0, curve, 100.0) == pytest.approx(0.0, abs=1e-12)
        assert speed_loss(-100.0, curve, 100.0) == 1.0


def test_the_figures_of_a_message():
    figures = severity(np.array([-3.6, 4.8]), np.array([0.1, 0.5]), (36.0, 0.0, -2.5e-4), 150.0, 24.0)
    assert figures["static_head_rise_m"] == {"value": 4.8, "interval": [pytest.approx(3.82), pytest.approx(5.78)]}
    assert figures["friction_rise_percent"]["value"] == pytest.approx(20.0)
    assert figures["friction_rise_percent"]["interval"] == pytest.approx([15.917, 24.083], abs=1e-3)
    assert figures["speed_loss_percent"]["value"] == pytest.approx(100.0 * (1.0 - math.sqrt(0.9)), abs=1e-3)
    low, high = figures["speed_loss_percent"]["interval"]
    assert low == pytest.approx(100.0 * (1.0 - math.sqrt(1.0 - 3.404 / 36.0)), abs=1e-3)
    assert high == pytest.approx(100.0 * (1.0 - math.sqrt(1.0 - 3.796 / 36.0)), abs=1e-3)


def test_without_friction_only_the_rest_is_told():
    figures = severity(np.zeros(2), np.ones(2), CURVES[1], 100.0, 0.0)
    assert set(figures) == {"speed_loss_percent", "static_head_rise_m"}


def test_the_interval_covers_a_loss_that_is_measured_with_its_deviation():
    rng, curve, covered = np.random.default_rng(0), CURVES[0], 0
    true_m = head_m(curve, 150.0, 0.9) - head_m(curve, 150.0, 1.0)
    for _ in range(400):
        seen_m = np.array([true_m + 0.2 * rng.normal(), 0.0])
        low, high = severity(seen_m, np.array([0.2, 0.2]), curve, 150.0, 20.0)["speed_loss_percent"]["interval"]
        covered += low <= 10.0 <= high
    assert 0.92 < covered / 400 < 0.98
