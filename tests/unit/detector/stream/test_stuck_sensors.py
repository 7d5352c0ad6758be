"""Meters that are stuck or noisy, told from their readings."""

import math

import numpy as np
import pytest

from wetwell.detector.stream.gate import Frame, PumpFrame
from wetwell.detector.stream.run_state import PUMP
from wetwell.detector.stream.stuck_sensors import (
    NOISY_FACTOR,
    healthy_noise,
    new_meters,
    noisy_meters,
    reading_noise,
    stuck_names,
    watch_meters,
)
from wetwell.protocols.timestamps import NS_PER_S

NAN = math.nan


def feed(meters, *, level_m, flow_m3h, head_m, is_learning=False, is_running=True):
    """Feed equally long series; the names that are stuck after each second."""
    stuck, pumps = [], np.zeros(1, dtype=PUMP)
    pumps["is_learning"], pumps["is_running"] = is_learning, is_running
    for second, (level, flow, head) in enumerate(zip(level_m, flow_m3h, head_m, strict=True)):
        frame = Frame(second * NS_PER_S, 1.0, level, NAN, (PumpFrame(50.0, flow, head, NAN, is_running),))
        watch_meters(meters, frame.time_ns, frame.gap_s, np.array(frame.values()), pumps)
        bits = sum(int(is_stuck) << bit for bit, is_stuck in enumerate(meters["is_stuck"]))
        stuck.append(set(stuck_names(0, bits)))
        if is_running:
            assert pumps["stuck"][0] & bits == bits, "the run remembers what was stuck"
    return stuck


def lively(rng, seconds):
    return {
        "level_m": 1.0 + 0.002 * rng.normal(size=seconds),
        "flow_m3h": 200.0 + rng.normal(size=seconds),
        "head_m": 26.0 + 0.2 * rng.normal(size=seconds),
    }


@pytest.mark.parametrize(
    ("name", "reading"), [("level_m", "level_m"), ("flow_m3h", "pump1_flow_m3h"), ("head_m", "pump1_head_m")]
)
def test_a_reading_that_stands_still_for_a_minute_is_stuck_until_it_moves(name, reading):
    rng, meters = np.random.default_rng(0), new_meters(1)
    feed(meters, **lively(rng, 600), is_learning=True)
    series = lively(rng, 200)
    series[name][20:120] = series[name][20]
    stuck = feed(meters, **series)
    first = next(second for second, names in enumerate(stuck) if names)
    assert first == pytest.approx(80, abs=2)
    assert all(names == {reading} for names in stuck[first:120])
    assert not any(stuck[120:])


def test_readings_of_zero_are_not_stuck():
    meters = new_meters(1)
    zeros = np.zeros(500)
    assert not any(
        feed(meters, level_m=lively(np.random.default_rng(0), 500)["level_m"], flow_m3h=zeros, head_m=zeros)
    )


def test_the_head_of_a_pump_that_stands_still_may_too():
    series = lively(np.random.default_rng(0), 500) | {"head_m": np.full(500, 3.3)}
    assert not any(feed(new_meters(1), **series, is_running=False))


def test_values_that_are_absent_are_not_stuck():
    absent = np.full(500, NAN)
    assert not any(feed(new_meters(1), level_m=absent, flow_m3h=absent, head_m=absent))


def by_exception(values, every):
    return np.repeat(values[::every], every)[: len(values)]


def test_a_feed_that_reports_by_exception_in_health_is_learnt():
    rng, meters = np.random.default_rng(1), new_meters(1)
    feed(meters, **{name: by_exception(values, 40) for name, values in lively(rng, 2000).items()}, is_learning=True)
    slow = {name: by_exception(values, 100) for name, values in lively(rng, 1000).items()}
    assert not any(feed(meters, **slow)), "five times as long as ever is not yet stuck"
    dead = lively(rng, 400) | {"flow_m3h": np.full(400, 201.5)}
    stuck = feed(meters, **dead)
    assert stuck[-1] == {"pump1_flow_m3h"}
    assert not any(stuck[:190])


def noisy_run(run_of, segments_of, rng, *, flow=0.01, head=0.01, drift=0.0):
    samples = 250
    return run_of(
        segments_of(np.zeros((10, 2))),
        flow_m3h=200.0 * (1.0 + flow * rng.normal(size=samples) + np.linspace(0.0, drift, samples)),
        head_m=26.0 * (1.0 + head * rng.normal(size=samples)),
    )


def test_noise_is_measured_as_a_share_and_a_drift_does_not_count(run_of, segments_of):
    rng = np.random.default_rng(2)
    found = [reading_noise(noisy_run(run_of, segments_of, rng, flow=0.02, head=0.005)) for _ in range(40)]
    np.testing.assert_allclose(np.mean(found, axis=0), [0.02, 0.005], rtol=0.05)
    drifting = reading_noise(noisy_run(run_of, segments_of, rng, drift=-0.3))
    np.testing.assert_allclose(drifting, 0.01, rtol=0.3)


def test_a_step_within_a_run_is_no_noise(run_of, segments_of):
    rng = np.random.default_rng(3)
    run = noisy_run(run_of, segments_of, rng)
    run.flow_m3h[100:] *= 0.6
    assert reading_noise(run)[0] == pytest.approx(0.0125, rel=0.4)


def test_only_the_meter_that_has_grown_noisy_is_told(run_of, segments_of):
    rng = np.random.default_rng(4)
    healthy = healthy_noise([reading_noise(noisy_run(run_of, segments_of, rng)) for _ in range(12)])
    for _ in range(20):
        assert noisy_meters(noisy_run(run_of, segments_of, rng, head=0.02, flow=0.02), healthy) == {}
        told = noisy_meters(noisy_run(run_of, segments_of, rng, head=0.05), healthy)
        assert list(told) == ["head_m"]
        assert told["head_m"] == pytest.approx(5.0, rel=0.35)
        assert told["head_m"] > NOISY_FACTOR
        assert list(noisy_meters(noisy_run(run_of, segments_of, rng, flow=0.05), healthy)) == ["flow_m3h"]


def test_a_short_run_or_one_with_gaps_tells_no_noise(run_of, segments_of):
    short = run_of(segments_of(np.zeros((1, 2))))
    assert np.isnan(reading_noise(short)).all()
    sparse = noisy_run(run_of, segments_of, np.random.default_rng(5))
    sparse.time_s[:] *= 5.0
    assert np.isnan(reading_noise(sparse)).all()
    assert noisy_meters(short, np.array([0.01, 0.01])) == {}


def test_noise_that_was_never_known_blames_nobody(run_of, segments_of):
    unknown = healthy_noise([np.full(2, NAN)] * 5)
    assert np.isnan(unknown).all()
    assert noisy_meters(noisy_run(run_of, segments_of, np.random.default_rng(6), head=0.5), unknown) == {}
