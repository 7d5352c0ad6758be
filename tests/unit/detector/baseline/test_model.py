"""What is learnt of a healthy pump: offset, slopes and scatter, against plants whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.detector.baseline.model import FLOOR_SHARE, LEVEL_SLOPE, SLOPE_SHARE, learn
from wetwell.detector.curves.residuals import level_residuals
from wetwell.detector.runs.run import SEGMENT_SAMPLES, Segments

CURVE = (36.0, -0.02333, -1.3333e-4)
FRICTION_H2_M5 = 6.0e-4
STATIC_M = 2.0
SEGMENTS = 10
LEVELS_M = np.linspace(1.6, 0.5, SEGMENTS)


def duty_m3h(curve, friction_h2_m5, speed, *, pumps=1):
    """Flow of one of so many equal pumps on a common main."""
    c0, c1, c2 = curve
    a, b, c = c2 - friction_h2_m5 * pumps**2, c1 * speed, c0 * speed**2 - STATIC_M
    return (-b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)


def made_runs(
    rng, *, curve, friction_h2_m5, speeds, pumps=None, noise=0.01, gain_share=0.0, bias_m=0.0, level_slopes=(0.0, 0.0)
):
    """Runs of a plant with these true curves, seen through its meters and from the datasheet."""
    runs = []
    for speed, on in zip(speeds, np.ones(len(speeds), int) if pumps is None else pumps, strict=True):
        level_m = np.repeat(LEVELS_M, SEGMENT_SAMPLES)
        true_m3h = duty_m3h(curve, friction_h2_m5, speed, pumps=on)
        head_m = STATIC_M + friction_h2_m5 * (on * true_m3h) ** 2
        gain = 1.0 + gain_share * rng.normal()
        flow_m3h = gain * true_m3h * (1.0 + noise * rng.normal(size=level_m.size))
        others_m3h = (on - 1) * true_m3h * (1.0 + noise * rng.normal(size=level_m.size))
        measured_m = head_m * (1.0 + 0.01 * rng.normal(size=level_m.size)) + bias_m * rng.normal()
        residuals_m = level_residuals(
            flow_m3h,
            measured_m,
            np.full(level_m.size, speed),
            curve=CURVE,
            static_head_m=STATIC_M,
            friction_h2_m5=FRICTION_H2_M5,
            total_flow_m3h=flow_m3h + others_m3h,
        )
        by_datasheet_m3h = duty_m3h(CURVE, FRICTION_H2_M5, speed, pumps=on)
        columns = np.column_stack([*residuals_m, flow_m3h / speed, flow_m3h + others_m3h])
        columns[:, :2] += np.outer(level_m - 1.0, level_slopes)
        means = columns.reshape(SEGMENTS, SEGMENT_SAMPLES, 4).mean(axis=1)
        runs.append(
            Segments(
                residual_m=means[:, :2],
                flow_m3h=means[:, 2],
                total_m3h=means[:, 3],
                duty_m3h=np.full(SEGMENTS, by_datasheet_m3h / speed),
                duty_total_m3h=np.full(SEGMENTS, on * by_datasheet_m3h),
                level_m=LEVELS_M,
                speed_ratio=np.full(SEGMENTS, speed),
            )
        )
    return runs


def expected_m(baseline, flow_m3h, total_m3h, level_m):
    return (
        baseline.pump.along(np.array([[flow_m3h, flow_m3h**2, level_m]]))[0][0],
        baseline.system.along(np.array([[total_m3h**2, level_m]]))[0][0],
    )


WORN = (36.0, 1.15 * CURVE[1], 1.15 * CURVE[2])
ROUGH_H2_M5 = 1.15 * FRICTION_H2_M5
VARIED = {"speeds": np.tile(np.linspace(0.6, 1.0, 6), 5)}
TWO_PUMPS = {"speeds": np.ones(30), "pumps": np.tile([1, 2], 15)}


@pytest.mark.parametrize("operation", [VARIED, TWO_PUMPS], ids=["varied speed", "two pumps"])
@pytest.mark.parametrize("gain_share", [0.0, 0.02], ids=["steady meter", "unsteady meter"])
def test_the_slopes_get_near_the_true_ones_and_the_flow_meter_does_not_bend_them(operation, gain_share):
    told, naive = [], []
    ends_m3h = [duty_m3h(WORN, ROUGH_H2_M5, speed) / speed for speed in (0.6, 1.0)]
    if "pumps" in operation:
        ends_m3h = [duty_m3h(WORN, ROUGH_H2_M5, 1.0, pumps=on) for on in (2, 1)]
    true_m = np.diff([0.15 * (CURVE[1] * q + CURVE[2] * q * q) for q in ends_m3h])[0]
    for seed in range(12):
        rng = np.random.default_rng(seed)
        runs = made_runs(rng, curve=WORN, friction_h2_m5=ROUGH_H2_M5, noise=0.03, gain_share=gain_share, **operation)
        baseline = learn(runs, CURVE, FRICTION_H2_M5)
        pump_m = np.diff([expected_m(baseline, flow_m3h, 200.0, 1.0)[0] for flow_m3h in ends_m3h])[0]
        told.append((pump_m, baseline.system.mean[1]))
        flow_m3h, total_m3h = (np.array([getattr(r, k).mean() for r in runs]) for k in ("flow_m3h", "total_m3h"))
        means_m = np.array([run.residual_m.mean(axis=0) for run in runs])
        slope = np.polyfit(flow_m3h, means_m[:, 0], 1)[0]
        naive.append((slope * np.diff(ends_m3h)[0], np.polyfit(total_m3h**2, means_m[:, 1], 1)[0]))
    truth = np.array([true_m, 0.15 * FRICTION_H2_M5])
    pump, system = np.abs(np.mean(told, axis=0) / truth - 1.0)
    assert system < 0.2, "that of the datasheet would be 1 off"
    assert pump < (0.35 if gain_share == 0.0 or "pumps" in operation else 1.0), "that of the datasheet would be 1 off"
    if gain_share and "pumps" not in operation:
        naive_pump, naive_system = np.abs(np.mean(naive, axis=0) / truth - 1.0)
        assert naive_pump > 3.0 * pump, "a fit to the measured flows is bent by the errors that it shares with them"
        assert naive_system > 3.0 * system


def test_without_a_spread_of_flows_the_slopes_stay_those_of_the_datasheet():
    rng = np.random.default_rng(0)
    baseline = learn(
        made_runs(rng, curve=WORN, friction_h2_m5=ROUGH_H2_M5, speeds=np.ones(30)), CURVE, FRICTION_H2_M5
    )
    np.testing.assert_allclose(baseline.pump.mean[1:3] / CURVE[1:], 0.0, atol=0.01)
    assert baseline.system.mean[1] / FRICTION_H2_M5 == pytest.approx(0.0, abs=0.01)
    prior = SLOPE_SHARE * np.array([abs(CURVE[1]), abs(CURVE[2])])
    np.testing.assert_allclose(np.sqrt(np.diag(baseline.pump.covariance))[1:3], prior, rtol=0.05)


@pytest.mark.parametrize("slopes", [(0.5, 0.0), (0.0, -0.7), (0.3, 0.3)])
def test_what_a_metre_of_level_does_is_learnt(slopes):
    rng = np.random.default_rng(1)
    runs = made_runs(
        rng, curve=CURVE, friction_h2_m5=FRICTION_H2_M5, speeds=np.ones(20), noise=0.005, level_slopes=slopes
    )
    baseline = learn(runs, CURVE, FRICTION_H2_M5)
    np.testing.assert_allclose([baseline.pump.mean[-1], baseline.system.mean[-1]], slopes, atol=0.08)
    assert baseline.level_m == pytest.approx(LEVELS_M.mean())
    np.testing.assert_allclose(baseline.shifts(runs[0]).mean(axis=0), 0.0, atol=0.2)
    np.testing.assert_allclose(np.polyfit(LEVELS_M, baseline.shifts(runs[0]), 1)[0], 0.0, atol=0.3)


def test_without_a_level_nothing_is_learnt_of_it_and_nothing_breaks(segments_of):
    rng = np.random.default_rng(2)
    runs = [segments_of(rng.normal(0.0, 0.1, (10, 2)), level_m=np.nan) for _ in range(20)]
    baseline = learn(runs, CURVE, FRICTION_H2_M5)
    assert np.isnan(baseline.level_m)
    assert np.isfinite(baseline.shifts(runs[0])).all()
    assert np.isfinite(baseline.shifts(segments_of(np.zeros((3, 2)), level_m=1.0))).all()
    assert np.sqrt(baseline.pump.covariance[-1, -1]) == pytest.approx(LEVEL_SLOPE)


def test_a_level_that_is_lost_after_learning_moves_nothing(segments_of):
    rng = np.random.default_rng(3)
    runs = made_runs(rng, curve=CURVE, friction_h2_m5=FRICTION_H2_M5, speeds=np.ones(20), level_slopes=(0.5, 0.5))
    baseline = learn(runs, CURVE, FRICTION_H2_M5)
    here = segments_of(np.zeros((3, 2)), level_m=baseline.level_m)
    lost = segments_of(np.zeros((3, 2)), level_m=np.nan)
    np.testing.assert_allclose(baseline.shifts(lost), baseline.shifts(here))


@pytest.mark.parametrize(
    ("operation", "flow_m3h", "total_m3h"),
    [
        ({"speeds": np.ones(20)}, 130.0, 130.0),
        ({"speeds": np.ones(20)}, 200.0, 320.0),
        ({"speeds": np.tile([0.9, 1.0], 10)}, 100.0, 100.0),
        ({"speeds": np.ones(20), "pumps": np.tile([1, 2], 10)}, 90.0, 260.0),
    ],
    ids=["less flow", "more total flow", "less speed", "three pumps"],
)
def test_error_bars_far_from_where_it_was_learnt_are_right(operation, flow_m3h, total_m3h):
    scores = []
    for seed in range(250):
        rng = np.random.default_rng(1000 + seed)
        wrong = SLOPE_SHARE * rng.normal(size=3)
        curve = (CURVE[0], CURVE[1] * (1.0 + wrong[0]), CURVE[2] * (1.0 + wrong[1]))
        friction_h2_m5 = FRICTION_H2_M5 * (1.0 + wrong[2])
        baseline = learn(
            made_runs(rng, curve=curve, friction_h2_m5=friction_h2_m5, bias_m=FLOOR_SHARE * CURVE[0], **operation),
            CURVE,
            FRICTION_H2_M5,
        )
        told_m = expected_m(baseline, flow_m3h, total_m3h, baseline.level_m)
        true_m = (
            (curve[1] - CURVE[1]) * flow_m3h + (curve[2] - CURVE[2]) * flow_m3h**2,
            (friction_h2_m5 - FRICTION_H2_M5) * total_m3h**2,
        )
        deviation_m = np.sqrt(baseline.variances(flow_m3h, total_m3h, baseline.level_m))
        scores.append((np.array(told_m) - true_m) / deviation_m)
    covered = np.mean(np.abs(scores) < 1.96, axis=0)
    assert (covered > 0.9).all(), covered
    assert (covered < 0.99).all(), "too cautious"


def test_shifts_are_counted_from_what_is_expected_at_the_flow_of_a_segment():
    rng = np.random.default_rng(4)
    baseline = learn(made_runs(rng, curve=WORN, friction_h2_m5=ROUGH_H2_M5, **VARIED), CURVE, FRICTION_H2_M5)
    (healthy,) = made_runs(rng, curve=WORN, friction_h2_m5=ROUGH_H2_M5, speeds=[0.72], noise=0.001)
    np.testing.assert_allclose(baseline.shifts(healthy).mean(axis=0), 0.0, atol=0.25)
    assert np.abs(healthy.residual_m.mean(axis=0)).max() > 0.8, "from the datasheet it lies far away"


def test_explained_flows_are_those_that_were_measured_in_health():
    rng = np.random.default_rng(5)
    baseline = learn(made_runs(rng, curve=WORN, friction_h2_m5=ROUGH_H2_M5, **VARIED), CURVE, FRICTION_H2_M5)
    (run,) = made_runs(rng, curve=WORN, friction_h2_m5=ROUGH_H2_M5, speeds=[0.8])
    measured = (run.flow_m3h.mean(), run.total_m3h.mean())
    np.testing.assert_allclose(baseline.explained_flows(run), measured, rtol=0.01)
    (blocked,) = made_runs(rng, curve=(20.0, *WORN[1:]), friction_h2_m5=ROUGH_H2_M5, speeds=[0.8])
    np.testing.assert_allclose(baseline.explained_flows(blocked), measured, rtol=0.01)


def test_scatter_is_that_of_the_runs_plus_a_floor(segments_of):
    rng = np.random.default_rng(6)
    runs = [segments_of([shift, 0.0] + rng.normal(size=(10, 2)) * [0.06, 0.1]) for shift in rng.normal(0.0, 0.5, 400)]
    baseline = learn(runs, CURVE, FRICTION_H2_M5)
    np.testing.assert_allclose(np.diag(baseline.segment_covariance), [0.06**2, 0.1**2], rtol=0.1)
    np.testing.assert_allclose(np.diag(baseline.run_covariance), [0.5**2 + 0.036**2, 0.036**2], rtol=0.2)


def test_runs_that_scatter_together_are_learnt_to(segments_of):
    rng = np.random.default_rng(7)
    runs = [
        segments_of(gain * np.array([1.0, -2.0]) + rng.normal(size=(10, 2)) * 0.05) for gain in rng.normal(size=200)
    ]
    covariance = learn(runs, CURVE, FRICTION_H2_M5).run_covariance
    assert covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]) < -0.99


def test_one_run_that_stands_out_moves_the_offset_little(segments_of):
    rng = np.random.default_rng(8)
    runs = [segments_of(rng.normal(size=(10, 2)) * 0.05) for _ in range(19)]
    runs.append(segments_of([-4.0, 4.0] + rng.normal(size=(10, 2)) * 0.05))
    assert np.abs(learn(runs, CURVE, FRICTION_H2_M5).offset_m).max() < 0.1, "the plain mean is 0.2 off"


def test_the_noise_follows_recent_runs_with_its_correlation_and_the_offset_does_not(segments_of):
    rng = np.random.default_rng(9)
    runs = [segments_of(np.repeat(rng.normal(size=(5, 2)) * [0.06, 0.1], 2, axis=0)) for _ in range(20)]
    baseline = learn(runs, CURVE, FRICTION_H2_M5)
    assert 2.0 < baseline.correlation_factor < 4.0
    followed = baseline
    for _ in range(200):
        followed = followed.with_noise_of(runs[rng.integers(20)], 0.05, 36.0)
    assert 0.6 < np.trace(followed.segment_covariance) / np.trace(baseline.segment_covariance) < 1.6
    noisier = baseline.with_noise_of(segments_of(np.array([9.0, 0.0]) + rng.normal(size=(10, 2))), 0.5, 36.0)
    assert (noisier.offset_m == baseline.offset_m).all()
    assert np.trace(noisier.segment_covariance) <= 2.5 * np.trace(baseline.segment_covariance) * (1.0 + 1e-9)


def test_segments_of_fewer_samples_are_taken_to_be_noisier():
    rng = np.random.default_rng(0)
    runs = made_runs(rng, curve=CURVE, friction_h2_m5=FRICTION_H2_M5, speeds=np.ones(8))
    baseline = learn(runs, CURVE, FRICTION_H2_M5)
    short = replace(runs[0], samples=5)
    np.testing.assert_allclose(baseline.noise(short), 5.0 * baseline.segment_covariance)
    assert baseline.with_noise_of(short, 0.5, 36.0) is baseline
